#include <dashpot/analysis/base/arithmetic.hpp>
#include <dashpot/analysis/damping_design.hpp>
#include <dashpot/analysis/design/damping_fit.hpp>
#include <dashpot/analysis/spectrum.hpp>
#include <dashpot/analysis/system/checks.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <utility>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Extended = long double;
using ExtendedMatrix = Eigen::Matrix<Extended, Eigen::Dynamic, Eigen::Dynamic>;
using ExtendedVector = Eigen::Matrix<Extended, Eigen::Dynamic, 1>;

/// Ratios nearer to their target than this reach it.
constexpr double kReached = 1e-9;
/// Steps in which a level is sought, and how near a search has to come to one.
constexpr double kRatioStep = 5e-4, kRatioSlack = 1e-7;

MatrixXd symmetric_part(const MatrixXd& A) {
  return 0.5 * (A + A.transpose());
}

/// F with K = F F', without the columns of directions that K leaves free. K is scaled to a unit
/// diagonal first, so that stiffnesses in different units do not hide each other.
ExtendedMatrix stiffness_factor(const std::string& key, const MatrixXd& stiffness) {
  const Index k = stiffness.rows();
  if (k == 0) return ExtendedMatrix(0, 0);
  const ExtendedMatrix K = symmetric_part(stiffness).cast<Extended>();
  const ExtendedVector scale =
      (K.diagonal().array() > 0).select(K.diagonal().array().abs().sqrt(), Extended{1});
  const ExtendedMatrix unit =
      scale.cwiseInverse().asDiagonal() * K * scale.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<ExtendedMatrix> eigen(unit);
  const ExtendedVector& values = eigen.eigenvalues();
  const Extended rounding =
      16 * static_cast<Extended>(k) * static_cast<Extended>(kEps) * values.cwiseAbs().maxCoeff();
  if (values[0] < -rounding) {
    throw InvalidSystem(key, "is not positive semidefinite, so it has no damping to match");
  }
  const Index rank = (values.array() > rounding).count();
  return scale.asDiagonal() * eigen.eigenvectors().rightCols(rank) *
         values.tail(rank).cwiseSqrt().asDiagonal();
}

/// The exact answer, or the nearest to it.
struct ClosedForm {
  MatrixXd damping;
  double indefinite_by = 0;
};

