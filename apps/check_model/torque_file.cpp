#include <dashpot/apps/check_model/torque_file.hpp>
#include <dashpot/apps/records/csv_column.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/lcmtypes/driver.hpp>
#include <dashpot/lcmtypes/log_file.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <sstream>
#include <string_view>

namespace dashpot::apps {

using controller::InputError;
using controller::Joint;
using controller::RobotModel;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using lcmtypes::DriverKind;

namespace {

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

/// Reads the statuses of a driver of an iiwa or a Panda from an LCM log: channels q1 ..., v1 ...
/// and the measured torques tau1 ...; and tau_cmd1 ..., the torques of the commands that followed
/// the statuses, if the log has any. Nothing if the file is not a log or has no statuses. Throws
/// InputError if the number of joints changes.
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
        throw InputError("", "its statuses differ in joints");
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
  file.values = MatrixXd::Map(samples.values.data(), 4 * joints, N);
  file.notes.emplace_back("tau1 ... are the torques that the driver measured");
  if (samples.commands > 0) {
    file.notes.back() += "; --torques tau_cmd1,... takes the commanded torques";
  } else {
    file.channels.resize(static_cast<std::size_t>(3 * joints));
    file.values.conservativeResize(3 * joints, Eigen::NoChange);
  }
  return file;
}

enum class Quantity { kOther, kPosition, kVelocity, kTorque };

Quantity quantity_of(const MotionChannel& channel) {
  const std::vector<std::string> words = words_of(channel.name);
  if (has_any(words, {"wrench", "force", "error", "err"})) return Quantity::kOther;
  if (channel.unit == "rad" || channel.unit == "m") return Quantity::kPosition;
  if (channel.unit == "rad/s" || channel.unit == "m/s") return Quantity::kVelocity;
  if (channel.unit == "N m" || channel.unit == "N") return Quantity::kTorque;
  if (!channel.unit.empty()) return Quantity::kOther;
  if (has_any(words, {"tau", "torque", "torques", "effort", "efforts", "moment"}))
    return Quantity::kTorque;
  if (has_any(words, {"qd", "dq", "vel", "velocity", "velocities"})) return Quantity::kVelocity;
  if (has_any(words, {"q", "pos", "position", "positions", "angle"})) return Quantity::kPosition;
  return Quantity::kOther;
}

/// Returns the rank of a column: measured torques come first, then commanded, then estimated ones.
int rank_of(const std::string& name) {
  const std::vector<std::string> words = words_of(name);
  if (has_any(words, {"ext", "external"})) return 2;
  return has_any(words, {"d", "des", "desired", "cmd", "command", "commanded", "ref", "reference",
                         "goal", "target", "setpoint"})
             ? 1
             : 0;
}

/// The stem of a column's name, and the joint, by a joint's name or otherwise by the last number.
struct Place {
  std::string stem;
  int number = -1;
  bool by_name = false;
};

Place place_of(const std::string& name, const RobotModel& model) {
  Place place{name, -1, false};
  std::size_t longest = 0;
  for (std::size_t j = 0; j < model.joints().size(); ++j) {
    const std::string& joint = model.joints()[j].name;
    const auto at = name.find(joint);
    if (joint.size() <= longest || at == std::string::npos) continue;
    longest = joint.size();
    place = {name.substr(0, at) + "#" + name.substr(at + joint.size()), static_cast<int>(j), true};
  }
  if (place.by_name) return place;
  const auto last = name.find_last_of("0123456789");
  if (last == std::string::npos) return place;
  const auto before = name.find_last_not_of("0123456789", last);
  const std::size_t first = before == std::string::npos ? 0 : before + 1;
  if (last - first > 3) return place;
  place.number = std::stoi(name.substr(first, last - first + 1));
  place.stem = name.substr(0, first) + "#" + name.substr(last + 1);
  return place;
}

class Columns {
 public:
  Columns(const MotionFile& file, const RobotModel& model) : file_(file), model_(model) {}

