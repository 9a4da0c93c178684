// What gains really do on an arm, at one posture and at many; one damping for many postures.

#include <dashpot/analysis/damping_region.hpp>
#include <dashpot/controller/audit.hpp>
#include <dashpot/controller/contact_audit.hpp>
#include <dashpot/controller/rotors.hpp>
#include <dashpot/python/src/shared.hpp>

#include <nanobind/stl/function.h>
#include <nanobind/stl/pair.h>

#include <type_traits>

namespace dashpot::python {
namespace {

using controller::Audit;
using controller::AuditOptions;
using controller::Distribution;
using controller::JointVector;
using controller::PostureAudit;
using controller::PostureNumbers;

/// Numbers of postures by rows: smallest ratio, fastest pole, gain margin, zero modes, singular.
using Table = Eigen::Matrix<double, Eigen::Dynamic, 5>;

/// An audit with the robot that checks postures.
struct RobotAudit {
  Robot robot;
  Audit audit;
};

RobotAudit make_audit(const Robot& robot, const controller::Gains& gains, bool cartesian,
                      const nb::dict& given) {
  AuditOptions options;
  options.mode = cartesian ? controller::Mode::kCartesian : controller::Mode::kJoint;
  options.gains = gains;
  const auto take = [&](const char* key, auto& value) {
    if (given.contains(key)) value = nb::cast<std::remove_reference_t<decltype(value)>>(given[key]);
  };
  take("half_quaternion", options.half_quaternion);
  take("inertia_blocks", options.inertia_blocks);
  std::string projector;
  take("null_projector", projector);
  options.gains.null_projector = controller::null_projector_of(projector);
  take("period", options.period);
  take("delay", options.delay);
  take("cutoff", options.cutoff);
  take("difference_velocity", options.difference_velocity);
  take("soft_frequency", options.soft_frequency);
  take("integral_time", options.integral_time);
  take("ideal_gravity", options.ideal_gravity);
  take("margin", options.margin);
  for (const auto& [key, values] : {std::pair("lower", &options.lower),
                                    {"upper", &options.upper},
                                    {"null_weights", &options.null_weights}}) {
    if (!given.contains(key)) continue;
    *values = robot.joint_vector(key, nb::cast<Eigen::VectorXd>(given[key]));
  }
  return {robot, Audit(robot.model, options)};
}

Table to_table(const std::vector<PostureNumbers>& numbers) {
  Table table(static_cast<Eigen::Index>(numbers.size()), 5);
  Eigen::Index i = 0;
  for (const PostureNumbers& one : numbers) {
    table.row(i++) << one.smallest_ratio, one.fastest_pole, one.gain_margin, one.zero_modes,
        one.singular ? 1 : 0;
  }
  return table;
}

std::vector<PostureNumbers> from_table(const Table& table) {
  std::vector<PostureNumbers> numbers;
  for (const auto& row : table.rowwise()) {
    PostureNumbers& one = numbers.emplace_back();
    one.smallest_ratio = row[0];
    one.fastest_pole = row[1];
    one.gain_margin = row[2];
    one.zero_modes = static_cast<int>(row[3]);
    one.singular = row[4] != 0;
  }
  return numbers;
}

/// The numbers of postures of a sequence.
Table sample(const RobotAudit& all, std::uint64_t seed, std::int64_t first, std::int64_t count) {
  return to_table(all.audit.sample(seed, first, count));
}

/// The numbers of postures given by rows.
Table numbers_at(const RobotAudit& all, const Eigen::MatrixXd& postures) {
  std::vector<PostureNumbers> numbers;
  for (Eigen::Index i = 0; i < postures.rows(); ++i) {
    numbers.push_back(all.audit.numbers(all.robot.joint_vector("postures", postures.row(i))));
  }
  return to_table(numbers);
}

nb::dict distribution_dict(const Distribution& found) {
  nb::dict result;
  result["median"] = found.median;
  result["p05"] = found.p05;
  result["p95"] = found.p95;
  result["worst"] = found.worst;
  result["worst_q"] = to_array(found.worst_q);
  result["bound"] = found.bound;
  return result;
}

nb::dict summarize(const RobotAudit& all, const Table& table, std::uint64_t seed,
                   const OptionalMatrix& postures) {
  controller::WorkspaceAudit found;
  {
    const nb::gil_scoped_release release;
    found = controller::summarize(all.audit, from_table(table), [&](std::int64_t i) -> JointVector {
      if (postures) return postures->row(i).transpose();
      return all.audit.posture(seed, i);
    });
  }
  nb::dict result;
  result["samples"] = found.samples;
  result["singular"] = found.singular;
  result["smallest_ratio"] = distribution_dict(found.smallest_ratio);
  result["fastest_pole"] = distribution_dict(found.fastest_pole);
  result["gain_margin"] = distribution_dict(found.gain_margin);
  return result;
}

nb::dict posture(const RobotAudit& all, const Eigen::VectorXd& q) {
  PostureAudit found;
  {
    const nb::gil_scoped_release release;
    found = all.audit.audit(all.robot.joint_vector("q", q));
    found.rotors = all.audit.missing_rotors(found);
  }
  nb::dict result;
  result["q"] = to_array(found.q);
  result["modes"] = modes_of(found.spectrum);
  result["smallest_ratio"] = found.numbers.smallest_ratio;
  result["fastest_pole"] = found.numbers.fastest_pole;
  result["gain_margin"] = found.numbers.gain_margin;
  result["singular"] = found.numbers.singular;
  result["smallest_ratio_bound"] = found.smallest_ratio_bound;
  result["fastest_pole_bound"] = found.fastest_pole_bound;
  result["integral_decays"] = to_column(found.integral_decays, [](double decay) { return decay; });
  result["assumes"] = loop_assumptions(all.audit.options(), &all.robot.model);
  const bool unknown = controller::unknown_rotors(all.robot.model).any();
  result["rotors"] = unknown ? "unknown" : "known";
  result["reflected_inertia_for_margin"] = nb::none();
  if (found.rotors.inertia) {
    result["reflected_inertia_for_margin"] = to_array(*found.rotors.inertia);
  }
  result["damping_ratios_with_rotors"] = to_array(found.rotors.damping_ratios);
  return result;
}

nb::dict suggest(const RobotAudit& all, const Eigen::VectorXd& q, double ratio) {
  controller::DampingSuggestion found;
  {
    const nb::gil_scoped_release release;
    found = all.audit.suggest(all.robot.joint_vector("q", q), ratio);
  }
  nb::dict result;
  result["damping"] = to_array(found.damping);
  result["diagonal"] = to_array(found.diagonal);
  result["smallest_ratio"] = found.smallest_ratio;
  result["diagonal_smallest_ratio"] = found.diagonal_smallest_ratio;
  return result;
}

nb::dict contact(const RobotAudit& all, const Eigen::VectorXd& q,
                 const std::optional<Eigen::Vector3d>& direction, double damper, double mass,
                 const std::vector<double>& stiffness) {
  const JointVector at = all.robot.joint_vector("q", q);
  controller::ContactOptions options{direction, damper, mass};
  controller::ContactAudit found;
  std::vector<analysis::ContactPoint> curve;
  {
    const nb::gil_scoped_release release;
    found = controller::audit_contact(all.audit, at, options);
    options.direction = found.touch.direction;
    curve = controller::contact_curve(all.audit, at, options, stiffness);
  }
  const analysis::ContactLimit& limit = found.touch.limit;
  Eigen::MatrixXd points(static_cast<Eigen::Index>(curve.size()), 3);
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const analysis::ContactPoint& point = curve[static_cast<std::size_t>(i)];
    points.row(i) << point.stiffness, point.damping_ratio, point.natural_frequency;
  }
  Eigen::MatrixXd forces(static_cast<Eigen::Index>(found.forces.size()), 6);
  for (Eigen::Index i = 0; i < forces.rows(); ++i) {
    const controller::HeldForce& one = found.forces[static_cast<std::size_t>(i)];
    forces.row(i) << one.direction.transpose(), one.force, one.deflection, one.joint;
  }
  nb::dict result;
  result["q"] = to_array(found.q);
  result["direction"] = to_array(found.touch.direction);
  result["limit"] = limit.stiffness;
  result["limit_lower"] = limit.lower;
  result["limit_upper"] = limit.upper;
  result["frequency"] = limit.frequency;
  result["stable_if_rigid"] = limit.stable_if_rigid;
  result["with_half_stiffness"] = found.with_half_stiffness;
  result["with_more_damping"] = found.with_more_damping;
  result["with_less_delay"] = found.with_less_delay;
  result["passive"] = found.passivity.passive;
  result["missing_friction"] = found.passivity.missing_friction;
  result["weight"] = to_array(found.weight);
  result["effort"] = to_array(found.effort);
  result["forces"] = to_array(forces);
  result["curve"] = to_array(points);
  return result;
}

/// Postures first .. first + count - 1 of a sequence, or of postures given by rows.
JointVector posture_of(const RobotAudit& all, std::uint64_t seed, const OptionalMatrix& postures,
                       std::int64_t index) {
  if (!postures) return all.audit.posture(seed, index);
  return all.robot.joint_vector("postures", postures->row(index));
}

/// A question to other processes: damping, wanted ratio, level, ceiling, largest gain margin of
/// interest, members.
using Question =
    std::tuple<Eigen::MatrixXd, double, double, double, double, std::vector<std::size_t>>;
/// Their answer: level, largest ratio, worst sample, smallest gain margin, its sample, samples that
/// limit the result.
using Verdict = std::tuple<double, double, std::int64_t, double, std::int64_t,
                           std::vector<std::pair<double, std::size_t>>>;

analysis::DampingTarget target_of(const RobotAudit& all, double ratio) {
  analysis::DampingTarget target = analysis::DampingTarget::constant(ratio);
  target.soft_frequency = all.audit.options().soft_frequency;
  return target;
}

/// Judges `count` postures of the region from number `first` on. `postures`, by rows, has only the
/// judged rows.
Verdict judge(const RobotAudit& all, const Question& asked, std::uint64_t seed, std::int64_t first,
              std::int64_t count, const OptionalMatrix& postures) {
  const auto q = [&](std::int64_t number) {
    return posture_of(all, seed, postures, postures ? number - first : number);
  };
  std::vector<analysis::TaskImpedance> configurations;
  for (std::int64_t i = first; i < first + count; ++i) {
    configurations.push_back(all.audit.undamped(q(i)));
  }
  const auto& [damping, ratio, level, ceiling, most_margin, members] = asked;
  const analysis::RegionVerdict found = analysis::judge_region(
      configurations, static_cast<std::size_t>(first),
      {damping, target_of(all, ratio), level, ceiling, members, most_margin},
      [&](std::size_t number) { return all.audit.loop(q(static_cast<std::int64_t>(number))); });
  return {found.level,       found.largest_ratio, found.worst_sample,
          found.gain_margin, found.margin_sample, found.binding};
}

/// Asks all parts of a region, in Python.
using AskAll = std::function<std::vector<Verdict>(const Question&)>;

nb::dict design_region(const RobotAudit& all, std::int64_t count, std::uint64_t seed,
                       const OptionalMatrix& postures, double ratio, const std::string& structure,
                       const std::optional<double>& largest_ratio, double gain_margin,
                       const AskAll& ask_all) {
  analysis::RegionOptions options;
  options.target = target_of(all, ratio);
  options.structure = structure_of(structure);
  options.ceiling = largest_ratio;
  options.gain_margin = gain_margin;
  const auto q = [&](std::int64_t i) { return posture_of(all, seed, postures, i); };
  if (all.audit.options().period > 0) {
    options.loop = [&](std::size_t i) { return all.audit.loop(q(static_cast<std::int64_t>(i))); };
  }
  analysis::RegionSource source;
  source.count = static_cast<std::size_t>(count);
  source.configuration = [&](std::size_t i) {
    return all.audit.undamped(q(static_cast<std::int64_t>(i)));
  };
  source.judge = [&](const analysis::RegionQuestion& question) {
    const nb::gil_scoped_acquire locked;
    analysis::RegionVerdict verdict;
    for (const auto& [level, largest, worst, margin, where, binding] :
         ask_all({question.damping, ratio, question.level, question.ceiling, question.most_margin,
                  question.members})) {
      analysis::RegionVerdict part;
      part.level = level;
      part.largest_ratio = largest;
      part.worst_sample = worst;
      part.gain_margin = margin;
      part.margin_sample = where;
      part.binding = binding;
      verdict.add(part);
    }
    return verdict;
  };
  analysis::RegionDesign found;
  {
    const nb::gil_scoped_release release;
    found = analysis::design_region(source, options);
  }
  nb::dict result;
  result["damping"] = to_array(found.damping);
  result["level"] = found.level;
  result["violation"] = found.violation;
  result["worst_q"] = to_array(found.worst_sample < 0 ? JointVector() : q(found.worst_sample));
  result["kept"] = found.kept;
  result["share"] = found.share;
  result["gain_margin"] = found.gain_margin;
  result["margin_q"] = to_array(found.margin_sample < 0 ? JointVector() : q(found.margin_sample));
  return result;
}

}  // namespace

void add_audit(nb::module_& m) {
  const auto unlocked = nb::call_guard<nb::gil_scoped_release>();
  nb::class_<RobotAudit>(m, "Audit", "controller::Audit")
      .def(nb::new_(&make_audit), nb::arg("robot"), nb::arg("gains"), nb::arg("cartesian"),
           nb::arg("options"))
      .def("sample", &sample, unlocked)
      .def("numbers", &numbers_at, unlocked)
      .def("summarize", &summarize, nb::arg("table"), nb::arg("seed"), nb::arg("postures").none())
      .def("posture", &posture)
      .def("suggest", &suggest)
      .def("contact", &contact, nb::arg("q"), nb::arg("direction").none(), nb::arg("damper"),
           nb::arg("mass"), nb::arg("stiffness"))
      .def("judge", &judge, unlocked, nb::arg("question"), nb::arg("seed"), nb::arg("first"),
           nb::arg("count"), nb::arg("postures").none())
      .def("design_region", &design_region, nb::arg("count"), nb::arg("seed"),
           nb::arg("postures").none(), nb::arg("ratio"), nb::arg("structure"),
           nb::arg("largest_ratio").none(), nb::arg("gain_margin"), nb::arg("ask_all"));
}

}  // namespace dashpot::python
