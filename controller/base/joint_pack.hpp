#pragma once
// One number for each joint of a chain, four joints to a register. The processor computes for four
// joints at once, except in sums along the chain. Numbers beyond the last joint are padding.

#include <array>

// Without AVX the compiler passes these types in memory, and mentions it.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace dashpot::controller {

using Vec4d = double __attribute__((vector_size(32)));

/// Number of registers for N joints.
template <int N>
inline constexpr int kGroups = (N + 3) / 4;
/// Number of joints, with padding, in these registers.
template <int N>
inline constexpr int kLanes = 4 * kGroups<N>;

/// G registers: one number for each of 4 G joints.
template <int G>
struct JointPack {
  Vec4d group[G];

  static JointPack load(const double* source) {
    JointPack result;
    __builtin_memcpy(&result, source, sizeof(result));
    return result;
  }
  void store(double* target) const { __builtin_memcpy(target, this, sizeof(*this)); }

  JointPack operator-() const {
    JointPack result;
    for (int g = 0; g < G; ++g) result.group[g] = -group[g];
    return result;
  }
  friend JointPack operator+(const JointPack& a, const JointPack& b) {
    JointPack result;
    for (int g = 0; g < G; ++g) result.group[g] = a.group[g] + b.group[g];
    return result;
  }
  friend JointPack operator-(const JointPack& a, const JointPack& b) {
    JointPack result;
    for (int g = 0; g < G; ++g) result.group[g] = a.group[g] - b.group[g];
    return result;
  }
  friend JointPack operator*(const JointPack& a, const JointPack& b) {
    JointPack result;
    for (int g = 0; g < G; ++g) result.group[g] = a.group[g] * b.group[g];
    return result;
  }
  friend JointPack operator*(double a, const JointPack& b) {
    JointPack result;
    for (int g = 0; g < G; ++g) result.group[g] = a * b.group[g];
    return result;
  }
};

/// Returns the same number for every joint.
template <int G>
JointPack<G> all(double value) {
  JointPack<G> result;
  for (int g = 0; g < G; ++g) result.group[g] = Vec4d{value, value, value, value};
  return result;
}

/// Returns for joint i the x of joint i + 1, and 0 for the last entry.
template <int G>
JointPack<G> of_next(const JointPack<G>& x) {
  JointPack<G> result;
  for (int g = 0; g < G; ++g) {
    const Vec4d after = g + 1 < G ? x.group[g + 1 < G ? g + 1 : g] : Vec4d{};
    result.group[g] = __builtin_shufflevector(x.group[g], after, 1, 2, 3, 4);
  }
  return result;
}

/// Returns for joint i the x of joint i - 1, and 0 for the first joint.
template <int G>
JointPack<G> of_previous(const JointPack<G>& x) {
  JointPack<G> result;
  for (int g = 0; g < G; ++g) {
    const Vec4d before = g > 0 ? x.group[g > 0 ? g - 1 : 0] : Vec4d{};
    result.group[g] = __builtin_shufflevector(before, x.group[g], 3, 4, 5, 6);
  }
  return result;
}

/// Returns for joint i the sum x_0 + ... + x_i.
template <int G>
JointPack<G> sum_outward(const JointPack<G>& x) {
  JointPack<G> result;
  Vec4d before{};
  for (int g = 0; g < G; ++g) {
    Vec4d sum = x.group[g];
    sum += __builtin_shufflevector(sum, Vec4d{}, 4, 0, 1, 2);
    sum += __builtin_shufflevector(sum, Vec4d{}, 4, 4, 0, 1);
    result.group[g] = sum + before;
    before = __builtin_shufflevector(result.group[g], result.group[g], 3, 3, 3, 3);
  }
  return result;
}

/// Returns for joint i the sum x_i + ... + x_last.
template <int G>
JointPack<G> sum_inward(const JointPack<G>& x) {
  JointPack<G> result;
  Vec4d beyond{};
  for (int g = G - 1; g >= 0; --g) {
    Vec4d sum = x.group[g];
    sum += __builtin_shufflevector(sum, Vec4d{}, 1, 2, 3, 4);
    sum += __builtin_shufflevector(sum, Vec4d{}, 2, 3, 4, 4);
    result.group[g] = sum + beyond;
    beyond = __builtin_shufflevector(result.group[g], result.group[g], 0, 0, 0, 0);
  }
  return result;
}

