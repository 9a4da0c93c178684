#pragma once
#include <dashpot/lcmtypes/contact_t.hpp>
#include <dashpot/lcmtypes/modes_t.hpp>
#include <dashpot/lcmtypes/sampled_modes_t.hpp>
#include <dashpot/lcmtypes/samples.hpp>
#include <dashpot/lcmtypes/state_t.hpp>

#include <cstdint>
#include <vector>

namespace dashpot::lcmtypes {

/// Quaternion w, x, y, z of a rotation matrix, with w >= 0.
void write_quaternion(const Eigen::Matrix3d& R, double (&quaternion)[4]);

/// Copies a sample into a message. Keeps fields that a sample does not have:
/// state_t::states_dropped, and `sequence` of the others. Joint vectors that are not as long as the
/// joint position are cut, or filled up with zeros.
void fill(const StateSample& sample, state_t& message);
/// Copies the contact of a sample that has one.
void fill(const StateSample& sample, contact_t& message);
void fill(const ModesSample& sample, modes_t& message);
void fill(const SampledModesSample& sample, sampled_modes_t& message);

/// The bytes of a message as LCM sends them, in a buffer that is used again and again.
template <class Message>
void encode(const Message& message, std::vector<std::uint8_t>& bytes) {
  bytes.resize(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
}

}  // namespace dashpot::lcmtypes
