#include <dashpot/identification/check_model/joint_order.hpp>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <map>

namespace dashpot::identification {
namespace {

/// Least fall of the sum of the logarithms of the residuals.
constexpr double kFarBetter = 2;

using Columns = ColumnOrder;

void exchange(Columns& columns, Index i, Index k) {
  std::swap(columns.from[static_cast<std::size_t>(i)], columns.from[static_cast<std::size_t>(k)]);
  std::swap(columns.sign[i], columns.sign[k]);
}

void shift(Columns& columns, Index by) {
  const auto n = static_cast<Index>(columns.from.size());
  const VectorXd before = columns.sign;
  std::rotate(columns.from.begin(), columns.from.begin() + (by + n) % n, columns.from.end());
  for (Index i = 0; i < n; ++i) columns.sign[i] = before[(i + by + n) % n];
}

void reverse(Columns& columns) {
  std::reverse(columns.from.begin(), columns.from.end());
  columns.sign = columns.sign.reverse().eval();
}

struct Guess {
  JointOrder order;
  double score;
};

/// Returns the residual of y after an offset and friction that brakes, as a share of `whole`.
double left_over(const VectorXd& y, const VectorXd& sign, const VectorXd& velocity, double whole) {
  MatrixXd A(y.size(), 3);
  A << VectorXd::Ones(y.size()), sign, velocity;
  std::vector<Index> used = {0, 1, 2};
  for (;;) {
    MatrixXd part(y.size(), static_cast<Index>(used.size()));
    for (std::size_t i = 0; i < used.size(); ++i) part.col(static_cast<Index>(i)) = A.col(used[i]);
    const VectorXd x = part.colPivHouseholderQr().solve(y);
    bool dropped = false;
    for (std::size_t i = used.size(); i-- > 1 && !dropped;) {
      if (x[static_cast<Index>(i)] < 0) {
        used.erase(used.begin() + static_cast<std::ptrdiff_t>(i));
        dropped = true;
      }
    }
    if (!dropped) return (y - part * x).squaredNorm() / whole;
  }
}

class OrderSearch {
 public:
  OrderSearch(const controller::RobotModel& model, const std::vector<SmoothRun>& runs,
              const RecordFilter& how)
      : kernel_(model), how_(how) {
    // Some windows are enough to see what is far better.
    constexpr std::size_t kMost = 80;
    const WeakForm all(runs, how);
    const auto& windows = all.windows();
    const std::size_t every = std::max<std::size_t>(1, windows.size() / kMost);
    const Index size = 2 * std::max<Index>(12, std::lround(all.width() / 2 / how.step)) + 1;
    for (std::size_t k = 0; k < windows.size(); k += every) {
      const SmoothRun& run = runs[windows[k].run];
      part_.push_back({0, 0, run.position.middleCols(windows[k].first, size),
                       run.velocity.middleCols(windows[k].first, size),
                       run.torque.middleCols(windows[k].first, size)});
    }
    torque_ = WeakForm(part_, how_).torque();
  }

  Index joints() const { return how_.rate_noise.size(); }

  double score(const JointOrder& order) {
    const Motion& motion = motion_of(order.position);
    const MatrixXd tau = order.torque.apply(torque_);
    MatrixXd y = tau;
    if (order.kind != TorqueKind::kExternal) y -= motion.model.inertial;
    if (order.kind == TorqueKind::kWhole) y -= motion.model.gravity;
    double sum = 0;
    for (Index j = 0; j < joints(); ++j) {
      constexpr double kLeast = 1e-3;  // better is as good
      const double whole = tau.row(j).squaredNorm();
      if (!(whole > 0)) continue;
      sum +=
          std::log(std::max(kLeast, left_over(y.row(j).transpose(), motion.sign.row(j).transpose(),
                                              motion.velocity.row(j).transpose(), whole)));
    }
    return sum;
  }

  Guess as_it_is(TorqueKind kind) {
    const Columns same(joints());
    const JointOrder order{kind, same, same};
    return {order, score(order)};
  }

  /// Greedy: the change that helps most, as long as one is far better.
  Guess improve(Guess guess) {
    for (Index round = 0; round < joints(); ++round) {
      Guess best = guess;
      const auto attempt = [&](const auto& change) {
        for (int which = 1; which < 4; ++which) {
          Guess next = guess;
          if ((which & 1) != 0) change(next.order.position);
          if ((which & 2) != 0) change(next.order.torque);
          next.score = score(next.order);
          if (next.score < best.score) best = std::move(next);
        }
      };
      for (Index i = 0; i < joints(); ++i) {
        attempt([i](Columns& columns) { columns.sign[i] = -columns.sign[i]; });
        for (Index k = 0; k < i; ++k)
          attempt([i, k](Columns& columns) { exchange(columns, i, k); });
      }
      if (joints() > 2) {
        attempt(reverse);
        attempt([](Columns& columns) { shift(columns, 1); });
        attempt([](Columns& columns) { shift(columns, -1); });
      }
      attempt([](Columns& columns) { columns.sign = -columns.sign; });
      if (guess.score - best.score < kFarBetter) break;
      guess = best;
    }
    return guess;
  }

