#include <dashpot/analysis/response.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/apps/cli/system_file.hpp>
#include <dashpot/apps/report/json.hpp>
#include <dashpot/apps/tune/tuned_loop.hpp>
#include <dashpot/apps/web/arm_view.hpp>
#include <dashpot/controller/dynamics.hpp>
#include <dashpot/controller/elastic_joints.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/settings_check.hpp>

#include <Eigen/Core>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <complex>
#include <exception>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <thread>

namespace dashpot::apps {

using controller::JointVector;
using controller::Mode;
using controller::PostureNumbers;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// The transition of (q, q') over a time.
MatrixXd transition_over(const analysis::Response& response, Eigen::Index n, double time) {
  MatrixXd result(2 * n, 2 * n);
  for (Eigen::Index k = 0; k < 2 * n; ++k) {
    const VectorXd unit = VectorXd::Unit(2 * n, k);
    const analysis::Motion moved = response.free(unit.head(n), unit.tail(n), time);
    result.col(k) << moved.position, moved.velocity;
  }
  return result;
}

/// Returns how a place that is released one unit away comes to rest; one minus it is the step to a
/// goal one unit away.
Json release_json(const analysis::Response& response, const analysis::Spectrum<>& spectrum,
                  const VectorXd& motion, const Eigen::RowVectorXd& row) {
  double decay = std::numeric_limits<double>::infinity();
  for (const analysis::Mode<>& mode : spectrum.modes) {
    for (const auto& value : mode.eigenvalues) {
      if (std::abs(value) > controller::kSoftFrequency) decay = std::min(decay, -value.real());
    }
  }
  constexpr int kPoints = 401;
  constexpr double kSettled = 0.02;
  const VectorXd rest = VectorXd::Zero(motion.size());
  const auto value_at = [&](double t) { return row.dot(response.free(motion, rest, t).position); };
  const bool grows = decay < 0;
  double horizon = 20;
  if (std::isfinite(decay) && decay != 0) {
    horizon = std::clamp(grows ? -1.5 / decay : 5 / decay, 0.02, 20.0);
  }
  std::vector<double> times(kPoints), values(kPoints);
  int last = 0;
  for (int round = 0; round < 2; ++round) {
    last = 0;
    const MatrixXd step = transition_over(response, motion.size(), horizon / (kPoints - 1));
    VectorXd state(2 * motion.size());
    state << motion, rest;
    for (int i = 0; i < kPoints; ++i, state = step * state) {
      const auto k = static_cast<std::size_t>(i);
      times[k] = horizon * i / (kPoints - 1);
      values[k] = row.dot(state.head(motion.size()));
      if (std::abs(values[k]) > kSettled) last = i;
    }
    if (grows || last > kPoints / 4) break;  // otherwise a slow mode hardly moves this place
    horizon = std::max(3 * times[static_cast<std::size_t>(last) + 1], 0.02);
  }
  const auto lowest = std::min_element(values.begin(), values.end());
  double overshoot = std::max(0.0, -*lowest);
  if (overshoot > 0) {  // between the points, by ternary search
    const auto at = static_cast<std::size_t>(lowest - values.begin());
    double a = times[at == 0 ? 0 : at - 1], b = times[std::min(at + 1, times.size() - 1)];
    for (int i = 0; i < 25; ++i) {
      const double c = a + (b - a) / 3, d = b - (b - a) / 3;
      const bool left = value_at(c) < value_at(d);
      (left ? b : a) = left ? d : c;
    }
    overshoot = std::max(overshoot, -value_at(0.5 * (a + b)));
  }
  Json settling;
  if (!grows && last + 1 < kPoints) {
    double a = times[static_cast<std::size_t>(last)], b = times[static_cast<std::size_t>(last) + 1];
    for (int i = 0; i < 40; ++i) {
      const double c = 0.5 * (a + b);
      (std::abs(value_at(c)) > kSettled ? a : b) = c;
    }
    settling = b;
  }
  return {{"time", times},
          {"value", values},
          {"overshoot", grows ? Json() : Json(overshoot)},
          {"settling_time", settling}};
}

/// The joint with the largest part of a shape.
int largest_joint(const Eigen::VectorXcd& shape, int n) {
  Eigen::Index at = 0;
  shape.head(n).cwiseAbs().maxCoeff(&at);
  return static_cast<int>(at);
}

/// The block of A, in the coordinates of the gears, from the controller's measurements to its
/// torques, n x n.
MatrixXd of_controller(const analysis::Gears& gears, const MatrixXd& A) {
  const Eigen::Index n = gears.data().stiffness.size();
  MatrixXd block(n, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i < n; ++i) block(i, j) = A(gears.motor(i), gears.measured(j));
  }
  return block;
}

