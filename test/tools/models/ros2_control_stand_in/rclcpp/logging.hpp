// A stand-in for the header of ros2_control, as far as a transmission needs it.
#pragma once
#include <cstdio>

namespace rclcpp
{
inline const char * get_logger(const char * name) {return name;}
}  // namespace rclcpp

#define RCLCPP_LOG(level, logger, ...) \
  (std::fprintf(stderr, "%s [%s] ", level, logger), std::fprintf(stderr, __VA_ARGS__), \
  std::fprintf(stderr, "\n"))
#define RCLCPP_WARN(logger, ...) RCLCPP_LOG("WARN", logger, __VA_ARGS__)
#define RCLCPP_ERROR(logger, ...) RCLCPP_LOG("ERROR", logger, __VA_ARGS__)