 private:
  /// The means over the windows that an order of positions gives: torques of the model, velocities
  /// and their signs.
  struct Motion {
    WindowTorques model;
    MatrixXd velocity, sign;
  };

  /// Nearly all the time goes here: each order of positions is tried with several of torques.
  const Motion& motion_of(const Columns& position) {
    std::vector<Index> key = position.from;
    for (Index j = 0; j < joints(); ++j) {
      Index& column = key[static_cast<std::size_t>(j)];
      if (position.sign[j] < 0) column = -1 - column;
    }
    const auto [at, is_new] = motions_.try_emplace(key);
    if (is_new) {
      const std::vector<SmoothRun> runs =
          JointOrder{TorqueKind::kWhole, position, Columns(joints())}.apply(part_);
      const WeakForm form(runs, how_);
      VectorXd v0(joints());
      for (Index j = 0; j < joints(); ++j) {
        v0[j] = std::max(1e-9, 3 * how_.rate_noise[position.from[static_cast<std::size_t>(j)]]);
      }
      at->second = {form.torques(kernel_, joints()), form.velocity(), form.sign(v0)};
    }
    return at->second;
  }

  controller::DynamicsKernel kernel_;
  RecordFilter how_;
  std::vector<SmoothRun> part_;
  MatrixXd torque_;  ///< of the windows, as the columns are
  std::map<std::vector<Index>, Motion> motions_;
};

/// "the torques fit far better in the order 1, 3, 2", "... with the opposite sign of joint 4".
void describe(const char* what, const Columns& columns, std::vector<std::string>& changes) {
  std::string order, signs;
  bool moved = false;
  const auto n = static_cast<Index>(columns.from.size());
  for (Index i = 0; i < n; ++i) {
    const Index from = columns.from[static_cast<std::size_t>(i)];
    moved = moved || from != i;
    order += (i > 0 ? ", " : "") + std::to_string(from + 1);
    if (columns.sign[i] < 0) signs += (signs.empty() ? "" : ", ") + std::to_string(i + 1);
  }
  if (moved) {
    changes.push_back(std::string("the columns of ") + what + " fit far better in the order " +
                      order);
  }
  if (columns.sign.maxCoeff() < 0) signs = "all joints";
  if (!signs.empty()) {
    changes.push_back(std::string("the ") + what + (signs == "all joints" ? " of " : " of joint ") +
                      signs + " fit far better with the opposite sign");
  }
}

}  // namespace

ColumnOrder::ColumnOrder(Index n) : sign(VectorXd::Ones(n)) {
  for (Index i = 0; i < n; ++i) from.push_back(i);
}

MatrixXd ColumnOrder::apply(const MatrixXd& value) const {
  MatrixXd result(value.rows(), value.cols());
  for (Index i = 0; i < value.rows(); ++i) {
    result.row(i) = sign[i] * value.row(from[static_cast<std::size_t>(i)]);
  }
  return result;
}

std::vector<SmoothRun> JointOrder::apply(const std::vector<SmoothRun>& runs) const {
  std::vector<SmoothRun> changed;
  changed.reserve(runs.size());
  for (const SmoothRun& run : runs) {
    changed.push_back({run.record, run.begin, position.apply(run.position),
                       position.apply(run.velocity), torque.apply(run.torque)});
  }
  return changed;
}

std::vector<std::string> JointOrder::changes() const {
  std::vector<std::string> sentences;
  describe("positions", position, sentences);
  describe("torques", torque, sentences);
  return sentences;
}

std::vector<Index> JointOrder::joints() const {
  std::vector<Index> doubted;
  for (Index i = 0; i < position.sign.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (position.from[at] != i || torque.from[at] != i || position.sign[i] < 0 ||
        torque.sign[i] < 0) {
      doubted.push_back(i);
    }
  }
  return doubted;
}

JointOrder find_order(const controller::RobotModel& model, const std::vector<SmoothRun>& runs,
                      const RecordFilter& how) {
  OrderSearch search(model, runs, how);
  Guess best = search.as_it_is(TorqueKind::kExternal);
  for (const TorqueKind kind : {TorqueKind::kWithoutGravity, TorqueKind::kWhole}) {
    const Guess found = search.improve(search.as_it_is(kind));
    if (found.score < best.score) best = found;
  }
  return best.order;
}

}  // namespace dashpot::identification
