#pragma once
// Families of paths through the hard places of damped systems, each from a seed: what a tracker of
// modes has to follow. SI units; a path goes from t = 0 to 1.

#include <dashpot/analysis/system.hpp>
#include <dashpot/tests/support/dice.hpp>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <ostream>
#include <string>
#include <vector>

namespace dashpot::testing {

using TrackedSystem = analysis::System<analysis::kMaxDof>;
using SystemPath = std::function<TrackedSystem(double)>;

inline TrackedSystem symmetric_system(const Eigen::MatrixXd& M, const Eigen::MatrixXd& C,
                                      const Eigen::MatrixXd& K) {
  TrackedSystem system(M.rows());
  system.mass = 0.5 * (M + M.transpose());
  system.damping = 0.5 * (C + C.transpose());
  system.stiffness = 0.5 * (K + K.transpose());
  return system;
}

/// T' A T and the like for all three coefficients.
inline TrackedSystem mixed_system(const Eigen::MatrixXd& T, const Eigen::MatrixXd& C,
                                  const Eigen::MatrixXd& K) {
  return symmetric_system(T.transpose() * T, T.transpose() * C * T, T.transpose() * K * T);
}

/// Undamped modes w with damping ratios zeta that decouple.
inline TrackedSystem classical_system(const Eigen::MatrixXd& T, const Eigen::VectorXd& w,
                                      const Eigen::VectorXd& zeta) {
  const Eigen::VectorXd c = 2 * zeta.cwiseProduct(w), k = w.cwiseAbs2();
  return mixed_system(T, c.asDiagonal(), k.asDiagonal());
}

/// All modes through critical damping, each at its own time and pace.
inline SystemPath through_critical(Dice& dice) {
  const int n = dice.integer(1, 7);
  const Eigen::MatrixXd T = dice.congruence(n, 3);
  const Eigen::VectorXd w = 3 * dice.log_vector(n, 30);
  const Eigen::VectorXd start = 0.2 * dice.log_vector(n, 4), end = 1.1 * dice.log_vector(n, 3);
  return [=](double t) { return classical_system(T, w, start + t * (end - start)); };
}

/// NLEVP `spring`: tau passes what makes the modes critical, one after the other.
inline SystemPath spring_chain(Dice& dice) {
  const int n = dice.integer(2, 8);
  Eigen::MatrixXd chain = 3 * Eigen::MatrixXd::Identity(n, n);
  for (int i = 1; i < n; ++i) chain(i, i - 1) = chain(i - 1, i) = -1;
  const double kappa = dice.log_uniform(1, 100), direction = dice.uniform(0, 1);
  return [=](double t) {
    const double share = direction < 0.5 ? t : 1 - t;
    const double tau = 2 * std::sqrt(kappa) * (0.3 + 0.8 * share);
    return symmetric_system(Eigen::MatrixXd::Identity(n, n), tau * chain, kappa * chain);
  };
}

/// NLEVP `sleeper` with its middle coefficient passing the place of two Jordan blocks at -1.
inline SystemPath sleeper(Dice& dice) {
  const int n = 6;
  Eigen::MatrixXd T = 2 * Eigen::MatrixXd::Identity(n, n);
  for (int i = 0; i < n; ++i) T(i, (i + 1) % n) = T((i + 1) % n, i) = -1;
  const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(n, n), squared = T * T;
  const double reach = dice.log_uniform(1e-6, 0.3);
  return [=](double t) {
    return symmetric_system(I, (1 + reach * (2 * t - 1)) * (I + squared), I + T + squared);
  };
}

/// NLEVP `damped_beam`: simply supported, a damper in the middle that grows from nothing.
inline SystemPath damped_beam(Dice& dice) {
  const int elements = 2 * dice.integer(1, 4), n = 2 * elements;
  const double length = 1.0 / elements;
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n + 2, n + 2), K = M;
  Eigen::Matrix4d m, k;
  const double l = length, l2 = l * l;
  m << 156, 22 * l, 54, -13 * l, 22 * l, 4 * l2, 13 * l, -3 * l2, 54, 13 * l, 156, -22 * l, -13 * l,
      -3 * l2, -22 * l, 4 * l2;
  k << 12, 6 * l, -12, 6 * l, 6 * l, 4 * l2, -6 * l, 2 * l2, -12, -6 * l, 12, -6 * l, 6 * l, 2 * l2,
      -6 * l, 4 * l2;
  for (int e = 0; e < elements; ++e) {
    M.block<4, 4>(2 * e, 2 * e) += 0.674 * length / 420 * m;
    K.block<4, 4>(2 * e, 2 * e) += 7e10 * 1.04e-8 / (length * length * length) * k;
  }
  std::vector<int> kept;  // deflections at both ends are held
  for (int i = 0; i < n + 2; ++i) {
    if (i != 0 && i != n) kept.push_back(i);
  }
  const Eigen::MatrixXd mass = M(kept, kept), stiffness = K(kept, kept);
  const double most = dice.log_uniform(0.1, 100);
  return [=](double t) {
    Eigen::MatrixXd C = Eigen::MatrixXd::Zero(n, n);
    C(elements - 1, elements - 1) = most * t;
    return symmetric_system(mass, C, stiffness);
  };
}

