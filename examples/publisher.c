/* A host in C99 whose controller is seen on LCM: an arm that never moves, for a second;
 * publisher CONFIG, and beside it `dashpot monitor`.
 */
#define _POSIX_C_SOURCE 200112L
#include <dashpot/lcmtypes/plugin_publisher.h>

#include <stdio.h>
#include <time.h>

static int failed(const char* what, const char* why) {
  fprintf(stderr, "%s: %s\n", what, why);
  return 1;
}

int main(int argc, char** argv) {
  const double position[7] = {0, -0.785, 0, -2.356, 0, 1.571, 0.785}; /* rad */
  const double velocity[7] = {0};
  double torque[7] = {0}; /* N m */
  dashpot_state state = {sizeof state, 7, 0, position, velocity, NULL};
  dashpot_output output = {sizeof output, 7, torque};
  const struct timespec period = {0, 1000000};
  dashpot_controller* arm;
  dashpot_publisher* publisher;
  int tick;

  if (argc != 2) {
    fprintf(stderr, "usage: publisher CONFIG\n");
    return 2;
  }
  arm = dashpot_create(argv[1]);
  if (arm == NULL) return failed("create", dashpot_last_error());
  if (dashpot_start(arm, position, NULL) != DASHPOT_OK) {
    return failed("start", dashpot_last_error());
  }
  publisher = dashpot_publisher_create(arm, NULL); /* on the usual bus */
  if (publisher == NULL) return failed("publisher", dashpot_publisher_error());
  for (tick = 1; tick <= 1000; ++tick) {
    state.time = (int64_t)(1e9 * dashpot_period(arm)) * tick;
    if (dashpot_update(arm, &state, NULL, &output) < DASHPOT_OK) {
      return failed("update", dashpot_last_error()); /* no torque was written: stop the robot */
    }
    nanosleep(&period, NULL); /* a robot's driver sets the pace */
  }
  dashpot_publisher_destroy(publisher);
  dashpot_destroy(arm);
  printf("%d ticks, published\n", tick - 1);
  return 0;
}
