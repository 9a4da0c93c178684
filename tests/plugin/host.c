/* A host in C99 that links with the plugin: an arm that never moves, for a second. */
#include <dashpot/controller/plugin.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

static int failures = 0;

static void expect(int condition, const char* what) {
  if (condition) return;
  fprintf(stderr, "not so: %s (%s)\n", what, dashpot_last_error());
  ++failures;
}

#define EXPECT(condition) expect((condition) != 0, #condition)

static void drive(dashpot_controller* controller) {
  const double position[7] = {0, -0.785, 0, -2.356, 0, 1.571, 0.785};
  const double velocity[7] = {0};
  double torque[7] = {0};
  dashpot_state state = {sizeof state, 7, 0, position, velocity, NULL};
  dashpot_output output = {sizeof output, 7, torque};
  static dashpot_snapshot snapshot;
  static dashpot_modes modes;
  int tick;
  uint32_t i;

  for (tick = 1; tick <= 1000; ++tick) {
    state.time = (int64_t)(1e9 * dashpot_period(controller)) * tick;
    const int32_t status = dashpot_update(controller, &state, NULL, &output);
    /* At first the torque, limited in its rate, has to grow from zero to what gravity asks for. */
    EXPECT(status == DASHPOT_OK || (status == DASHPOT_TORQUE_LIMITED && tick < 200));
  }
  snapshot.struct_size = sizeof snapshot;
  EXPECT(dashpot_read_snapshot(controller, &snapshot) == DASHPOT_OK);
  EXPECT(snapshot.tick == 1000 && snapshot.joints == 7);
  EXPECT(memcmp(snapshot.torque, torque, sizeof torque) == 0);
  /* Gravity acts on the second joint, and not along the axis of the first. */
  EXPECT(fabs(torque[0]) < 1e-9 && fabs(torque[1]) > 1);

  modes.struct_size = sizeof modes;
  EXPECT(dashpot_read_modes(controller, &modes) == DASHPOT_OK);
  EXPECT(modes.count + modes.zero_modes == 7);
  for (i = 0; i < modes.count; ++i) {
    const dashpot_mode* mode = &modes.modes[i];
    printf("%8.3f rad/s (within %.1e), damping ratio %.3f, %s\n", mode->natural_frequency,
           mode->natural_frequency_bound, mode->damping_ratio, dashpot_kind_text(mode->kind));
    EXPECT(mode->natural_frequency > 0 && mode->damping_ratio > 0);
  }
}

int main(int argc, char** argv) {
  dashpot_controller* controller;
  if (argc != 2) return 2;
  EXPECT(dashpot_create("no-such-file.yaml") == NULL);
  EXPECT(strstr(dashpot_last_error(), "no-such-file.yaml") != NULL);
  EXPECT(dashpot_plugin_interface(DASHPOT_PLUGIN_VERSION)->update == dashpot_update);

  controller = dashpot_create(argv[1]);
  EXPECT(controller != NULL);
  if (controller != NULL) drive(controller);
  dashpot_destroy(controller);
  return failures == 0 ? 0 : 1;
}
