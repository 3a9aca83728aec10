// A linkage as a transmission of ros2_control, written by linkage_ros @VERSION@ from @FILE@.
// Change that file, and compile it again.
//
// The handles hold positions, velocities and efforts. After configure() nothing is allocated,
// locked or thrown: a thread of its own tells of states without a pose.

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "hardware_interface/hardware_info.hpp"
#include "pluginlib/class_list_macros.hpp"
#include "rclcpp/logging.hpp"
#include "transmission_interface/exception.hpp"
#include "transmission_interface/transmission.hpp"
#include "transmission_interface/transmission_loader.hpp"

#include "linkage.hpp"

namespace @PACKAGE@_plugin
{

using hardware_interface::TransmissionInfo;
using transmission_interface::ActuatorHandle;
using transmission_interface::Exception;
using transmission_interface::JointHandle;

constexpr std::size_t POSITION = 0, VELOCITY = 1, EFFORT = 2;
constexpr std::array<const char *, 3> INTERFACES{"position", "velocity", "effort"};

// Values of the inputs, or of the commanded joints.
using Values = std::array<double, INPUTS>;

bool are_finite(const Values & values)
{
  for (const double value : values) {
    if (!std::isfinite(value)) {
      return false;
    }
  }
  return true;
}

template<std::size_t N>
std::array<std::array<double, N>, 3> filled()
{
  std::array<std::array<double, N>, 3> values{};
  for (auto & each : values) {
    each.fill(std::nan(""));
  }
  return values;
}

// The rows of the commanded joints in the derivatives of all joints by the inputs.
struct Jacobian
{
  std::array<double, JOINTS * INPUTS> of_joints{};

  double commanded(std::size_t row, std::size_t column) const
  {
    return of_joints[COMMANDED[row] * INPUTS + column];
  }

  // Solve J·x = y, or its transpose, by elimination; false if a pivot has no digits.
  bool solve(const Values & y, Values & x, bool transposed) const
  {
    std::array<Values, INPUTS> rows{};
    double size = 0.0;
    for (std::size_t i = 0; i < INPUTS; ++i) {
      for (std::size_t k = 0; k < INPUTS; ++k) {
        rows[i][k] = transposed ? commanded(k, i) : commanded(i, k);
        size = std::fmax(size, std::fabs(rows[i][k]));
      }
    }
    Values right = y;
    for (std::size_t i = 0; i < INPUTS; ++i) {
      std::size_t pivot = i;
      for (std::size_t k = i + 1; k < INPUTS; ++k) {
        pivot = std::fabs(rows[k][i]) > std::fabs(rows[pivot][i]) ? k : pivot;
      }
      if (!(std::fabs(rows[pivot][i]) > 1e-12 * size)) {
        return false;
      }
      std::swap(rows[i], rows[pivot]);
      std::swap(right[i], right[pivot]);
      for (std::size_t k = i + 1; k < INPUTS; ++k) {
        const double factor = rows[k][i] / rows[i][i];
        for (std::size_t j = i + 1; j < INPUTS; ++j) {
          rows[k][j] -= factor * rows[i][j];
        }
        right[k] -= factor * right[i];
      }
    }
    for (std::size_t i = INPUTS; i-- > 0; ) {
      for (std::size_t k = i + 1; k < INPUTS; ++k) {
        right[i] -= rows[i][k] * right[k];
      }
      right[i] /= rows[i][i];
    }
    x = right;
    return are_finite(x);
  }
};

// Tells once a second, on a thread of its own, of states and commands without a pose.
class StatusLog
{
public:
  explicit StatusLog(std::string name)
  : name_(std::move(name)), thread_([this] {run();})
  {
  }

  ~StatusLog()
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      ends_ = true;
    }
    wakes_.notify_one();
    thread_.join();
  }

  void note(std::atomic<int> & which, int status, const Values & values)
  {
    const bool is_command = &which == &command;
    if (status > (is_command ? LAST_VALID : LAST_WITH_VALUES)) {
      for (std::size_t k = 0; k < INPUTS; ++k) {
        (is_command ? commanded_ : measured_)[k].store(
          values[k], std::memory_order_relaxed);
      }
    }
    which.store(status, std::memory_order_relaxed);
  }

  std::atomic<int> state{0};
  std::atomic<int> command{0};

