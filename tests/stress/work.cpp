// Ordinary work with default settings: an arm picks bodies up and puts them down, wipes a table, is
// guided by a hand, pushed, shaken and tapped, and gets other gains. All is a little wrong, as on a
// robot: links and bodies weigh 1.1 of what the controller knows in the first half, 0.9 in the
// second; joints stick by friction that it does not know, torques are a tick late, and one state in
// a thousand is lost. Encoders have 18 bits, and velocities are their differences; in the second
// half encoders have 12 bits, and velocities steps of 1 mrad/s. No fault may latch.
#include <dashpot/controller/plugin.h>
#include <dashpot/controller/config.hpp>
#include <dashpot/sim/plant.hpp>
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/stress/work_round.hpp>
#include <dashpot/text/yaml_document.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace dashpot;  // NOLINT(google-build-using-namespace)
using Eigen::Vector3d;
using stress::JointVector;
using stress::kRound;
using stress::kTable;
using stress::Round;
using stress::TestArm;

constexpr double kPeriod = 1e-3;     // s
constexpr double kLost = 1e-3;       // share of the states that never come
constexpr double kArrived = 0.15;    // m; wrong weights on soft springs leave less
constexpr double kFriction = 0.02;   // of the torque limit
constexpr double kSticks = 1e-4;     // rad/s: slower joints do not leave an encoder's count
constexpr double kSpeedStep = 1e-3;  // rad/s, of velocities that are measured by themselves

struct Destroy {
  void operator()(dashpot_controller* controller) const { dashpot_destroy(controller); }
};

/// Observations of an arm.
struct Seen {
  double seconds = 0, pressed = 0;  ///< of it, on the table
  double speed = 0, torque = 0;     ///< greatest shares of the limits
  int moves = 0, arrived = 0, refused = 0, faults = 0;
  double farthest = 0;                 ///< from a goal at the end of a move, m
  std::map<std::int32_t, long> ticks;  ///< with each status
};

/// An arm that works for some rounds, with links and bodies of `factor` times their stated masses.
class Work {
 public:
  Work(const TestArm& arm, double factor, int rounds, std::mt19937_64& engine, Seen& seen)
      : name_(arm.name), home_(stress::start_of(arm)), engine_(engine), seen_(seen) {
    const std::string text =
        stress::robot_yaml(arm, 0) + "control: {mode: cartesian}\nanalysis: {where: off}\n";
    stiffness_ =
        controller::read_config(text::parse_yaml(text), "").settings.initial.gains.task_stiffness;
    controller_.reset(dashpot_create_from_text(text.c_str(), ""));
    if (!controller_) throw std::runtime_error(dashpot_last_error());
    const sim::Robot model = stress::simulated_robot(arm);
    const auto n = static_cast<Eigen::Index>(model.joints().size());
    fastest_ = stress::limits_of(arm, &sim::Joint::velocity);
    strongest_ = stress::limits_of(arm, &sim::Joint::effort);
    start_ = sim::Arm(model).tip_pose(home_);
    for (int i = 0; i < rounds; ++i)
      rounds_.push_back(stress::draw_round(engine, static_cast<int>(n)));
    sim::ArmOptions world = stress::scene(rounds_, start_.position, factor);
    world.friction_velocity = kSticks;
    body_.emplace(stress::weighed(arm, factor, kFriction * strongest_), world);
    sim::PlantOptions plant;
    plant.period = kPeriod;
    plant.integrator.method = sim::Method::kRosenbrock;  // Coulomb friction of light joints
    plant.delay = 1;
    coarse_ = factor < 1;
    plant.position_resolution =
        JointVector::Constant(n, 2 * std::numbers::pi / (coarse_ ? 1 << 12 : 1 << 18));
    plant.difference_velocity = !coarse_;
    torque_ = terms(home_).first;
    plant.initial_torque = torque_;
    plant_.emplace(*body_, plant, home_);
    if (dashpot_start(controller_.get(), home_.data(), torque_.data()) != DASHPOT_OK) {
      throw std::runtime_error(dashpot_last_error());
    }
  }

