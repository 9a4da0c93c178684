#include <dashpot/identification/motion_record.hpp>
#include <dashpot/identification/records/common.hpp>

#include <cmath>
#include <string>

namespace dashpot::identification {
namespace {

constexpr Index kSamples = 20;    ///< of a record, for a mode or two
constexpr Index kOfChannel = 10;  ///< of one of its channels

}  // namespace

MotionRecord part_of(const MotionRecord& record, Index from, Index to) {
  MotionRecord part{record.time.segment(from, to - from),
                    record.output.middleCols(from, to - from)};
  if (record.input.size() > 0) part.input = record.input.middleCols(from, to - from);
  return part;
}

void check_records(const std::vector<MotionRecord>& records) {
  check_that(!records.empty(), "there is no record");
  const Index channels = records.front().output.rows();
  check_that(channels > 0, "there is no channel");
  for (std::size_t r = 0; r < records.size(); ++r) {
    const auto& [time, output, input] = records[r];
    const std::string name = "record " + std::to_string(r + 1) + ": ";
    check_that(output.rows() == channels && output.cols() == time.size(),
               name + "output has to be channels x samples, with as many channels as others");
    check_that(time.size() >= kSamples, name + std::to_string(time.size()) + " samples, need " +
                                            std::to_string(kSamples) + " or more");
    check_that(time.allFinite(), name + "a time is not finite");
    check_that(input.size() == 0 || input.cols() == time.size(),
               name + "input has to be inputs x samples");
    check_that(input.rows() == records.front().input.rows() && input.allFinite(),
               name + "its inputs are not finite, or not as many as others");
    for (Index i = 1; i < time.size(); ++i)
      check_that(time[i] > time[i - 1], name + "time does not rise");
    for (Index c = 0; c < channels; ++c) {
      Index samples = 0;
      for (const double y : output.row(c)) {
        samples += std::isfinite(y);
        check_that(!std::isinf(y), name + "a sample is infinite");
      }
      check_that(samples >= kOfChannel, name + "channel " + std::to_string(c + 1) + " has " +
                                            std::to_string(samples) + " samples, need " +
                                            std::to_string(kOfChannel) + " or more");
    }
  }
}

}  // namespace dashpot::identification