private:
  using Noted = std::array<std::atomic<double>, INPUTS>;

  void run()
  {
    std::unique_lock<std::mutex> lock(mutex_);
    int told_state = 0, told_command = 0;
    while (!wakes_.wait_for(lock, std::chrono::seconds(1), [this] {return ends_;})) {
      tell(
        state, told_state, LAST_WITH_VALUES, measured_, "the actuators' ", "no new joint states");
      tell(
        command, told_command, LAST_VALID, commanded_, "the command ",
        "the last valid command stays");
    }
  }

  void tell(
    const std::atomic<int> & of, int & told, int last, const Noted & noted, const char * what,
    const char * then) const
  {
    const int status = of.load(std::memory_order_relaxed);
    if (status != told && status > last) {
      std::string values;
      for (const auto & value : noted) {
        values += (values.empty() ? "" : ", ") +
          std::to_string(value.load(std::memory_order_relaxed));
      }
      RCLCPP_WARN(
        rclcpp::get_logger("@PACKAGE@"), "%s: %s%s: %s; %s", name_.c_str(), what, values.c_str(),
        STATUS_NAMES[static_cast<std::size_t>(status)], then);
    }
    told = status;
  }

  const std::string name_;
  Noted measured_{}, commanded_{};
  std::mutex mutex_;
  std::condition_variable wakes_;
  bool ends_ = false;
  std::thread thread_;
};

// What the URDF says of the inputs and the joints, in the order of the linkage.
struct Names
{
  std::string transmission;
  std::array<std::string, INPUTS> actuators;
  std::array<double, INPUTS> reductions;
  std::array<std::string, JOINTS> joints;  // Empty where the URDF leaves one out
  std::array<double, JOINTS> offsets{};
  std::array<bool, 3> commands{};  // Whether position, velocity, effort of all are commanded
};

class Transmission : public transmission_interface::Transmission
{
public:
  explicit Transmission(Names names)
  : names_(std::move(names)), log_(names_.transmission)
  {
  }

  void configure(
    const std::vector<JointHandle> & joint_handles,
    const std::vector<ActuatorHandle> & actuator_handles) override
  {
    has_state_ = false;
    told_ = filled<JOINTS>();
    given_ = filled<INPUTS>();
    log_.note(log_.state, 0, {});
    log_.note(log_.command, 0, {});
    statuses_.clear();
    for (std::size_t which = 0; which < INTERFACES.size(); ++which) {
      joints_[which].clear();
      actuators_[which].clear();
      for (const std::string & name : names_.joints) {
        joints_[which].push_back(find(joint_handles, name, INTERFACES[which]));
      }
      for (const std::string & name : names_.actuators) {
        actuators_[which].push_back(find(actuator_handles, name, INTERFACES[which]));
      }
      has_actuators_[which] = true;
      for (const ActuatorHandle & handle : actuators_[which]) {
        has_actuators_[which] = has_actuators_[which] && handle;
      }
      has_commands_[which] = names_.commands[which];
      for (const std::size_t joint : COMMANDED) {
        has_commands_[which] = has_commands_[which] && joints_[which][joint];
      }
    }
    for (const JointHandle & handle : joint_handles) {
      if (handle && handle.get_interface_name() == "linkage_status") {
        statuses_.push_back(handle);
      }
    }
    if (!has_actuators_[POSITION]) {
      throw Exception(
              names_.transmission + ": an actuator has no position; the linkage needs all of them");
    }
  }

  // A handle may hold a command, of another call: states and commands are always written, if only
  // the last valid ones.
  void actuator_to_joint() override
  {
    Values inputs{};
    for (std::size_t k = 0; k < INPUTS; ++k) {
      inputs[k] = actuators_[POSITION][k].get_value() / names_.reductions[k];
    }
    std::array<double, JOINTS> joints{};
    Jacobian jacobian;
    const int status = to_joints(inputs.data(), joints.data(), jacobian.of_joints.data());
    log_.note(log_.state, status, inputs);
    tell_status();
    if (status <= LAST_WITH_VALUES) {
      has_state_ = true;
      state_ = jacobian;
      for (std::size_t i = 0; i < JOINTS; ++i) {
        told_[POSITION][i] = joints[i] + names_.offsets[i];
      }
      tell_rates();
      tell_efforts();
    }
    for (std::size_t which = 0; which < INTERFACES.size(); ++which) {
      for (std::size_t i = 0; has_actuators_[which] && i < JOINTS; ++i) {
        set(joints_[which][i], told_[which][i]);
      }
    }
  }

