// The real-time side allocates nothing, and bytes of unknown origin make nobody allocate much.
#include <dashpot/lcmtypes/command_receiver.hpp>
#include <dashpot/lcmtypes/messages/message_check.hpp>
#include <dashpot/lcmtypes/publisher.hpp>
#include <dashpot/tests/lcmtypes/allocations.hpp>
#include <dashpot/tests/lcmtypes/random_samples.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <new>

namespace dashpot::lcmtypes {

Allocations& allocations() noexcept {
  constinit thread_local Allocations all;
  return all;
}

}  // namespace dashpot::lcmtypes

#if !DASHPOT_SANITIZED  // for the whole program; inlined, g++ 12 takes them for a mismatch
[[gnu::noinline]] void* operator new(std::size_t size) {
  dashpot::lcmtypes::Allocations& all = dashpot::lcmtypes::allocations();
  ++all.count;
  all.largest = std::max(all.largest, size);
  if (void* block = std::malloc(size)) return block;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* block) noexcept {
  std::free(block);
}
[[gnu::noinline]] void operator delete(void* block, std::size_t /*size*/) noexcept {
  std::free(block);
}
#endif

namespace dashpot::lcmtypes {
namespace {

TEST(Allocations, AreSeenByThisTest) {
  if (DASHPOT_SANITIZED) GTEST_SKIP() << "the sanitizer owns operator new";
  EXPECT_EQ(allocations_of([] {}).count, 0);
  const Allocations seen = allocations_of([] { ::operator delete(::operator new(8000)); });
  EXPECT_EQ(seen.count, 1);
  EXPECT_EQ(seen.largest, 8000u);
}

TEST(Allocations, DoNotHappenWhereSamplesAreOffered) {
  if (DASHPOT_SANITIZED) GTEST_SKIP() << "the sanitizer owns operator new";
  Random random(981);
  PublisherOptions options;
  options.queue = 10;
  Publisher publisher({}, options);
  for (int n = 1; n <= controller::kMaxJoints; ++n) {
    const StateSample state = random_state(random, n);
    const ModesSample modes = random_modes(random, n);
    const Allocations seen = allocations_of([&] {
      for (int i = 0; i < 20; ++i) {  // more than there is room for
        publisher.offer(state);
        publisher.offer(modes);
      }
    });
    EXPECT_EQ(seen.count, 0);
    publisher.publish_pending();
  }
}

TEST(Allocations, DoNotHappenWhereCommandsAreFetched) {
  if (DASHPOT_SANITIZED) GTEST_SKIP() << "the sanitizer owns operator new";
  Random random(982);
  CommandFilter filter(limits_for(7));
  const Bytes bytes = bytes_of(random_command(random, 7));
  ASSERT_EQ(filter.judge(bytes.data(), bytes.size(), kNow, 0), CommandVerdict::kAccepted);
  controller::Latest<Command> slot;
  controller::Setpoint setpoint;
  const Allocations seen = allocations_of([&] {
    slot.write(filter.command());
    EXPECT_TRUE(slot.fetch());
    apply(slot.value(), setpoint);
  });
  EXPECT_EQ(seen.count, 0);
  EXPECT_EQ(setpoint.joint_position.size(), 7);
}

template <class Message>
Allocations allocations_of_decoding(Bytes bytes, std::size_t offset, std::int32_t size) {
  write_int32(bytes, offset, size);
  return allocations_of([&bytes] {
    Message message;
    EXPECT_FALSE(decode(bytes.data(), bytes.size(), message));
  });
}

TEST(Allocations, StaySmallWhateverTheSizesInAMessageSay) {
  if (DASHPOT_SANITIZED) GTEST_SKIP() << "the sanitizer owns operator new";
  Random random(983);
  const Bytes state = bytes_of(message_of<state_t>(random_state(random, 7)));
  ModesSample some = random_modes(random, 7);
  while (some.vibration.count == 0) some = random_modes(random, 7);  // of which 0 were the size
  const Bytes modes = bytes_of(message_of<modes_t>(some));
  const Bytes command = bytes_of(random_command(random, 7));
  for (const std::int32_t size : {-1, 0, 17, 40'000, 1 << 24, std::numeric_limits<int>::max(),
                                  std::numeric_limits<int>::min()}) {
    for (const Allocations& seen : {allocations_of_decoding<state_t>(state, 8, size),
                                    allocations_of_decoding<modes_t>(modes, 8, size),
                                    allocations_of_decoding<modes_t>(modes, 12, size),
                                    allocations_of_decoding<command_t>(command, 8, size)}) {
      EXPECT_LE(seen.largest, 1024u) << size;
      EXPECT_LE(seen.count, 100) << size;
    }
  }
}

}  // namespace
}  // namespace dashpot::lcmtypes
