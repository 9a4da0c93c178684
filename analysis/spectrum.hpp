#pragma once
#include <dashpot/analysis/certificate.hpp>
#include <dashpot/analysis/modal_basis.hpp>
#include <dashpot/analysis/status.hpp>
#include <dashpot/analysis/work.hpp>
#include <dashpot/analysis/zero_modes.hpp>

#include <limits>

namespace dashpot::analysis {

/// Decided by the proved bounds; by the numbers as they are where no bound could be proved.
enum class ModeKind {
  kUnderdamped,  ///< a complex pair, 0 < zeta < 1
  kCritical,     ///< a double real eigenvalue, as far as the error bound can tell
  kOverdamped,   ///< two real eigenvalues
  kUndamped,     ///< a purely imaginary pair, as far as the error bound can tell
  kUnstable,     ///< an eigenvalue with positive real part, beyond its error bound
  kSoft,         ///< below SpectrumOptions::soft_frequency, or no frequency because an eigenvalue
                 ///< cannot be told from zero: its damping ratio means nothing
};

/// "underdamped", "critical", ...
const char* to_text(ModeKind kind) noexcept;

/// Where a spectrum comes from.
enum class SpectrumOrigin {
  kTracked,  ///< the previous one, refined
  kReused,   ///< the previous one: the system has hardly changed
  kDirect,   ///< solved anew
};

/// One vibration mode: a pair of eigenvalues of  (lambda^2 M + lambda C + K) u = 0.
template <int N = kDynamic>
struct Mode {
  /// A complex pair (positive imaginary part first) or two real ones (slower, nearer zero, first),
  /// 1/s
  std::array<Complex, 2> eigenvalues{};
  /// sqrt(lambda_1 lambda_2), rad/s; NaN if the product is negative (static instability)
  double natural_frequency = 0;
  /// -(lambda_1 + lambda_2) / (2 natural_frequency); above 1 if overdamped
  double damping_ratio = 0;
  /// Imaginary part of the first eigenvalue, rad/s; zero if real
  double damped_frequency = 0;
  ModeKind kind = ModeKind::kUnderdamped;
  /// Right eigenvectors u of the two eigenvalues in joint coordinates, n each, u^H M u = 1, largest
  /// entry real and positive. At critical damping both are the one eigenvector there is.
  std::array<ComplexVector<N>, 2> shapes;
  /// Left eigenvectors y, y^T (lambda^2 M + lambda C + K) = 0; equal to `shapes` if symmetric.
  std::array<ComplexVector<N>, 2> left_shapes;
  /// Normwise backward error of the worse eigenpair (Tisseur 2000):
  /// |Q(lambda) u| / ((|lambda|^2 |M| + |lambda| |C| + |K|) |u|), Frobenius norms of the
  /// coefficients
  double backward_error = 0;
  /// Condition number of the worse eigenvalue in the same measure (Tisseur 2000); infinite at
  /// critical damping
  double condition = 0;
  /// Proved bounds of |computed - true|; infinite if none could be proved, and where frequencies
  /// leave 1e-60 .. 1e60 rad/s or masses 1e-120 .. 1e120, because underflow is not counted there.
  /// Of either eigenvalue, 1/s (of the two nearest each other):
  double error_bound = std::numeric_limits<double>::infinity();
  double natural_frequency_bound = std::numeric_limits<double>::infinity();  ///< rad/s
  double damping_ratio_bound = std::numeric_limits<double>::infinity();
};

struct SpectrumOptions {
  /// Modes with a natural frequency below this are called soft, rad/s.
  double soft_frequency = 1e-6;
  /// Precision of the residuals: working, or twice that (kExtended), or kAutomatic: first working,
  /// then extended for all modes if for one of them the proved bound exceeds `target_bound` times
  /// |lambda_1| + |lambda_2|, the backward error exceeds 2e-14, or only the bound decides the kind
  /// (critical; undamped in spite of damping).
  enum class Residual { kAutomatic, kWorking, kExtended } residual = Residual::kAutomatic;
  double target_bound = 1e-10;  ///< relative, no unit
};

/// A list of at most N modes that allocates only when N is kDynamic.
template <int N>
class ModeList {
 public:
  void resize(int size) {
    size_ = size;
    if constexpr (N == kDynamic) items_.resize(static_cast<std::size_t>(size));
  }
  int size() const { return size_; }
  bool empty() const { return size_ == 0; }
  const Mode<N>& operator[](int i) const { return items_[static_cast<std::size_t>(i)]; }
  Mode<N>& operator[](int i) { return items_[static_cast<std::size_t>(i)]; }
  const Mode<N>* begin() const { return items_.data(); }
  const Mode<N>* end() const { return items_.data() + size_; }
  Mode<N>* begin() { return items_.data(); }
  Mode<N>* end() { return items_.data() + size_; }

