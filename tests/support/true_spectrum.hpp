#pragma once
// EXPECT that the bounds of a tracked spectrum enclose the truth, in long double.

#include <dashpot/tests/support/enclosure.hpp>
#include <dashpot/tests/support/systems.hpp>

#include <gtest/gtest.h>

namespace dashpot::testing {

/// Expects each eigenvalue within its bound of a true one, one to one; and frequency and damping
/// ratio within theirs, where the two true eigenvalues of the mode are clear.
inline Verdict expect_enclosed(const analysis::System<analysis::kMaxDof>& system,
                               const analysis::TrackedSpectrum& spectrum) {
  const Verdict verdict = judge<long double>(system, spectrum, 1e-17);
  EXPECT_TRUE(verdict.enclosed) << verdict.what << ", error / bound " << verdict.tightest;
  return verdict;
}

}  // namespace dashpot::testing
