// Records of torques beside a model, with known truth.
#include <dashpot/identification/check_model.hpp>
#include <dashpot/tests/support/arms.hpp>
#include <dashpot/tests/support/random.hpp>
#include <dashpot/tests/support/sanitized.hpp>
#include <dashpot/tests/support/scratch.hpp>
#include <dashpot/tests/support/torque_record.hpp>

#include <gmock/gmock.h>

#include <fstream>
#include <sstream>

namespace dashpot::identification {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::RecordedArm;

controller::RobotDescription description_of(const testing::Arm& arm) {
  return {testing::arm_path(arm.file), arm.base, arm.tip, {}};
}

/// A Panda with a payload of 1.3 kg that its description does not have.
RecordedArm loaded_panda() {
  RecordedArm arm(description_of(testing::arms()[0]));
  arm.center.resize(7);
  arm.center << 0.2, -0.4, 0.3, -1.9, 0.1, 1.7, 0.6;
  arm.offset << 0.3, -0.5, 0.2, 0.6, -0.1, 0.05, 0.02;
  arm.coulomb << 0.8, 1.0, 0.6, 0.9, 0.4, 0.3, 0.2;
  arm.viscous << 0.5, 0.8, 0.3, 0.6, 0.2, 0.1, 0.05;
  arm.description.options.payload = {1.3, {0.02, -0.03, 0.05}, Eigen::Matrix3d::Identity() * 0.003};
  arm.duration = 12;
  arm.rate = 250;
  return arm;
}

controller::RobotDescription panda() {
  return description_of(testing::arms()[0]);
}

/// Number of fitted parameters within `deviations` of the truth, and of all.
std::pair<int, int> inside(const ModelCheck& check, const RecordedArm& arm, double deviations) {
  int within = 0, all = 0;
  const auto count = [&](const Estimate& one, double truth) {
    ++all;
    within += std::abs(one.value - truth) < deviations * one.deviation ? 1 : 0;
  };
  for (std::size_t j = 0; j < check.joints.size(); ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    count(check.joints[j].offset, arm.offset[i]);
    count(check.joints[j].coulomb_friction, arm.coulomb[i]);
    count(check.joints[j].viscous_friction, arm.viscous[i]);
  }
  const controller::Payload& payload = arm.description.options.payload;
  count(check.payload.mass, payload.mass);
  for (std::size_t i = 0; i < 3; ++i) {
    count(check.payload.center[i], payload.center[static_cast<Eigen::Index>(i)]);
  }
  return {within, all};
}

void expect_loaded_panda(const ModelCheck& check, double mass, double center) {
  EXPECT_NEAR(check.payload.mass.value, 1.3, mass);
  EXPECT_TRUE(check.payload.mass.determined);
  const Eigen::Vector3d truth(0.02, -0.03, 0.05);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(check.payload.center[i].value, truth[static_cast<Eigen::Index>(i)], center);
    EXPECT_TRUE(check.payload.center[i].determined);
  }
}

void expect_no_doubt(const ModelCheck& check) {
  EXPECT_THAT(check.order, IsEmpty());
  for (const JointCheck& joint : check.joints) EXPECT_EQ(joint.suspicious, "");
}

TEST(CheckModel, LeavesNothingOverOfTheDynamicsOfAnotherLibrary) {
  for (const testing::Arm& one : testing::arms()) {
    SCOPED_TRACE(one.file);
    RecordedArm arm(description_of(one));
    arm.position_noise = arm.torque_noise = 0;
    arm.slowest = 0.3;  // so that M and C matter beside g
    arm.duration = 5;
    const TorqueRecord record = arm.record(1);
    const ModelCheck check = check_model(arm.description, {record});
    for (std::size_t j = 0; j < check.joints.size(); ++j) {
      const double size = std::sqrt(record.torque.row(static_cast<Eigen::Index>(j)).squaredNorm() /
                                    static_cast<double>(record.time.size()));
      EXPECT_LT(check.joints[j].residual_before, 1e-3 * size + 1e-3) << j;
    }
    EXPECT_EQ(check.kind, TorqueKind::kWhole);
    expect_no_doubt(check);
  }
}