 private:
  std::conditional_t<N == kDynamic, std::vector<Mode<N>>,
                     std::array<Mode<N>, static_cast<std::size_t>(N == kDynamic ? 1 : N)>>
      items_;
  int size_ = 0;
};

/// Everything the analysis knows of one system.
template <int N = kDynamic>
struct Spectrum {
  Status status = Status::kOk;
  bool symmetric = true;      ///< damping and stiffness equal their transposes
  bool proportional = false;  ///< the undamped modes decouple the damping too (C = 0 included);
                              ///< then zero_modes.coordinates is the mass-normalised modal matrix,
                              ///< n x n, with the zero modes in its last columns
  bool extended = false;      ///< residuals were evaluated with twice the working precision
  bool coupled =
      false;            ///< the damping couples zero and nonzero modes, and that was solved exactly
  double coupling = 0;  ///< how strongly: |damping between nonzero and zero modes| / |damping|, in
                        ///< mass-normalised coordinates (Frobenius)

  ZeroModes<N> zero_modes;
  /// n - r modes by falling natural frequency, or sqrt|l1 l2| where that is NaN; more than n - r
  /// where zero modes' velocities form complex pairs
  ModeList<N> modes;
  /// Eigenvalues -a of the r zero modes' velocities, 1/s: zero if nothing damps them, positive if
  /// they grow (no mode says so then), NaN if they are not real and so are among the modes. They
  /// come without a proved bound.
  Vector<N> zero_mode_rates;
  ModalBasis<N> basis;
};

/// State matrix A = [0 I; -M^-1 K  -M^-1 C] in the coordinates (q, q') and its dual eigenvectors
/// (paper, Eqs. 29-31): A X = X diag(lambda), Y^T A = diag(lambda) Y^T, Y^T X = I.
struct DualEigenvectors {
  Eigen::VectorXcd eigenvalues;  ///< 2m: of the nonzero modes, pairs in the order of the modes
  Eigen::MatrixXcd right;        ///< X, 2n x 2m
  Eigen::MatrixXcd left;         ///< Y, 2n x 2m; infinite where eigenvalues are defective
};

/// Dual eigenvectors of the nonzero modes. Scaled so that right columns have unit length.
DualEigenvectors dual_eigenvectors(const System<>& system, const Spectrum<>& spectrum);

/// Computes spectra of systems of up to N coordinates, all in storage of its own.
template <int N = kDynamic>
class SpectrumSolver {
 public:
  explicit SpectrumSolver(SpectrumOptions options = {}) : options_(options) {}

  /// Analyses `system` into `out`, and returns out.status. The work is bounded (see
  /// hessenberg_eigenvalues; three bases at most, 6 refinement steps each); for a fixed N there is
  /// no allocation. On a status other than kOk and kUncertified `out` has no modes.
  Status solve(const System<N>& system, Spectrum<N>& out) noexcept {
    Work work;
    return solve(system, out, work);
  }
  /// The same, with no more work than is granted: kUnfinished if that is not enough.
  Status solve(const System<N>& system, Spectrum<N>& out, Work& work) noexcept;

 private:
  bool good(const Spectrum<N>& spectrum) const noexcept;
  /// Evaluates, certifies and reads the modes; improves the basis while that helps.
  void refine(const System<N>& system, Spectrum<N>& out, Work& work) noexcept;

  SpectrumOptions options_;
  bool damped_ = true;
  Defect<N> defect_;
  Certificate<N> certificate_;
  ModalBasis<N> before_step_;
};

/// The one obvious call: validates the system (throws InvalidSystem), solves it, and returns the
/// spectrum; its status is kOk or kUncertified. Throws std::runtime_error if the solver fails.
Spectrum<> analyze(const System<>& system, const SpectrumOptions& options = {});

}  // namespace dashpot::analysis
