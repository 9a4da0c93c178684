// Audit::missing_rotors: what an audit would find with the rotors that a model lacks.
#include <dashpot/controller/audit.hpp>
#include <dashpot/controller/rotors.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace dashpot::controller {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr double kUnpaired = std::numeric_limits<double>::quiet_NaN();

/// The largest similarity |u^H M v| of two modes' shapes, at most 1.
double likeness(const MatrixXd& mass, const analysis::Mode<>& a, const analysis::Mode<>& b) {
  double largest = 0;
  for (const auto& u : a.shapes) {
    for (const auto& v : b.shapes) {
      const double norms = std::sqrt(std::abs(u.dot(mass * u)) * std::abs(v.dot(mass * v)));
      if (norms > 0) largest = std::max(largest, std::abs(u.dot(mass * v)) / norms);
    }
  }
  return largest;
}

/// The damping ratios of the modes `with`, in the order of the modes `without` with the most
/// similar shapes, the most similar pair first; NaN if no mode remains.
Eigen::VectorXd paired_ratios(const MatrixXd& mass, const analysis::Spectrum<>& without,
                              const analysis::Spectrum<>& with) {
  MatrixXd alike(without.modes.size(), with.modes.size());
  for (int i = 0; i < without.modes.size(); ++i) {
    for (int j = 0; j < with.modes.size(); ++j) {
      alike(i, j) = likeness(mass, without.modes[i], with.modes[j]);
    }
  }
  Eigen::VectorXd ratios = Eigen::VectorXd::Constant(alike.rows(), kUnpaired);
  for (Index k = std::min(alike.rows(), alike.cols()); k > 0; --k) {
    Index i = 0, j = 0;
    alike.maxCoeff(&i, &j);
    ratios[i] = with.modes[static_cast<int>(j)].damping_ratio;
    alike.row(i).setConstant(-1);
    alike.col(j).setConstant(-1);
  }
  return ratios;
}

}  // namespace

MissingRotors Audit::missing_rotors(const PostureAudit& found) const {
  MissingRotors missing;
  const UnknownRotors unknown = unknown_rotors(model_);
  if (!unknown.any()) return missing;
  if (options_.period > 0 && found.numbers.gain_margin >= options_.margin) {
    missing.inertia = JointVector::Zero(model_.dof());
  } else if (options_.period > 0) {
    const analysis::System<> system = at(found.q).system;
    missing.inertia = enough_reflected_inertia(
        model_, system, options_.period, [&](const RobotModel& with_rotors) {
          return Audit(with_rotors, options_).numbers(found.q).gain_margin >= options_.margin;
        });
  }
  if (unknown.published != nullptr) {
    missing.compared = unknown.published->values(unknown.published->reflected_inertia);
  } else if (missing.inertia && !missing.inertia->isZero(0)) {
    missing.compared = *missing.inertia;
  }
  if (missing.compared.size() == 0) return missing;
  const Audit with_rotors(with_at_least(model_, missing.compared), options_);
  const PostureAudit with = with_rotors.audit(found.q);
  missing.numbers = with.numbers;
  MatrixXd mass = with_rotors.evaluate(found.q).M;
  if (arm_.gears().any()) with_rotors.arm_.gears().extend_mass(mass);
  missing.damping_ratios = paired_ratios(mass, found.spectrum, with.spectrum);
  return missing;
}

}  // namespace dashpot::controller
