// An e-agent as in 2016: a random walk on right lanes at 30 Hz. Started in the namespace of its car, with the path of
// a road network (JSON) as its only argument and cmd_vel remapped to mobile_base/commands/velocity.

#include <cmath>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include <ros/ros.h>

#include <gazebo_msgs/ModelStates.h>
#include <geometry_msgs/Twist.h>
#include <sensor_msgs/LaserScan.h>

#include "numbers.hpp"

struct Point { double x, y; };
struct Segment { Point from, to; };

// The segments of a road network in the world's frame; without "segments", those of the grid.
std::vector<Segment> read_roads(const std::string &json) {
    const auto frame = numbers(json, "transform"), shape = numbers(json, "shape");
    const double length = numbers(json, "length").at(0), c = std::cos(frame.at(2)), s = std::sin(frame.at(2));
    auto lattice = numbers(json, "segments");
    if (lattice.empty())
        for (int x = 0; x < shape.at(1); ++x)
            for (int y = 0; y < shape.at(0); ++y) {
                if (x + 1 < shape[1]) for (int v : {x, y, x + 1, y}) lattice.push_back(v);
                if (y + 1 < shape[0]) for (int v : {x, y, x, y + 1}) lattice.push_back(v);
            }
    const auto place = [&](double x, double y) {
        return Point{length * (c * x - s * y) + frame[0], length * (s * x + c * y) + frame[1]};
    };
    std::vector<Segment> roads;
    for (size_t k = 0; k + 3 < lattice.size(); k += 4)
        roads.push_back({place(lattice[k], lattice[k + 1]), place(lattice[k + 2], lattice[k + 3])});
    return roads;
}

double distance(const Point &a, const Point &b) { return std::hypot(a.x - b.x, a.y - b.y); }

class Wander {
public:
    Wander(ros::NodeHandle &node, std::vector<Segment> roads, std::string name)
        : roads_(std::move(roads)), name_(std::move(name)), draw_(std::hash<std::string>()(name_)) {
        commands_ = node.advertise<geometry_msgs::Twist>("cmd_vel", 1);
        states_ = node.subscribe("/gazebo/model_states", 1, &Wander::look, this);
        scan_ = node.subscribe("scan", 1, &Wander::range, this);
    }

    void drive() {
        geometry_msgs::Twist command;
        if (placed_) {
            if (!aiming_) begin();
            if (distance(here_, goal_) < 0.075) arrive();
            const double bearing = std::atan2(goal_.y - here_.y, goal_.x - here_.x);
            const double error = std::remainder(bearing - heading_, 2 * M_PI);
            if (nearest_ >= 0.5) {
                if (std::fabs(error) > 0.07) command.angular.z = std::copysign(0.9, error);
                else if (distance(here_, ego_) > 1.0) command.linear.x = 0.5;
            }
        }
        commands_.publish(command);
    }

private:
    void look(const gazebo_msgs::ModelStates &message) {
        for (size_t k = 0; k < message.name.size(); ++k) {
            const auto &pose = message.pose[k];
            const Point point{pose.position.x, pose.position.y};
            if (message.name[k] == "ego") ego_ = point;
            if (message.name[k] != name_) continue;
            here_ = point;
            heading_ = 2 * std::atan2(pose.orientation.z, pose.orientation.w);
            placed_ = true;
        }
    }

    void range(const sensor_msgs::LaserScan &message) {
        nearest_ = HUGE_VAL;
        for (const float value : message.ranges)
            if (value >= message.range_min && value < nearest_) nearest_ = value;
    }

    // A point of the right lane of a road driven from a to b, at its start or its end.
    static Point lane(const Point &a, const Point &b, bool at_end) {
        const double length = distance(a, b), ux = (b.x - a.x) / length, uy = (b.y - a.y) / length;
        const Point &base = at_end ? b : a;
        return {base.x + 0.42 * uy, base.y - 0.42 * ux};
    }

    // Begin with the road that is nearest, in the direction that is ahead.
    void begin() {
        double best = HUGE_VAL;
        for (const auto &road : roads_) {
            const Point middle{(road.from.x + road.to.x) / 2, (road.from.y + road.to.y) / 2};
            if (distance(middle, here_) >= best) continue;
            best = distance(middle, here_);
            const bool ahead = (road.to.x - road.from.x) * std::cos(heading_) +
                               (road.to.y - road.from.y) * std::sin(heading_) >= 0;
            now_ = ahead ? road : Segment{road.to, road.from};
        }
        goal_ = lane(now_.from, now_.to, true);
        aiming_ = at_end_ = true;
    }

    void arrive() {
        if (at_end_) {
            std::vector<Segment> next;
            for (const auto &road : roads_)
                for (const auto &way : {road, Segment{road.to, road.from}})
                    if (distance(way.from, now_.to) < 1e-6 && distance(way.to, now_.from) > 1e-6) next.push_back(way);
            if (next.empty()) next.push_back({now_.to, now_.from});
            now_ = next[std::uniform_int_distribution<size_t>(0, next.size() - 1)(draw_)];
        }
        at_end_ = !at_end_;
        goal_ = lane(now_.from, now_.to, at_end_);
    }

    ros::Publisher commands_;
    ros::Subscriber states_, scan_;
    std::vector<Segment> roads_;
    std::string name_;
    std::mt19937 draw_;
    Segment now_{};
    Point here_{}, goal_{}, ego_{1e9, 1e9};
    double heading_ = 0, nearest_ = HUGE_VAL;
    bool placed_ = false, aiming_ = false, at_end_ = false;
};

int main(int argc, char **argv) {
    ros::init(argc, argv, "wander", ros::init_options::AnonymousName);
    if (argc != 2) {
        ROS_FATAL("usage: wander ROADS.json, in the namespace of a car");
        return 1;
    }
    ros::NodeHandle node;
    std::ifstream file(argv[1]);
    const std::string json((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    Wander wander(node, read_roads(json), node.getNamespace().substr(1));
    for (ros::WallRate rate(30); ros::ok(); rate.sleep()) {
        ros::spinOnce();
        wander.drive();
    }
    return 0;
}