/// A 3-vector for each joint.
template <int G>
struct Lanes3 {
  JointPack<G> x, y, z;

  friend Lanes3 operator+(const Lanes3& a, const Lanes3& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  friend Lanes3 operator-(const Lanes3& a, const Lanes3& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  friend Lanes3 operator*(const JointPack<G>& a, const Lanes3& b) {
    return {a * b.x, a * b.y, a * b.z};
  }
};

template <int G>
JointPack<G> dot(const Lanes3<G>& a, const Lanes3<G>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <int G>
Lanes3<G> cross(const Lanes3<G>& a, const Lanes3<G>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <int G>
Lanes3<G> of_next(const Lanes3<G>& a) {
  return {of_next(a.x), of_next(a.y), of_next(a.z)};
}
template <int G>
Lanes3<G> of_previous(const Lanes3<G>& a) {
  return {of_previous(a.x), of_previous(a.y), of_previous(a.z)};
}
template <int G>
Lanes3<G> sum_outward(const Lanes3<G>& a) {
  return {sum_outward(a.x), sum_outward(a.y), sum_outward(a.z)};
}
template <int G>
Lanes3<G> sum_inward(const Lanes3<G>& a) {
  return {sum_inward(a.x), sum_inward(a.y), sum_inward(a.z)};
}

/// A symmetric 3 x 3 matrix for each joint.
template <int G>
struct LanesSymmetric {
  JointPack<G> xx, yy, zz, xy, xz, yz;

  friend LanesSymmetric operator+(const LanesSymmetric& a, const LanesSymmetric& b) {
    return {a.xx + b.xx, a.yy + b.yy, a.zz + b.zz, a.xy + b.xy, a.xz + b.xz, a.yz + b.yz};
  }
  friend Lanes3<G> operator*(const LanesSymmetric& a, const Lanes3<G>& b) {
    return {a.xx * b.x + a.xy * b.y + a.xz * b.z, a.xy * b.x + a.yy * b.y + a.yz * b.z,
            a.xz * b.x + a.yz * b.y + a.zz * b.z};
  }
};

template <int G>
LanesSymmetric<G> sum_inward(const LanesSymmetric<G>& a) {
  return {sum_inward(a.xx), sum_inward(a.yy), sum_inward(a.zz),
          sum_inward(a.xy), sum_inward(a.xz), sum_inward(a.yz)};
}

/// A 3 x 3 matrix for each joint, by its columns.
template <int G>
struct Lanes33 {
  Lanes3<G> x, y, z;

  friend Lanes3<G> operator*(const Lanes33& a, const Lanes3<G>& b) {
    return b.x * a.x + b.y * a.y + b.z * a.z;
  }
};

/// Returns R S R'.
template <int G>
LanesSymmetric<G> turned(const Lanes33<G>& R, const LanesSymmetric<G>& S) {
  const Lanes3<G> x = S.xx * R.x + S.xy * R.y + S.xz * R.z;  // columns of R S
  const Lanes3<G> y = S.xy * R.x + S.yy * R.y + S.yz * R.z;
  const Lanes3<G> z = S.xz * R.x + S.yz * R.y + S.zz * R.z;
  return {x.x * R.x.x + y.x * R.y.x + z.x * R.z.x, x.y * R.x.y + y.y * R.y.y + z.y * R.z.y,
          x.z * R.x.z + y.z * R.y.z + z.z * R.z.z, x.x * R.x.y + y.x * R.y.y + z.x * R.z.y,
          x.x * R.x.z + y.x * R.y.z + z.x * R.z.z, x.y * R.x.z + y.y * R.y.z + z.y * R.z.z};
}

/// Returns 2 (a.b) 1 - a b' - b a', the change of a body's inertia when the body is shifted by b; a
/// is the body's first moment plus half of its mass times b.
template <int G>
LanesSymmetric<G> shift_term(const Lanes3<G>& a, const Lanes3<G>& b) {
  const JointPack<G> x = a.x * b.x, y = a.y * b.y, z = a.z * b.z;
  return {2 * (y + z),
          2 * (x + z),
          2 * (x + y),
          -(a.x * b.y + b.x * a.y),
          -(a.x * b.z + b.x * a.z),
          -(a.y * b.z + b.y * a.z)};
}

}  // namespace dashpot::controller
