#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/cli/posture_files.hpp>
#include <dashpot/apps/cli/posture_option.hpp>
#include <dashpot/apps/cli/subcommands.hpp>
#include <dashpot/controller/config.hpp>
#include <dashpot/controller/posture.hpp>

#include <limits>
#include <numbers>

namespace dashpot::apps {

using controller::JointVector;
using controller::RobotModel;

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
