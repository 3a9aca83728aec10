// A stand-in for the header of ros2_control, as far as a transmission needs it.
#pragma once
#include <stdexcept>

namespace transmission_interface
{
class Exception : public std::runtime_error
{
public:
  using std::runtime_error::runtime_error;
};
}  // namespace transmission_interface
