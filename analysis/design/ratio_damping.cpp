#include <dashpot/analysis/design/modal_damping.hpp>
#include <dashpot/analysis/linalg/semidefinite_cholesky.hpp>
#include <dashpot/analysis/ratio_damping.hpp>

#include <cmath>
#include <limits>
#include <utility>

namespace dashpot::analysis {
namespace {

using PairedRow = RatioDamping::PairedRow;
using PairedRows = RatioDamping::PairedRows;

constexpr std::size_t kDirections = kTaskDirections;
constexpr std::size_t kLanes = 4;
/// Cosines between columns below this are squared by the sweep that has seen them.
constexpr double kConverged = 1e-8;
constexpr int kMaxSweeps = 16;
/// After so many updates the rotations restart, before their rounding errors add up.
constexpr int kFreshStart = 256;

double& entry(PairedRow& row, std::size_t column) {
  return column < 3 ? row.left[column] : row.right[column - 3];
}

template <std::size_t Joints>
using LowerTriangle = std::array<std::array<double, Joints>, Joints>;  // by columns

/// L and the rows of L^-1 J' F for n = Joints; false unless M is positive definite.
template <std::size_t Joints>
bool scaled_rows(const double* M, Eigen::Index stride, const double* J, const PairedRows& F,
                 LowerTriangle<Joints>& L, std::array<PairedRow, Joints>& A) noexcept {
  for (std::size_t j = 0; j < Joints; ++j) {
    const double* const column = M + static_cast<Eigen::Index>(j) * stride;
    for (std::size_t i = j; i < Joints; ++i) L[j][i] = column[i];
  }
  for (std::size_t j = 0; j < Joints; ++j) {
    PairedRow row{};
    for (std::size_t k = 0; k < kDirections; ++k) {
      const double factor = J[k + j * kDirections];
      for (std::size_t l = 0; l < kLanes; ++l) {
        row.left[l] += factor * F[k].left[l];
        row.right[l] += factor * F[k].right[l];
      }
    }
    A[j] = row;
  }
  for (std::size_t j = 0; j < Joints; ++j) {
    if (!(L[j][j] > 0)) return false;
    const double inverse = 1 / std::sqrt(L[j][j]);
    for (std::size_t i = j; i < Joints; ++i) L[j][i] *= inverse;
    for (std::size_t k = j + 1; k < Joints; ++k) {
      for (std::size_t i = k; i < Joints; ++i) L[k][i] -= L[j][i] * L[j][k];
    }
    for (std::size_t l = 0; l < kLanes; ++l) {
      A[j].left[l] *= inverse;
      A[j].right[l] *= inverse;
    }
    for (std::size_t i = j + 1; i < Joints; ++i) {
      for (std::size_t l = 0; l < kLanes; ++l) {
        A[i].left[l] -= L[j][i] * A[j].left[l];
        A[i].right[l] -= L[j][i] * A[j].right[l];
      }
    }
  }
  return true;
}

/// Turns the columns of each pair by their angle, and moves on to the next three pairs of a round
/// robin: the first column stays, the others go round.
template <std::size_t Rows>
void turn(const std::array<double, kLanes>& c, const std::array<double, kLanes>& s,
          std::array<PairedRow, Rows>& rows) noexcept {
  for (PairedRow& row : rows) {
    std::array<double, kLanes> l, r;
    for (std::size_t k = 0; k < kLanes; ++k) {
      l[k] = c[k] * row.left[k] - s[k] * row.right[k];
      r[k] = s[k] * row.left[k] + c[k] * row.right[k];
    }
    row.left = {l[0], r[0], l[1], 0};
    row.right = {r[1], r[2], l[2], 0};
  }
}

/// One sweep over all 15 pairs of columns of A, with B turned alike. Returns the square of the
/// largest cosine between two columns that it met.
template <std::size_t Joints>
double sweep(std::array<PairedRow, Joints>& A, PairedRows& B) noexcept {
  std::array<double, kLanes> worst{};
  for (std::size_t round = 0; round + 1 < kDirections; ++round) {
    std::array<double, kLanes> left{}, right{}, dot{}, c, s;
    for (const PairedRow& row : A) {
      for (std::size_t k = 0; k < kLanes; ++k) {
        left[k] += row.left[k] * row.left[k];
        right[k] += row.right[k] * row.right[k];
        dot[k] += row.left[k] * row.right[k];
      }
    }
    constexpr double kTiny = std::numeric_limits<double>::min();
    for (std::size_t k = 0; k < kLanes; ++k) {
      const double square = dot[k] * dot[k], cosine = square / (left[k] * right[k] + kTiny);
      worst[k] = cosine > worst[k] ? cosine : worst[k];
      // tan of the smaller angle, free of cancellation
      const double half = 0.5 * (right[k] - left[k]);
      const double size = std::abs(half) + std::sqrt(half * half + square) + kTiny;
      const double t = dot[k] / std::copysign(size, half);
      c[k] = 1 / std::sqrt(1 + t * t);
      s[k] = c[k] * t;
    }
    turn(c, s, A);
    turn(c, s, B);
  }
  return std::max(std::max(worst[0], worst[1]), worst[2]);
}

/// (L^-T A)' diag(d) L^-T A, of which the upper triangle is computed; A is overwritten by L^-T A.
template <std::size_t Joints>
void task_friction(const LowerTriangle<Joints>& L, const double* d,
                   std::array<PairedRow, Joints>& A, TaskMatrix& G) noexcept {
  G.setZero();
  for (std::size_t i = Joints; i-- > 0;) {
    PairedRow row = A[i];
    for (std::size_t k = i + 1; k < Joints; ++k) {
      for (std::size_t l = 0; l < kLanes; ++l) {
        row.left[l] -= L[i][k] * A[k].left[l];
        row.right[l] -= L[i][k] * A[k].right[l];
      }
    }
    for (std::size_t l = 0; l < kLanes; ++l) {
      row.left[l] /= L[i][i];
      row.right[l] /= L[i][i];
    }
    A[i] = row;
    for (std::size_t q = 0; q < kDirections; ++q) {
      const double scaled = d[i] * entry(row, q);
      for (std::size_t p = 0; p <= q; ++p) {
        G(static_cast<Eigen::Index>(p), static_cast<Eigen::Index>(q)) += scaled * entry(row, p);
      }
    }
  }
}

/// Sweeps until the columns are orthogonal; their lengths are the frequencies. With friction d (n),
/// also G = (L^-T A)' diag(d) L^-T A of these columns.
template <std::size_t Joints>
Status frequencies(const double* M, Eigen::Index stride, const double* J, const double* d,
                   PairedRows& B, std::array<double, kDirections>& omega, TaskMatrix& G) noexcept {
  std::array<PairedRow, Joints> A;
  LowerTriangle<Joints> L;
  if (!scaled_rows<Joints>(M, stride, J, B, L, A)) return Status::kMassNotPositiveDefinite;
  double worst = 1;
  for (int count = 0; !(worst <= kConverged * kConverged); ++count) {
    if (count == kMaxSweeps) return Status::kNotConverged;
    worst = sweep(A, B);
  }
  PairedRow squares{};
  for (const PairedRow& row : A) {
    for (std::size_t k = 0; k < kLanes; ++k) {
      squares.left[k] += row.left[k] * row.left[k];
      squares.right[k] += row.right[k] * row.right[k];
    }
  }
  for (std::size_t i = 0; i < kDirections; ++i) omega[i] = std::sqrt(entry(squares, i));
  if (d != nullptr) task_friction<Joints>(L, d, A, G);
  return Status::kOk;
}

using Frequencies = Status (*)(const double*, Eigen::Index, const double*, const double*,
                               PairedRows&, std::array<double, kDirections>&, TaskMatrix&) noexcept;

template <std::size_t... I>
constexpr std::array<Frequencies, sizeof...(I)> frequencies_table(std::index_sequence<I...>) {
  return {frequencies<I + 1>...};
}

constexpr auto kFrequencies = frequencies_table(std::make_index_sequence<kMaxDof>());

/// B R B' for what friction, with its G, leaves to do.
Status damping_beside_friction(const PairedRows& B, const std::array<double, kDirections>& omega,
                               const DampingTarget& target, double soft, const TaskMatrix& G,
                               TaskMatrix& out, bool& overdone) noexcept {
  Vector<kMaxDof> frequencies(kTaskDirections);
  Square<kMaxDof> R(kTaskDirections, kTaskDirections);
  TaskMatrix rows;
  for (Eigen::Index j = 0; j < kTaskDirections; ++j) {
    frequencies[j] = omega[static_cast<std::size_t>(j)];
    for (Eigen::Index i = 0; i <= j; ++i) {
      const double size = omega[static_cast<std::size_t>(i)] * omega[static_cast<std::size_t>(j)];
      R(i, j) = R(j, i) = size > 0 ? G(i, j) / size : 0;
    }
    PairedRow row = B[static_cast<std::size_t>(j)];
    for (std::size_t k = 0; k < kDirections; ++k) {
      rows(j, static_cast<Eigen::Index>(k)) = entry(row, k);
    }
  }
  const Status status = missing_damping(frequencies, target, soft, R, overdone);
  if (status != Status::kOk) return status;
  const TaskMatrix half = rows.lazyProduct(TaskMatrix(R));
  const TaskMatrix whole = half.lazyProduct(rows.transpose());
  out = 0.5 * (whole + whole.transpose());
  return Status::kOk;
}

/// B diag(weight) B', of which one half is computed.
void weighted_square(const PairedRows& B, const std::array<double, kDirections>& weight,
                     TaskMatrix& out) noexcept {
  PairedRow w{};
  for (std::size_t k = 0; k < kDirections; ++k) entry(w, k) = weight[k];
  for (std::size_t j = 0; j < kDirections; ++j) {
    PairedRow scaled;
    for (std::size_t k = 0; k < kLanes; ++k) {
      scaled.left[k] = w.left[k] * B[j].left[k];
      scaled.right[k] = w.right[k] * B[j].right[k];
    }
    for (std::size_t i = 0; i <= j; ++i) {
      std::array<double, kLanes> sum;
      for (std::size_t k = 0; k < kLanes; ++k) {
        sum[k] = scaled.left[k] * B[i].left[k] + scaled.right[k] * B[i].right[k];
      }
      const double value = (sum[0] + sum[1]) + sum[2];
      out(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = value;
      out(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(i)) = value;
    }
  }
}

}  // namespace

Status RatioDamping::set_stiffness(const TaskMatrix& K_C) noexcept {
  if (!K_C.allFinite()) return Status::kNotFinite;
  TaskMatrix F;
  if (!semidefinite_cholesky(K_C, F)) return Status::kStiffnessIndefinite;
  for (std::size_t i = 0; i < kDirections; ++i) {
    for (std::size_t j = 0; j < kDirections; ++j) {
      entry(factor_[i], j) = F(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
    }
  }
  rotated_ = factor_;
  updates_ = 0;
  return Status::kOk;
}

template <int N>
Status RatioDamping::update(const Square<N>& M, const TaskJacobian<N>& J,
                            TaskMatrix& C_C) noexcept {
  const Eigen::Index n = M.rows();
  if (n == 0 || n > kMaxDof || M.cols() != n || J.cols() != n) return Status::kWrongSize;
  const bool friction = friction_.size() > 0;
  if (friction && friction_.size() != n) return Status::kWrongSize;
  PairedRows B = updates_ < kFreshStart ? rotated_ : factor_;
  std::array<double, kDirections> omega, weight;
  TaskMatrix G;
  Status status = kFrequencies[static_cast<std::size_t>(n - 1)](
      M.data(), M.outerStride(), J.data(), friction ? friction_.data() : nullptr, B, omega, G);
  if (status != Status::kOk) return status;
  double fastest = 0;
  for (const double value : omega) {
    if (!std::isfinite(value)) return Status::kNotFinite;
    fastest = std::max(fastest, value);
  }
  const double soft = target_.soft_limit(fastest);
  overdone_ = false;
  if (friction) {
    status = damping_beside_friction(B, omega, target_, soft, G, C_C, overdone_);
    if (status != Status::kOk) return status;
  } else {
    for (std::size_t i = 0; i < kDirections; ++i) weight[i] = target_.damper(omega[i], soft);
    weighted_square(B, weight, C_C);
  }
  updates_ = updates_ < kFreshStart ? updates_ + 1 : 0;
  rotated_ = B;
  frequencies_ = omega;
  return Status::kOk;
}

template Status RatioDamping::update<kMaxDof>(const Square<kMaxDof>&, const TaskJacobian<kMaxDof>&,
                                              TaskMatrix&) noexcept;

}  // namespace dashpot::analysis