ClosedForm solve_closed_form(const TaskImpedance& impedance, const MatrixXd& map,
                             const DampingTarget& target) {
  const Index k = map.cols();
  const ExtendedMatrix F = impedance.jacobian
                               ? stiffness_factor("task_stiffness", *impedance.task_stiffness)
                               : stiffness_factor("stiffness", *impedance.stiffness);
  const Eigen::LLT<ExtendedMatrix> cholesky(symmetric_part(impedance.mass).cast<Extended>());
  const ExtendedMatrix columns = cholesky.matrixL().solve(map.cast<Extended>() * F);  // L^-1 J' F
  if (columns.size() == 0) return {MatrixXd::Zero(k, k)};
  const Eigen::JacobiSVD<ExtendedMatrix> svd(columns, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const ExtendedVector& omega = svd.singularValues();
  const double soft = target.soft_limit(static_cast<double>(omega[0]));
  const Index count = omega.size();
  ExtendedVector damper(count);
  for (Index i = 0; i < count; ++i) {
    damper[i] = static_cast<Extended>(target.damper(static_cast<double>(omega[i]), soft));
  }
  const ExtendedMatrix FU = F * svd.matrixV();
  if (!impedance.damping) {
    const MatrixXd C = (FU * damper.asDiagonal() * FU.transpose()).cast<double>();
    return {symmetric_part(C)};
  }
  // With S^2 = damper / (2 zeta omega): 1 / omega^2, less for soft modes.
  ExtendedVector S(count), wanted(count);
  for (Index i = 0; i < count; ++i) {
    const double frequency = static_cast<double>(omega[i]);
    wanted[i] = static_cast<Extended>(2 * target.ratio * frequency);
    DampingTarget unit = DampingTarget::constant(1);
    const double s = frequency > 0 ? std::sqrt(unit.damper(frequency, soft) / (2 * frequency)) : 0;
    S[i] = static_cast<Extended>(s);
  }
  const ExtendedMatrix D = symmetric_part(*impedance.damping).cast<Extended>();
  const ExtendedMatrix LV = cholesky.matrixU().solve(svd.matrixU());  // L^-T V
  ExtendedMatrix T = -(LV.transpose() * D * LV);
  T.diagonal() += wanted;
  const Eigen::SelfAdjointEigenSolver<ExtendedMatrix> eigen(
      ExtendedMatrix((T + T.transpose()) / 2));
  const ExtendedVector positive = eigen.eigenvalues().cwiseMax(0);
  const ExtendedMatrix half = FU * S.asDiagonal() * eigen.eigenvectors();
  const MatrixXd C = (half * positive.asDiagonal() * half.transpose()).cast<double>();
  const Extended least = eigen.eigenvalues()[0];
  const bool indefinite = least < -1e-13L * (wanted.maxCoeff() + D.norm());
  return {symmetric_part(C), indefinite ? static_cast<double>(least) : 0};
}

void check_target(const DampingTarget& target) {
  if (!std::isfinite(target.ratio) || !(target.ratio >= 0)) {
    throw std::invalid_argument("damping: the ratio is negative or not finite");
  }
  if (!(target.soft_frequency > 0)) {
    throw std::invalid_argument("damping: the soft frequency has to be positive");
  }
}

double worst_miss(const std::vector<DampingMiss>& misses) {
  double worst = 0;
  for (const DampingMiss& miss : misses) {
    if (miss.reason != DampingMiss::Reason::kSoft) {
      worst = std::max(worst, std::abs(miss.obtained - miss.wanted));
    }
  }
  return worst;
}

void evaluate(const TaskImpedance& impedance, const DampingTarget& target, DampingDesign& design) {
  const DampingMiss::Reason reason =
      design.indefinite_by < 0 ? DampingMiss::Reason::kOverdone : DampingMiss::Reason::kCoupling;
  design.system = to_joint_space(with_damping(impedance, design.damping));
  SpectrumOptions options;
  options.soft_frequency = target.soft_frequency;
  design.spectrum = analyze(design.system, options);
  design.misses = find_misses(design.spectrum, target, reason);
}

/// The modes of a design that are not soft, in short.
struct Extremes {
  double level = 1;    ///< smallest ratio relative to its target, at most 1
  double largest = 0;  ///< ratio
};

Extremes extremes_of(const DampingDesign& design, const DampingTarget& target) {
  const auto& modes = design.spectrum.modes;
  const double soft = target.soft_limit(modes.empty() ? 0 : modes[0].natural_frequency);
  Extremes result;
  for (const Mode<>& mode : modes) {
    if (!(mode.natural_frequency >= soft) || !(target.ratio > 0)) continue;
    result.level = std::min(result.level, mode.damping_ratio / target.ratio);
    result.largest = std::max(result.largest, mode.damping_ratio);
  }
  return result;
}

/// Improves a design whose structure allows no exact answer until its smallest ratio, relative to
/// its target, is (locally) largest. It is no smaller than with the part of `exact` inside the
/// structure. Ratios exceed their target by no more than half, or than what the better of these two
/// needs.
void raise_smallest_ratio(const TaskImpedance& impedance, const DampingTarget& target,
                          const DampingFit& fit, const MatrixXd& exact, DampingDesign& design) {
  const auto offer = [&](const MatrixXd& damping) {
    DampingDesign other;
    other.damping = damping;
    evaluate(impedance, target, other);
    const double reached = extremes_of(other, target).level;
    if (reached > extremes_of(design, target).level) design = std::move(other);
    return reached;
  };
  offer(fit.within_structure(exact));
  const double ceiling = std::max(1.5 * target.ratio, extremes_of(design, target).largest);
  double high = 1;
  for (;;) {
    const double low = std::max(0.0, extremes_of(design, target).level);
    if (high - low <= kRatioStep) return;
    const double level = 0.5 * (low + high);
    if (offer(fit.search(design.damping, {target, level, ceiling}).damping) < level - kRatioSlack) {
      high = level;
    }
  }
}

/// Replaces a design of a search from `start` that misses its target by a better one. Its search
/// starts nearer to `exact`, because a search can get stuck where modes coincide.
void search_farther_away(const MatrixXd& start, const MatrixXd& exact,
                         const std::function<DampingDesign(const MatrixXd&)>& search,
                         DampingDesign& design) {
  constexpr double kFirstShare = 1.0 / 16;  // of `exact`
  for (double share = kFirstShare; share <= 1 && worst_miss(design.misses) > 0; share *= 2) {
    DampingDesign other = search((1 - share) * start + share * exact);
    if (worst_miss(other.misses) < worst_miss(design.misses)) design = std::move(other);
  }
}

}  // namespace

const char* to_text(DampingMiss::Reason reason) noexcept {
  switch (reason) {
    case DampingMiss::Reason::kSoft:
      return "soft";
    case DampingMiss::Reason::kOverdone:
      return "overdone";
    case DampingMiss::Reason::kStructure:
      return "structure";
    case DampingMiss::Reason::kCoupling:
      return "coupling";
    case DampingMiss::Reason::kLoop:
      return "loop";
  }
  return "unknown";
}