  void run() {
    for (const Round& round : rounds_) work(round);
    seen_.seconds += plant_->time();
  }

 private:
  void work(const Round& round) {
    const double over = 0.12 - kTable, at = 0.02 - kTable;
    move({round.pick.x(), round.pick.y(), over}, 3);
    move({round.pick.x(), round.pick.y(), at}, 2);
    hold(round.mass, round.told_late, 1);
    move({round.pick.x(), round.pick.y(), over}, 1.5);
    move({round.place.x(), round.place.y(), over}, 3);
    move({round.place.x(), round.place.y(), at}, 1.5);
    hold(0, round.told_late, 1);
    move({round.place.x(), round.place.y(), over}, 1.5);
    doing_ = "presses on the table";
    go({0, 0, -kTable - 0.05});
    run(2);
    doing_ = "wipes the table";
    go({round.wipe.x(), round.wipe.y(), -kTable - 0.05});
    run(2);
    move({0, 0, 0}, 1.5);
    be_guided(round);  // 7 s
    doing_ = "moves its joints";
    joints_ = home_ + round.away;
    while (body_->tip_pose(joints_).position.z() < start_.position.z() - 0.75 * kTable) {
      joints_ = 0.5 * (joints_ + home_);  // an arm is not driven into a table
    }
    cartesian_ = false;
    run(3);  // soft springs, friction and wrong weights leave 0.2 m
    stiffen(round.stiffer);
    move({0, 0, 0}, 3);
  }

  /// Moves the tip to a place, from where it started.
  void move(const Vector3d& to, double seconds) {
    doing_ = "moves its tip";
    go(to);
    run(seconds);
    const double missed = (body_->tip_pose(plant_->position()).position - goal_.position).norm();
    if (missed >= kArrived) {
      std::printf("  %s at %.3f s, when it %s: %.0f mm from its goal\n", name_, plant_->time(),
                  doing_, 1e3 * missed);
    }
    ++seen_.moves;
    seen_.arrived += missed < kArrived ? 1 : 0;
    seen_.farthest = std::max(seen_.farthest, missed);
  }
  void go(const Vector3d& to) {
    cartesian_ = true;
    goal_ = {start_.position + to, start_.rotation};
  }
  /// The body has come or gone; the payload is set a little later.
  void hold(double mass, double late, double seconds) {
    doing_ = "takes or puts down a body";
    run(late);
    const sim::Inertia body = stress::body_of(mass);
    dashpot_payload payload{};
    payload.struct_size = sizeof payload;
    payload.mass = mass;
    std::copy(body.center.begin(), body.center.end(), payload.center);
    for (int i = 0; i < 9; i += 4) payload.inertia[i] = body.about_center(0, 0);
    taken(dashpot_set_payload(controller_.get(), &payload));
    run(seconds - late);
  }
  /// A hand takes the tip, its springs give way, the hand moves it, and springs hold it there. Then
  /// the hand shakes it at 4 Hz, lets go, and taps it.
  void be_guided(const Round& round) {
    doing_ = "is guided by a hand";
    const Vector3d from = body_->tip_pose(plant_->position()).position;
    hand_ = from;
    run(0.5);
    free_tip(true);
    lead(2, [&](double t) {
      const double s = t / 2;
      return Vector3d(from + s * s * s * (10 + s * (-15 + 6 * s)) * round.guide);
    });
    goal_ = body_->tip_pose(plant_->position());
    tell();
    free_tip(false);
    run(1);
    doing_ = "is shaken by a hand";
    const Vector3d there = *hand_;
    lead(1.5, [&](double t) {
      return Vector3d(there + std::sin(8 * std::numbers::pi * t) * round.shake);
    });
    hand_.reset();
    run(1);
    doing_ = "is tapped";
    run(1);
  }
  /// For so many seconds the hand is where a function of time says.
  template <class Place>
  void lead(double seconds, const Place& place) {
    const double begin = plant_->time();
    for (long i = std::lround(seconds / kPeriod); i > 0; --i) {
      hand_ = place(plant_->time() - begin);
      tick();
    }
  }
  void free_tip(bool free) {
    const std::uint8_t on = free ? 0 : 1;
    const std::uint8_t directions[6] = {on, on, on, 1, 1, 1};
    dashpot_gains gains = no_gains();
    gains.directions = directions;
    taken(dashpot_set_gains(controller_.get(), &gains));
  }
  void stiffen(double factor) {
    const controller::Matrix6 K = factor * stiffness_;
    dashpot_gains gains = no_gains();
    gains.task_stiffness = K.data();
    taken(dashpot_set_gains(controller_.get(), &gains));
  }
  dashpot_gains no_gains() const {
    dashpot_gains gains{};
    gains.struct_size = sizeof gains;
    gains.joints = static_cast<std::uint32_t>(home_.size());
    return gains;
  }
  void taken(std::int32_t code) {
    if (code == DASHPOT_OK) return;
    if (++seen_.refused <= 5)
      std::printf("  %s at %.3f s: %s\n", name_, plant_->time(), dashpot_last_error());
  }

