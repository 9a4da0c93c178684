// Rotors, delay, gravity and links from records of arms in MuJoCo, whose truth is known.
#include <dashpot/identification/check_model.hpp>
#include <dashpot/tests/support/moved_arm.hpp>
#include <dashpot/tests/support/sanitized.hpp>

#include <gmock/gmock.h>

namespace dashpot::identification {
namespace {

using ::testing::Contains;
using testing::Dice;
using ::testing::HasSubstr;
using testing::MovedArm;

/// A UR5 at 250 Hz, for 10 s.
MovedArm short_record(Dice& dice) {
  MovedArm arm(testing::arms()[2], dice);
  arm.duration = 10;
  arm.rate = 250;
  arm.bits = 17;
  arm.delay = 2;
  arm.torque_noise = 0.05;
  return arm;
}

/// Expects what a regression of a right model finds. Returns how many intervals hold.
int expect_found(const ModelCheck& check, const MovedArm& arm) {
  int inside = 0;
  for (Eigen::Index j = 0; j < arm.n; ++j) {
    const JointCheck& joint = check.joints[static_cast<std::size_t>(j)];
    EXPECT_TRUE(joint.reflected_inertia.determined) << j;
    for (const auto& [one, truth] : {std::pair(joint.reflected_inertia, arm.rotors[j]),
                                     std::pair(joint.coulomb_friction, arm.coulomb[j]),
                                     std::pair(joint.viscous_friction, arm.viscous[j]),
                                     std::pair(joint.offset, arm.offset[j])}) {
      inside += std::abs(one.value - truth) < 1.96 * one.deviation ? 1 : 0;
      EXPECT_NEAR(one.value, truth, 5 * one.deviation) << j;
    }
    EXPECT_NEAR(joint.reflected_inertia.value, arm.rotors[j], 0.1 * arm.rotors[j]);
    EXPECT_GT(joint.explained_after, 0.99);
    EXPECT_LT(joint.explained_before, joint.explained_after);
  }
  constexpr double kQuarterTick = 2.5e-4;
  EXPECT_TRUE(check.delay.determined);
  EXPECT_NEAR(check.delay.value, arm.delay_in_record(), kQuarterTick);
  EXPECT_NEAR(check.payload.mass.value, arm.payload.mass, 0.05);
  return inside;
}

class Calibrate : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!testing::MujocoArm::available()) GTEST_SKIP() << "this build has no MuJoCo";
  }
  static ModelCheck check(const MovedArm& arm, Dice& dice, bool payload_known = false) {
    return check_model(arm.description, {arm.record(dice)}, {0.2, payload_known});
  }
};

TEST_F(Calibrate, FindsRotorsFrictionAndDelay) {
  Dice dice(11);
  MovedArm arm = short_record(dice);
  arm.payload = {0.8, {0.02, -0.01, 0.05}, 0.001 * Eigen::Matrix3d::Identity()};
  const ModelCheck found = check(arm, dice);
  EXPECT_GE(expect_found(found, arm), 20) << "of 24";
  EXPECT_FALSE(found.gravity);
  EXPECT_EQ(found.rank, found.parameters);
  EXPECT_NEAR(found.validation, 0.2 * found.used, 1e-9);
}

TEST_F(Calibrate, TellsTorquesThatCameLate) {
  Dice dice(12);
  MovedArm arm = short_record(dice);
  arm.recorded_late = 0.02;
  EXPECT_GE(expect_found(check(arm, dice), arm), 20) << "of 24";
}

TEST_F(Calibrate, TellsABaseThatIsInclined) {
  DASHPOT_SKIP_IF_QUICK();
  Dice dice(13);
  MovedArm arm = short_record(dice);
  arm.gravity = 9.81 * Eigen::Vector3d(0.06, -0.06, -0.9964).normalized();
  const ModelCheck found = check(arm, dice);
  EXPECT_GE(expect_found(found, arm), 20) << "of 24";
  ASSERT_TRUE(found.gravity);
  EXPECT_LT((*found.gravity - arm.gravity).norm(), 0.02);
  EXPECT_TRUE(found.gravity_fits);
  EXPECT_LT(found.gravity_deviation, 1e-3);
}

TEST_F(Calibrate, TellsALinkFromAPayload) {
  DASHPOT_SKIP_IF_QUICK();
  Dice dice(14);
  MovedArm arm = short_record(dice);
  arm.make_heavier(3, 0.25);
  const ModelCheck found = check(arm, dice);
  EXPECT_GE(expect_found(found, arm), 20) << "of 24";
  EXPECT_THAT(found.joints[3].suspicious, HasSubstr("the mass of link 'wrist_1_link' is 0.3"));
  // So noisy and short that either may be.
  arm.torque_noise = 1.5;
  arm.rate = 100;
  const ModelCheck unsure = check(arm, dice);
  EXPECT_THAT(unsure.ambiguities, Contains(HasSubstr("link or payload")));
  EXPECT_FALSE(unsure.payload.mass.determined);
}

TEST_F(Calibrate, SaysWhatIsNotDeterminedAndWhichMotionWouldTell) {
  Dice dice(15);
  MovedArm arm = short_record(dice);
  arm.speed = 0.2;
  arm.torque_noise = 2;
  const ModelCheck found = check(arm, dice);
  const JointCheck& wrist = found.joints[5];
  EXPECT_FALSE(wrist.reflected_inertia.determined);
  EXPECT_THAT(wrist.wanted, HasSubstr("reflected inertia"));
  EXPECT_THAT(wrist.wanted, HasSubstr("accelerate"));
  EXPECT_NEAR(wrist.reflected_inertia.value, arm.rotors[5], 4 * wrist.reflected_inertia.deviation);
  arm.payload.mass = 0.5;  // which is then taken for known
  EXPECT_LT(check(arm, dice, true).payload.mass.deviation, 1e-6);
}

}  // namespace
}  // namespace dashpot::identification