/// Two frequencies that exchange and come no nearer than `gap` (relative), beside others.
inline SystemPath veering(Dice& dice) {
  const int n = dice.integer(2, 6);
  const double gap = dice.uniform(0, 1) < 0.1 ? 0 : dice.log_uniform(1e-13, 0.3);
  const double w = dice.log_uniform(5, 50), zeta = dice.log_uniform(1e-3, 2);
  const double skew = dice.uniform(0, 1) < 0.5 ? 0 : dice.uniform(0, 0.5);  // of the damping
  const Eigen::MatrixXd T = dice.congruence(n, 3);
  const Eigen::VectorXd others = 2 * w * dice.log_vector(n, 10);
  return [=](double t) {
    Eigen::MatrixXd K = others.cwiseAbs2().asDiagonal(), C = (2 * zeta * others).asDiagonal();
    const double difference = 0.2 * w * w * (2 * t - 1);
    K.topLeftCorner(2, 2) << w * w + difference, w * w * gap, w * w * gap, w * w - difference;
    C.topLeftCorner(2, 2) << 2 * zeta * w * (1 + skew), 0, 0, 2 * zeta * w * (1 - skew);
    return mixed_system(T, C, K);
  };
}

/// Round an exceptional point once, and near it, so that labels swap.
inline SystemPath exceptional_loop(Dice& dice) {
  const double w = 10, c1 = dice.uniform(1, 4), c2 = dice.uniform(0.1, 0.9);
  const double center = w * (c1 - c2) / 2, radius = center * dice.log_uniform(1e-3, 0.8);
  const Eigen::MatrixXd T = dice.congruence(2, 3);
  return [=](double t) {
    const double angle = 2 * std::numbers::pi * t, x = radius * std::sin(angle);
    const double coupling = center + radius * std::cos(angle);
    Eigen::Matrix2d K;
    K << w * w + x, coupling, coupling, w * w - x;
    return mixed_system(T, Eigen::Vector2d(c1, c2).asDiagonal(), K);
  };
}

/// Real eigenvalues of two modes meet, turn complex if coupled, and part again.
inline SystemPath reals_meet(Dice& dice) {
  const double coupling = dice.uniform(0, 1) < 0.1 ? 0 : dice.log_uniform(1e-9, 2);
  const double shift = dice.uniform(0, 1);
  const Eigen::MatrixXd T = dice.congruence(3, 3);
  return [=](double t) {
    Eigen::Matrix3d C, K;
    const double c = 25 + 15 * std::sin(std::numbers::pi * (t + shift));
    C << 4, coupling, 0.1, coupling, c, 0, 0.1, 0, 3;
    K << 1, 0.3 * coupling, 0, 0.3 * coupling, 100, 0, 0, 0, 400;
    return mixed_system(T, C, K);
  };
}

/// Graded over many orders of magnitude: masses over 1e8, frequencies over 1e6.
inline SystemPath graded(Dice& dice) {
  const int n = dice.integer(2, 7);
  const Eigen::MatrixXd T = dice.congruence(n, dice.log_uniform(1, 1e4));
  const Eigen::VectorXd w = dice.log_uniform(1e-2, 1) * dice.log_vector(n, 1e6);
  const double most = dice.log_uniform(1e-12, 1e3);
  return [=](double t) {
    const Eigen::VectorXd zeta = Eigen::VectorXd::Constant(n, most * (0.5 + t));
    return classical_system(T, w * (1 + 0.1 * t), zeta);
  };
}

/// Modes that coincide throughout.
inline SystemPath coinciding(Dice& dice) {
  const int n = dice.integer(2, 6), equal = dice.integer(2, n);
  const Eigen::MatrixXd T = dice.congruence(n, 2);
  const double zeta = dice.uniform(0, 1) < 0.3 ? 1 : dice.log_uniform(1e-3, 3);
  Eigen::VectorXd w = 5 * dice.log_vector(n, 10);
  w.head(equal).setConstant(w[0]);
  return [=](double t) {
    return classical_system(T, (1 + 0.3 * t) * w, Eigen::VectorXd::Constant(n, zeta));
  };
}