TaskImpedance with_damping(const TaskImpedance& impedance, const MatrixXd& damping) {
  const Index n = impedance.mass.rows();
  TaskImpedance result = impedance;
  if (impedance.jacobian) {
    result.task_damping = damping;
  } else {
    result.damping = impedance.damping ? MatrixXd(*impedance.damping + damping) : damping;
    if (impedance.damping) {
      if (result.damping_error.rows() == 0) result.damping_error.setZero(n, n);
      result.damping_error += kEps * result.damping->cwiseAbs();
    }
  }
  return result;
}

std::vector<DampingMiss> find_misses(const Spectrum<>& spectrum, const DampingTarget& target,
                                     DampingMiss::Reason reason) {
  std::vector<DampingMiss> misses;
  const double fastest = spectrum.modes.empty() ? 0 : spectrum.modes[0].natural_frequency;
  const double soft = target.soft_limit(fastest);
  for (int i = 0; i < spectrum.modes.size(); ++i) {
    const Mode<>& mode = spectrum.modes[i];
    const double omega = mode.natural_frequency;
    const double wanted = target.ratio;
    const double bound = std::isfinite(mode.damping_ratio_bound) ? mode.damping_ratio_bound : 0;
    if (std::abs(mode.damping_ratio - wanted) <= std::max(kReached, bound)) continue;
    misses.push_back({i, omega, wanted, mode.damping_ratio,
                      omega >= soft ? reason : DampingMiss::Reason::kSoft});
  }
  return misses;
}

VectorXd negative_eigenvalues(const MatrixXd& damping) {
  if (damping.size() == 0) return VectorXd(0);
  const VectorXd values =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(symmetric_part(damping), Eigen::EigenvaluesOnly)
          .eigenvalues();
  const double rounding =
      16 * static_cast<double>(damping.rows()) * kEps * values.cwiseAbs().maxCoeff();
  return values.head((values.array() < -rounding).count());
}

DampingDesign design_damping(const TaskImpedance& impedance, const DampingTarget& target) {
  check_target(target);
  if (!impedance.jacobian && !impedance.stiffness) throw InvalidSystem("stiffness", "missing");
  const std::vector<DampingSample> samples = {damping_sample(impedance)};
  ClosedForm closed = solve_closed_form(impedance, samples[0].map, target);
  DampingDesign design;
  design.damping = std::move(closed.damping);
  design.indefinite_by = closed.indefinite_by;
  evaluate(impedance, target, design);
  const double missed = worst_miss(design.misses);
  if (missed == 0 || design.indefinite_by < 0) return design;
  const Index k = samples[0].map.cols();
  if (!DampingFit::fits(1, samples[0].system.dof(), k, DampingStructure::kFull)) return design;
  // Existing damping couples the zero modes, or joints have springs of their own.
  const FitResult fit =
      DampingFit(samples, DampingStructure::kFull).search(design.damping, {target, 1, {}});
  DampingDesign better;
  better.damping = fit.damping;
  evaluate(impedance, target, better);
  return worst_miss(better.misses) < missed ? better : design;
}

DampingDesign design_damping(const TaskImpedance& impedance, const DampingTarget& target,
                             DampingStructure structure, const std::optional<MatrixXd>& start) {
  if (structure == DampingStructure::kFull && !start) return design_damping(impedance, target);
  check_target(target);
  const std::vector<DampingSample> samples = {damping_sample(impedance)};
  const Index k = samples[0].map.cols();
  MatrixXd from;
  if (start) {
    const std::string key = impedance.jacobian ? "task_damping" : "damping";
    check_size(key, *start, k, k);
    check_symmetric(key, *start);
    if (negative_eigenvalues(*start).size() > 0) {
      throw InvalidSystem(key, "is not positive semidefinite");
    }
    from = symmetric_part(*start);
  } else {
    from = design_damping(impedance, target).damping;
  }
  const DampingFit fit(samples, structure);
  const auto search = [&](const MatrixXd& first) {
    DampingDesign found;
    found.damping = fit.search(first, {target, 1, {}}).damping;
    evaluate(impedance, target, found);
    return found;
  };
  DampingDesign design = search(from);
  if (worst_miss(design.misses) > 0 && start) {
    search_farther_away(from, design_damping(impedance, target).damping, search, design);
  } else if (worst_miss(design.misses) > 0) {
    raise_smallest_ratio(impedance, target, fit, from, design);
  }
  for (DampingMiss& miss : design.misses) {
    if (structure == DampingStructure::kFull) break;  // no constraint
    if (miss.reason != DampingMiss::Reason::kSoft) miss.reason = DampingMiss::Reason::kStructure;
  }
  return design;
}

}  // namespace dashpot::analysis