TEST(CheckModel, FindsFrictionOffsetsAndPayload) {
  const RecordedArm arm = loaded_panda();
  const ModelCheck check = check_model(panda(), {arm.record(1)});
  expect_loaded_panda(check, 0.005, 0.002);
  expect_no_doubt(check);
  for (std::size_t j = 0; j < 7; ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    EXPECT_NEAR(check.joints[j].offset.value, arm.offset[i], 0.02);
    EXPECT_NEAR(check.joints[j].coulomb_friction.value, arm.coulomb[i], 0.02);
    EXPECT_NEAR(check.joints[j].viscous_friction.value, arm.viscous[i], 0.03);
    EXPECT_TRUE(check.joints[j].coulomb_friction.determined);
    EXPECT_LT(check.joints[j].residual_after, 0.02);
    EXPECT_GT(check.joints[j].residual_before, 0.2);
  }
}

TEST(CheckModel, HoldsItsIntervalsInColouredNoise) {
  DASHPOT_SKIP_IF_QUICK();
  RecordedArm arm = loaded_panda();
  arm.slow_noise = 0.15;
  int within = 0, all = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const auto [in, of] = inside(check_model(panda(), {arm.record(seed)}), arm, 1.96);
    within += in;
    all += of;
  }
  EXPECT_GE(within, 0.88 * all) << within << " of " << all << ", seeds 1 to 6";
}

TEST(CheckModel, TakesCoarseEncodersAndSlowSampling) {
  RecordedArm arm = loaded_panda();
  arm.quantum = 1.5e-3;  // rad, a turn in 4096 steps
  arm.rate = 100;
  ModelCheck check = check_model(panda(), {arm.record(2)});
  expect_loaded_panda(check, 0.01, 0.003);
  expect_no_doubt(check);
  arm.rate = 1000;
  arm.slowest = 0.03;
  check = check_model(panda(), {arm.record(3)});
  expect_loaded_panda(check, 0.02, 0.005);
  expect_no_doubt(check);
}

TEST(CheckModel, TakesGapsMissingAndRepeatedSamples) {
  const RecordedArm arm = loaded_panda();
  TorqueRecord record = arm.record(4);
  const double missing = std::numeric_limits<double>::quiet_NaN();
  testing::Dice dice(4);
  for (Eigen::Index i = 0; i < record.time.size(); ++i) {
    if (i % 37 == 5) record.position(2, i) = missing;
    if (i % 41 == 7) record.torque(4, i) = missing;
    if (i > 1000) record.time[i] += 3;  // somebody paused the recorder
    record.time[i] += 5e-4 * dice.uniform(0, 1);
  }
  // Written four times as fast as the robot reports.
  const Eigen::Index N = record.time.size();
  TorqueRecord held{Eigen::VectorXd(4 * N), Eigen::MatrixXd(7, 4 * N), Eigen::MatrixXd(7, 4 * N)};
  for (Eigen::Index i = 0; i < 4 * N; ++i) {
    held.time[i] = record.time[i / 4] + 1e-4 + 7e-4 * static_cast<double>(i % 4);
    held.position.col(i) = record.position.col(i / 4);
    held.torque.col(i) = record.torque.col(i / 4);
  }
  for (const TorqueRecord& one : {record, held}) {
    const ModelCheck check = check_model(panda(), {one});
    expect_loaded_panda(check, 0.01, 0.003);
    expect_no_doubt(check);
    EXPECT_LT(check.used, 13);
  }
}

TEST(CheckModel, TakesPositionsThatComeMoreRarelyThanTorques) {
  RecordedArm arm = loaded_panda();
  arm.rate = 1000;
  arm.slowest = 0.2;
  TorqueRecord record = arm.record(18);
  for (Eigen::Index i = 0; i < record.time.size(); ++i) {
    if (i % 10 > 0) record.position.col(i) = record.position.col(i - 1);
  }
  const ModelCheck check = check_model(panda(), {record});
  expect_loaded_panda(check, 0.01, 0.003);
  // Positions that are taken to be as old as their repetitions lag by 4.5 ms.
  for (const JointCheck& joint : check.joints) EXPECT_LT(joint.residual_after, 0.04);
}

TEST(CheckModel, LeavesOutAContact) {
  RecordedArm arm = loaded_panda();
  arm.contact_from = 5;
  arm.contact_to = 7;
  const ModelCheck check = check_model(panda(), {arm.record(5)});
  expect_loaded_panda(check, 0.01, 0.003);
  expect_no_doubt(check);
  ASSERT_EQ(check.contacts.size(), 1U);
  EXPECT_NEAR(check.contacts[0].from, 5, 0.3);
  EXPECT_NEAR(check.contacts[0].to, 7, 0.3);
}

