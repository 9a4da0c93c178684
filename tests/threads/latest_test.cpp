#include <dashpot/controller/latest.hpp>

#include <gtest/gtest.h>

#include <array>
#include <thread>

namespace dashpot::controller {
namespace {

TEST(Latest, HandsOverTheLatestOnce) {
  Latest<int> slot;
  EXPECT_FALSE(slot.fetch());
  EXPECT_EQ(slot.value(), 0);
  slot.write(1);
  slot.write(2);
  EXPECT_TRUE(slot.fetch());
  EXPECT_EQ(slot.value(), 2);
  EXPECT_FALSE(slot.fetch());
  EXPECT_EQ(slot.value(), 2);
  slot.write(3);
  EXPECT_EQ(slot.value(), 2);  // until it is fetched
  EXPECT_TRUE(slot.fetch());
  EXPECT_EQ(slot.value(), 3);
}

TEST(Latest, NeverShowsHalfAValueNorGoesBack) {
  using Value = std::array<std::uint64_t, 100>;
  Latest<Value> slot;
  constexpr std::uint64_t kLast = 100'000;
  std::thread writer([&] {
    Value value{};
    for (std::uint64_t k = 1; k <= kLast; ++k) {
      value.fill(k);
      slot.write(value);
    }
  });
  std::uint64_t last = 0;
  while (last < kLast) {
    if (!slot.fetch()) {
      std::this_thread::yield();
      continue;
    }
    const Value& value = slot.value();
    ASSERT_GT(value[0], last);
    for (const std::uint64_t entry : value) ASSERT_EQ(entry, value[0]);
    last = value[0];
  }
  writer.join();
}

}  // namespace
}  // namespace dashpot::controller
