// From the C structs to the controller's types and back, and on to the messages' types: every field
// arrives in its own place.
#include <dashpot/controller/plugin/plugin_data.hpp>
#include <dashpot/lcmtypes/plugin_samples.hpp>

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <cstring>
#include <numeric>
#include <utility>
#include <vector>

namespace dashpot::controller {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// `size` numbers, all different, also from the numbers of other calls.
class Numbers {
 public:
  std::vector<double> operator()(int size) {
    std::vector<double> result(static_cast<std::size_t>(size));
    std::iota(result.begin(), result.end(), next_);
    next_ += size;
    return result;
  }
  double operator()() { return next_++; }
  Eigen::VectorXd vector(int size) {
    const std::vector<double> all = (*this)(size);
    return Eigen::Map<const Eigen::VectorXd>(all.data(), size);
  }
  std::uint64_t count() { return static_cast<std::uint64_t>((*this)()); }

 private:
  double next_ = 1;
};

Eigen::VectorXd seen(const double* data, Eigen::Index size) {
  return Eigen::Map<const Eigen::VectorXd>(data, size);
}
Eigen::MatrixXd seen_square(const double* data, Eigen::Index size) {
  return Eigen::Map<const RowMajor>(data, size, size);
}
/// These arrays hold a number for each joint, and zeros.
void expect_padded(const std::vector<std::pair<const double*, Eigen::VectorXd>>& arrays) {
  for (const auto& [found, values] : arrays) {
    Eigen::VectorXd expected = Eigen::VectorXd::Zero(DASHPOT_MAX_JOINTS);
    expected.head(values.size()) = values;
    EXPECT_EQ(seen(found, DASHPOT_MAX_JOINTS), expected);
  }
}
/// Returns the result for something of three joints at 77 ns, in memory with other contents.
template <class Struct, class From>
Struct filled(const From& from) {
  Struct out;
  std::memset(&out, 7, sizeof out);
  to_c(from, out);
  EXPECT_EQ(out.struct_size, sizeof out);
  EXPECT_EQ(out.joints, 3u);
  EXPECT_EQ(out.time, 77);
  return out;
}
template <class Thing, class... Member>
void expect_same(const Thing& one, const Thing& other, Member... member) {
  (void)std::initializer_list<int>{([&] { EXPECT_EQ(one.*member, other.*member); }(), 0)...};
}

TEST(FromC, AStateHasWhatIsGiven) {
  Numbers numbers;
  const auto position = numbers(3), velocity = numbers(3), wrench = numbers(6);
  dashpot_state given{sizeof given, 3, 77, position.data(), velocity.data(), nullptr};
  RobotState state = to_state(&given, 3, 5);
  EXPECT_EQ(state.time, 77);
  EXPECT_EQ(state.position, seen(position.data(), 3));
  EXPECT_EQ(state.velocity, seen(velocity.data(), 3));
  EXPECT_TRUE(state.external_wrench.isZero(0));
  given.external_wrench = wrench.data();
  EXPECT_EQ(to_state(&given, 3, 5).external_wrench, seen(wrench.data(), 6));

  const auto expect_none = [](const RobotState& none) {
    EXPECT_EQ(none.time, 5);
    EXPECT_EQ(none.position.size(), 0);
    EXPECT_EQ(none.velocity.size(), 0);
  };
  expect_none(to_state(nullptr, 3, 5));
  expect_none(to_state(&given, 4, 5));
  given.position = nullptr;
  expect_none(to_state(&given, 3, 5));
  given.position = position.data();
  given.velocity = nullptr;
  expect_none(to_state(&given, 3, 5));
  given.velocity = velocity.data();
  --given.struct_size;
  expect_none(to_state(&given, 3, 5));
}

TEST(FromC, ASetpointHasWhatIsGiven) {
  Numbers numbers;
  const auto joints = numbers(2), position = numbers(3), rotation = numbers(9), wrench = numbers(6);
  dashpot_setpoint given{};
  given.struct_size = sizeof given;
  given.joints = 2;
  given.time = 77;
  given.mode = DASHPOT_MODE_JOINT;
  Setpoint setpoint;
  setpoint.wrench.setOnes();
  EXPECT_EQ(to_setpoint(&given, 2, 5, setpoint), DASHPOT_NULL_ARGUMENT);
  given.joint_position = joints.data();
  ASSERT_EQ(to_setpoint(&given, 2, 5, setpoint), DASHPOT_OK);
  EXPECT_EQ(setpoint.time, 77);
  EXPECT_EQ(setpoint.mode, Mode::kJoint);
  EXPECT_EQ(setpoint.joint_position, seen(joints.data(), 2));
  EXPECT_TRUE(setpoint.wrench.isZero(0));

  given.mode = DASHPOT_MODE_CARTESIAN;
  given.time = DASHPOT_ON_ARRIVAL;
  given.wrench = wrench.data();
  for (const bool first : {false, true}) {  // each without the other
    given.tip_position = first ? position.data() : nullptr;
    given.tip_rotation = first ? nullptr : rotation.data();
    EXPECT_EQ(to_setpoint(&given, 2, 5, setpoint), DASHPOT_NULL_ARGUMENT);
  }
  given.tip_rotation = rotation.data();
  ASSERT_EQ(to_setpoint(&given, 2, 5, setpoint), DASHPOT_OK);
  EXPECT_EQ(setpoint.time, 5);
  EXPECT_EQ(setpoint.mode, Mode::kCartesian);
  EXPECT_EQ(setpoint.joint_position, seen(joints.data(), 2));
  EXPECT_EQ(setpoint.tip_pose.position, seen(position.data(), 3));
  EXPECT_EQ(setpoint.tip_pose.rotation, seen_square(rotation.data(), 3));
  EXPECT_EQ(setpoint.wrench, seen(wrench.data(), 6));
  given.joint_position = nullptr;
  ASSERT_EQ(to_setpoint(&given, 2, 5, setpoint), DASHPOT_OK);
  EXPECT_EQ(setpoint.joint_position.size(), 0);
  given.mode = DASHPOT_MODE_JOINT;
  given.joint_position = joints.data();
  ASSERT_EQ(to_setpoint(&given, 2, 5, setpoint), DASHPOT_OK);
  EXPECT_EQ(setpoint.tip_pose.position, Pose().position);
  EXPECT_EQ(setpoint.tip_pose.rotation, Pose().rotation);

  given.mode = 7;
  EXPECT_EQ(to_setpoint(&given, 2, 5, setpoint), DASHPOT_WRONG_VALUE);
  EXPECT_EQ(to_setpoint(&given, 3, 5, setpoint), DASHPOT_WRONG_JOINTS);
  ++given.struct_size;
  EXPECT_EQ(to_setpoint(&given, 2, 5, setpoint), DASHPOT_WRONG_STRUCT_SIZE);
  EXPECT_EQ(to_setpoint(nullptr, 2, 5, setpoint), DASHPOT_NULL_ARGUMENT);
}

dashpot_gains no_gains() {
  dashpot_gains given{};
  given.struct_size = sizeof given;
  given.joints = 2;
  return given;
}

TEST(FromC, GainsHaveWhatIsGivenAndKeepTheRest) {
  Numbers numbers;
  const auto K_q = numbers(4), C_q = numbers(4), K_C = numbers(36), C_C = numbers(36);
  const auto K_0 = numbers(2), C_0 = numbers(2);
  const std::int32_t tool = DASHPOT_FRAME_TOOL, base = DASHPOT_FRAME_BASE, neither = 2;
  const std::vector<std::uint8_t> directions{0, 0, 2, 0, 1, 0};
  Gains gains;
  dashpot_gains given = no_gains();
  given.joint_stiffness = K_q.data();
  given.task_damping = C_C.data();
  given.null_stiffness = K_0.data();
  given.frame = &tool;
  ASSERT_EQ(to_gains(&given, 2, gains), DASHPOT_OK);
  EXPECT_EQ(gains.joint_damping.size(), 0);
  EXPECT_TRUE(gains.task_stiffness.isZero(0));
  EXPECT_EQ(gains.null_damping.size(), 0);
  EXPECT_EQ(gains.directions, (std::array{true, true, true, true, true, true}));
  given = no_gains();
  given.joint_damping = C_q.data();
  given.task_stiffness = K_C.data();
  given.null_damping = C_0.data();
  given.directions = directions.data();
  ASSERT_EQ(to_gains(&given, 2, gains), DASHPOT_OK);
  EXPECT_EQ(gains.joint_stiffness, seen_square(K_q.data(), 2));
  EXPECT_EQ(gains.joint_damping, seen_square(C_q.data(), 2));
  EXPECT_EQ(gains.task_stiffness, seen_square(K_C.data(), 6));
  EXPECT_EQ(gains.task_damping, seen_square(C_C.data(), 6));
  EXPECT_EQ(gains.null_stiffness, seen(K_0.data(), 2));
  EXPECT_EQ(gains.null_damping, seen(C_0.data(), 2));
  EXPECT_EQ(gains.frame, Frame::kTool);
  EXPECT_EQ(gains.directions, (std::array{false, false, true, false, true, false}));
  given = no_gains();
  ASSERT_EQ(to_gains(&given, 2, gains), DASHPOT_OK);
  EXPECT_EQ(gains.frame, Frame::kTool);
  given.frame = &base;
  ASSERT_EQ(to_gains(&given, 2, gains), DASHPOT_OK);
  EXPECT_EQ(gains.frame, Frame::kBase);

  given.frame = &neither;
  EXPECT_EQ(to_gains(&given, 2, gains), DASHPOT_WRONG_VALUE);
  EXPECT_EQ(to_gains(&given, 3, gains), DASHPOT_WRONG_JOINTS);
  EXPECT_EQ(to_gains(nullptr, 2, gains), DASHPOT_NULL_ARGUMENT);
}

TEST(FromC, ADampingRatioStandsInPlaceOfADamping) {
  Numbers numbers;
  const auto damping = numbers(36);
  const double ratio = 0.7, zero = 0;
  Gains gains;
  const auto set = [&](const double* task_damping, const double* task_ratio,
                       const double* joint_damping, const double* joint_ratio) {
    dashpot_gains given = no_gains();
    given.task_damping = task_damping;
    given.task_damping_ratio = task_ratio;
    given.joint_damping = joint_damping;
    given.joint_damping_ratio = joint_ratio;
    return to_gains(&given, 2, gains);
  };
  const double* const none = nullptr;
  EXPECT_EQ(set(none, &ratio, none, none), DASHPOT_OK);
  EXPECT_EQ(gains.task_damping_ratio, 0.7);
  EXPECT_EQ(gains.joint_damping_ratio, 0);
  EXPECT_EQ(set(none, none, none, &ratio), DASHPOT_OK);
  EXPECT_EQ(gains.task_damping_ratio, 0.7);  // stays
  EXPECT_EQ(gains.joint_damping_ratio, 0.7);
  EXPECT_EQ(set(damping.data(), none, none, none), DASHPOT_OK);
  EXPECT_EQ(gains.task_damping_ratio, 0);
  EXPECT_EQ(gains.joint_damping_ratio, 0.7);
  EXPECT_EQ(set(none, none, damping.data(), &zero), DASHPOT_OK);
  EXPECT_EQ(gains.joint_damping_ratio, 0);
  EXPECT_EQ(set(damping.data(), &ratio, none, none), DASHPOT_WRONG_VALUE);
  EXPECT_EQ(set(none, none, damping.data(), &ratio), DASHPOT_WRONG_VALUE);
  dashpot_gains given = no_gains();
  given.null_damping_ratio = &ratio;
  EXPECT_EQ(to_gains(&given, 2, gains), DASHPOT_OK);
  EXPECT_EQ(gains.null_damping_ratio, 0.7);
  given.null_damping = damping.data();
  EXPECT_EQ(to_gains(&given, 2, gains), DASHPOT_WRONG_VALUE);
  given.null_damping_ratio = none;
  EXPECT_EQ(to_gains(&given, 2, gains), DASHPOT_OK);
  EXPECT_EQ(gains.null_damping_ratio, 0);
}

TEST(FromC, AProjectorStaysUnlessAKnownOneIsGiven) {
  Gains gains;
  gains.null_projector = NullProjector::kWeighted;
  dashpot_gains given = no_gains();
  EXPECT_EQ(to_gains(&given, 2, gains), DASHPOT_OK);
  EXPECT_EQ(gains.null_projector, NullProjector::kWeighted);
  for (std::int32_t projector = -1; projector <= 4; ++projector) {
    given.null_projector = &projector;
    const bool known = projector >= 0 && projector < 4;
    EXPECT_EQ(to_gains(&given, 2, gains), known ? DASHPOT_OK : DASHPOT_WRONG_VALUE);
    if (known) EXPECT_EQ(static_cast<std::int32_t>(gains.null_projector), projector);
  }
}

TEST(ToC, ASnapshotHasAllThatIsInIt) {
  Numbers numbers;
  Snapshot snapshot;
  snapshot.time = 77;
  snapshot.tick = numbers.count();
  snapshot.restarts = numbers.count();
  snapshot.status = Status::kSetpointStale;
  snapshot.mode = Mode::kCartesian;
  for (JointVector* values : {&snapshot.position, &snapshot.velocity, &snapshot.torque,
                              &snapshot.law_torque, &snapshot.reference_position}) {
    *values = numbers.vector(3);
  }
  snapshot.fault = Status::kStateNotFinite;
  for (Pose* pose : {&snapshot.tip, &snapshot.reference_tip, &snapshot.tool}) {
    pose->position = numbers.vector(3);
    pose->rotation = numbers.vector(9).reshaped(3, 3);
  }
  snapshot.tip_error = numbers.vector(6);
  snapshot.tip_wrench = numbers.vector(6);
  for (double* value :
       {&snapshot.joint_damping_ratio, &snapshot.task_damping_ratio, &snapshot.damping_level,
        &snapshot.energy_store, &snapshot.spring_share, &snapshot.payload.mass}) {
    *value = numbers();
  }
  snapshot.payload.center = numbers.vector(3);
  snapshot.payload.inertia = numbers.vector(9).reshaped(3, 3);
  const auto out = filled<dashpot_snapshot>(snapshot);
  EXPECT_EQ(out.tick, snapshot.tick);
  EXPECT_EQ(out.restarts, snapshot.restarts);
  EXPECT_EQ(out.status, DASHPOT_SETPOINT_STALE);
  EXPECT_EQ(out.mode, DASHPOT_MODE_CARTESIAN);
  expect_padded({{out.position, snapshot.position},
                 {out.velocity, snapshot.velocity},
                 {out.torque, snapshot.torque},
                 {out.law_torque, snapshot.law_torque},
                 {out.reference_joint_position, snapshot.reference_position}});
  EXPECT_EQ(seen(out.tip_position, 3), snapshot.tip.position);
  EXPECT_EQ(seen_square(out.tip_rotation, 3), snapshot.tip.rotation);
  EXPECT_EQ(seen(out.reference_tip_position, 3), snapshot.reference_tip.position);
  EXPECT_EQ(seen_square(out.reference_tip_rotation, 3), snapshot.reference_tip.rotation);
  EXPECT_EQ(seen(out.tip_error, 6), snapshot.tip_error);
  EXPECT_EQ(out.damping_level, snapshot.damping_level);
  EXPECT_EQ(seen(out.tip_wrench, 6), snapshot.tip_wrench);

  // And again what it was, for the publisher of a host.
  Snapshot again;
  lcmtypes::fill(out, again);
  expect_same(again, snapshot, &Snapshot::time, &Snapshot::tick, &Snapshot::restarts,
              &Snapshot::status, &Snapshot::fault, &Snapshot::mode, &Snapshot::position,
              &Snapshot::velocity, &Snapshot::torque, &Snapshot::law_torque,
              &Snapshot::reference_position, &Snapshot::tip_error, &Snapshot::tip_wrench,
              &Snapshot::joint_damping_ratio, &Snapshot::task_damping_ratio,
              &Snapshot::damping_level, &Snapshot::energy_store, &Snapshot::spring_share);
  EXPECT_EQ(again.joint_error, JointVector(snapshot.reference_position - snapshot.position));
  for (const auto pose : {&Snapshot::tip, &Snapshot::reference_tip, &Snapshot::tool}) {
    expect_same(again.*pose, snapshot.*pose, &Pose::position, &Pose::rotation);
  }
  expect_same(again.payload, snapshot.payload, &Payload::mass, &Payload::center, &Payload::inertia);
}

TEST(ToC, ModesHaveAllThatIsInThem) {
  Numbers numbers;
  Vibration vibration;
  vibration.time = 77;
  vibration.tick = numbers.count();
  vibration.position = numbers.vector(3);
  vibration.status = analysis::Status::kNotFinite;
  vibration.origin = analysis::SpectrumOrigin::kReused;
  vibration.zero_modes = 1;
  vibration.count = 2;
  VibrationCounters& counters = vibration.counters;
  const std::vector<std::uint64_t*> fields = {
      &counters.tracked,    &counters.reused,    &counters.direct, &counters.unchanged,
      &counters.no_springs, &counters.failed,    &counters.missed, &counters.no_zero_modes,
      &counters.no_wrench,  &counters.no_shapes, &counters.at_rest};
  for (std::uint64_t* field : fields) *field = numbers.count();
  for (std::size_t i = 0; i < 2; ++i) {
    VibrationMode& mode = vibration.modes[i];
    mode.label = static_cast<std::int32_t>(numbers());
    mode.kind = i == 0 ? analysis::ModeKind::kOverdamped : analysis::ModeKind::kSoft;
    mode.eigenvalues = {analysis::Complex(numbers(), numbers()),
                        analysis::Complex(numbers(), numbers())};
    for (double* field :
         {&mode.natural_frequency, &mode.damping_ratio, &mode.damped_frequency, &mode.error_bound,
          &mode.natural_frequency_bound, &mode.damping_ratio_bound}) {
      *field = numbers();
    }
    mode.shape = numbers.vector(3) + analysis::Complex(0, 1) * numbers.vector(3);
  }
  const auto out = filled<dashpot_modes>(vibration);
  EXPECT_EQ(out.tick, vibration.tick);
  expect_padded({{out.position, vibration.position}});
  EXPECT_EQ(out.status, static_cast<int>(analysis::Status::kNotFinite));
  EXPECT_EQ(out.origin, DASHPOT_REUSED);
  EXPECT_EQ(out.zero_modes, 1u);
  ASSERT_EQ(out.count, 2u);
  const std::vector<std::uint64_t> counted = {
      out.tracked, out.reused,        out.direct,    out.unchanged, out.no_springs, out.failed,
      out.missed,  out.no_zero_modes, out.no_wrench, out.no_shapes, out.at_rest};
  for (std::size_t i = 0; i < fields.size(); ++i) EXPECT_EQ(counted[i], *fields[i]) << i;
  for (std::size_t i = 0; i < 2; ++i) {
    const VibrationMode& from = vibration.modes[i];
    const dashpot_mode& mode = out.modes[i];
    EXPECT_EQ((std::array{mode.natural_frequency, mode.natural_frequency_bound, mode.damping_ratio,
                          mode.damping_ratio_bound, mode.damped_frequency, mode.eigenvalue_bound}),
              (std::array{from.natural_frequency, from.natural_frequency_bound, from.damping_ratio,
                          from.damping_ratio_bound, from.damped_frequency, from.error_bound}));
    EXPECT_EQ(mode.label, from.label);
    EXPECT_EQ(mode.kind, i == 0 ? DASHPOT_OVERDAMPED : DASHPOT_SOFT);
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_EQ(analysis::Complex(mode.eigenvalues[k][0], mode.eigenvalues[k][1]),
                from.eigenvalues[k]);
    }
    expect_padded({{mode.shape_real, from.shape.real()}, {mode.shape_imag, from.shape.imag()}});
  }
  EXPECT_EQ(out.modes[2].natural_frequency, 0);
  EXPECT_EQ(out.modes[2].label, 0);

