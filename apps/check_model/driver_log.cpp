#include <dashpot/apps/check_model/driver_log.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/lcmtypes/driver.hpp>
#include <dashpot/lcmtypes/log_file.hpp>

#include <fstream>
#include <vector>

namespace dashpot::apps {
namespace {

using Eigen::Index;
using lcmtypes::DriverKind;

bool begins_as_log(const std::string& path) {
  std::string begin(4, '\0');
  std::ifstream(path, std::ios::binary).read(begin.data(), 4);
  return begin == "\xED\xA1\xDA\x01";
}

}  // namespace

std::optional<MotionFile> read_driver_log(const std::string& path) {
  if (!begins_as_log(path)) return std::nullopt;
  MotionFile file;
  std::vector<double> times, values;
  Index joints = 0;
  lcmtypes::LogFile log(path);
  lcmtypes::DriverStatus status;
  while (log.read()) {
    const lcmtypes::LogFile::Event& event = log.event();
    for (const DriverKind kind : {DriverKind::kIiwa, DriverKind::kPanda}) {
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
      times.push_back(time);
      for (const auto* list : {&status.position, &status.velocity, &status.torque}) {
        values.insert(values.end(), list->begin(), list->end());
      }
    }
  }
  if (times.empty()) return std::nullopt;
  for (const auto& [letters, unit] :
       {std::pair("q", "rad"), std::pair("v", "rad/s"), std::pair("tau", "N m")}) {
    for (Index i = 1; i <= joints; ++i) {
      file.channels.push_back({letters + std::to_string(i), unit});
    }
  }
  const auto N = static_cast<Index>(times.size());
  file.time = Eigen::VectorXd::Map(times.data(), N).array() - times.front();
  file.values = Eigen::MatrixXd::Map(values.data(), 3 * joints, N);
  file.notes.emplace_back("the torques are those that the driver measured");
  return file;
}

}  // namespace dashpot::apps