/// The motion that becomes unstable first when the gains grow: with gains just beyond the margin
/// the loop has a z outside the unit circle.
Json limit_json(const analysis::System<>& system, const analysis::SampledLoop& loop, double margin,
                const controller::RobotModel& model) {
  if (!(margin > 0) || !std::isfinite(margin)) return nullptr;
  const double factor = 1.001 * margin;
  const Eigen::Index n = system.dof();
  const auto scaled = [&](const MatrixXd& all, const MatrixXd& passive) {
    const MatrixXd kept = passive.size() == 0 ? MatrixXd::Zero(n, n) : passive;
    return MatrixXd(kept + factor * (all - kept));
  };
  analysis::System<> edge(n);
  edge.mass = system.mass;
  edge.stiffness = scaled(system.stiffness, loop.passive_stiffness);
  edge.damping = scaled(system.damping, loop.friction);
  analysis::SampledLoop grown = loop;
  grown.memory.output *= factor;
  const analysis::Spectrum<> spectrum = analysis::analyze(edge);
  const analysis::SampledSpectrum found = analysis::sample_loop(edge, spectrum, grown);
  double largest = 0, turn = 0;
  int mode = -1;
  const auto see = [&](std::complex<double> z, int of) {
    if (std::abs(z) <= largest || std::abs(std::log(z)) < controller::kSoftFrequency * loop.period)
      return;
    largest = std::abs(z);
    turn = std::abs(std::arg(z));
    mode = of;
  };
  for (std::size_t i = 0; i < found.modes.size(); ++i) {
    for (const auto& z : found.modes[i].discrete_eigenvalues) see(z, static_cast<int>(i));
  }
  for (const auto* others : {&found.zero_modes, &found.memory, &found.others}) {
    for (const auto& z : *others) see(z, -1);
  }
  if (largest < 1) return nullptr;
  Json joint;
  if (mode >= 0 && mode < spectrum.modes.size()) {
    joint = model
                .joints()[static_cast<std::size_t>(
                    largest_joint(spectrum.modes[mode].shapes[0], model.dof()))]
                .name;
  }
  return {{"frequency", turn / loop.period}, {"joint", joint}};
}

/// Sets C_C, or C_q, to the damping that the controller designed: with J# of `consistent_inverse`
/// the null space's dampers vanish in J#' C J#.
void set_designed_damping(const analysis::System<>& system, const analysis::Gears& gears,
                          const MatrixXd& friction, analysis::TaskImpedance& parts) {
  MatrixXd passive = MatrixXd::Zero(system.dof(), system.dof());
  gears.add_friction(passive);
  gears.add_gears(gears.data().damping, passive);
  const MatrixXd C = of_controller(gears, system.damping - passive);
  parts.damping = C + friction;
  if (!parts.jacobian) return;
  const MatrixXd& J = *parts.jacobian;
  const MatrixXd inverse = consistent_inverse(parts.mass, J);
  parts.task_damping = inverse.transpose() * C * inverse;
  *parts.damping -= J.transpose() * *parts.task_damping * J;
}

/// Stiffness and damping that act at the tip or in the joints, without friction.
Json gains_json(const analysis::TaskImpedance& parts, const MatrixXd& friction) {
  if (parts.jacobian) {
    return {{"stiffness", json_rows(*parts.task_stiffness)},
            {"damping", json_rows(*parts.task_damping)}};
  }
  return {{"stiffness", json_rows(*parts.stiffness)},
          {"damping", json_rows(*parts.damping - friction)}};
}

