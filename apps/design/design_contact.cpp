// dashpot design --contact: a damping that is enough against whatever the tip touches.
#include <dashpot/apps/cli/number_list.hpp>
#include <dashpot/apps/design/design_contact.hpp>
#include <dashpot/controller/contact_audit.hpp>
#include <dashpot/controller/dynamics.hpp>

#include <cmath>

namespace dashpot::apps {
namespace {

using controller::JointVector;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Adds the spring of what is touched to an arm.
SystemEntry touched(SystemEntry entry, const VectorXd& a, double stiffness) {
  const MatrixXd spring = stiffness * a * a.transpose();
  MatrixXd& all = entry.impedance.stiffness
                      ? *entry.impedance.stiffness
                      : entry.impedance.stiffness.emplace(MatrixXd::Zero(a.size(), a.size()));
  all += spring;
  if (stiffness > 0) entry.loop.passive_stiffness = spring;
  return entry;
}

/// Whether the ratio wanted is there to the steps in which it is sought.
bool holds(const RegionReport& report) {
  constexpr double kSteps = 1e-3;
  return report.design.kept && report.design.level >= 1 - kSteps;
}

/// Returns the configurations of postures in the air and against stiffnesses up to `most`, and
/// notes in the report what is touched in each.
SystemFile against(double most, const DesignOptions& options, const SystemFile& air,
                   const std::vector<MatrixXd>& J, const std::vector<JointVector>& postures,
                   RegionReport& report) {
  constexpr int kDecades = 3, kADecade = 4;  // below which the arm's own springs are stiffer
  std::vector<Eigen::Vector3d> directions = controller::contact_directions();
  if (!options.direction.empty()) directions = {read_direction(options.direction)};
  SystemFile file;
  const auto add = [&](std::size_t i, double stiffness, const Eigen::Vector3d& n) {
    file.entries.push_back(touched(air.entries[i], J[i].transpose() * n, stiffness));
    report.touches.push_back({stiffness, n});
    report.postures.push_back(postures[i]);
  };
  for (std::size_t i = 0; i < air.entries.size(); ++i) {
    add(i, 0, Eigen::Vector3d::Zero());
    for (int k = most > 0 ? kDecades * kADecade : -1; k >= 0; --k) {
      const double stiffness = most * std::pow(10.0, -static_cast<double>(k) / kADecade);
      for (const Eigen::Vector3d& n : directions) add(i, stiffness, n);
    }
  }
  return file;
}

}  // namespace

RegionReport design_for_contact(const DesignOptions& options, const SystemFile& air,
                                const controller::RobotModel& model,
                                const std::vector<JointVector>& postures,
                                const RegionSearch& search, const SampledRatio& ratio) {
  constexpr double kNear = 1.03, kLeast = 1;  // of the stiffness that is sought; N/m
  std::vector<MatrixXd> J;
  J.reserve(postures.size());
  for (const JointVector& q : postures) {
    J.emplace_back(controller::evaluate(model, q, JointVector::Zero(q.size())).J.topRows<3>());
  }
  const auto design = [&](double most) {
    RegionReport noted;
    const SystemFile file = against(most, options, air, J, postures, noted);
    RegionReport found = search(file);
    found.touches = std::move(noted.touches);
    found.postures = std::move(noted.postures);
    found.asked_contact = options.contact;
    if (holds(found)) found.contact = most;
    return found;
  };
  RegionReport best = design(options.contact);
  if (!holds(best)) best = design(0);
  for (double high = options.contact;
       best.contact && high > kNear * *best.contact && high > kLeast;) {
    const double low = *best.contact;
    const double middle = low > 0 ? std::sqrt(low * high) : 0.1 * high;
    RegionReport found = design(middle);
    if (holds(found)) {
      best = std::move(found);
    } else {
      high = middle;
    }
  }
  RegionReport again;
  const double most = best.contact.value_or(0);
  best.sampled_ratio = ratio(against(most, options, air, J, postures, again), best.design.damping);
  return best;
}

}  // namespace dashpot::apps
