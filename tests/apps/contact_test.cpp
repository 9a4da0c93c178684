// The force of a scene's wall on the tip, in summary, table and log.
#include <dashpot/lcmtypes/message_reader.hpp>
#include <dashpot/tests/apps/scene_run.hpp>

#include <gmock/gmock.h>

#include <cmath>

namespace dashpot::tests {
namespace {

using ::testing::HasSubstr;

constexpr double kWall = 0.49;  // m, above where the springs of the tip are fixed

std::string wall_scene(const Scratch& scratch) {
  return changed(scratch, "panda", {{"point: [0, 0, 0.2 m]", "point: [0, 0, 0.49 m]"}});
}

TEST(Contact, IsTheSpringOfTheWallInTableAndSummary) {
  const Scratch scratch;
  const std::string csv = scratch.path("a.csv");
  const Json result = run_json(wall_scene(scratch), {"--duration", "0.9", "--csv", csv});
  const auto columns = table(csv);
  const Numbers &z = columns.at("z"), &force = columns.at("contact_z");
  double greatest = 0;
  for (std::size_t i = 0; i < z.size(); ++i) {
    EXPECT_EQ(columns.at("contact_x")[i], 0);
    if (z[i] > kWall + 1e-4) EXPECT_EQ(force[i], 0) << i;
    greatest = std::max(greatest, force[i]);
  }
  EXPECT_EQ(force[0], 0);  // the tip is let go above the wall
  // At rest: 2e4 N/m, and sensors that show a hundredth of a millimetre.
  EXPECT_GT(force.back(), 5);
  EXPECT_NEAR(force.back(), 2e4 * (kWall - z.back()), 0.4);
  const Json& contact = result["contact"];
  EXPECT_GE(contact["greatest_force"], greatest);
  EXPECT_LT(contact["greatest_force"], 1.01 * greatest);
  EXPECT_NEAR(contact["final_force"][2], force.back(), 0.1);
  EXPECT_EQ(text_of(csv).substr(0, 24), "time [s],q1 [rad],q2 [ra");
}

TEST(Contact, IsInTheLogBeforeTheStateOfItsTick) {
  const Scratch scratch;
  const std::string log = scratch.path("a.lcm");
  const Outcome outcome = run_scene(wall_scene(scratch), {"--duration", "0.3", "--log", log});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("Force of the wall on the tip: at most "));
  lcmtypes::MessageHandlers handlers;
  std::int64_t contacts = 0, states = 0, tick = 0;
  double greatest = 0;
  handlers.on_contact = [&](const contact_t& message) {
    ++contacts;
    tick = message.tick;
    greatest = std::max(greatest, message.force[2]);
  };
  handlers.on_state = [&](const state_t& message) {
    ++states;
    EXPECT_EQ(message.tick, tick);
  };
  lcmtypes::LogReader reader(log, handlers);
  while (reader.read()) reader.handle();
  EXPECT_EQ(handlers.malformed, 0);
  EXPECT_EQ(states, 300);
  EXPECT_EQ(contacts, states);
  EXPECT_GT(greatest, 5);
}

TEST(Contact, IsNotToldWithoutAWall) {
  const Scratch scratch;
  const std::string csv = scratch.path("a.csv");
  const Json result = run_json(scene("chain3"), {"--duration", "0.1", "--csv", csv});
  EXPECT_TRUE(result["contact"].is_null());
  EXPECT_EQ(table(csv).count("contact_z"), 0U);
  EXPECT_EQ(text_of(csv).substr(0, 12), "time [s],q1,");  // of units that nobody knows
}

}  // namespace
}  // namespace dashpot::tests
