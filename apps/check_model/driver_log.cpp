#include <dashpot/apps/check_model/driver_log.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/lcmtypes/driver.hpp>
#include <dashpot/lcmtypes/log_file.hpp>

#include <algorithm>
#include <fstream>
#include <limits>
#include <vector>

namespace dashpot::apps {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using lcmtypes::DriverKind;

/// Samples of position, velocity, measured and commanded torque, one after the other.
struct Samples {
  std::vector<double> times, values;
  Index joints = 0, commands = 0;

  void add(double time, const lcmtypes::DriverStatus& status) {
    times.push_back(time);
    for (const auto* list : {&status.position, &status.velocity, &status.torque}) {
      values.insert(values.end(), list->begin(), list->end());
    }
    values.insert(values.end(), static_cast<std::size_t>(joints),
                  std::numeric_limits<double>::quiet_NaN());
  }
  /// A driver answers to the command that follows its status.
  void command(const controller::JointVector& torque) {
    if (times.empty() || torque.size() != joints) return;
    std::copy(torque.begin(), torque.end(), values.end() - joints);
    ++commands;
  }
};

bool begins_as_log(const std::string& path) {
  std::string begin(4, '\0');
  std::ifstream(path, std::ios::binary).read(begin.data(), 4);
  return begin == "\xED\xA1\xDA\x01";
}

}  // namespace

std::optional<MotionFile> read_driver_log(const std::string& path) {
  if (!begins_as_log(path)) return std::nullopt;
  MotionFile file;
  Samples samples;
  Index& joints = samples.joints;
  std::vector<double>& times = samples.times;
  lcmtypes::LogFile log(path);
  lcmtypes::DriverStatus status;
  lcmtypes::DriverCommand command;
  while (log.read()) {
    const lcmtypes::LogFile::Event& event = log.event();
    for (const DriverKind kind : {DriverKind::kIiwa, DriverKind::kPanda}) {
      if (event.channel == lcmtypes::profile_of(kind).command_channel &&
          lcmtypes::decode(kind, event.data.data(), event.data.size(), command)) {
        samples.command(command.torque);
      }
      if (event.channel != lcmtypes::profile_of(kind).status_channel) continue;
      if (!lcmtypes::decode(kind, event.data.data(), event.data.size(), status)) continue;
      if (joints == 0) joints = status.position.size();
      if (joints != status.position.size()) {
        throw controller::InputError("", "its statuses differ in joints");
      }
      // An iiwa does not know its clock at first.
      const double time = 1e-6 * static_cast<double>(status.utime < 0 ? event.utime : status.utime);
      if (!times.empty() && time <= times.back()) {
        ++(time == times.back() ? file.duplicates : file.out_of_order);
        continue;
      }
      samples.add(time, status);
    }
  }
  if (times.empty()) return std::nullopt;
  for (const auto& [letters, unit] : {std::pair("q", "rad"), std::pair("v", "rad/s"),
                                      std::pair("tau", "N m"), std::pair("tau_cmd", "N m")}) {
    for (Index i = 1; i <= joints; ++i) {
      file.channels.push_back({letters + std::to_string(i), unit});
    }
  }
  const auto N = static_cast<Index>(times.size());
  file.time = VectorXd::Map(times.data(), N).array() - times.front();
  file.values = Eigen::MatrixXd::Map(samples.values.data(), 4 * joints, N);
  file.notes.emplace_back("tau1 ... are the torques that the driver measured");
  if (samples.commands > 0) {
    file.notes.back() += "; --torques tau_cmd1,... takes the commanded torques";
  } else {
    file.channels.resize(static_cast<std::size_t>(3 * joints));
    file.values.conservativeResize(3 * joints, Eigen::NoChange);
  }
  return file;
}

}  // namespace dashpot::apps