TEST(CheckModel, SaysWhichPartOfTheModelTheTorquesContain) {
  DASHPOT_SKIP_IF_QUICK();
  RecordedArm arm = loaded_panda();
  EXPECT_EQ(check_model(panda(), {arm.record(6)}).kind, TorqueKind::kWhole);
  arm.without_gravity = true;
  ModelCheck check = check_model(panda(), {arm.record(6)});
  EXPECT_EQ(check.kind, TorqueKind::kWithoutGravity);
  expect_loaded_panda(check, 0.01, 0.003);
  expect_no_doubt(check);
  arm.without_gravity = false;
  arm.external_only = true;
  check = check_model(panda(), {arm.record(6)});
  EXPECT_EQ(check.kind, TorqueKind::kExternal);
  expect_loaded_panda(check, 0.01, 0.003);
  expect_no_doubt(check);
}

TEST(CheckModel, TellsHowAnArmHangs) {
  RecordedArm arm = loaded_panda();
  for (const Eigen::Vector3d& gravity :
       {Eigen::Vector3d(0, 0, 9.81), Eigen::Vector3d(-9.81, 0, 0)}) {
    arm.description.options.gravity = gravity;
    const ModelCheck check = check_model(panda(), {arm.record(4)});
    ASSERT_TRUE(check.gravity);
    EXPECT_EQ(*check.gravity, gravity);
    EXPECT_TRUE(check.gravity_fits);
    expect_loaded_panda(check, 0.02, 0.004);
    expect_no_doubt(check);
  }
  arm.description.options.gravity = 9.81 * Eigen::Vector3d(0, 0.5, std::sqrt(0.75));
  const ModelCheck inclined = check_model(panda(), {arm.record(4)});
  ASSERT_TRUE(inclined.gravity);
  EXPECT_LT((*inclined.gravity - arm.description.options.gravity).norm(), 0.01);
  EXPECT_TRUE(inclined.gravity_fits);
  expect_loaded_panda(inclined, 0.02, 0.004);
  expect_no_doubt(inclined);
}

TEST(CheckModel, NamesExchangedColumnsAndWrongSigns) {
  const TorqueRecord right = loaded_panda().record(7);
  TorqueRecord record = right;
  record.torque.row(3) *= -1;
  ModelCheck check = check_model(panda(), {record});
  EXPECT_THAT(check.order,
              ElementsAre("the torques of joint 4 fit far better with the opposite sign"));
  EXPECT_THAT(check.joints[3].suspicious, HasSubstr("turned around"));
  EXPECT_EQ(check.joints[0].suspicious, "");
  record = right;
  record.position.row(3) *= -1;
  check = check_model(panda(), {record});
  EXPECT_THAT(check.order,
              ElementsAre("the positions of joint 4 fit far better with the opposite sign"));
  record = right;
  record.torque.row(1).swap(record.torque.row(3));
  check = check_model(panda(), {record});
  EXPECT_THAT(check.order, ElementsAre("the columns of torques fit far better in the order 1, 4, "
                                       "3, 2, 5, 6, 7"));
  record.position.row(1).swap(record.position.row(3));
  check = check_model(panda(), {record});
  EXPECT_THAT(check.order, ElementsAre(HasSubstr("positions fit far better in the order 1, 4, 3"),
                                       HasSubstr("torques fit far better in the order 1, 4, 3")));
  record = right;
  record.torque *= -1;
  check = check_model(panda(), {record});
  EXPECT_THAT(check.order,
              ElementsAre("the torques of all joints fit far better with the opposite sign"));
}

/// The Panda's description with another mass of a link, in a file.
controller::RobotDescription with_mass(const tests::Scratch& scratch, const std::string& link,
                                       double factor) {
  std::ifstream file(panda().urdf);
  std::stringstream text;
  text << file.rdbuf();
  std::string urdf = text.str();
  auto at = urdf.find("<link name=\"" + link + "\"");
  at = urdf.find("<mass value=\"", at) + 13;
  const auto end = urdf.find('"', at);
  urdf.replace(at, end - at, std::to_string(factor * std::stod(urdf.substr(at, end - at))));
  controller::RobotDescription robot = panda();
  robot.urdf = scratch.write("panda.urdf", urdf);
  robot.options.accept_inertias = true;
  return robot;
}

