// An ego controller as a ROS 1 node in C++: round the goals in order, straight across country, as `simple` of 2016.
// It answers each message of model states with one command, and starts trial after trial. Build: see docs/attach.md.

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <ros/ros.h>

#include <dubins_traffic_msgs/LabelStamped.h>
#include <dubins_traffic_msgs/MMode.h>
#include <gazebo_msgs/ModelStates.h>
#include <geometry_msgs/Twist.h>
#include <integrator_chains_msgs/ProblemInstanceJSON.h>

#include "numbers.hpp"

class Controller {
public:
    explicit Controller(ros::NodeHandle &node) {
        const auto fast = ros::TransportHints().tcpNoDelay();
        commands_ = node.advertise<geometry_msgs::Twist>("/ego/mobile_base/commands/velocity", 10);
        instance_ = node.subscribe("/dubins_traffic_maestro/probleminstance_JSON", 10, &Controller::begin, this, fast);
        labels_ = node.subscribe("/loutput", 10, &Controller::look, this, fast);
        states_ = node.subscribe("/gazebo/model_states", 10, &Controller::drive, this, fast);
        mode_ = node.serviceClient<dubins_traffic_msgs::MMode>("/dubins_traffic_maestro/mode");
    }

    // Start the next trial once there is one; false when the maestro has gone.
    bool ask() {
        if (!idle_) return true;
        dubins_traffic_msgs::MMode ready, start;
        ready.request.mode = dubins_traffic_msgs::MMode::Request::READY;
        start.request.mode = dubins_traffic_msgs::MMode::Request::START;
        if (!mode_.call(ready)) return false;
        if (ready.response.result) idle_ = !(mode_.call(start) && start.response.result);
        return true;
    }

private:
    void begin(const integrator_chains_msgs::ProblemInstanceJSON &message) {
        goals_.clear();
        next_ = 0;
        idle_ = message.problemjson.empty();
        if (idle_) {
            ROS_INFO("the trial is over; labels seen: %zu", seen_);
            return;
        }
        const auto length = numbers(message.problemjson, "length"), goals = numbers(message.problemjson, "goals"),
                   frame = numbers(message.problemjson, "transform"),
                   radius = numbers(message.problemjson, "intersection_radius");
        radius_ = radius.at(0);
        const double c = std::cos(frame.at(2)), s = std::sin(frame.at(2));
        for (size_t k = 0; k + 1 < goals.size(); k += 2) {
            const double x = length.at(0) * goals[k], y = length.at(0) * goals[k + 1];
            goals_.emplace_back(c * x - s * y + frame[0], s * x + c * y + frame[1]);
        }
    }

    void look(const dubins_traffic_msgs::LabelStamped &message) { seen_ += message.label.size(); }

    void drive(const gazebo_msgs::ModelStates &message) {
        if (goals_.empty()) return;
        for (size_t k = 0; k < message.name.size(); ++k) {
            if (message.name[k] != "ego") continue;
            const auto &pose = message.pose[k];
            const auto &goal = goals_[next_ % goals_.size()];
            const double dx = goal.first - pose.position.x, dy = goal.second - pose.position.y;
            if (std::hypot(dx, dy) < radius_ / 2) ++next_;
            const double heading = 2 * std::atan2(pose.orientation.z, pose.orientation.w);
            const double error = std::remainder(std::atan2(dy, dx) - heading, 2 * M_PI);
            geometry_msgs::Twist command;
            if (std::fabs(error) > 0.1) command.angular.z = std::copysign(0.9, error);
            else command.linear.x = 0.5;
            commands_.publish(command);
        }
    }

    ros::Publisher commands_;
    ros::Subscriber instance_, labels_, states_;
    ros::ServiceClient mode_;
    std::vector<std::pair<double, double>> goals_;
    double radius_ = 1.0;
    size_t next_ = 0, seen_ = 0;
    bool idle_ = true;
};

int main(int argc, char **argv) {
    ros::init(argc, argv, "controller", ros::init_options::AnonymousName);
    ros::NodeHandle node;
    ros::service::waitForService("/dubins_traffic_maestro/mode");
    Controller controller(node);
    for (ros::WallRate rate(200); ros::ok(); rate.sleep()) {
        ros::spinOnce();
        if (!controller.ask()) break;
    }
    return 0;
}
