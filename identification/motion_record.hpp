#pragma once
#include <dashpot/analysis/matrix_types.hpp>

#include <vector>

namespace dashpot::identification {

using analysis::Complex;
using analysis::modulus;

/// A recorded motion: some channels of an arm at some times.
struct MotionRecord {
  Eigen::VectorXd time;    ///< N, s, strictly rising; need not be evenly spaced
  Eigen::MatrixXd output;  ///< channels x N, in any units; NaN where a sample is missing
  /// inputs x N, in any units: excitation from each sample to the next; no sample is missing.
  /// Empty: not measured.
  Eigen::MatrixXd input = {};
};

/// The samples of a record from `from`, before `to`.
MotionRecord part_of(const MotionRecord& record, Eigen::Index from, Eigen::Index to);

/// Throws std::invalid_argument, which names the record and the channel, for no records, records
/// without channels, of different channels, with fewer than 20 samples, with times that do not rise
/// or are not finite, infinite samples, channels with fewer than 10 samples, and inputs of another
/// number or length or that are not finite.
void check_records(const std::vector<MotionRecord>& records);

}  // namespace dashpot::identification
