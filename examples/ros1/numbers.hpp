// All numbers in the JSON value of a key, in order: enough for road networks and instances, whose values are lists.
#pragma once

#include <cstdlib>
#include <string>
#include <vector>

inline std::vector<double> numbers(const std::string &json, const std::string &key) {
    std::vector<double> found;
    size_t at = json.find("\"" + key + "\"");
    if (at == std::string::npos) return found;
    at = json.find(':', at) + 1;
    for (int depth = 0; at < json.size();) {
        const char c = json[at];
        if (c == '[') ++depth, ++at;
        else if (c == ']') { if (--depth <= 0) break; ++at; }
        else if (c == '-' || (c >= '0' && c <= '9')) {
            char *end = nullptr;
            found.push_back(std::strtod(json.c_str() + at, &end));
            at = end - json.c_str();
            if (depth == 0) break;
        } else if (c == '}' || c == '{' || c == '"') break;
        else ++at;
    }
    return found;
}