/// The loop for `dashpot analyze`: in parts, or with elastic gears as a whole.
Json system_json(const analysis::System<>& system, const analysis::TaskImpedance& parts,
                 bool rigid) {
  if (!rigid) {
    return {{"mass", json_rows(system.mass)},
            {"damping", json_rows(system.damping)},
            {"stiffness", json_rows(system.stiffness)}};
  }
  Json result = {{"mass", json_rows(parts.mass)}};
  const auto add = [&result](const char* name, const std::optional<MatrixXd>& matrix) {
    if (matrix) result[name] = json_rows(*matrix);
  };
  add("jacobian", parts.jacobian);
  add("task_stiffness", parts.task_stiffness);
  add("task_damping", parts.task_damping);
  add("stiffness", parts.stiffness);
  add("damping", parts.damping);
  return result;
}

}  // namespace

TunedLoop::TunedLoop(const TunedArm& arm, const TunedDesign& design)
    : arm_(arm),
      design_(design),
      audit_(arm.model(), design.stated),
      gears_(controller::elastic_joints(arm.model())) {
  if (!design.designed()) return;
  validate(design.settings, arm.model());
}

TunedLoop::There TunedLoop::there(const JointVector& q) const {
  There result;
  result.parts = audit_.impedance(q);
  analysis::SpectrumOptions options;
  options.soft_frequency = design_.stated.soft_frequency;
  if (design_.designed()) {
    controller::PostureLoop loop(arm_.model(), design_.settings);
    controller::LoopAt found = designed(q, loop);
    result.level = loop.level();
    result.system = std::move(found.system);
    result.sampled = std::move(found.sampled);
  } else {
    SystemEntry entry;
    entry.loop.gears = gears_;
    result.system = entry.system(result.parts);
    if (design_.stated.period > 0) result.sampled = with_gears(audit_.loop(q));
  }
  result.spectrum = analysis::analyze(result.system, options);
  return result;
}

PostureNumbers TunedLoop::numbers(const There& loop) const {
  PostureNumbers result = controller::numbers_of(loop.spectrum);
  if (design_.stated.period > 0) {
    result.gain_margin = analysis::gain_margin(loop.system, loop.spectrum, loop.sampled);
  }
  return result;
}

PostureNumbers TunedLoop::numbers(const JointVector& q, controller::PostureLoop* loop) const {
  if (loop == nullptr) return audit_.numbers(q);
  const std::optional<PostureNumbers> quick = audit_.numbers(designed(q, *loop));
  return quick ? *quick : numbers(there(q));
}

nlohmann::ordered_json TunedLoop::workspace(std::uint64_t seed, std::int64_t first,
                                            std::int64_t count) const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<PostureNumbers> found(static_cast<std::size_t>(count));
  std::atomic<std::int64_t> next = 0;
  const auto end = std::chrono::steady_clock::now() + kLongest;
  std::exception_ptr failure;
  std::once_flag failed;
  const auto find = [&] {
    std::optional<controller::PostureLoop> loop;
    if (design_.designed()) loop.emplace(arm_.model(), design_.settings);
    for (std::int64_t i = next++; i < count; i = next++) {
      PostureNumbers& here = found[static_cast<std::size_t>(i)];
      try {
        here = numbers(audit_.posture(seed, first + i), loop ? &*loop : nullptr);
      } catch (const std::runtime_error&) {  // an eigenvalue iteration that fails has no numbers
        here = {};
      }
      if (std::chrono::steady_clock::now() > end) return;
    }
  };
  const auto work = [&]() noexcept {
    try {
      find();
    } catch (...) {
      next = count;
      std::call_once(failed, [&] { failure = std::current_exception(); });
    }
  };
  {
    std::vector<std::jthread> threads;
    threads.reserve(std::thread::hardware_concurrency());
    for (unsigned k = 1; k < std::thread::hardware_concurrency(); ++k) threads.emplace_back(work);
    work();
  }
  if (failure) std::rethrow_exception(failure);
  count = std::min(count, next.load());  // the threads finish postures that they have begun
  Json result = {{"count", count},
                 {"smallest_ratio", Json::array()},
                 {"gain_margin", Json::array()},
                 {"worst", Json::object()}};
  const auto add = [&](const char* name, double PostureNumbers::*number) {
    double worst = kNone;
    std::int64_t at = -1;
    for (std::int64_t i = 0; i < count; ++i) {
      const double value = found[static_cast<std::size_t>(i)].*number;
      result[name].push_back(std::isinf(value) ? 1e6 : value);
      if (std::isnan(value) || value >= worst) continue;
      worst = value;
      at = i;
    }
    if (at < 0) return;
    result["worst"][name] = {{"value", std::isinf(worst) ? 1e6 : worst},
                             {"q", json_list(audit_.posture(seed, first + at))}};
  };
  add("smallest_ratio", &PostureNumbers::smallest_ratio);
  add("gain_margin", &PostureNumbers::gain_margin);
  return result;
}

