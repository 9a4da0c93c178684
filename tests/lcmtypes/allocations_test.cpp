// The real-time side allocates nothing, and bytes of unknown origin cause no large allocation.
#include <dashpot/lcmtypes/command_receiver.hpp>
#include <dashpot/lcmtypes/message_check.hpp>
#include <dashpot/lcmtypes/publisher.hpp>
#include <dashpot/tests/lcmtypes/random_samples.hpp>
#include <dashpot/tests/support/count_allocations.hpp>

#include <gtest/gtest.h>

#include <limits>

namespace dashpot::lcmtypes {
namespace {

using testing::allocations_of;
using testing::largest_allocation;

TEST(Allocations, AreSeenByThisTest) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  EXPECT_EQ(allocations_of([] {}), 0);
  EXPECT_EQ(allocations_of([] { ::operator delete(::operator new(8000)); }), 1);
  EXPECT_EQ(largest_allocation, 8000u);
}

TEST(Allocations, DoNotHappenWhereSamplesAreOffered) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  Random random(981);
  PublisherOptions options;
  options.queue = 10;
  Publisher publisher({}, options);
  for (int n = 1; n <= controller::kMaxJoints; ++n) {
    const StateSample state = random_state(random, n);
    const ModesSample modes = random_modes(random, n);
    const int seen = allocations_of([&] {
      for (int i = 0; i < 20; ++i) {  // more than fit
        publisher.offer(state);
        publisher.offer(modes);
      }
    });
    EXPECT_EQ(seen, 0);
    publisher.publish_pending();
  }
}

TEST(Allocations, DoNotHappenWhereCommandsAreFetched) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  Random random(982);
  CommandFilter filter(limits_for(7));
  const Bytes bytes = bytes_of(random_command(random, 7));
  ASSERT_EQ(filter.judge(bytes.data(), bytes.size(), kNow, 0), CommandVerdict::kAccepted);
  controller::Latest<Command> slot;
  controller::Setpoint setpoint;
  const int seen = allocations_of([&] {
    slot.write(filter.command());
    EXPECT_TRUE(slot.fetch());
    apply(slot.value(), setpoint);
  });
  EXPECT_EQ(seen, 0);
  EXPECT_EQ(setpoint.joint_position.size(), 7);
}

/// Decodes bytes of which this place states another size.
template <class Message>
void expect_few_allocations(Bytes bytes, std::size_t offset, std::int32_t size) {
  write_int32(bytes, offset, size);
  const int count = allocations_of([&bytes] {
    Message message;
    EXPECT_FALSE(decode(bytes.data(), bytes.size(), message));
  });
  EXPECT_LE(count, 100) << size;
  EXPECT_LE(largest_allocation, 1024u) << size;
}

TEST(Allocations, StaySmallWhateverTheSizesInAMessageSay) {
  if (!DASHPOT_COUNTS_ALLOCATIONS) GTEST_SKIP() << "the sanitizer owns malloc";
  Random random(983);
  const Bytes state = bytes_of(message_of<state_t>(random_state(random, 7)));
  ModesSample some = random_modes(random, 7);
  while (some.vibration.count == 0) some = random_modes(random, 7);  // of which 0 were the size
  const Bytes modes = bytes_of(message_of<modes_t>(some));
  const Bytes command = bytes_of(random_command(random, 7));
  for (const std::int32_t size : {-1, 0, 17, 40'000, 1 << 24, std::numeric_limits<int>::max(),
                                  std::numeric_limits<int>::min()}) {
    expect_few_allocations<state_t>(state, 8, size);
    expect_few_allocations<modes_t>(modes, 8, size);
    expect_few_allocations<modes_t>(modes, 12, size);
    expect_few_allocations<command_t>(command, 8, size);
  }
}

}  // namespace
}  // namespace dashpot::lcmtypes
