#pragma once
// Comparisons with the JSON of `dashpot analyze`.

#include <dashpot/tests/apps/run_program.hpp>

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <vector>

namespace dashpot::tests {

using Json = nlohmann::json;
using Numbers = std::vector<double>;
using Rows = std::vector<Numbers>;

inline Json parse(const Outcome& outcome) {
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  // A run of more than 2 s tells how far it is, however fast the machine is.
  const std::regex progress("[0-9.]+ of [0-9.]+ s, [0-9]+ overruns\n");
  EXPECT_THAT(std::regex_replace(outcome.err, progress, ""), ::testing::IsEmpty());
  return Json::parse(outcome.out);
}

inline Json analyze_json(const std::string& text, const Words& options = {}) {
  return parse(analyze_text(text, joined(options, {"--json"})));
}

/// `relative` to the largest of the expected numbers.
inline void expect_near(const Rows& actual, const Rows& expected, double relative) {
  ASSERT_EQ(actual.size(), expected.size());
  double largest = 0;
  for (const Numbers& row : expected)
    for (const double value : row) largest = std::max(largest, std::abs(value));
  for (std::size_t i = 0; i < expected.size(); ++i) {
    ASSERT_EQ(actual[i].size(), expected[i].size());
    for (std::size_t j = 0; j < expected[i].size(); ++j)
      EXPECT_NEAR(actual[i][j], expected[i][j], relative * largest) << "at " << i << ", " << j;
  }
}

inline Rows product(const Rows& a, const Rows& b) {
  Rows result(a.size(), Numbers(b[0].size(), 0.0));
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t j = 0; j < b[0].size(); ++j)
      for (std::size_t k = 0; k < b.size(); ++k) result[i][j] += a[i][k] * b[k][j];
  return result;
}

inline Rows transposed(const Rows& a) {
  Rows result(a[0].size(), Numbers(a.size()));
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t j = 0; j < a[i].size(); ++j) result[j][i] = a[i][j];
  return result;
}

inline Numbers of_modes(const Json& result, const std::string& key) {
  Numbers values;
  for (const Json& mode : result["modes"]) values.push_back(mode[key]);
  return values;
}

/// The first eigenvalue of each mode, [re, im].
inline Rows eigenvalues(const Json& result) {
  Rows values;
  for (const Json& mode : result["modes"]) values.push_back(mode["eigenvalues"][0]);
  return values;
}

}  // namespace dashpot::tests