  /// The columns of a quantity, in the model's order; nothing if there are none.
  std::optional<std::vector<Index>> find(Quantity quantity, std::vector<std::string>& notes) const {
    std::map<std::string, std::vector<std::pair<int, Index>>> groups;
    std::vector<std::string> order;
    for (std::size_t i = 0; i < file_.channels.size(); ++i) {
      if (quantity_of(file_.channels[i]) != quantity) continue;
      const Place place = place_of(file_.channels[i].name, model_);
      // A commanded motion is not a measurement.
      if (quantity != Quantity::kTorque && rank_of(place.stem) > 0) continue;
      auto& group = groups[place.stem];
      if (group.empty()) order.push_back(place.stem);
      group.emplace_back(place.number, static_cast<Index>(i));
    }
    std::erase_if(order, [&](const std::string& stem) {
      auto& group = groups[stem];
      std::sort(group.begin(), group.end());
      const auto twice = std::adjacent_find(group.begin(), group.end(),
                                            [](auto& a, auto& b) { return a.first == b.first; });
      return group.size() != static_cast<std::size_t>(model_.dof()) || twice != group.end();
    });
    if (order.empty()) return std::nullopt;
    const auto best = std::min_element(order.begin(), order.end(),
                                       [](auto& a, auto& b) { return rank_of(a) < rank_of(b); });
    std::vector<Index> found;
    for (const auto& [number, column] : groups[*best]) found.push_back(column);
    if (order.size() > 1) {
      notes.push_back("columns " + file_.channels[static_cast<std::size_t>(found.front())].name +
                      " ... are used; there are " + std::to_string(order.size()) +
                      " sets of such columns");
    }
    return found;
  }

  std::vector<Index> named(Quantity quantity, const std::string& names,
                           const std::string& option) const {
    std::vector<Index> chosen = chosen_channels(file_.channels, names, {}, option);
    const std::string turns = quantity == Quantity::kTorque ? "N m" : "rad";
    const std::string slides = quantity == Quantity::kTorque ? "N" : "m";
    for (const Index i : chosen) {
      const MotionChannel& channel = file_.channels[static_cast<std::size_t>(i)];
      if (channel.unit.empty() || channel.unit == turns || channel.unit == slides) continue;
      std::string text = channel.name;
      text.append(" is in ").append(channel.unit).append(", ").append(turns);
      throw InputError(option, text.append(" or ").append(slides).append(" is wanted"));
    }
    if (chosen.size() != static_cast<std::size_t>(model_.dof())) {
      throw InputError(option, std::to_string(chosen.size()) + " columns, the model has " +
                                   std::to_string(model_.dof()) + " joints");
    }
    return chosen;
  }

  std::vector<Index> take(Quantity quantity, const std::string& names, const std::string& option,
                          const char* what, std::vector<std::string>& notes) const {
    if (!names.empty()) return named(quantity, names, option);
    if (const auto found = find(quantity, notes)) return *found;
    std::string known;
    for (const MotionChannel& channel : file_.channels) {
      if (known.size() < 200) known += (known.empty() ? "" : ", ") + channel.name;
    }
    throw InputError(option, std::string("no columns are known to be the ") + what + " of all " +
                                 std::to_string(model_.dof()) + " joints; name them; there are " +
                                 known);
  }

  MatrixXd rows(const std::vector<Index>& columns) const {
    MatrixXd result(static_cast<Index>(columns.size()), file_.values.cols());
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const std::string& problem = file_.channels[static_cast<std::size_t>(columns[i])].problem;
      if (!problem.empty()) throw InputError("", problem);
      result.row(static_cast<Index>(i)) = file_.values.row(columns[i]);
    }
    return result;
  }
  std::vector<std::string> names(const std::vector<Index>& columns) const {
    std::vector<std::string> result;
    result.reserve(columns.size());
    for (const Index i : columns) {
      result.push_back(file_.channels[static_cast<std::size_t>(i)].name);
    }
    return result;
  }

 private:
  const MotionFile& file_;
  const RobotModel& model_;
};

std::string short_text(double value) {
  std::string text = std::to_string(value);
  while (text.back() == '0') text.pop_back();
  if (text.back() == '.') text.pop_back();
  return text;
}

/// Refuses positions that a joint cannot have in rad.
void check_positions(const TorqueFile& file, const RobotModel& model) {
  for (Index j = 0; j < file.record.position.rows(); ++j) {
    const Joint& joint = model.joints()[static_cast<std::size_t>(j)];
    const std::string& name = file.positions[static_cast<std::size_t>(j)];
    if (joint.type == controller::JointType::kPrismatic) continue;
    for (Index i = 0; i < file.record.position.cols(); ++i) {
      const double q = file.record.position(j, i);
      constexpr double kTurn = 2 * std::numbers::pi, kMargin = 0.5;
      if (!(std::abs(q) > kTurn) || (q > joint.lower - kMargin && q < joint.upper + kMargin)) {
        continue;
      }
      throw InputError(name, short_text(q) + " at " + short_text(file.record.time[i]) +
                                 " s is far beyond the limits of joint '" + joint.name +
                                 "' in rad; degrees need their unit in the heading: " + name +
                                 " [deg]");
    }
  }
}

