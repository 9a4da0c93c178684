#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/posture_option.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/input_error.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/robot_types.hpp>
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/text/yaml_document.hpp>

#include <fstream>
#include <limits>
#include <numbers>

namespace dashpot::apps {

using controller::JointVector;
using controller::RobotModel;

namespace {

/// Returns the postures in a YAML file: a list of lists of n joint positions, rad or m. Throws
/// InputError that names the file and the entry.
std::vector<JointVector> read_postures(const std::string& path, int n) try {
  const text::YamlNode document = text::parse_yaml(text::read_input(path));
  if (document.kind != text::YamlNode::Kind::kSequence || document.items.empty()) {
    throw InputError("", "a list of postures is wanted, each a list of joint positions");
  }
  std::vector<JointVector> postures;
  for (const text::YamlNode& item : document.items) {
    text::YamlNode holder;  // a mapping, which reads lists of numbers
    text::YamlNode key;
    key.kind = text::YamlNode::Kind::kScalar;
    key.text = "posture";
    holder.kind = text::YamlNode::Kind::kMap;
    holder.line = item.line;
    holder.items = {key, item};
    static constexpr auto kKeys = text::key_list("posture");
    const text::YamlMapping mapping(holder, "[" + std::to_string(postures.size()) + "].", kKeys);
    const Eigen::VectorXd q = *mapping.vector("posture");
    if (q.size() != n) {
      throw mapping.error("posture",
                          std::to_string(q.size()) + " numbers, expected " + std::to_string(n));
    }
    postures.emplace_back(q);
  }
  return postures;
} catch (const InputError& error) {
  throw error.in_file(path);
}

/// Returns measured postures of the DASHPOT_STATE messages of an LCM log: the first one, and then
/// each in which a joint is further than `step` (rad or m) from the one before it in the result.
/// Malformed messages are left out, and so are positions that are not finite. Throws InputError for
/// a log with another number of joints or without states, and std::runtime_error for a file that
/// cannot be opened.
std::vector<JointVector> read_log_postures(const std::string& path, int n, double step) {
  std::vector<JointVector> postures;
  lcmtypes::MessageHandlers handlers;
  handlers.on_state = [&](const state_t& state) {
    if (state.n != n) {
      throw InputError("--log", path + ": its states have " + std::to_string(state.n) +
                                    " joints, expected " + std::to_string(n));
    }
    const JointVector q = Eigen::Map<const Eigen::VectorXd>(state.joint_position.data(), n);
    if (!q.allFinite()) return;
    if (!postures.empty() && !((q - postures.back()).cwiseAbs().maxCoeff() > step)) return;
    postures.push_back(q);
  };
  if (!std::ifstream(path)) throw InputError("--log", path + ": cannot be read");
  lcmtypes::LogReader log(path, handlers);
  while (log.read()) log.handle();
  if (postures.empty()) throw InputError("--log", path + ": has no states of a controller");
  return postures;
}

}  // namespace

void PostureOption::add(CLI::App& command) {
  command.add_option("--q", q, "Joint positions, rad or m")
      ->option_text("a,b,... (middle of the limits; if singular, beside it)");
  command.add_flag("--outside-limits", outside_limits,
                   "Take joint positions outside the limits, with a warning");
}

JointVector PostureOption::read(const RobotModel& model, const JointVector& usual) const {
  JointVector posture = usual.size() > 0 ? usual : controller::default_posture(model);
  if (!q.empty()) {
    posture = parse_quantities("--q", q, controller::joint_units(model, "rad", "m"));
    check("--q", model, posture);
  }
  const std::string heavy = controller::too_heavy(model, posture);
  if (!heavy.empty() && has_to_hold) throw InputError("--q", heavy);
  if (!heavy.empty()) print_error("warning: --q: " + heavy);
  return posture;
}

void PostureOption::check(const std::string& option, const RobotModel& model,
                          const JointVector& posture) const {
  const std::string complaint = controller::outside_limits(model, posture);
  if (complaint.empty()) return;
  const std::string refusal = controller::outside_limits(model, posture, refused);
  if (!outside_limits && !refusal.empty()) {
    throw InputError(option, refusal + "; --outside-limits takes it all the same");
  }
  print_error("warning: " + option + ": " + complaint);
}

void PosturesOption::add(CLI::App& command) {
  const auto text = [&](const char* name, std::string& value, const char* help) {
    command.add_option(name, value, help)->option_text("FILE");
  };
  text("--postures", file, "YAML file with a list of postures");
  text("--log", log, "LCM log whose measured postures count");
  command.add_option("--log-step", log_step, "Movement of a joint between two of these")
      ->transform(positive("rad", "an angle in rad"))
      ->option_text("R (0.01)");
  command.add_option("--samples", samples, "Postures spread over the position limits")
      ->check(CLI::Range(std::int64_t{1}, std::int64_t{10'000'000}))
      ->option_text("N");
  command.add_option("--seed", seed, "Of the samples")
      ->check(CLI::Range(0.0, 1.8e19))
      ->option_text("S (1)");
  command.add_option("--spread", spread, "Samples no further than this from --q")
      ->transform(quantity("rad", std::numeric_limits<double>::min(), 2 * std::numbers::pi,
                           "an angle up to a turn, in rad,"))
      ->option_text("R");
}

void PosturesOption::check() const {
  if ((samples > 0 ? 1 : 0) + (file.empty() ? 0 : 1) + (log.empty() ? 0 : 1) > 1) {
    throw InputError(file.empty() ? "--log" : "--postures",
                     file.empty() || log.empty() ? "does not go with --samples"
                                                 : "does not go with --samples or --log");
  }
  if (spread && samples == 0) throw InputError("--spread", "needs --samples");
}

std::vector<JointVector> PosturesOption::listed(const PostureOption& one,
                                                const RobotModel& model) const {
  if (!log.empty()) return read_log_postures(log, model.dof(), log_step);
  if (file.empty()) return {};
  std::vector<JointVector> postures = read_postures(file, model.dof());
  for (std::size_t i = 0; i < postures.size(); ++i) {
    one.check("--postures: " + file + ": [" + std::to_string(i) + "]", model, postures[i]);
  }
  return postures;
}

void PosturesOption::range(const RobotModel& model, const JointVector& q, JointVector& lower,
                           JointVector& upper) const {
  lower = model.joint_values(&controller::Joint::lower);
  upper = model.joint_values(&controller::Joint::upper);
  if (!spread) return;
  lower = lower.cwiseMax((q.array() - *spread).matrix());
  upper = upper.cwiseMin((q.array() + *spread).matrix());
  if ((lower.array() > upper.array()).any()) {
    throw InputError("--q", "is outside the position limits by more than --spread");
  }
}

}  // namespace dashpot::apps
