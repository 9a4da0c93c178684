// The messages of the public drivers: their fingerprints, and bytes of unknown origin.
#include <dashpot/lcmtypes/driver.hpp>
#include <dashpot/lcmtypes/lcmt_iiwa_command.hpp>
#include <dashpot/lcmtypes/lcmt_iiwa_status.hpp>
#include <dashpot/lcmtypes/lcmt_panda_command.hpp>
#include <dashpot/lcmtypes/lcmt_panda_status.hpp>
#include <dashpot/tests/lcmtypes/random_samples.hpp>

#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <memory>

namespace dashpot::lcmtypes {
namespace {

using controller::JointVector;

constexpr DriverKind kKinds[] = {DriverKind::kIiwa, DriverKind::kPanda};

/// The hashes in the code that drake's build generates, turned by a bit as on the wire.
TEST(Driver, HasTheFingerprintsOfThePublicMessages) {
  const auto turned = [](std::uint64_t base) {
    return static_cast<std::int64_t>(std::rotl(base, 1));
  };
  EXPECT_EQ(drake::lcmt_iiwa_command::getHash(), turned(0x6ee3e3b9c640a99a));
  EXPECT_EQ(drake::lcmt_iiwa_status::getHash(), turned(0xf8b7dc0214255e51));
  EXPECT_EQ(drake::lcmt_panda_command::getHash(), turned(0x7346fbbb8026ace8));
  EXPECT_EQ(drake::lcmt_panda_status::getHash(), turned(0x0cab8e6fa6c17d73));
}

JointVector some(testing::Random& random, int n) {
  JointVector values(n);
  for (double& value : values) value = random.uniform(-3, 3);
  return values;
}

template <class Message>
bool decodes(DriverKind kind, const Bytes& bytes, Message& message) {
  return decode(kind, Exact(bytes).data(), bytes.size(), message);
}

DriverStatus random_status(testing::Random& random, int n) {
  DriverStatus status;
  status.utime = 123456789;
  for (JointVector* part :
       {&status.position, &status.velocity, &status.commanded, &status.torque, &status.external}) {
    *part = some(random, n);
  }
  status.robot_mode = 5;
  status.success_rate = 0.75;
  return status;
}

TEST(Driver, GivesBackWhatWasEncoded) {
  testing::Random random(20);
  for (const DriverKind kind : kKinds) {
    for (int n = 1; n <= controller::kMaxJoints; ++n) {
      const DriverStatus status = random_status(random, n);
      Bytes bytes;
      encode(kind, status, bytes);
      DriverStatus back;
      ASSERT_TRUE(decodes(kind, bytes, back));
      EXPECT_EQ(back.utime, status.utime);
      EXPECT_EQ(back.position, status.position);
      EXPECT_EQ(back.velocity, status.velocity);
      EXPECT_EQ(back.commanded, kind == DriverKind::kIiwa ? status.commanded : JointVector());
      EXPECT_EQ(back.torque, status.torque);
      EXPECT_EQ(back.external, status.external);
      EXPECT_EQ(back.robot_mode, kind == DriverKind::kPanda ? 5 : 0);
      EXPECT_EQ(back.success_rate, kind == DriverKind::kPanda ? 0.75 : 1);
      const DriverCommand command{42, n % 2 == 0 ? some(random, n) : JointVector(), some(random, n),
                                  2};
      encode(kind, command, bytes);
      DriverCommand order;
      ASSERT_TRUE(decodes(kind, bytes, order));
      EXPECT_EQ(order.utime, 42);
      EXPECT_EQ(order.position, command.position);
      EXPECT_EQ(order.torque, command.torque);
      EXPECT_EQ(order.control_mode, kind == DriverKind::kPanda ? 2 : 4);
    }
  }
}

TEST(Driver, RefusesBytesOfAnotherSize) {
  testing::Random random(21);
  for (const DriverKind kind : kKinds) {
    Bytes bytes;
    DriverStatus status = random_status(random, 7);
    DriverCommand command{1, status.position, status.torque, 4};
    for (const bool of_status : {true, false}) {
      of_status ? encode(kind, status, bytes) : encode(kind, command, bytes);
      const auto fits = [&](const Bytes& some_bytes) {
        return of_status ? decodes(kind, some_bytes, status) : decodes(kind, some_bytes, command);
      };
      EXPECT_TRUE(fits(bytes));
      for (std::size_t size = 0; size < bytes.size(); ++size) {
        EXPECT_FALSE(fits(Bytes(bytes.begin(), bytes.begin() + static_cast<long>(size))));
      }
      Bytes longer = bytes;
      longer.push_back(0);
      EXPECT_FALSE(fits(longer));
      for (const std::int32_t joints : {-1, 0, 6, 8, 17, 1 << 30}) {
        Bytes other = bytes;  // the number of joints follows the fingerprint and utime
        write_int32(other, 16, joints);
        EXPECT_FALSE(fits(other)) << joints;
      }
      Bytes other = bytes;
      other[3] ^= 1;
      EXPECT_FALSE(fits(other));
    }
    DriverStatus empty;
    EXPECT_FALSE(decode(kind, nullptr, 0, empty));
  }
}

}  // namespace
}  // namespace dashpot::lcmtypes
