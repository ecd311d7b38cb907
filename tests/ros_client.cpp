// A client of the ROS 1 interface in C++, written from its tables of names and types alone.
// usage: ros_client ACTION...   one ACTION a trial: drive (to its end), or reset or restart after ten commands.
// Prints a JSON object a trial: what it has seen of it.

#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <mutex>
#include <string>
#include <vector>

#include <ros/ros.h>

#include <dubins_traffic_msgs/LabelStamped.h>
#include <dubins_traffic_msgs/MMode.h>
#include <gazebo_msgs/ModelStates.h>
#include <geometry_msgs/Twist.h>
#include <integrator_chains_msgs/ProblemInstanceJSON.h>

using Request = dubins_traffic_msgs::MMode::Request;

class Client {
public:
    explicit Client(ros::NodeHandle &node) {
        const auto fast = ros::TransportHints().tcpNoDelay();
        commands_ = node.advertise<geometry_msgs::Twist>("/ego/mobile_base/commands/velocity", 100);
        problem_ = node.subscribe("/dubins_traffic_maestro/probleminstance_JSON", 10, &Client::learn, this);
        label_ = node.subscribe("/loutput", 100, &Client::label, this);
        states_ = node.subscribe("/gazebo/model_states", 100, &Client::drive, this, fast);
        mode_ = node.serviceClient<dubins_traffic_msgs::MMode>("/dubins_traffic_maestro/mode");
    }

    bool meet() {
        for (int k = 0; k < 2000 && commands_.getNumSubscribers() == 0; ++k) ros::WallDuration(0.01).sleep();
        return commands_.getNumSubscribers() > 0 && mode_.waitForExistence(ros::Duration(20));
    }

    // Go through one trial and print what has been seen of it; false if something does not come.
    bool trial(const std::string &action) {
        for (int k = 0; !ask(Request::READY); ++k) {
            if (k > 1000) return false;
            ros::WallDuration(0.02).sleep();
        }
        size_t before;
        {
            std::lock_guard<std::mutex> hold(lock_);
            before = problems_.size();
            limit_ = action == "drive" ? -1 : 10;
            sent_ = 0;
            labels_.clear();
        }
        const bool started = ask(Request::START), again = ask(Request::START);
        if (!until([&] { return problems_.size() > before; })) return false;
        bool granted = true;
        if (action != "drive") {
            if (!until([&] { return sent_ >= limit_; })) return false;
            granted = ask(action == "reset" ? Request::RESET : Request::RESTART);
        }
        if (!until([&] { return problems_.size() > before + 1; })) return false;
        std::lock_guard<std::mutex> hold(lock_);
        std::string labels;
        for (const auto &label : labels_) labels += (labels.empty() ? "\"" : ", \"") + label + "\"";
        std::printf("{\"action\": \"%s\", \"started\": %s, \"again\": %s, \"refused\": %s, \"problem\": %s, "
                    "\"last\": \"%s\", \"labels\": [%s], \"sent\": %d}\n",
                    action.c_str(), started ? "true" : "false", again ? "true" : "false", granted ? "false" : "true",
                    problems_[before].c_str(), problems_[before + 1].c_str(), labels.c_str(), sent_);
        return true;
    }

private:
    bool ask(int mode) {
        dubins_traffic_msgs::MMode call;
        call.request.mode = mode;
        return mode_.call(call) && call.response.result;
    }

    template <class Done>
    bool until(Done done) {
        std::unique_lock<std::mutex> hold(lock_);
        return news_.wait_for(hold, std::chrono::seconds(30), done);
    }

    void learn(const integrator_chains_msgs::ProblemInstanceJSON &message) {
        std::lock_guard<std::mutex> hold(lock_);
        problems_.push_back(message.problemjson);
        news_.notify_all();
    }

    void label(const dubins_traffic_msgs::LabelStamped &message) {
        std::lock_guard<std::mutex> hold(lock_);
        labels_ = message.label;
    }

    void drive(const gazebo_msgs::ModelStates &message) {
        std::lock_guard<std::mutex> hold(lock_);
        if (problems_.empty() || problems_.back().empty() || sent_ == limit_) return;
        for (size_t k = 0; k < message.name.size(); ++k) {
            if (message.name[k] != "ego") continue;
            const auto &at = message.pose[k].position;
            geometry_msgs::Twist command;
            command.linear.x = 0.3 + 0.1 * std::sin(at.x);
            command.angular.z = 0.4 * std::cos(at.y);
            commands_.publish(command);
            ++sent_;
        }
        news_.notify_all();
    }

    ros::Publisher commands_;
    ros::Subscriber problem_, label_, states_;
    ros::ServiceClient mode_;
    std::mutex lock_;
    std::condition_variable news_;
    std::vector<std::string> problems_, labels_;
    int limit_ = -1, sent_ = 0;
};

int main(int argc, char **argv) {
    ros::init(argc, argv, "client", ros::init_options::AnonymousName);
    ros::NodeHandle node;
    Client client(node);
    ros::AsyncSpinner spinner(1);
    spinner.start();
    bool well = client.meet();
    for (int k = 1; well && k < argc; ++k) well = client.trial(argv[k]);
    return well ? 0 : 1;
}