/// Modes that coincide throughout while all shapes turn, as in a moving arm whose stiffness is a
/// multiple of its mass.
inline SystemPath turning_coinciding(Dice& dice) {
  const int n = dice.integer(2, 7), equal = dice.integer(2, n);
  const Eigen::MatrixXd T = dice.congruence(n, 2), turn = 0.3 * dice.matrix(n, n);
  const double zeta = dice.log_uniform(1e-3, 3);
  Eigen::VectorXd w = 5 * dice.log_vector(n, 10);
  w.head(equal).setConstant(w[0]);
  return [=](double t) {
    return classical_system(T * (Eigen::MatrixXd::Identity(n, n) + t * turn), (1 + 0.3 * t) * w,
                            Eigen::VectorXd::Constant(n, zeta));
  };
}

/// Coefficients that turn and swing at random, not proportionally damped; with a stiffness factor
/// of so many rows, if any.
inline SystemPath wandering_of(int n, int rows, Dice& dice) {
  const bool factored = rows > 0;
  std::array<Eigen::MatrixXd, 6> part;
  for (Eigen::MatrixXd& matrix : part) matrix = dice.matrix(n, n) / std::sqrt(n);
  const double damping = dice.log_uniform(0.01, 30), turns = dice.log_uniform(0.3, 10);
  return [=](double t) {
    const auto F = [&](std::size_t k) {
      return Eigen::MatrixXd(std::cos(turns * t) * part[k] + std::sin(turns * t) * part[k + 1]);
    };
    const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(n, n);
    TrackedSystem system = symmetric_system(F(0).transpose() * F(0) + 0.3 * I,
                                            damping * (F(2).transpose() * F(2) + 0.02 * I),
                                            400 * (F(4).transpose() * F(4) + 0.05 * I));
    if (factored) system.stiffness_factor = 20 * F(4).topRows(rows);
    return system;
  };
}

inline SystemPath wandering(Dice& dice) {
  const int n = dice.integer(1, 9), rows = dice.integer(0, n);
  return wandering_of(n, rows, dice);
}

/// One system, and changes about the last digits, or above.
inline SystemPath frozen(Dice& dice) {
  const SystemPath path = wandering(dice);
  const double size = dice.uniform(0, 1) < 0.3 ? 0 : dice.log_uniform(1e-17, 1e-9);
  const std::uint64_t seed = dice.engine()();
  return [=](double t) {
    TrackedSystem system = path(0.3);
    Dice jitter(seed + static_cast<std::uint64_t>(t * 1e6));
    const auto disturb = [&](auto& matrix) {
      for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
        for (Eigen::Index i = 0; i <= j && i < matrix.rows(); ++i) {
          matrix(i, j) *= 1 + size * jitter.uniform(-1, 1);
          if (matrix.rows() == matrix.cols()) matrix(j, i) = matrix(i, j);
        }
      }
    };
    disturb(system.mass);
    disturb(system.damping);
    if (system.stiffness_factor.rows() == 0) disturb(system.stiffness);
    return system;
  };
}

/// A path that jumps elsewhere now and then.
inline SystemPath jumping(Dice& dice) {
  const int n = dice.integer(2, 6);
  const std::uint64_t seed = dice.engine()();
  const double apart = dice.log_uniform(0.003, 0.2);
  return [=](double t) {
    Dice jump(seed + static_cast<std::uint64_t>(t / apart));
    const Eigen::MatrixXd T = jump.congruence(n, 3), F = jump.matrix(n, n);
    const Eigen::MatrixXd C = jump.log_uniform(0.01, 10) * F.transpose() * F;
    const Eigen::VectorXd w = 5 * jump.log_vector(n, 10);
    return mixed_system(T, (1 + 0.1 * t) * C, (1 + t) * Eigen::MatrixXd(w.asDiagonal()));
  };
}

/// M V A V^-1 of a matrix A of modes: nonsymmetric unless V is orthonormal in M.
inline TrackedSystem turned_system(const Eigen::MatrixXd& M, const Eigen::MatrixXd& V,
                                   const Eigen::MatrixXd& C, const Eigen::MatrixXd& K) {
  const Eigen::MatrixXd inverse = V.inverse();
  TrackedSystem system(M.rows());
  system.mass = 0.5 * (M + M.transpose());
  system.damping = M * V * C * inverse;
  system.stiffness = M * V * K * inverse;
  return system;
}

/// A mass and columns V that turn with t, far from orthonormal.
struct Skewed {
  Eigen::MatrixXd M, V, dV;

  Skewed(Dice& dice, int n) : V(dice.congruence(n, 3)), dV(0.3 * dice.matrix(n, n) / std::sqrt(n)) {
    const Eigen::MatrixXd T = dice.congruence(n, 3);
    M = T.transpose() * T;
  }
  Eigen::MatrixXd columns(double t) const { return V + std::sin(t) * dV; }
};