  lcmtypes::ModesSample again;
  lcmtypes::fill(out, again);
  expect_same(again.vibration, vibration, &Vibration::time, &Vibration::tick, &Vibration::position,
              &Vibration::status, &Vibration::origin, &Vibration::zero_modes, &Vibration::count);
  for (std::size_t i = 0; i < 2; ++i) {
    using M = VibrationMode;
    expect_same(again.vibration.modes[i], vibration.modes[i], &M::label, &M::kind, &M::eigenvalues,
                &M::shape, &M::natural_frequency, &M::damping_ratio, &M::damped_frequency,
                &M::error_bound, &M::natural_frequency_bound, &M::damping_ratio_bound);
  }
}

TEST(ToC, TheSampledLoopHasAllThatIsInIt) {
  Numbers numbers;
  SampledVibration vibration;
  vibration.time = 77;
  vibration.tick = numbers.count();
  vibration.position = numbers.vector(3);
  vibration.status = analysis::Status::kNotFinite;
  vibration.spectral_radius = numbers();
  vibration.gain_margin = numbers();
  vibration.assumes = 42;
  vibration.count = 2;
  for (std::size_t i = 0; i < 2; ++i) {
    vibration.modes[i] = {
        analysis::ModeKind::kUnstable, numbers(), numbers(), numbers(), numbers(), numbers()};
  }
  const auto out = filled<dashpot_sampled_modes>(vibration);
  EXPECT_EQ(out.tick, vibration.tick);
  expect_padded({{out.position, vibration.position}});
  EXPECT_EQ(out.status, static_cast<int>(analysis::Status::kNotFinite));
  EXPECT_EQ(out.spectral_radius, vibration.spectral_radius);
  EXPECT_EQ(out.gain_margin, vibration.gain_margin);
  EXPECT_EQ(out.assumes, 42u);
  ASSERT_EQ(out.count, 2u);
  lcmtypes::SampledModesSample again;
  lcmtypes::fill(out, again);
  using V = SampledVibration;
  expect_same(again.vibration, vibration, &V::time, &V::tick, &V::position, &V::status,
              &V::spectral_radius, &V::gain_margin, &V::assumes, &V::count);
  for (std::size_t i = 0; i < 2; ++i) {
    const dashpot_sampled_mode& mode = out.modes[i];
    const SampledVibrationMode& from = vibration.modes[i];
    EXPECT_EQ((std::array{mode.continuous_frequency, mode.continuous_ratio, mode.natural_frequency,
                          mode.damping_ratio, mode.damped_frequency}),
              (std::array{from.continuous_frequency, from.continuous_ratio, from.natural_frequency,
                          from.damping_ratio, from.damped_frequency}));
    EXPECT_EQ(mode.kind, DASHPOT_UNSTABLE);
    EXPECT_EQ(mode.reserved, 0);
    using M = SampledVibrationMode;
    expect_same(again.vibration.modes[i], from, &M::kind, &M::continuous_frequency,
                &M::continuous_ratio, &M::natural_frequency, &M::damping_ratio,
                &M::damped_frequency);
  }
  EXPECT_EQ(out.modes[2].natural_frequency, 0);
}

}  // namespace
}  // namespace dashpot::controller
