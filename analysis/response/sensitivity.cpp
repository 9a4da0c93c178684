#include <dashpot/analysis/sensitivity.hpp>

#include <Eigen/LU>
#include <cmath>
#include <limits>

namespace dashpot::analysis {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

/// Sum and product of a mode's eigenvalues may differ by this much of their size from trace and
/// determinant of its block.
constexpr double kSameBlock = 1e-8;
/// Relative distance of eigenvalues below which no first derivative is worth much.
constexpr double kTooNear = 1e-6;

/// The block of two columns that holds the mode and that no mode before has taken; -1 if none.
int block_of(const Mode<>& mode, const ModalBasis<>& basis, std::vector<bool>& taken) {
  const double sum = (mode.eigenvalues[0] + mode.eigenvalues[1]).real();
  const double product = (mode.eigenvalues[0] * mode.eigenvalues[1]).real();
  const double size = modulus(mode.eigenvalues[0]) + modulus(mode.eigenvalues[1]);
  int best = -1;
  double least = kSameBlock;
  for (int k = 0; k < basis.blocks.size(); ++k) {
    const Block& block = basis.blocks[k];
    if (block.size != 2 || block.zero_mode || taken[static_cast<std::size_t>(k)]) continue;
    const Eigen::Matrix2d L = basis.Lambda.block<2, 2>(block.first, block.first);
    const double distance = std::max(std::abs(L.trace() - sum) / size,
                                     std::abs(L.determinant() - product) / (size * size));
    if (distance < least) least = distance, best = k;
  }
  if (best >= 0) taken[static_cast<std::size_t>(best)] = true;
  return best;
}

/// Whether the mode's eigenvalues are far enough from the eigenvalues of all other modes, and from
/// each other unless a block holds both.
bool is_regular(const Mode<>& mode, const Spectrum<>& spectrum, bool has_block) {
  if (!std::isfinite(mode.natural_frequency)) return false;
  for (const Complex& value : mode.eigenvalues) {
    for (const Mode<>& other : spectrum.modes) {
      if (&other == &mode) continue;
      for (const Complex& near : other.eigenvalues) {
        if (modulus(value - near) <= kTooNear * modulus(value)) return false;
      }
    }
  }
  return has_block || modulus(mode.eigenvalues[0] - mode.eigenvalues[1]) >
                          kTooNear * modulus(mode.eigenvalues[0]);
}

/// Gradients of l1 + l2 and of l1 l2.
struct PairGradient {
  MatrixXd sum;
  MatrixXd product;
};

/// The gradients of one mode by the coefficient of lambda^power: K, C, M for 0, 1, 2.
class ModeReader {
 public:
  ModeReader(const System<>& system, const Spectrum<>& spectrum, const Mode<>& mode, int block)
      : system_(system), basis_(spectrum.basis), mode_(mode), block_(block) {
    symmetric_ = spectrum.symmetric;
  }

  std::array<MatrixXcd, 2> eigenvalues(int power) const {
    std::array<MatrixXcd, 2> result;
    for (std::size_t k = 0; k < 2; ++k) {
      const Complex lambda = mode_.eigenvalues[k];
      const Eigen::VectorXcd &x = mode_.shapes[k], &y = mode_.left_shapes[k];
      const Eigen::VectorXcd slope_x = 2.0 * lambda * (system_.mass * x) + system_.damping * x;
      const Complex slope = (y.transpose() * slope_x).value();
      result[k] = (-std::pow(lambda, power) / slope) * y * x.transpose();
      if (symmetric_) result[k] = (0.5 * (result[k] + result[k].transpose())).eval();
    }
    return result;
  }

  PairGradient pair(int power) const {
    if (block_ < 0) {
      const auto [first, second] = eigenvalues(power);
      return {(first + second).real(),
              (mode_.eigenvalues[1] * first + mode_.eigenvalues[0] * second).real()};
    }
    const Index at = basis_.blocks[block_].first;
    const Eigen::Matrix2d L = basis_.Lambda.block<2, 2>(at, at);
    const Eigen::Matrix2d adjugate = L.trace() * Eigen::Matrix2d::Identity() - L;
    const MatrixXd wY = basis_.weight.block<2, 2>(at, at) * basis_.Y.middleCols(at, 2).transpose();
    Eigen::Matrix2d L_power = Eigen::Matrix2d::Identity();
    for (int k = 0; k < power; ++k) L_power *= L;
    const MatrixXd UL = basis_.U.middleCols(at, 2) * L_power;
    PairGradient result{-(UL * wY).transpose(), -(UL * adjugate * wY).transpose()};
    if (symmetric_) {
      result.sum = (0.5 * (result.sum + result.sum.transpose())).eval();
      result.product = (0.5 * (result.product + result.product.transpose())).eval();
    }
    return result;
  }

  /// Returns the gradients of frequency and ratio.
  DampingGradient numbers(int power) const {
    const PairGradient by = pair(power);
    const double omega = mode_.natural_frequency, zeta = mode_.damping_ratio;
    DampingGradient result;
    result.natural_frequency = by.product / (2 * omega);
    result.damping_ratio = -by.sum / (2 * omega) - zeta / omega * result.natural_frequency;
    return result;
  }

  ModeGradient all(int power) const {
    const DampingGradient by = numbers(power);
    return {eigenvalues(power), by.natural_frequency, by.damping_ratio};
  }

 private:
  const System<>& system_;
  const ModalBasis<>& basis_;
  const Mode<>& mode_;
  int block_;
  bool symmetric_ = true;
};

/// Calls act(reader, mode, block) for every mode.
template <class Act>
void for_each_mode(const System<>& system, const Spectrum<>& spectrum, const Act& act) {
  std::vector<bool> taken(static_cast<std::size_t>(spectrum.basis.blocks.size()), false);
  for (const Mode<>& mode : spectrum.modes) {
    const int block = block_of(mode, spectrum.basis, taken);
    act(ModeReader(system, spectrum, mode, block), mode, block);
  }
}

}  // namespace

std::vector<ModeSensitivity> sensitivities(const System<>& system, const Spectrum<>& spectrum) {
  std::vector<ModeSensitivity> result;
  for_each_mode(system, spectrum, [&](const ModeReader& reader, const Mode<>& mode, int block) {
    ModeSensitivity one{reader.all(2), reader.all(1), reader.all(0)};
    one.regular = is_regular(mode, spectrum, block >= 0);
    result.push_back(std::move(one));
  });
  return result;
}

std::vector<DampingGradient> damping_gradients(const System<>& system, const Spectrum<>& spectrum) {
  std::vector<DampingGradient> result;
  for_each_mode(system, spectrum, [&](const ModeReader& reader, const Mode<>&, int) {
    result.push_back(reader.numbers(1));
  });
  return result;
}

MatrixXd task_gradient(const MatrixXd& jacobian, const MatrixXd& gradient) {
  return jacobian * gradient * jacobian.transpose();
}

}  // namespace dashpot::analysis
