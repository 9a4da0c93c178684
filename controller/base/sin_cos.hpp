#pragma once
// Sine and cosine of four angles at once.

#include <dashpot/controller/base/joint_pack.hpp>

#include <cmath>
#include <cstdint>

namespace dashpot::controller {

/// Computes sine and cosine within 2 units in the last place for any angle; an infinite angle gives
/// NaN.
///
/// The angle is reduced to r = angle - k pi/2, |r| <= pi/4. pi/2 is split into parts of 33 bits, so
/// that k times a part is exact up to |k| = 2^20. The polynomials in r come from fdlibm (k_sin.c,
/// k_cos.c).
inline void sin_cos(const Vec4d& angle, Vec4d& sine, Vec4d& cosine) noexcept {
  using Bits = std::int64_t __attribute__((vector_size(32)));
  constexpr double kLargest = 1e6;
  constexpr double kToInteger = 0x1.8p52;  // adding it rounds; the integer is in its lowest bits
  constexpr double kPart1 = 0x1.921fb544p0, kPart2 = 0x1.0b4611a6p-34, kPart3 = 0x1.3198a2e0p-69,
                   kPart4 = 0x1.b839a252049c1p-104;

  const Vec4d shifted = angle * 0x1.45f306dc9c883p-1 + kToInteger;  // 2/pi
  const Vec4d k = shifted - kToInteger;
  const Vec4d high = angle - k * kPart1;  // exact
  const Vec4d low = k * kPart2;           // exact
  const Vec4d difference = high - low;
  const Vec4d lost = (high - difference) - low;
  const Vec4d r = difference + (lost - (k * kPart3 + k * kPart4));
  const Vec4d z = r * r;
  const Vec4d s =
      r + r * z *
              (-1.66666666666666324348e-01 +
               z * (8.33333333332248946124e-03 +
                    z * (-1.98412698298579493134e-04 +
                         z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 +
                                                                z * 1.58969099521155010221e-10)))));
  const Vec4d half = 0.5 * z;
  const Vec4d w = 1.0 - half;
  const Vec4d c =
      w +
      (((1.0 - w) - half) +
       z * z *
           (4.16666666666666019037e-02 +
            z * (-1.38888888888741095749e-03 +
                 z * (2.48015872894767294178e-05 +
                      z * (-2.75573143513906633035e-07 +
                           z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))))));

  Bits quarter;
  __builtin_memcpy(&quarter, &shifted, sizeof(quarter));
  const Bits odd = -(quarter & 1);
  const Bits sine_sign = (quarter & 2) << 62, cosine_sign = ((quarter + 1) & 2) << 62;
  Bits s_bits, c_bits;
  __builtin_memcpy(&s_bits, &s, sizeof(s));
  __builtin_memcpy(&c_bits, &c, sizeof(c));
  const Bits sine_bits = ((s_bits & ~odd) | (c_bits & odd)) ^ sine_sign;
  const Bits cosine_bits = ((c_bits & ~odd) | (s_bits & odd)) ^ cosine_sign;
  __builtin_memcpy(&sine, &sine_bits, sizeof(sine));
  __builtin_memcpy(&cosine, &cosine_bits, sizeof(cosine));

  for (int i = 0; i < 4; ++i) {
    if (std::abs(angle[i]) <= kLargest) continue;  // NaN goes on
    sine[i] = std::sin(angle[i]);
    cosine[i] = std::cos(angle[i]);
  }
}

}  // namespace dashpot::controller