TEST(CheckModel, NamesAWrongLinkAndAMissingRotor) {
  DASHPOT_SKIP_IF_QUICK();
  const tests::Scratch scratch;
  RecordedArm arm = loaded_panda();
  arm.description.options.payload = {};
  arm.slow_noise = 0.05;
  ModelCheck check = check_model(with_mass(scratch, "panda_link3", 1.3), {arm.record(8)});
  EXPECT_THAT(check.joints[2].suspicious, HasSubstr("the mass of link 'panda_link3' is 0.9"));
  EXPECT_THAT(check.joints[2].suspicious, HasSubstr("less than the model says"));
  EXPECT_NEAR(check.joints[1].coulomb_friction.value, 1.0, 0.1);

  arm.description.options.reflected_inertia = Eigen::VectorXd::Zero(7);
  arm.description.options.reflected_inertia[1] = 0.6;
  check = check_model(panda(), {arm.record(9)});
  EXPECT_THAT(check.joints[1].suspicious, HasSubstr("reflected inertia is 0.6"));
  EXPECT_THAT(check.joints[0].suspicious, IsEmpty());

  TorqueRecord record = loaded_panda().record(10);
  record.torque.row(3) *= 1.15;
  check = check_model(panda(), {record});
  EXPECT_THAT(check.joints[3].suspicious, HasSubstr("its torque reads 1"));
  // Lighter than the model at its end: no payload has a negative mass.
  arm.description = panda();
  check = check_model(with_mass(scratch, "panda_link7", 2), {arm.record(11)});
  EXPECT_THAT(check.joints[6].suspicious, HasSubstr("negative mass"));
}

TEST(CheckModel, SaysWhatTheRecordsCannotTell) {
  RecordedArm arm = loaded_panda();
  arm.amplitude = 0.03;  // at one posture
  arm.slowest = 0.5;
  const ModelCheck check = check_model(panda(), {arm.record(12)});
  EXPECT_THAT(check.ambiguities, ::testing::Contains(HasSubstr("tell apart")));
  const auto [within, all] = inside(check, arm, 3.5);
  EXPECT_GE(within, all - 1);

  TorqueRecord record = loaded_panda().record(13);
  record.position.row(0).setConstant(record.position(0, 0));
  const ModelCheck rests = check_model(panda(), {record});
  EXPECT_FALSE(rests.joints[0].moves);
  EXPECT_FALSE(rests.joints[0].coulomb_friction.determined);
  EXPECT_THAT(rests.ambiguities, ::testing::Contains(HasSubstr("joint 1 hardly moves")));
}

TEST(CheckModel, RefusesWhatIsNoRecord) {
  const auto refusal = [](const TorqueRecord& record) {
    try {
      check_model(panda(), {record});
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  RecordedArm arm = loaded_panda();
  arm.duration = 1;
  EXPECT_THAT(refusal(arm.record(14)), HasSubstr("s without gaps, need 2 s or more"));
  TorqueRecord record = arm.record(15);
  record.time[7] = record.time[6];
  EXPECT_THAT(refusal(record), HasSubstr("rise (sample 8)"));
  record = arm.record(16);
  record.torque.conservativeResize(6, Eigen::NoChange);
  EXPECT_THAT(refusal(record), HasSubstr("7 rows"));
  arm.duration = 5;
  arm.amplitude = 0;
  EXPECT_THAT(refusal(arm.record(17)), HasSubstr("no joint moves"));
}

TEST(CheckModel, TellsFrictionThatGrowsWithLoadOrAtLowSpeed) {
  RecordedArm arm = loaded_panda();
  arm.description.options.payload = {};
  arm.of_load = 0.1;
  const ModelCheck loaded = check_model(panda(), {arm.record(5)}, {0, true});
  EXPECT_THAT(loaded.joints[1].suspicious, HasSubstr("its Coulomb friction is 10 +- "));
  EXPECT_THAT(loaded.joints[1].suspicious, HasSubstr("% of its load more than the model says"));
  EXPECT_NEAR(loaded.joints[1].coulomb_friction.value, arm.coulomb[1], 0.1);
  arm.of_load = 0;
  arm.at_rest = 1.5;
  const ModelCheck sticky = check_model(panda(), {arm.record(6)}, {0, true});
  EXPECT_THAT(sticky.joints[1].suspicious,
              HasSubstr("its friction at low speed (Stribeck) is 1.5 +- 0.0"));
  arm.at_rest = 0;
  EXPECT_THAT(check_model(panda(), {arm.record(6)}, {0, true}).joints[1].suspicious, IsEmpty());
}

}  // namespace
}  // namespace dashpot::identification