/// All modes of a nonsymmetric system through critical damping, each at its own time and pace.
inline SystemPath skewed_critical(Dice& dice) {
  const int n = dice.integer(1, 7);
  const Skewed skewed(dice, n);
  const Eigen::VectorXd w = 3 * dice.log_vector(n, 30);
  const Eigen::VectorXd start = 0.2 * dice.log_vector(n, 4), end = 1.1 * dice.log_vector(n, 3);
  return [=](double t) {
    const Eigen::VectorXd c = 2 * (start + t * (end - start)).cwiseProduct(w), k = w.cwiseAbs2();
    return turned_system(skewed.M, skewed.columns(t), c.asDiagonal(), k.asDiagonal());
  };
}

/// Modes of a nonsymmetric system that coincide throughout.
inline SystemPath skewed_coinciding(Dice& dice) {
  const int n = dice.integer(2, 6), equal = dice.integer(2, n);
  const Skewed skewed(dice, n);
  const double zeta = dice.log_uniform(1e-3, 3);
  Eigen::VectorXd w = 5 * dice.log_vector(n, 10);
  w.head(equal).setConstant(w[0]);
  return [=](double t) {
    const Eigen::VectorXd moved = (1 + 0.3 * t) * w;
    return turned_system(skewed.M, skewed.columns(t),
                         2 * zeta * Eigen::MatrixXd(moved.asDiagonal()),
                         moved.cwiseAbs2().asDiagonal());
  };
}

/// K and C that turn and swing at random, far from symmetric. A third has a factor and thereby
/// zero modes, and damping alone that is not symmetric.
inline SystemPath skewed_wandering(Dice& dice) {
  const SystemPath path = wandering(dice);
  const auto n = path(0).dof();
  const Eigen::MatrixXd A = dice.matrix(n, n) / std::sqrt(n), B = dice.matrix(n, n) / std::sqrt(n);
  const double damping = dice.log_uniform(0.01, 10), stiffness = dice.log_uniform(1, 300);
  return [=](double t) {
    TrackedSystem system = path(t);
    system.damping += damping * std::cos(3 * t) * A;
    if (system.stiffness_factor.rows() == 0) system.stiffness += stiffness * std::cos(2 * t) * B;
    return system;
  };
}

/// Springs in fewer directions than there are coordinates, and a nonsymmetric part in the same
/// directions, as J' (K J + C dJ/dt) has: one zero mode, or two, and no factor.
inline SystemPath skewed_singular(Dice& dice) {
  const int n = dice.integer(2, 7), rows = n - (dice.uniform(0, 1) < 0.8 || n == 2 ? 1 : 2);
  const Skewed skewed(dice, n);
  const Eigen::MatrixXd J = dice.matrix(rows, n), dJ = dice.matrix(rows, n);
  const Eigen::MatrixXd F = dice.matrix(rows, rows);
  const Eigen::MatrixXd K = 400 * (F * F.transpose() + 0.2 * Eigen::MatrixXd::Identity(rows, rows));
  const double damping = dice.log_uniform(0.3, 30), free = dice.uniform(0, 1) < 0.5 ? 0 : 0.4;
  return [=](double t) {
    const Eigen::MatrixXd now = J + std::sin(2 * t) * dJ, rate = 2 * std::cos(2 * t) * dJ;
    TrackedSystem system(n);
    system.mass = 0.5 * (skewed.M + skewed.M.transpose());
    system.damping = damping * now.transpose() * now + free * system.mass;
    system.stiffness = now.transpose() * (K * now + damping * rate);
    return system;
  };
}

struct PathFamily {
  std::string name;
  SystemPath (*make)(Dice&);
};
inline void PrintTo(const PathFamily& family, std::ostream* out) {
  *out << family.name;
}

inline const std::vector<PathFamily>& path_families() {
  static const std::vector<PathFamily> all = {
      {"through critical", through_critical},
      {"spring chain", spring_chain},
      {"sleeper", sleeper},
      {"damped beam", damped_beam},
      {"veering", veering},
      {"exceptional loop", exceptional_loop},
      {"reals meet", reals_meet},
      {"graded", graded},
      {"coinciding", coinciding},
      {"turning coinciding", turning_coinciding},
      {"wandering", wandering},
      {"frozen", frozen},
      {"jumping", jumping},
      {"skewed critical", skewed_critical},
      {"skewed coinciding", skewed_coinciding},
      {"skewed wandering", skewed_wandering},
      {"skewed singular", skewed_singular},
  };
  return all;
}

}  // namespace dashpot::testing