  // Without any command the actuators get none: after a deactivation the last one is not repeated,
  // since they may have been moved since.
  void joint_to_actuator() override
  {
    std::array<bool, 3> is_given{};
    for (std::size_t which = 0; which < INTERFACES.size(); ++which) {
      is_given[which] = has_commands_[which] && is_any_given(read_commands(which));
      if (!is_given[which]) {
        given_[which].fill(std::nan(""));
      }
    }
    Jacobian jacobian = state_;
    bool is_valid = has_state_;
    if (!is_given[POSITION]) {
      log_.note(log_.command, 0, {});
      tell_status();
    } else {
      Values commands = read_commands(POSITION), inputs{};
      for (std::size_t k = 0; k < INPUTS; ++k) {
        commands[k] -= names_.offsets[COMMANDED[k]];
      }
      std::array<double, JOINTS> joints{};
      int status = to_inputs(commands.data(), inputs.data());
      if (status <= LAST_VALID) {
        status = to_joints(inputs.data(), joints.data(), jacobian.of_joints.data());
        // In another assembly the same joints have other inputs.
        status = status > LAST_VALID || are_at(joints, commands) ? status : OPEN;
      }
      log_.note(log_.command, status, commands);
      tell_status();
      is_valid = status <= LAST_VALID;
      for (std::size_t k = 0; is_valid && k < INPUTS; ++k) {
        given_[POSITION][k] = inputs[k] * names_.reductions[k];
      }
    }
    if (is_given[VELOCITY]) {
      give_rates(jacobian, is_valid);
    }
    if (is_given[EFFORT] && is_valid) {
      give_efforts(jacobian);
    }
    for (std::size_t which = 0; which < INTERFACES.size(); ++which) {
      for (std::size_t k = 0; has_commands_[which] && k < INPUTS; ++k) {
        set(actuators_[which][k], given_[which][k]);
      }
    }
  }

  std::size_t num_actuators() const override {return INPUTS;}
  std::size_t num_joints() const override {return JOINTS;}

private:
  void tell_rates()
  {
    for (std::size_t i = 0; has_actuators_[VELOCITY] && i < JOINTS; ++i) {
      double rate = 0.0;
      for (std::size_t k = 0; k < INPUTS; ++k) {
        rate += state_.of_joints[i * INPUTS + k] *
          (actuators_[VELOCITY][k].get_value() / names_.reductions[k]);
      }
      told_[VELOCITY][i] = rate;
    }
  }

  // The commanded joints carry all.
  void tell_efforts()
  {
    if (!has_actuators_[EFFORT]) {
      return;
    }
    Values efforts{}, of_joints{};
    for (std::size_t k = 0; k < INPUTS; ++k) {
      efforts[k] = actuators_[EFFORT][k].get_value() * names_.reductions[k];
    }
    if (state_.solve(efforts, of_joints, true)) {
      told_[EFFORT].fill(0.0);
      for (std::size_t k = 0; k < INPUTS; ++k) {
        told_[EFFORT][COMMANDED[k]] = of_joints[k];
      }
    }
  }

  // Without a pose, or rates of the inputs that move the joints so, the actuators stop.
  void give_rates(const Jacobian & jacobian, bool is_valid)
  {
    Values of_inputs{};
    if (!is_valid || !jacobian.solve(read_commands(VELOCITY), of_inputs, false)) {
      of_inputs.fill(0.0);
    }
    for (std::size_t k = 0; k < INPUTS; ++k) {
      given_[VELOCITY][k] = of_inputs[k] * names_.reductions[k];
    }
  }

  void give_efforts(const Jacobian & jacobian)
  {
    const Values efforts = read_commands(EFFORT);
    for (std::size_t k = 0; are_finite(efforts) && k < INPUTS; ++k) {
      double effort = 0.0;
      for (std::size_t i = 0; i < INPUTS; ++i) {
        effort += jacobian.commanded(i, k) * efforts[i];
      }
      given_[EFFORT][k] = effort / names_.reductions[k];
    }
  }

  template<typename Handle>
  static Handle find(
    const std::vector<Handle> & handles, const std::string & name, const std::string & interface)
  {
    for (const Handle & handle : handles) {
      if (handle && handle.get_prefix_name() == name && handle.get_interface_name() == interface) {
        return handle;
      }
    }
    return Handle("", "", nullptr);
  }

  template<typename Handle>
  static void set(Handle & handle, double value)
  {
    if (handle) {
      static_cast<void>(handle.set_value(value));
    }
  }

  // NaN is no command.
  static bool is_any_given(const Values & commands)
  {
    for (const double command : commands) {
      if (!std::isnan(command)) {
        return true;
      }
    }
    return false;
  }

  Values read_commands(std::size_t which) const
  {
    Values values{};
    for (std::size_t k = 0; k < INPUTS; ++k) {
      values[k] = joints_[which][COMMANDED[k]].get_value();
    }
    return values;
  }

  // Whether the commanded joints are where they shall be, apart from whole turns.
  static bool are_at(const std::array<double, JOINTS> & joints, const Values & commands)
  {
    for (std::size_t k = 0; k < INPUTS; ++k) {
      double off = joints[COMMANDED[k]] - commands[k];
      off = TURNS[k] ? std::remainder(off, 2.0 * std::acos(-1.0)) : off;
      if (!(std::fabs(off) < 1e-6)) {
        return false;
      }
    }
    return true;
  }