nlohmann::ordered_json TunedLoop::contact(const JointVector& q, double stiffness,
                                          std::optional<controller::ContactAt>& least) const {
  if (design_.stated.period == 0) return nullptr;
  try {
    controller::ContactOptions options;
    if (!least) least = controller::find_contact(audit_, q, options);
    options.direction = least->direction;
    const auto point = controller::contact_curve(audit_, q, options, {stiffness})[0];
    return {{"stiffness", stiffness},
            {"direction", json_list(least->direction)},
            {"damping_ratio", point.damping_ratio},
            {"natural_frequency", point.natural_frequency},
            {"limit", std::min(least->limit.stiffness, options.most)}};
  } catch (const std::exception&) {  // a tip that is stuck, no convergence
    return nullptr;
  }
}

nlohmann::ordered_json TunedLoop::at(const JointVector& q, const std::string& place) const {
  There loop = there(q);
  const controller::RobotModel& model = arm_.model();
  const int n = model.dof();
  const MatrixXd J = controller::evaluate(model, q, JointVector::Zero(n)).J;
  const Place moved = place_of(place, loop.parts.mass, J);
  const bool rigid = !gears_.any();
  const MatrixXd friction = model.joint_values(&controller::Joint::viscous_friction).asDiagonal();
  if (design_.designed()) set_designed_damping(loop.system, gears_, friction, loop.parts);
  const PostureNumbers here = numbers(loop);

  const Eigen::Index size = loop.system.dof();
  VectorXd motion = VectorXd::Zero(size);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(size);
  motion.head(n) = moved.motion;
  row.head(n) = moved.row;
  for (std::size_t k = 0; k < gears_.joints().size(); ++k) {
    motion[n + static_cast<Eigen::Index>(k)] = moved.motion[gears_.joints()[k]];
  }
  const analysis::Response response(loop.system, loop.spectrum);
  Json result = {{"modes", modes_json(loop.spectrum)},
                 {"zero_modes", json_rows(loop.spectrum.zero_modes.basis.transpose())},
                 {"soft_or_zero", here.zero_modes},
                 {"smallest_ratio", here.smallest_ratio},
                 {"fastest_pole", here.fastest_pole},
                 {"gain_margin", std::isinf(here.gain_margin) ? 1e6 : here.gain_margin},
                 {"assumes", loop_assumptions(design_.stated, &model)},
                 {"damping_level", nullptr},
                 {"limit", nullptr},
                 {"release", release_json(response, loop.spectrum, motion, row)},
                 {"frequency", receptance_json(loop.system, loop.spectrum, row, moved.unit)},
                 {"system", system_json(loop.system, loop.parts, rigid)},
                 {"gains", gains_json(loop.parts, friction)}};
  if (loop.level) {
    result["damping_level"] = {{"share", loop.level->level}, {"kept", loop.level->kept}};
  }
  if (design_.stated.period > 0) {
    result["limit"] = limit_json(loop.system, loop.sampled, here.gain_margin, model);
  }
  const bool task = design_.stated.mode == Mode::kCartesian;
  if (task && design_.designed() && !controller::lost_directions(model, q).empty()) {
    result["gains"]["damping"] = nullptr;  // it fits this posture only
  }
  return result;
}

}  // namespace dashpot::apps
