#pragma once
// Files of motion with known modes, and the results of `dashpot identify`.

#include <dashpot/tests/apps/json_result.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace dashpot::tests {

/// A file with a decay of 9 rad/s at 0.12 and one of 14 rad/s at 0.55 in two channels, after half a
/// second of rest.
inline std::string decay_csv(const std::string& heading, double angle, double time = 1) {
  std::string text = heading + "\n";
  std::uint64_t state = 7;  // of noise, about even, that every machine makes alike
  const auto noise = [&state] {
    state = state * 6364136223846793005U + 1442695040888963407U;
    return (static_cast<double>(state >> 33) / 2147483648.0 - 0.5) * 3e-5;
  };
  for (int i = 0; i < 1200; ++i) {
    const double t = 0.002 * i - 0.5;
    const auto wave = [t](double w, double z) {
      return t < 0 ? 1 : std::exp(-z * w * t) * std::cos(w * std::sqrt(1 - z * z) * t);
    };
    const double x = 0.02 * wave(9, 0.12), y = 0.02 * wave(14, 0.55);
    text += printed("%.6f,%.9f,%.9f\n", time * (t + 0.5), angle * (x + y / 2 + noise()),
                    angle * (x / 2 - y + noise()));
  }
  return text;
}

inline Json identify(const Words& arguments) {
  return parse(run_program(joined({"identify", "--json"}, arguments)));
}

/// The report on records without modes: the program fails with one line.
inline Json no_modes(const Words& arguments) {
  Outcome outcome = run_program(joined({"identify", "--json"}, arguments));
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err, ::testing::HasSubstr("dashpot identify: no modes: "));
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1);
  return Json::parse(outcome.out);
}

inline void expect_known_modes(const Json& found) {
  ASSERT_EQ(found["modes"].size(), 2U) << found.dump();
  const std::array<double, 2> w{9, 14}, z{0.12, 0.55};
  for (std::size_t k = 0; k < 2; ++k) {
    const Json& mode = found["modes"][k];
    EXPECT_NEAR(mode["natural_frequency"].get<double>(), w[k], 0.002 * w[k]);
    EXPECT_NEAR(mode["damping_ratio"].get<double>(), z[k], 0.003);
    EXPECT_LT(mode["natural_frequency_std"].get<double>(), 0.002 * w[k]);
    EXPECT_GT(mode["damping_ratio_std"].get<double>(), 0);
    EXPECT_EQ(mode["shape"].size(), 2U);
    EXPECT_GE(mode["stability"].get<double>(), 0.5);
  }
}

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
    text.replace(at, from.size(), to);
  }
  return text;
}

}  // namespace dashpot::tests
