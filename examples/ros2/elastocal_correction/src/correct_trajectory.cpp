// A node that corrects joint trajectories by a calibrated model of elastocal.

#include <algorithm>
#include <cstddef>
#include <geometry_msgs/msg/wrench_stamped.hpp>
#include <memory>
#include <optional>
#include <rclcpp/rclcpp.hpp>
#include <stdexcept>
#include <string>
#include <trajectory_msgs/msg/joint_trajectory.hpp>
#include <vector>

#include "elastocal_model.hpp"

using geometry_msgs::msg::WrenchStamped;
using trajectory_msgs::msg::JointTrajectory;

class CorrectTrajectory : public rclcpp::Node {
 public:
  CorrectTrajectory()
      : Node("correct_trajectory"),
        model_(elastocal::Model::load(declare_parameter<std::string>("model"))),
        workspace_(model_),
        joint_names_(
            declare_parameter<std::vector<std::string>>("joint_names", model_.command_names())),
        allow_extrapolation_(declare_parameter<bool>("allow_extrapolation", false)) {
    if (joint_names_.size() != model_.commands())
      throw std::runtime_error("joint_names: a name for each commanded joint is needed");
    corrected_ = create_publisher<JointTrajectory>("trajectory_out", rclcpp::QoS(1));
    planned_ = create_subscription<JointTrajectory>(
        "trajectory_in", rclcpp::QoS(1),
        [this](const JointTrajectory::ConstSharedPtr message) { correct(*message); });
    load_ = create_subscription<WrenchStamped>(
        "wrench", rclcpp::SensorDataQoS(),
        [this](const WrenchStamped::ConstSharedPtr message) { set_wrench(*message); });
  }

 private:
  void set_wrench(const WrenchStamped& message) {
    const auto& force = message.wrench.force;
    const auto& torque = message.wrench.torque;
    wrench_ = {force.x, force.y, force.z, torque.x, torque.y, torque.z};
  }

  // Publish the corrected trajectory, or refuse it as a whole.
  void correct(const JointTrajectory& planned) {
    const auto columns = find_columns(planned.joint_names);
    if (!columns) return;
    JointTrajectory corrected = planned;
    for (std::size_t number = 0; number < corrected.points.size(); ++number) {
      std::vector<double>& positions = corrected.points[number].positions;
      if (positions.size() != planned.joint_names.size()) {
        RCLCPP_ERROR(get_logger(), "point %zu: not a position for each joint", number);
        return;
      }
      std::vector<double> command(model_.commands());
      for (std::size_t joint = 0; joint < command.size(); ++joint)
        command[joint] = positions[(*columns)[joint]];
      const elastocal::Pose wanted = model_.rigid(command, workspace_);
      const auto result = model_.correct(wanted, command, wrench_, workspace_);
      if (!result.converged) {
        RCLCPP_ERROR(get_logger(), "point %zu: near a singular posture, not corrected", number);
        return;
      }
      if (!allow_extrapolation_ && model_.is_extrapolated(command, wrench_, workspace_)) {
        RCLCPP_ERROR(get_logger(), "point %zu: beyond the fitted joints or loads", number);
        return;
      }
      for (std::size_t joint = 0; joint < command.size(); ++joint)
        positions[(*columns)[joint]] = result.joint_angles[joint];
    }
    corrected_->publish(corrected);
  }

  // Column of each joint of the model in a trajectory.
  std::optional<std::vector<std::size_t>> find_columns(
      const std::vector<std::string>& names) const {
    std::vector<std::size_t> columns;
    for (const std::string& joint : joint_names_) {
      const auto found = std::find(names.begin(), names.end(), joint);
      if (found == names.end()) {
        RCLCPP_ERROR(get_logger(), "the trajectory has no joint %s", joint.c_str());
        return std::nullopt;
      }
      columns.push_back(static_cast<std::size_t>(found - names.begin()));
    }
    return columns;
  }

  elastocal::Model model_;
  elastocal::Workspace workspace_;
  std::vector<std::string> joint_names_;
  bool allow_extrapolation_;
  elastocal::Wrench wrench_{};
  rclcpp::Publisher<JointTrajectory>::SharedPtr corrected_;
  rclcpp::Subscription<JointTrajectory>::SharedPtr planned_;
  rclcpp::Subscription<WrenchStamped>::SharedPtr load_;
};

int main(int argc, char** argv) {
  rclcpp::init(argc, argv);
  try {
    rclcpp::spin(std::make_shared<CorrectTrajectory>());
  } catch (const std::exception& error) {
    RCLCPP_FATAL(rclcpp::get_logger("correct_trajectory"), "%s", error.what());
    return 1;
  }
  rclcpp::shutdown();
  return 0;
}
