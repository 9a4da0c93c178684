/* A host in C99 that links with the plugin: an arm that never moves, for a second; plugin CONFIG.
 */
#include <dashpot/controller/plugin.h>

#include <stdio.h>

static int failed(const char* what) {
  fprintf(stderr, "%s: %s\n", what, dashpot_last_error());
  return 1;
}

int main(int argc, char** argv) {
  const double position[7] = {0, -0.785, 0, -2.356, 0, 1.571, 0.785}; /* rad */
  const double velocity[7] = {0};
  double torque[7] = {0}; /* N m */
  dashpot_state state = {sizeof state, 7, 0, position, velocity, NULL};
  dashpot_output output = {sizeof output, 7, torque};
  static dashpot_modes modes;
  dashpot_controller* arm;
  int tick;
  uint32_t i;

  if (argc != 2) {
    fprintf(stderr, "usage: plugin CONFIG\n");
    return 2;
  }
  arm = dashpot_create(argv[1]);
  if (arm == NULL) return failed("create");
  if (dashpot_start(arm, position, NULL) != DASHPOT_OK) return failed("start");
  for (tick = 1; tick <= 1000; ++tick) { /* every period, with what the robot reports */
    int32_t status;
    state.time = (int64_t)(1e9 * dashpot_period(arm)) * tick;
    status = dashpot_update(arm, &state, NULL, &output);
    if (status < DASHPOT_OK) return failed("update"); /* no torque was written: stop the robot */
    if (status != DASHPOT_OK) printf("tick %d: %s\n", tick, dashpot_status_text(status));
  }
  printf("torque, N m:");
  for (i = 0; i < 7; ++i) printf(" %.3f", torque[i]);
  modes.struct_size = sizeof modes;
  if (dashpot_read_modes(arm, &modes) != DASHPOT_OK) return failed("modes");
  printf("\n%u modes and %u zero modes\n", (unsigned)modes.count, (unsigned)modes.zero_modes);
  for (i = 0; i < modes.count; ++i) {
    const dashpot_mode* mode = &modes.modes[i];
    if (mode->kind == DASHPOT_UNDERDAMPED) {
      printf("%.3f rad/s, damping ratio %.3f\n", mode->natural_frequency, mode->damping_ratio);
    }
  }
  dashpot_destroy(arm);
  return 0;
}
