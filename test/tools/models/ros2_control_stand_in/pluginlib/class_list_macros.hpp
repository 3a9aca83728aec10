// A stand-in for the header of ros2_control, as far as a transmission needs it.
#pragma once
#include <memory>

#define PLUGINLIB_EXPORT_CLASS(Class, Base) \
  std::unique_ptr<Base> make_plugin() {return std::make_unique<Class>();}
