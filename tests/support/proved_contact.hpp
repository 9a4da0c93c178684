#pragma once
// Stability of a sampled loop that touches a spring, proved in balls of 50 digits by FLINT/Arb from
// the loop's definition: another matrix, algorithm and arithmetic than the library's.
#include <dashpot/analysis/contact_limit.hpp>
#include <dashpot/tests/support/certified_spectrum.hpp>
#include <dashpot/tests/support/sampled_loops.hpp>

#include <algorithm>
#include <optional>

namespace dashpot::testing {

/// A system, a loop and a touch drawn by chance.
struct RandomTouch {
  analysis::System<> system;
  analysis::SampledLoop loop;
  analysis::Touch touch;

  RandomTouch(Dice& random, bool heavy) : system(0) {
    const int n = random.integer(1, 3);
    system = random_system(random, n);
    loop = random_loop(random);
    loop.friction = random.integer(0, 1) * 0.1 * system.damping;
    touch.direction = random.vector(n);
    touch.most = 1e8;
    if (!heavy) return;
    touch.damping = random.integer(0, 1) * random.log_uniform(0.1, 30);
    touch.mass = random.integer(0, 1) * random.log_uniform(0.01, 3);
  }
  analysis::ContactLimit limit() const {
    return analysis::contact_limit(system, analysis::analyze(system), loop, touch);
  }
};

/// Whether the loop is stable, as balls of 50 digits prove of its tick in joint coordinates;
/// nothing where they cannot tell.
inline std::optional<bool> proved_stable(const RandomTouch& touched, double stiffness) {
  const analysis::System<>& system = touched.system;
  const analysis::SampledLoop& loop = touched.loop;
  const analysis::Touch& touch = touched.touch;
  using Eigen::MatrixXd;
  constexpr slong kBits = 170;
  const Eigen::Index n = system.dof(), r = loop.torque_cutoff > 0 ? n : 0, d = loop.delay * n;
  const Eigen::Index last = loop.difference_velocity ? n : 0, rows = 2 * n + last + d + r;
  const MatrixXd along = touch.direction * touch.direction.transpose();
  const MatrixXd contact = stiffness * along, D = loop.friction + touch.damping * along;
  // (q, v, u) moves for a tick by an exponential; A = robot + [torque's columns] command.
  BallMatrix mass(system.mass + touch.mass * along), pull(n, 3 * n), moved(n, 3 * n),
      flow(3 * n, 3 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      acb_set_d(pull.at(i, j), -contact(i, j));
      acb_set_d(pull.at(i, n + j), -D(i, j));
    }
    acb_set_d(pull.at(i, 2 * n + i), 1);
  }
  acb_mat_solve(moved.get(), mass.get(), pull.get(), kBits);
  const auto scaled = [&](acb_ptr out, acb_ptr in) {
    arb_t T;
    arb_init(T);
    arb_set_d(T, loop.period);
    acb_mul_arb(out, in, T, kBits);
    arb_clear(T);
  };
  for (Eigen::Index i = 0; i < n; ++i) {
    acb_set_d(flow.at(i, n + i), loop.period);
    for (Eigen::Index j = 0; j < 3 * n; ++j) scaled(flow.at(n + i, j), moved.at(i, j));
  }
  BallMatrix tick(3 * n, 3 * n);
  acb_mat_exp(tick.get(), flow.get(), kBits);
  // The command from the state, and the torque that acts.
  BallMatrix command(n, rows), torque(n, rows), A(rows, rows);
  const MatrixXd K = system.stiffness, C = system.damping - loop.friction;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      acb_set_d(command.at(i, j), -K(i, j));
      acb_set_d(command.at(i, (last > 0 ? 2 * n : n) + j), -C(i, j));
    }
  }
  const Eigen::Index queue = 2 * n + last, filter = queue + d;
  if (d > 0) {
    for (Eigen::Index i = 0; i < n; ++i) acb_one(torque.at(i, queue + i));
  } else {
    acb_mat_set(torque.get(), command.get());
  }
  if (r > 0) {
    arb_t share;
    arb_init(share);
    arb_const_pi(share, kBits);
    arb_mul_si(share, share, -2, kBits);
    acb_t factor;
    acb_init(factor);
    acb_set_arb(factor, share);
    for (const double part : {loop.torque_cutoff, loop.period}) {
      arb_set_d(share, part);
      acb_mul_arb(factor, factor, share, kBits);
    }
    acb_exp(factor, factor, kBits);  // 1 - share
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j < rows; ++j) {
        acb_submul(torque.at(i, j), torque.at(i, j), factor, kBits);
      }
      acb_add(torque.at(i, filter + i), torque.at(i, filter + i), factor, kBits);
    }
    acb_clear(factor);
    arb_clear(share);
  }
  for (Eigen::Index i = 0; i < 2 * n; ++i) {
    for (Eigen::Index j = 0; j < rows; ++j) {
      for (Eigen::Index k = 0; k < n; ++k) {
        acb_addmul(A.at(i, j), tick.at(i, 2 * n + k), torque.at(k, j), kBits);
      }
      if (j < 2 * n) acb_add(A.at(i, j), A.at(i, j), tick.at(i, j), kBits);
    }
  }
  for (Eigen::Index i = 0; i < last; ++i) {  // (q_k+1 - q_k) / T
    for (Eigen::Index j = 0; j < rows; ++j) {
      acb_set(A.at(2 * n + i, j), A.at(i, j));
      if (i == j) acb_sub_ui(A.at(2 * n + i, j), A.at(2 * n + i, j), 1, kBits);
      acb_t T;
      acb_init(T);
      acb_set_d(T, loop.period);
      acb_div(A.at(2 * n + i, j), A.at(2 * n + i, j), T, kBits);
      acb_clear(T);
    }
  }
  for (Eigen::Index i = 0; i < d; ++i) {
    for (Eigen::Index j = 0; j < rows; ++j) {
      if (i + n < d) {
        if (j == queue + i + n) acb_one(A.at(queue + i, j));
      } else {
        acb_set(A.at(queue + i, j), command.at(i + n - d, j));
      }
    }
  }
  for (Eigen::Index i = 0; i < r; ++i) {
    for (Eigen::Index j = 0; j < rows; ++j) acb_set(A.at(filter + i, j), torque.at(i, j));
  }
  BallMatrix vectors(rows, rows), about(1, rows), proved(1, rows);
  acb_mat_approx_eig_qr(about.at(0, 0), nullptr, vectors.get(), A.get(), nullptr, 0, kBits);
  if (acb_mat_eig_multiple(proved.at(0, 0), A.get(), about.at(0, 0), vectors.get(), kBits) == 0) {
    return std::nullopt;
  }
  bool all_inside = true, any_outside = false;
  arb_t modulus;
  arb_init(modulus);
  for (Eigen::Index i = 0; i < rows; ++i) {
    acb_abs(modulus, proved.at(0, i), kBits);
    arb_sub_ui(modulus, modulus, 1, kBits);
    all_inside = all_inside && arb_is_negative(modulus);
    any_outside = any_outside || arb_is_positive(modulus);
  }
  arb_clear(modulus);
  if (!all_inside && !any_outside) return std::nullopt;
  return all_inside;
}

}  // namespace dashpot::testing