  // The worse of both: of the states, and of the commands.
  void tell_status()
  {
    const int worse = std::max(log_.state.load(), log_.command.load());
    for (JointHandle & handle : statuses_) {
      set(handle, worse);
    }
  }

  const Names names_;
  StatusLog log_;
  std::array<std::vector<JointHandle>, 3> joints_;
  std::array<std::vector<ActuatorHandle>, 3> actuators_;
  std::vector<JointHandle> statuses_;
  std::array<bool, 3> has_actuators_{}, has_commands_{};
  Jacobian state_;
  bool has_state_ = false;
  // The last valid states of the joints and commands of the actuators; NaN where there are none
  std::array<std::array<double, JOINTS>, 3> told_ = filled<JOINTS>();
  std::array<Values, 3> given_ = filled<INPUTS>();
};

class Loader : public transmission_interface::TransmissionLoader
{
public:
  std::shared_ptr<transmission_interface::Transmission> load(const TransmissionInfo & info) override
  {
    try {
      return std::make_shared<Transmission>(read_names(info));
    } catch (const std::exception & error) {
      RCLCPP_ERROR(rclcpp::get_logger("@PACKAGE@"), "%s: %s", info.name.c_str(), error.what());
      return nullptr;
    }
  }

private:
  static Names read_names(const TransmissionInfo & info)
  {
    Names names;
    names.transmission = info.name;
    for (const auto & actuator : info.actuators) {
      const std::size_t k = place(INPUT_NAMES, actuator.role, "actuator", names.actuators);
      if (actuator.mechanical_reduction == 0.0 || actuator.offset != 0.0) {
        throw Exception(
                "actuator " + actuator.name +
                ": its reduction is 0, or it has an offset; give offsets to joints");
      }
      names.actuators[k] = actuator.name;
      names.reductions[k] = actuator.mechanical_reduction;
    }
    names.commands.fill(true);
    for (const auto & joint : info.joints) {
      const std::size_t k = place(JOINT_NAMES, joint.role, "joint", names.joints);
      if (joint.mechanical_reduction != 1.0) {
        throw Exception("joint " + joint.name + ": has a reduction; give it to an actuator");
      }
      if (!joint.command_interfaces.empty() && !is_commanded(k)) {
        throw Exception(
                "joint " + joint.name + ": has command interfaces, but only " + list_commanded() +
                " can be commanded; leave them out, or compile with --driven-by " + joint.role);
      }
      names.joints[k] = joint.name;
      names.offsets[k] = joint.offset;
      for (std::size_t which = 0; is_commanded(k) && which < INTERFACES.size(); ++which) {
        const auto & all = joint.command_interfaces;
        const bool has = std::find(all.begin(), all.end(), INTERFACES[which]) != all.end();
        names.commands[which] = names.commands[which] && has;
      }
    }
    for (std::size_t k = 0; k < INPUTS; ++k) {
      require(names.actuators[k], INPUT_NAMES[k], "actuator");
      require(names.joints[COMMANDED[k]], JOINT_NAMES[COMMANDED[k]], "joint");
    }
    return names;
  }

  template<std::size_t N>
  static std::size_t place(
    const std::array<const char *, N> & known, const std::string & role, const std::string & what,
    const std::array<std::string, N> & taken)
  {
    std::string all;
    for (std::size_t k = 0; k < N; ++k) {
      if (role == known[k]) {
        if (!taken[k].empty()) {
          throw Exception(what + " with the role " + role + " is given twice; leave one out");
        }
        return k;
      }
      all += (all.empty() ? "" : ", ") + std::string(known[k]);
    }
    throw Exception("the linkage has no " + what + " " + role + "; write a role of " + all);
  }

  static void require(const std::string & name, const std::string & role, const std::string & what)
  {
    if (name.empty()) {
      throw Exception("no " + what + " has the role " + role + "; add it");
    }
  }

  static bool is_commanded(std::size_t joint)
  {
    for (const std::size_t each : COMMANDED) {
      if (each == joint) {
        return true;
      }
    }
    return false;
  }

  static std::string list_commanded()
  {
    std::string all;
    for (const std::size_t joint : COMMANDED) {
      all += (all.empty() ? "" : ", ") + std::string(JOINT_NAMES[joint]);
    }
    return all;
  }
};

}  // namespace @PACKAGE@_plugin

PLUGINLIB_EXPORT_CLASS(@PACKAGE@_plugin::Loader, transmission_interface::TransmissionLoader)