/// Refuses columns without a value, and torques that do not vary.
void check_values(const TorqueFile& file) {
  for (const auto& [values, names] : {std::pair(&file.record.position, &file.positions),
                                      std::pair(&file.record.torque, &file.torques)}) {
    for (Index j = 0; j < values->rows(); ++j) {
      const bool any = (values->row(j).array() == values->row(j).array()).any();
      if (!any) throw InputError((*names)[static_cast<std::size_t>(j)], "has no values");
      if (values == &file.record.torque && (values->row(j).array() == 0).all()) {
        throw InputError((*names)[static_cast<std::size_t>(j)], "is 0 throughout");
      }
    }
  }
}

/// Notes torques of more than three times the torque limit of a joint.
void note_torques(TorqueFile& file, const RobotModel& model) {
  for (Index j = 0; j < file.record.torque.rows(); ++j) {
    const double effort = model.joints()[static_cast<std::size_t>(j)].effort;
    const double most = file.record.torque.row(j).cwiseAbs().maxCoeff<Eigen::PropagateNumbers>();
    if (!(most > 3 * effort)) continue;
    const std::string& name = file.torques[static_cast<std::size_t>(j)];
    file.notes.push_back(name + " is up to " + short_text(most) + ", the joint's effort limit is " +
                         short_text(effort) + ": is it in another unit?");
    return;
  }
}

/// The factor by which velocities exceed the rates of positions: sums over steps of 0.1 s.
double rate_factor(const TorqueFile& file, const MatrixXd& velocity, Index j) {
  const VectorXd& time = file.record.time;
  double cross = 0, square = 0;
  Index to = 0;
  for (Index from = 0; from < time.size(); ++from) {
    while (to < time.size() && time[to] < time[from] + 0.05) ++to;
    if (to == time.size()) break;
    const double rate =
        (file.record.position(j, to) - file.record.position(j, from)) / (time[to] - time[from]);
    const double mean = (velocity(j, to) + velocity(j, from)) / 2;
    if (!std::isfinite(rate) || !std::isfinite(mean)) continue;
    cross += rate * mean;
    square += rate * rate;
  }
  return square > 0 ? cross / square : 1;
}

/// Velocities only serve to check the units that the file states for positions and velocities.
void check_velocities(TorqueFile& file, const Columns& columns) {
  std::vector<std::string> unused;
  const auto found = columns.find(Quantity::kVelocity, unused);
  if (!found) return;
  const MatrixXd velocity = columns.rows(*found);
  const std::vector<std::string> names = columns.names(*found);
  constexpr double kDegree = 180 / std::numbers::pi;
  for (Index j = 0; j < velocity.rows(); ++j) {
    const double factor = rate_factor(file, velocity, j);
    const std::string& name = names[static_cast<std::size_t>(j)];
    const std::string& position = file.positions[static_cast<std::size_t>(j)];
    std::ostringstream text;
    if (factor > kDegree / 1.3 && factor < kDegree * 1.3) {
      text << short_text(factor) << " times the rate of " << position
           << "; is one in degrees? Its heading needs the unit: " << name << " [deg/s]";
      throw InputError(name, text.str());
    }
    if (factor > 1 / kDegree / 1.3 && factor < 1.3 / kDegree) {
      text << short_text(1 / factor) << " times as fast as " << name
           << " says; degrees need their unit in the heading: " << position << " [deg]";
      throw InputError(position, text.str());
    }
    if (factor < -0.5) {
      text << name << " has the opposite sign of the rate of " << position;
      file.notes.push_back(text.str());
    }
  }
}

}  // namespace

TorqueFile read_torque_file(const std::string& path, const RobotModel& model,
                            const std::string& positions, const std::string& torques,
                            const FileHints& hints) try {
  const MotionFile file = [&path, &hints] {
    try {
      if (std::optional<MotionFile> driver = read_driver_log(path)) return *std::move(driver);
      return read_motion_file(path, hints);
    } catch (const InputError& error) {
      // The file's name comes in front below.
      const std::string text = error.what();
      const std::string begin = path + ": ";
      throw InputError("", text.starts_with(begin) ? text.substr(begin.size()) : text);
    }
  }();
  const Columns columns(file, model);
  TorqueFile result;
  result.notes = file.notes;
  const auto q =
      columns.take(Quantity::kPosition, positions, "--positions", "positions", result.notes);
  const auto tau = columns.take(Quantity::kTorque, torques, "--torques", "torques", result.notes);
  result.record = {file.time, columns.rows(q), columns.rows(tau)};
  result.positions = columns.names(q);
  result.torques = columns.names(tau);
  if (file.duplicates + file.out_of_order > 0) {
    result.notes.push_back(std::to_string(file.duplicates + file.out_of_order) +
                           " samples were left out, whose times do not rise");
  }
  check_values(result);
  check_positions(result, model);
  note_torques(result, model);
  check_velocities(result, columns);
  return result;
} catch (const InputError& error) {
  throw error.in_file(path);
}

}  // namespace dashpot::apps
