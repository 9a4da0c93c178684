// Bytes of unknown origin never do harm: they decode to what was encoded, or not at all.
#include <dashpot/lcmtypes/message_check.hpp>
#include <dashpot/tests/lcmtypes/random_samples.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>

namespace dashpot::lcmtypes {
namespace {

template <class Message>
Message random_message(Random& random, int n) {
  if constexpr (std::is_same_v<Message, state_t>) {
    return message_of<state_t>(random_state(random, n));
  } else if constexpr (std::is_same_v<Message, modes_t>) {
    return message_of<modes_t>(random_modes(random, n));
  } else if constexpr (std::is_same_v<Message, sampled_modes_t>) {
    return message_of<sampled_modes_t>(random_sampled_modes(random, n));
  } else if constexpr (std::is_same_v<Message, contact_t>) {
    StateSample sample = random_state(random, n);
    sample.contact_force = random.vector(3);
    return message_of<contact_t>(sample);
  } else {
    return random_command(random, n);
  }
}

template <class Message>
class MessageCheck : public ::testing::Test {};
using Messages = ::testing::Types<state_t, modes_t, sampled_modes_t, contact_t, command_t>;
TYPED_TEST_SUITE(MessageCheck, Messages);

template <class Message>
bool decodes(const Bytes& bytes, Message& message) {
  return decode(Exact(bytes).data(), bytes.size(), message);
}

TYPED_TEST(MessageCheck, GivesBackWhatWasEncoded) {
  Random random(911);
  TypeParam reused;
  for (int n = controller::kMaxJoints; n >= 1; --n) {
    const Bytes bytes = bytes_of(random_message<TypeParam>(random, n));
    ASSERT_TRUE(decodes(bytes, reused)) << n;
    EXPECT_EQ(bytes_of(reused), bytes) << n;
  }
}

TYPED_TEST(MessageCheck, RefusesOtherLengthsFingerprintsAndSizes) {
  Random random(912);
  const Bytes bytes = bytes_of(random_message<TypeParam>(random, 7));
  TypeParam message;
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(decodes(Bytes(bytes.data(), bytes.data() + size), message)) << size;
  }
  Bytes longer = bytes;
  longer.push_back(0);
  EXPECT_FALSE(decodes(longer, message));
  longer.resize(kMaxMessageSize + 1);
  EXPECT_FALSE(decodes(longer, message));
  EXPECT_FALSE(decode(nullptr, 0, message));
  EXPECT_FALSE(decode(nullptr, bytes.size(), message));
  for (std::size_t i = 0; i < 8; ++i) {
    Bytes foreign = bytes;
    foreign[i] ^= 1;
    EXPECT_FALSE(decodes(foreign, message));
  }
  if constexpr (std::is_same_v<TypeParam, contact_t>) return;  // it has no sizes
  // With these the generated decoder would ask for up to 2^31 doubles before it looked further.
  for (const std::int32_t size :
       {0, -1, 6, 8, 17, 1000, 1 << 20, 1 << 28, std::numeric_limits<std::int32_t>::max(),
        std::numeric_limits<std::int32_t>::min()}) {
    Bytes hostile = bytes;
    write_int32(hostile, 8, size);
    EXPECT_FALSE(decodes(hostile, message)) << size;
  }
}

TEST(ModesCheck, RefusesMoreModesThanElasticJointsHave) {
  Random random(915);
  modes_t message;
  ModesSample sample = random_modes(random, 7);
  sample.vibration.count = 7;
  for (auto& mode : sample.vibration.modes) mode.shape = analysis::ComplexVector<16>::Zero(7);
  const Bytes bytes = bytes_of(message_of<modes_t>(sample));
  ASSERT_TRUE(decodes(bytes, message));
  for (const std::int32_t count : {-1, 8, 15, 1 << 30, std::numeric_limits<std::int32_t>::min()}) {
    Bytes hostile = bytes;
    write_int32(hostile, 12, count);
    EXPECT_FALSE(decodes(hostile, message)) << count;
  }
  modes_t many = message_of<modes_t>(sample);  // consistent, but there is no such robot
  many.num_modes = 15;
  for (auto* values :
       {&many.natural_frequency, &many.damping_ratio, &many.damped_frequency,
        &many.eigenvalue_bound, &many.natural_frequency_bound, &many.damping_ratio_bound}) {
    values->resize(15);
  }
  many.label.resize(15);
  many.kind.resize(15);
  many.eigenvalue_real.resize(15, {0, 0});
  many.eigenvalue_imag.resize(15, {0, 0});
  many.shape_real.resize(15, std::vector<double>(7));
  many.shape_imag.resize(15, std::vector<double>(7));
  EXPECT_FALSE(decodes(bytes_of(many), message));
}

TEST(CommandCheck, ReadsTheSenderFromTheFirstBytes) {
  Random random(917);
  command_t message = random_command(random, 7);
  for (const std::int64_t sender :
       {std::int64_t{1}, std::int64_t{-2}, kSender, std::numeric_limits<std::int64_t>::min()}) {
    message.sender = sender;
    const Bytes bytes = bytes_of(message);
    for (std::size_t size = 0; size <= 40; ++size) {
      const Exact exact(Bytes(bytes.data(), bytes.data() + size));
      std::int64_t read = 0;
      EXPECT_EQ(read_sender(exact.data(), size, read), size >= 20) << size;
      EXPECT_EQ(read, size >= 20 ? sender : 0);
    }
  }
  Bytes foreign = bytes_of(message);
  foreign[3] ^= 1;
  std::int64_t read = 0;
  EXPECT_FALSE(read_sender(foreign.data(), foreign.size(), read));
  EXPECT_FALSE(read_sender(nullptr, 100, read));
}

/// Changes some bytes, favouring the header; cuts; lengthens.
Bytes mutated(Random& random, Bytes bytes) {
  const auto byte = [&random] { return static_cast<std::uint8_t>(random.integer(0, 255)); };
  for (int k = random.integer(1, 4); k > 0 && bytes.size() > 8; --k) {
    const int size = static_cast<int>(bytes.size()), kind = random.integer(0, 4);
    if (kind == 0) {
      bytes.resize(static_cast<std::size_t>(random.integer(1, size + 40)), byte());
    } else {
      const int first = kind < 3 ? 8 : 0, end = kind < 3 ? std::min(size, 28) : size;
      bytes[static_cast<std::size_t>(random.integer(first, end - 1))] = byte();
    }
  }
  return bytes;
}

TYPED_TEST(MessageCheck, SurvivesRandomMutations) {
  constexpr std::uint64_t kSeed = 916;
  constexpr int kCases = 20'000;
  Random random(kSeed);
  int good = 0;
  TypeParam message;
  Bytes original;
  for (int i = 0; i < kCases; ++i) {
    if (i % 20 == 0) {
      original = bytes_of(random_message<TypeParam>(random, random.integer(1, 16)));
    }
    const Bytes bytes = mutated(random, original);
    if (!decodes(bytes, message)) continue;
    ++good;
    if constexpr (!std::is_same_v<TypeParam, contact_t>) {
      ASSERT_GE(message.n, 1);
      ASSERT_LE(message.n, controller::kMaxJoints);
    }
    ASSERT_EQ(bytes_of(message), bytes) << "case " << i;  // nothing was added or left out
  }
  std::printf("seed %llu: %d cases, %d still well-formed\n", static_cast<unsigned long long>(kSeed),
              kCases, good);
  EXPECT_GT(good, kCases / 100);
  EXPECT_LT(good, kCases);
}

}  // namespace
}  // namespace dashpot::lcmtypes
