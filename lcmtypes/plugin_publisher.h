#pragma once
/* What a controller of plugin.h measures and finds, published over LCM, for hosts in any language:
 * the channels DASHPOT_STATE, DASHPOT_MODES and DASHPOT_SAMPLED_MODES of docs/plugin.md.
 *
 *   dashpot_publisher* p = dashpot_publisher_create(c, NULL);
 *   if (!p) { puts(dashpot_publisher_error()); return 1; }
 *   ... the loop, which does not know of it
 *   dashpot_publisher_destroy(p);
 *   dashpot_destroy(c);
 *
 * Link with libdashpot_publisher.so. It starts a thread, which looks for a new tick every half
 * millisecond. While there is a publisher, only this thread may call dashpot_read_snapshot,
 * dashpot_read_modes and dashpot_read_sampled_modes. Of ticks that follow each other faster, only
 * some are published. `utime` is the time when the tick was found. Values that only the host knows
 * (tick_time, overruns, verdicts of commands) are zero. */

/* NOLINTBEGIN(readability-identifier-naming) */
#include <dashpot/controller/plugin.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct dashpot_publisher dashpot_publisher;

/* Publishes on the bus `url`, such as "udpm://239.255.76.67:7667?ttl=0" or
 * "file:///tmp/arm.lcm?mode=w"; NULL stands for the environment's LCM_DEFAULT_URL, or else the
 * first of these. Of several URLs, one a line, each gets everything. `controller` must live longer
 * than the publisher. Returns NULL if the bus cannot be opened; dashpot_publisher_error says why.
 * Not real-time safe. */
dashpot_publisher* dashpot_publisher_create(dashpot_controller* controller, const char* url);

/* Publishes the last tick and destroys a publisher. Does nothing if `publisher` is NULL. */
void dashpot_publisher_destroy(dashpot_publisher* publisher);

/* Returns why dashpot_publisher_create failed last in this thread; "" if it did not. The text is
 * valid until the next call of it in this thread. */
const char* dashpot_publisher_error(void);

#ifdef __cplusplus
}
#endif
/* NOLINTEND(readability-identifier-naming) */
