// Policies that change the stiffness of arms as they like, with and without an energy tank.
#include <dashpot/tests/stress/part.hpp>
#include <dashpot/tests/support/fed_arm.hpp>

#include <algorithm>
#include <cstdio>

namespace {

using dashpot::testing::FedArm;

/// What is seen of all policies in one engine.
struct Seen {
  int policies = 0, weakened = 0, braked = 0, beyond = 0, broken = 0;
  double most = 0, free = 0;  ///< of the energy given, in stores

  void add(const FedArm& arm, const FedArm::Fed& bound, const FedArm::Fed& unbound) {
    constexpr double kExact = 1e-6;  // of the store
    ++policies;
    weakened += bound.share < 1 ? 1 : 0;
    braked += bound.braked ? 1 : 0;
    beyond += unbound.most > arm.store ? 1 : 0;
    broken += bound.most > (1 + kExact) * arm.store ? 1 : 0;
    most = std::max(most, bound.most / arm.store);
    free = std::max(free, unbound.most / arm.store);
  }
  bool print(const char* engine) const {
    std::printf("| %s | %d | %d, %.6f | %d, %d | %d, %.0f |\n", engine, policies, broken, most,
                weakened, braked, beyond, free);
    return broken == 0 && (policies < 10 || beyond > 0);
  }
};

bool feed(const dashpot::stress::Request& request) {
  const auto policies = static_cast<std::uint64_t>(request.whole());
  std::printf(
      "seed %lu\n| engine | policies | beyond the store with a tank, most in stores | springs "
      "weakened, stopped | beyond it without one, most |\n|---|---|---|---|---|\n",
      request.seed);
  Seen stand_in, mujoco;
  constexpr std::uint64_t kOfMujoco = 50;  // one in so many, and at least three
  for (std::uint64_t k = 0; k < policies; ++k) {
    FedArm arm(1'000'003 * request.seed + k);
    stand_in.add(arm, arm.in_stand_in(true), arm.in_stand_in(false));
  }
  bool good = stand_in.print("stand-in");
  if (!dashpot::testing::MujocoArm::available()) return good;
  for (std::uint64_t k = 0; k < std::max<std::uint64_t>(3, policies / kOfMujoco); ++k) {
    FedArm arm(2'000'003 * request.seed + k);
    mujoco.add(arm, arm.in_mujoco(true), arm.in_mujoco(false));
  }
  return mujoco.print("MuJoCo") && good;
}

const dashpot::stress::AddPart part(
    {"energy",
     9,
     "Let policies change the stiffness of arms as they like, with and without an energy tank",
     "POLICIES",
     {{1000, 12}},
     feed,
     {"SEED"}});

}  // namespace