  void tell() {
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rotation = goal_.rotation;
    const dashpot_setpoint setpoint = {sizeof setpoint,
                                       static_cast<std::uint32_t>(home_.size()),
                                       DASHPOT_ON_ARRIVAL,
                                       cartesian_ ? DASHPOT_MODE_CARTESIAN : DASHPOT_MODE_JOINT,
                                       cartesian_ ? home_.data() : joints_.data(),
                                       goal_.position.data(),
                                       rotation.data(),
                                       nullptr};
    taken(dashpot_set_setpoint(controller_.get(), &setpoint));
  }
  void run(double seconds) {
    tell();
    for (long i = std::lround(seconds / kPeriod); i > 0; --i) tick();
  }

  /// Weight and the Jacobian of the tip, by the controller's model.
  std::pair<JointVector, Eigen::MatrixXd> terms(const JointVector& q) {
    dashpot_dynamics dynamics{};
    dynamics.struct_size = sizeof dynamics;
    const JointVector still = JointVector::Zero(q.size());
    dashpot_evaluate(controller_.get(), q.data(), still.data(), &dynamics);
    using RowMajor = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::RowMajor>;
    return {Eigen::Map<const Eigen::VectorXd>(dynamics.gravity, q.size()),
            Eigen::Map<const RowMajor>(dynamics.jacobian, 6, q.size())};
  }

  void tick() {
    if (plant_->ticks() % 100 == 0) tell();
    if (!std::bernoulli_distribution(kLost)(engine_)) control();
    JointVector exerted = torque_;
    if (hand_) {  // springs and dampers of a hand
      const JointVector q = plant_->position();
      const Eigen::MatrixXd J = terms(q).second.topRows<3>();
      const Vector3d force =
          500 * (*hand_ - body_->tip_pose(q).position) - 30 * (J * plant_->velocity());
      exerted += J.transpose() * force;
    }
    if (plant_->step(exerted) != sim::Status::kOk)
      throw std::runtime_error("the simulation failed");
    seen_.speed =
        std::max(seen_.speed, plant_->velocity().cwiseQuotient(fastest_).cwiseAbs().maxCoeff());
    if (body_->tip_pose(plant_->position()).position.z() < start_.position.z() - kTable) {
      seen_.pressed += kPeriod;
    }
    seen_.torque = std::max(seen_.torque, torque_.cwiseQuotient(strongest_).cwiseAbs().maxCoeff());
  }

