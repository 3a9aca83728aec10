// Runs a transmission by lines from the standard input; its numbers are hexadecimal.
//
//   actuator NAME ROLE REDUCTION OFFSET        joint NAME ROLE REDUCTION OFFSET [INTERFACE...]
//   configure [INTERFACE...]                   all interfaces, if none is named; again, another time
//   to_joints NUMBER...                        position, velocity, effort of each actuator
//   to_actuators NUMBER...                     the same of each joint
//   time COUNT                                 both ways, from where the values are
//   sleep MILLISECONDS
// It answers the first two with the values of the other side, the status, and how often memory was
// allocated; and `time` with nanoseconds for both ways.

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <map>
#include <memory>
#include <new>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "transmission_interface/transmission_loader.hpp"

std::unique_ptr<transmission_interface::TransmissionLoader> make_plugin();

static thread_local long allocated = 0;

void * operator new(std::size_t size)
{
  ++allocated;
  if (void * found = std::malloc(size)) {
    return found;
  }
  throw std::bad_alloc();
}
void operator delete(void * found) noexcept {std::free(found);}
void operator delete(void * found, std::size_t) noexcept {std::free(found);}

using Values = std::vector<double>;

static void read(std::istream & from, Values & values)
{
  std::string word;
  for (double & value : values) {
    from >> word;
    value = std::strtod(word.c_str(), nullptr);
  }
}

int main()
{
  hardware_interface::TransmissionInfo info;
  info.name = "arm";
  std::shared_ptr<transmission_interface::Transmission> transmission;
  Values of_actuators, of_joints;
  double status = -1.0;
  const std::vector<std::string> all{"position", "velocity", "effort"};
  for (std::string line; std::getline(std::cin, line); ) {
    std::istringstream words(line);
    std::string what;
    words >> what;
    if (what == "actuator" || what == "joint") {
      hardware_interface::JointInfo one;
      words >> one.name >> one.role >> one.mechanical_reduction >> one.offset;
      for (std::string each; words >> each; ) {
        one.command_interfaces.push_back(each);
      }
      (what == "joint" ? info.joints : info.actuators).push_back(one);
    } else if (what == "configure") {
      transmission = transmission ? transmission : make_plugin()->load(info);
      if (!transmission) {
        return 1;
      }
      std::string named;
      std::getline(words, named);
      of_actuators.assign(3 * info.actuators.size(), 0.0);
      of_joints.assign(3 * info.joints.size(), 0.0);
      std::vector<transmission_interface::ActuatorHandle> actuators;
      std::vector<transmission_interface::JointHandle> joints;
      for (std::size_t k = 0; k < 3; ++k) {
        if (!named.empty() && named.find(all[k]) == std::string::npos) {
          continue;
        }
        for (std::size_t i = 0; i < info.actuators.size(); ++i) {
          actuators.emplace_back(info.actuators[i].name, all[k], &of_actuators[3 * i + k]);
        }
        for (std::size_t i = 0; i < info.joints.size(); ++i) {
          joints.emplace_back(info.joints[i].name, all[k], &of_joints[3 * i + k]);
        }
      }
      joints.emplace_back(info.joints[0].name, "linkage_status", &status);
      try {
        transmission->configure(joints, actuators);
      } catch (const std::exception & error) {
        std::fprintf(stderr, "ERROR %s\n", error.what());
        return 1;
      }
    } else if (what == "sleep") {
      int milliseconds = 0;
      words >> milliseconds;
      std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
    } else if (what == "time") {
      long count = 0;
      words >> count;
      const auto begin = std::chrono::steady_clock::now();
      for (long i = 0; i < count; ++i) {
        transmission->joint_to_actuator();
        transmission->actuator_to_joint();
      }
      const std::chrono::duration<double, std::nano> took = std::chrono::steady_clock::now() - begin;
      std::printf("%.1f\n", took.count() / count);
    } else {
      const bool back = what == "to_actuators";
      read(words, back ? of_joints : of_actuators);
      const long before = allocated;
      back ? transmission->joint_to_actuator() : transmission->actuator_to_joint();
      const long after = allocated;
      for (const double value : back ? of_actuators : of_joints) {
        std::printf("%a ", value);
      }
      std::printf("%g %ld\n", status, after - before);
    }
  }
}
