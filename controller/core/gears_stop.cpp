#include <dashpot/controller/core/gears_stop.hpp>
#include <dashpot/controller/posture.hpp>
#include <dashpot/controller/posture_loop.hpp>
#include <dashpot/controller/safety/brake.hpp>
#include <dashpot/controller/settings_check.hpp>
#include <dashpot/text/printable.hpp>

#include <algorithm>

namespace dashpot::controller {
namespace {

constexpr double kGearMargin = 2;  // of gain: a brake leaves a gear's mode half of its damping
constexpr double kEdge = 0.2;      // times the brake's T: edges of velocity intervals are this hard
constexpr double kLongest = 1e3;   // s: no T is stable
constexpr double kSearched = 1e3;  // times: range of the search for a boundary
constexpr int kPostures = 16;

}  // namespace

double gears_stopping_time(const RobotModel& model, const Settings& settings, double wanted) {
  const SampledArm arm(model, timing_of(settings));
  if (!arm.gears().any()) return 0;
  const PostureSequence postures(settings.limits.position_lower, settings.limits.position_upper);
  const JointVector rest = JointVector::Zero(model.dof());
  DynamicsResult robot;
  double T = kEdge * wanted;
  for (int k = 0; k < kPostures && T <= kLongest; ++k) {
    arm.kernel().evaluate(postures.at(k), rest, robot);
    const analysis::SampledLoop loop = with_gears(arm.at(postures.at(k)));
    for (double margin = 0; margin == 0 && T <= kLongest;) {
      analysis::System<kMaxJoints> system(model.dof());
      system.mass = robot.M;
      system.damping = robot.M * (kGearMargin / T);
      system.damping.diagonal() += arm.friction();
      arm.gears().extend(system);
      margin = margin_up_to(system, loop, 1);
      T = margin > 0 ? T / margin : kSearched * T;
    }
  }
  if (T <= 1.01 * wanted) return T;
  const std::string gears_keys = "(robot.gear_stiffness, gear_damping, position_sensor)";
  throw InvalidSettings("limits.stopping_time",
                        "is " + text::number(settings.limits.stopping_time, 3) +
                            " s, but with elastic gears " + gears_keys +
                            (T > kLongest ? " no brake is stable: their damping is too small"
                                          : " a brake keeps a gain margin of 2 from " +
                                                text::number(T, 3) + " s on: set that"));
}

}  // namespace dashpot::controller