  void control() {
    const sim::Measurement& measured = plant_->measured();
    const auto n = static_cast<std::uint32_t>(home_.size());
    JointVector velocity = measured.velocity;
    for (double& v : velocity) v = coarse_ ? kSpeedStep * std::nearbyint(v / kSpeedStep) : v;
    const dashpot_state state = {sizeof state,    n,      measured.time, measured.position.data(),
                                 velocity.data(), nullptr};
    dashpot_output output = {sizeof output, n, torque_.data()};
    const std::int32_t status = dashpot_update(controller_.get(), &state, nullptr, &output);
    ++seen_.ticks[status];
    const bool bad = status < 0 || status >= DASHPOT_FAULT_LATCHED;
    if (bad && !faulted_) {
      std::printf("  FAULT of %s at %.3f s, while it %s: %s\n", name_, plant_->time(), doing_,
                  dashpot_status_text(status));
      std::printf("    position %s\n    velocity %s\n",
                  stress::yaml_list(plant_->position()).c_str(),
                  stress::yaml_list(plant_->velocity()).c_str());
      ++seen_.faults;
      std::fflush(stdout);
      since_ = plant_->ticks();
    }
    faulted_ = bad;
    if (bad && (plant_->ticks() - since_) % 1000 == 999) dashpot_release(controller_.get());
  }

  const char* name_;
  JointVector home_, fastest_, strongest_;
  std::mt19937_64& engine_;
  Seen& seen_;
  std::vector<Round> rounds_;
  controller::Matrix6 stiffness_;
  std::unique_ptr<dashpot_controller, Destroy> controller_;
  std::optional<sim::Arm> body_;
  std::optional<sim::Plant> plant_;
  sim::Pose start_, goal_;
  JointVector joints_, torque_;
  bool cartesian_ = true, coarse_ = false;
  std::optional<Vector3d> hand_;  ///< where it draws the tip, m
  const char* doing_ = "";
  bool faulted_ = false;
  std::int64_t since_ = 0;  ///< tick of a fault
};

bool print(const char* name, const Seen& seen) {
  const bool good =
      seen.faults == 0 && seen.refused == 0 && seen.arrived == seen.moves && seen.pressed > 0;
  std::printf("%-14s %6.1f %8.1f %6d %8d %9.0f %8d %7.2f %7.2f %7d", name, seen.seconds / 60,
              seen.pressed / 60, seen.moves, seen.arrived, 1e3 * seen.farthest, seen.refused,
              seen.speed, seen.torque, seen.faults);
  long all = 0;
  for (const auto& [status, ticks] : seen.ticks) all += ticks;
  const char* between = "  ";
  for (const auto& [status, ticks] : seen.ticks) {
    std::printf("%s%s %.3g %%", between, dashpot_status_text(status),
                100 * static_cast<double>(ticks) / static_cast<double>(all));
    between = ", ";
  }
  std::printf("\n");
  std::fflush(stdout);
  return good;
}

bool work(const stress::Request& request) {
  std::printf(
      "Ordinary work, seed %lu; speed and torque: greatest shares of their limits\n%-14s %6s %8s "
      "%6s %8s %9s %8s %7s %7s %7s  %s\n",
      request.seed, "arm", "min", "on table", "moves", "arrived", "miss, mm", "refused", "speed",
      "torque", "faults", "statuses");
  const int rounds = std::max(1, static_cast<int>(std::lround(request.count * 60 / kRound / 2)));
  bool good = true;
  for (const TestArm& arm : stress::test_arms()) {
    const std::string name = arm.name;
    if (name != "panda+rotors" && name != "fr3" && name != "iiwa14+rotors" && name != "ur5")
      continue;
    std::mt19937_64 engine(request.seed);
    Seen seen;
    for (const double factor : {1.1, 0.9}) Work(arm, factor, rounds, engine, seen).run();
    good &= print(arm.name, seen);
  }
  return good;
}

const stress::AddPart part({"work",
                            12,
                            "Let four simulated arms do ordinary work, without a fault",
                            "MINUTES",
                            {{15, 0.5}},
                            work,
                            {"SEED"}});

}  // namespace
