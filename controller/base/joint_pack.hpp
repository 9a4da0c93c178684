#pragma once
// Numbers for four neighbouring joints of a chain in a register, so that the processor computes for
// four joints at once, except in sums along the chain. Numbers beyond the last joint are padding.

// Without AVX the compiler passes these types in memory, and mentions it.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace dashpot::controller {

/// One number for each of four joints, in the order of the chain.
using Vec4d = double __attribute__((vector_size(32)));

inline Vec4d load(const double* source) noexcept {
  Vec4d result;
  __builtin_memcpy(&result, source, sizeof(result));
  return result;
}
inline void store(const Vec4d& source, double* target) noexcept {
  __builtin_memcpy(target, &source, sizeof(source));
}

/// Returns for joint i the x of joint i + 1; `next` is the x of the four joints further out.
inline Vec4d of_next(const Vec4d& x, const Vec4d& next) noexcept {
  return __builtin_shufflevector(x, next, 1, 2, 3, 4);
}
/// Returns for joint i the x of joint i - 1; `previous` is the x of the four joints further in.
inline Vec4d of_previous(const Vec4d& x, const Vec4d& previous) noexcept {
  return __builtin_shufflevector(previous, x, 3, 4, 5, 6);
}
/// Returns for joint i the sum x_0 + ... + x_i; `before` is the sum for the four joints further in.
inline Vec4d sum_outward(const Vec4d& x, const Vec4d& before) noexcept {
  const Vec4d pairs = x + __builtin_shufflevector(x, Vec4d{}, 4, 0, 1, 2);
  const Vec4d fours = pairs + __builtin_shufflevector(pairs, Vec4d{}, 4, 4, 0, 1);
  return fours + __builtin_shufflevector(before, before, 3, 3, 3, 3);
}
/// Returns for joint i the sum x_i + ... + x_last; `beyond` is the sum for the four joints further
/// out.
inline Vec4d sum_inward(const Vec4d& x, const Vec4d& beyond) noexcept {
  const Vec4d pairs = x + __builtin_shufflevector(x, Vec4d{}, 1, 2, 3, 4);
  const Vec4d fours = pairs + __builtin_shufflevector(pairs, Vec4d{}, 2, 3, 4, 4);
  return fours + __builtin_shufflevector(beyond, beyond, 0, 0, 0, 0);
}

/// A 3-vector for each joint.
struct Lanes3 {
  Vec4d x, y, z;

  friend Lanes3 operator+(const Lanes3& a, const Lanes3& b) noexcept {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  friend Lanes3 operator-(const Lanes3& a, const Lanes3& b) noexcept {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  friend Lanes3 operator*(const Vec4d& a, const Lanes3& b) noexcept {
    return {a * b.x, a * b.y, a * b.z};
  }
};

inline Vec4d dot(const Lanes3& a, const Lanes3& b) noexcept {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Lanes3 cross(const Lanes3& a, const Lanes3& b) noexcept {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Lanes3 of_next(const Lanes3& a, const Lanes3& next) noexcept {
  return {of_next(a.x, next.x), of_next(a.y, next.y), of_next(a.z, next.z)};
}
inline Lanes3 of_previous(const Lanes3& a, const Lanes3& previous) noexcept {
  return {of_previous(a.x, previous.x), of_previous(a.y, previous.y), of_previous(a.z, previous.z)};
}
inline Lanes3 sum_outward(const Lanes3& a, const Lanes3& before) noexcept {
  return {sum_outward(a.x, before.x), sum_outward(a.y, before.y), sum_outward(a.z, before.z)};
}
inline Lanes3 sum_inward(const Lanes3& a, const Lanes3& beyond) noexcept {
  return {sum_inward(a.x, beyond.x), sum_inward(a.y, beyond.y), sum_inward(a.z, beyond.z)};
}

/// A symmetric 3 x 3 matrix for each joint.
struct LanesSymmetric {
  Vec4d xx, yy, zz, xy, xz, yz;

  friend LanesSymmetric operator+(const LanesSymmetric& a, const LanesSymmetric& b) noexcept {
    return {a.xx + b.xx, a.yy + b.yy, a.zz + b.zz, a.xy + b.xy, a.xz + b.xz, a.yz + b.yz};
  }
  friend Lanes3 operator*(const LanesSymmetric& a, const Lanes3& b) noexcept {
    return {a.xx * b.x + a.xy * b.y + a.xz * b.z, a.xy * b.x + a.yy * b.y + a.yz * b.z,
            a.xz * b.x + a.yz * b.y + a.zz * b.z};
  }
};

inline LanesSymmetric sum_inward(const LanesSymmetric& a, const LanesSymmetric& beyond) noexcept {
  return {sum_inward(a.xx, beyond.xx), sum_inward(a.yy, beyond.yy), sum_inward(a.zz, beyond.zz),
          sum_inward(a.xy, beyond.xy), sum_inward(a.xz, beyond.xz), sum_inward(a.yz, beyond.yz)};
}

/// A 3 x 3 matrix for each joint, by its columns.
struct Lanes33 {
  Lanes3 x, y, z;

  friend Lanes3 operator*(const Lanes33& a, const Lanes3& b) noexcept {
    return b.x * a.x + b.y * a.y + b.z * a.z;
  }
};

/// Returns R S R'.
inline LanesSymmetric turned(const Lanes33& R, const LanesSymmetric& S) noexcept {
  const Lanes3 x = S.xx * R.x + S.xy * R.y + S.xz * R.z;  // columns of R S
  const Lanes3 y = S.xy * R.x + S.yy * R.y + S.yz * R.z;
  const Lanes3 z = S.xz * R.x + S.yz * R.y + S.zz * R.z;
  return {x.x * R.x.x + y.x * R.y.x + z.x * R.z.x, x.y * R.x.y + y.y * R.y.y + z.y * R.z.y,
          x.z * R.x.z + y.z * R.y.z + z.z * R.z.z, x.x * R.x.y + y.x * R.y.y + z.x * R.z.y,
          x.x * R.x.z + y.x * R.y.z + z.x * R.z.z, x.y * R.x.z + y.y * R.y.z + z.y * R.z.z};
}

/// Returns 2 (a.b) 1 - a b' - b a', the change of a body's inertia when the body is shifted by b; a
/// is the body's first moment plus half of its mass times b.
inline LanesSymmetric shift_term(const Lanes3& a, const Lanes3& b) noexcept {
  const Vec4d x = a.x * b.x, y = a.y * b.y, z = a.z * b.z;
  return {2 * (y + z),
          2 * (x + z),
          2 * (x + y),
          -(a.x * b.y + b.x * a.y),
          -(a.x * b.z + b.x * a.z),
          -(a.y * b.z + b.y * a.z)};
}

}  // namespace dashpot::controller
