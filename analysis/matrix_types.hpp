#pragma once
// Matrix types of the analysis. The template parameter N of every type and class is a capacity: the
// largest number of degrees of freedom that it can hold in fixed storage, without any allocation.
// N = kDynamic means storage that is sized at set-up. Actual sizes are set at run time.

#if !defined(EIGEN_MAX_ALIGN_BYTES) || EIGEN_MAX_ALIGN_BYTES != 64 || \
    !defined(EIGEN_MAX_STATIC_ALIGN_BYTES) || EIGEN_MAX_STATIC_ALIGN_BYTES != 64
#error \
    "the libraries lay out Eigen's types otherwise: add -DEIGEN_MAX_ALIGN_BYTES=64 \
-DEIGEN_MAX_STATIC_ALIGN_BYTES=64, or use the CMake targets or the pkg-config files"
#endif

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <complex>
#include <type_traits>
#include <vector>

#ifdef __FAST_MATH__
#error "the error bounds rest on IEEE arithmetic: compile without -ffast-math"
#endif

namespace dashpot::analysis {

inline constexpr int kDynamic = Eigen::Dynamic;

/// 2 N, or kDynamic.
template <int N>
inline constexpr int kTwice = N == kDynamic ? kDynamic : 2 * N;

using Complex = std::complex<double>;

/// Returns |z| without the care for overflow that makes std::abs slow, because eigenvalues are
/// nowhere near overflow.
inline double modulus(const Complex& z) noexcept {
  return std::sqrt(z.real() * z.real() + z.imag() * z.imag());
}

/// Capacity for arms, enough for every robot that the controller takes.
inline constexpr int kMaxDof = 16;

/// k x k, k <= n
template <int N>
using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, N, N>;
/// n
template <int N>
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, N, 1>;
template <int N>
using ComplexVector = Eigen::Matrix<Complex, Eigen::Dynamic, 1, Eigen::ColMajor, N, 1>;
/// n x 2n: one column for each coordinate of the state space
template <int N>
using Wide = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, N, kTwice<N>>;
/// k x l, k and l <= 2n
template <int N>
using State =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kTwice<N>, kTwice<N>>;
/// k, k <= 2n
template <int N>
using StateVector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kTwice<N>, 1>;

/// A list of at most `Capacity` items that allocates only when this is kDynamic.
template <class T, int Capacity>
class BoundedList {
 public:
  void clear() { size_ = 0; }
  void resize(int size) {
    size_ = size;
    if constexpr (Capacity == kDynamic) items_.resize(static_cast<std::size_t>(size));
  }
  void push_back(const T& item) {
    resize(size_ + 1);
    (*this)[size_ - 1] = item;
  }
  int size() const { return size_; }
  bool empty() const { return size_ == 0; }
  const T& operator[](Eigen::Index i) const { return items_[static_cast<std::size_t>(i)]; }
  T& operator[](Eigen::Index i) { return items_[static_cast<std::size_t>(i)]; }
  const T* begin() const { return items_.data(); }
  const T* end() const { return items_.data() + size_; }
  T* begin() { return items_.data(); }
  T* end() { return items_.data() + size_; }

 private:
  std::conditional_t<Capacity == kDynamic, std::vector<T>,
                     std::array<T, static_cast<std::size_t>(Capacity == kDynamic ? 1 : Capacity)>>
      items_;
  int size_ = 0;
};

}  // namespace dashpot::analysis
