// A stand-in for the header of ros2_control, as far as a transmission needs it.
#pragma once
#include <string>
#include <vector>

namespace hardware_interface
{
struct JointInfo
{
  std::string name;
  std::vector<std::string> state_interfaces, command_interfaces;
  std::string role;
  double mechanical_reduction = 1.0, offset = 0.0;
};
using ActuatorInfo = JointInfo;

struct TransmissionInfo
{
  std::string name, type;
  std::vector<JointInfo> joints;
  std::vector<ActuatorInfo> actuators;
};
}  // namespace hardware_interface
