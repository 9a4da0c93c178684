#pragma once
/* The Dashpot controller for hosts in any language: plain C99, arrays and numbers.
 *
 *   dashpot_controller* c = dashpot_create("panda.yaml");
 *   if (!c || dashpot_start(c, q, NULL)) { puts(dashpot_last_error()); return 1; }
 *   ... every millisecond:
 *   dashpot_state state = {sizeof state, n, time_ns, q, qd, NULL};
 *   dashpot_output output = {sizeof output, n, torque};
 *   int32_t status = dashpot_update(c, &state, NULL, &output);   (holds still)
 *   ... send torque, whatever the status
 *
 * Link with libdashpot_plugin.so, or load it and ask it for dashpot_plugin_interface.
 *
 * Units are SI: m, rad, kg, s, N, N m; time in nanoseconds. For a prismatic joint read m for rad
 * and N for N m. n is the number of joints, from the base to the tip. Matrices are given row by
 * row. Frames: B is the base link, T the tip or the tool's frame. Twists and wrenches have the
 * linear part first, are taken at T's origin, in B's axes.
 *
 * Threads. One thread, the real-time one, calls dashpot_update and dashpot_reset. One other thread
 * at a time calls dashpot_set_setpoint, dashpot_set_gains and dashpot_release, and one, which may
 * be the real-time thread, dashpot_read_snapshot, dashpot_read_modes and
 * dashpot_read_sampled_modes; none of these ever waits for the real-time thread or makes it wait.
 * dashpot_start is called before the loop begins. The remaining functions may be called by any
 * thread; dashpot_destroy only once no other call is under way. Controllers are independent of each
 * other. dashpot_update and dashpot_reset leave nothing for dashpot_last_error; of the others, the
 * first call in a thread may allocate that thread's text.
 *
 * Every struct begins with struct_size, which the caller sets to sizeof of that struct; a function
 * refuses any other value. No exception leaves the library. */

/* NOLINTBEGIN(readability-identifier-naming,modernize-use-using,modernize-deprecated-headers) */
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Grows whenever a function or struct changes; a library serves the versions it knows. */
#define DASHPOT_PLUGIN_VERSION 5u
#define DASHPOT_MAX_JOINTS 16

typedef struct dashpot_controller dashpot_controller;

/* What functions return. Zero and above: the status of a tick, with the torque that it comes with.
 *   hold: the springs stop where they are, whatever the set-point says.
 *   damp: no springs: joint damping, and the weight of the arm where the controller compensates it.
 *   ramp: the last good torque goes to zero within 0.1 s, or as fast as limits.torque_rate allows.
 * Where damp and ramp take torque away, it fades evenly, in all joints alike.
 * Faults latch: after any "damp" but DASHPOT_SETPOINT_LOST, and after a "ramp" of more than
 * watchdog.longest_gap, the arm stays damped, with its weight held, and the status is at least
 * DASHPOT_FAULT_LATCHED, until dashpot_release or dashpot_reset, or, where the configuration has
 * watchdog.release_after, until the arm has been at rest for that long. dashpot_snapshot.fault
 * names the fault. Springs then start where the robot is. docs/safety.md has each fault in full.
 * Below zero: a call that was refused and did nothing. */
enum {
  DASHPOT_OK = 0,
  DASHPOT_TORQUE_LIMITED = 1,    /* a limit of torque, torque rate, power or speed is at work */
  DASHPOT_NEAR_JOINT_LIMIT = 2,  /* a joint is pushed back from a position limit that is near */
  DASHPOT_WRENCH_NOT_FINITE = 3, /* NaN or infinity in the external wrench: the last one stays */
  DASHPOT_SETPOINT_REJECTED = 4, /* the set-point is not possible; the last good one stays */
  DASHPOT_WEIGHT_NOT_HELD = 5,   /* the weight needs more than a torque limit: the arm sinks */
  DASHPOT_SETPOINT_STALE = 6,    /* the set-point is old: hold */
  DASHPOT_SETPOINT_LOST = 7,     /* the set-point is very old: damp */
  DASHPOT_FAULT_LATCHED = 8,     /* a fault is over, but was not released: damp */
  DASHPOT_TOO_MANY_RESTARTS = 9, /* springs started again too often: damp */
  DASHPOT_TIME_GAP = 10,         /* the last good state is too long ago: damp */
  DASHPOT_WRONG_RATE = 11,       /* the loop runs at another rate than the configured one: damp */
  DASHPOT_COLLISION = 12,        /* an external torque or force above its threshold: damp */
  DASHPOT_INSTABILITY = 13,      /* a vibration grows, or the torque reverses all the time: damp */
  DASHPOT_TIP_SPEED_LIMIT = 14,  /* the tip is too fast: damp */
  DASHPOT_VELOCITY_LIMIT = 15,   /* a joint is too fast: damp */
  DASHPOT_WALL = 16,             /* the tip is beyond a wall of limits.walls: damp */
  DASHPOT_POSITION_LIMIT = 17,   /* a joint is outside its position limits: damp; slow return */
  DASHPOT_STATE_FROZEN = 18,     /* the state never changes though the torque does: weight alone */
  DASHPOT_STATE_CONTRADICTORY = 19, /* positions do not move as the velocities say: damp, by what
                                       the positions say */
  DASHPOT_STATE_NOT_FINITE = 20,    /* NaN or infinity in position or velocity: ramp */
  DASHPOT_STATE_WRONG_SIZE = 21,    /* the state is missing or has not n joints: ramp */
  DASHPOT_STATE_JUMP = 22,          /* further from the last state than the robot can move: ramp */
  DASHPOT_TIME_BACKWARD = 23,       /* the state's time is at or before the last one: ramp */
  DASHPOT_NOT_FINITE = 24,          /* the torque would not be finite: ramp */

  DASHPOT_NULL_ARGUMENT = -1,     /* a pointer that has to be there is NULL */
  DASHPOT_WRONG_STRUCT_SIZE = -2, /* struct_size is not that of this version */
  DASHPOT_WRONG_JOINTS = -3,      /* joints is not n */
  DASHPOT_WRONG_VALUE = -4,       /* not finite, not semidefinite, out of reach, ... */
  DASHPOT_NOTHING_YET = -5,       /* nothing to read so far */
  DASHPOT_UNSTABLE_GAINS = -6     /* the sampled loop would have less than limits.gain_margin */
};

enum { DASHPOT_MODE_JOINT = 0, DASHPOT_MODE_CARTESIAN = 1 };
enum { DASHPOT_FRAME_BASE = 0, DASHPOT_FRAME_TOOL = 1 };

enum {
  DASHPOT_UNDERDAMPED = 0,
  DASHPOT_CRITICAL = 1,
  DASHPOT_OVERDAMPED = 2,
  DASHPOT_UNDAMPED = 3,
  DASHPOT_UNSTABLE = 4,
  DASHPOT_SOFT = 5
};

/* Where modes come from. */
enum {
  DASHPOT_TRACKED = 0, /* the modes before, refined */
  DASHPOT_REUSED = 1,  /* the modes before: nothing that matters has changed */
  DASHPOT_DIRECT = 2   /* solved directly */
};

/* As dashpot_setpoint.time: given at the tick that takes it up. */
#define DASHPOT_ON_ARRIVAL INT64_MIN

/* What the robot reports at the beginning of a tick. */
typedef struct dashpot_state {
  uint32_t struct_size;
  uint32_t joints;               /* n */
  int64_t time;                  /* ns, of any clock that does not run backward */
  const double* position;        /* n, rad */
  const double* velocity;        /* n, rad/s */
  const double* external_wrench; /* 6, that the world exerts on the tip, N and N m; NULL: zero. For
                                    the analysis and limits.external_force: with that, one that is
                                    not finite is a collision; else no torque depends on it. */
} dashpot_state;

/* Where to go; the controller gets there smoothly. */
typedef struct dashpot_setpoint {
  uint32_t struct_size;
  uint32_t joints;              /* n */
  int64_t time;                 /* ns, when it was given, on the clock of dashpot_state, or
                                   DASHPOT_ON_ARRIVAL; dashpot_update takes a set-point with the
                                   time of the last one for the same */
  int32_t mode;                 /* DASHPOT_MODE_JOINT or DASHPOT_MODE_CARTESIAN */
  const double* joint_position; /* n, rad: the goal of the joint mode, and there wanted; otherwise
                                   the posture, or NULL: the one there is */
  const double* tip_position;   /* 3, of T in B, m: wanted in the Cartesian mode, else not used */
  const double* tip_rotation;   /* 3 x 3, turns T's axes into B's; likewise */
  const double* wrench;         /* 6, that the tip is to exert besides, N and N m; NULL: zero */
} dashpot_setpoint;

/* Springs and dampers. Matrices are symmetric positive semidefinite. What is NULL stays. */
typedef struct dashpot_gains {
  uint32_t struct_size;
  uint32_t joints;                   /* n */
  const double* joint_stiffness;     /* n x n, N m/rad */
  const double* joint_damping;       /* n x n, N m s/rad */
  const double* task_stiffness;      /* 6 x 6, N/m, N/rad and N m/rad */
  const double* task_damping;        /* 6 x 6, N s/m, N s/rad and N m s/rad */
  const double* task_damping_ratio;  /* 1, from 0 to 2: above 0, C_C is designed at every tick so
                                        that every mode of the task has this damping ratio, in place
                                        of task_damping; 0: C_C is task_damping. task_damping alone
                                        makes it 0, and does not go with one above 0. */
  const double* null_stiffness;      /* n, not negative, N m/rad, toward the posture */
  const double* null_damping;        /* n, not negative, N m s/rad */
  const int32_t* frame;              /* in whose axes the 6 x 6 are: DASHPOT_FRAME_BASE or _TOOL */
  const uint8_t* directions;         /* 6, whether the task holds this direction of `frame` */
  const double* joint_damping_ratio; /* 1, from 0 to 2: what task_damping_ratio is to the task, for
                                        the modes of the joint mode and joint_damping */
} dashpot_gains;

/* What the robot's joints are to exert. */
typedef struct dashpot_output {
  uint32_t struct_size;
  uint32_t joints; /* n */
  double* torque;  /* n, written, N m */
} dashpot_output;

/* One tick, seen from outside. Entries from n on are zero. With a status whose output is "ramp",
 * position and velocity are those given, where they are numbers; tip, goals, law_torque, tip_error
 * and tip_wrench are those of the last good state. */
typedef struct dashpot_snapshot {
  uint32_t struct_size;
  uint32_t joints;   /* n */
  int64_t time;      /* of the state, ns */
  uint64_t tick;     /* counts from 1 */
  uint64_t restarts; /* how often the springs restarted, the first time included */
  int32_t status;    /* DASHPOT_OK, ... */
  int32_t fault;     /* the status that latched; DASHPOT_OK: none */
  int32_t mode;      /* DASHPOT_MODE_JOINT or DASHPOT_MODE_CARTESIAN */
  int32_t reserved;  /* 0 */
  double position[DASHPOT_MAX_JOINTS]; /* rad */
  double velocity[DASHPOT_MAX_JOINTS]; /* rad/s */
  double torque[DASHPOT_MAX_JOINTS];   /* N m */
  double tip_position[3];              /* of T in B, m */
  double tip_rotation[9];              /* 3 x 3, turns T's axes into B's */
  double
      reference_joint_position[DASHPOT_MAX_JOINTS]; /* where the springs are fixed just now, rad */
  double reference_tip_position[3];                 /* m */
  double reference_tip_rotation[9];                 /* 3 x 3 */
  double law_torque[DASHPOT_MAX_JOINTS];            /* what the law asked for, before limits, N m */
  double tip_error[6];  /* goal less tip, m, and rotation vector from tip to goal, rad */
  double tip_wrench[6]; /* of Cartesian springs, dampers and feed-forward, N and N m */
} dashpot_snapshot;

/* A vibration mode; docs/concepts.md says what the numbers mean. A bound says how far the
 * number can be wrong; it is infinite if none could be proved. */
typedef struct dashpot_mode {
  double natural_frequency;              /* rad/s; NaN if there is none */
  double natural_frequency_bound;        /* rad/s */
  double damping_ratio;                  /* above 1 if overdamped */
  double damping_ratio_bound;            /* */
  double damped_frequency;               /* rad/s */
  double eigenvalues[2][2];              /* real and imaginary part, 1/s */
  double eigenvalue_bound;               /* 1/s */
  int32_t kind;                          /* DASHPOT_UNDERDAMPED, ... */
  int32_t label;                         /* stays with this mode as long as it can be followed */
  double shape_real[DASHPOT_MAX_JOINTS]; /* how far each joint moves, u^H M u = 1; zero if the
                                            configuration asks for no shapes */
  double shape_imag[DASHPOT_MAX_JOINTS];
} dashpot_mode;

/* The modes at one tick, by falling natural frequency. */
typedef struct dashpot_modes {
  uint32_t struct_size;
  uint32_t joints;                     /* n */
  int64_t time;                        /* of the state that they belong to, ns */
  uint64_t tick;                       /* likewise */
  double position[DASHPOT_MAX_JOINTS]; /* likewise, rad */
  int32_t status;                      /* 0: all numbers have a proved bound */
  uint32_t zero_modes;                 /* motions that no spring resists */
  uint32_t count;                      /* of the modes */
  int32_t origin;                      /* DASHPOT_TRACKED, ... */
  /* Ticks since the start or the last reset, each of which counts once here, ... */
  uint64_t tracked;    /* the modes before were refined */
  uint64_t reused;     /* the modes before still held within their bounds */
  uint64_t direct;     /* solved directly */
  uint64_t unchanged;  /* joints and gains did not move at all: nothing was computed */
  uint64_t no_springs; /* nothing vibrates: nothing was solved */
  uint64_t failed;     /* no modes */
  uint64_t missed;     /* the background thread was busy */
  /* ... and what some of them could leave out. */
  uint64_t no_zero_modes; /* springs hold every motion */
  uint64_t proportional;  /* the undamped modes decouple the damping, by design or for want of it */
  uint64_t no_wrench;     /* geometric_stiffness is on, but there is no external wrench */
  uint64_t no_shapes;     /* nobody asks for shapes */
  uint64_t at_rest;       /* jacobian_rate is on, but the robot stands still */
  dashpot_mode modes[DASHPOT_MAX_JOINTS];
} dashpot_modes;

/* A mode of the continuous loop, and what becomes of it because the torque is held over a tick,
 * delayed and filtered. */
typedef struct dashpot_sampled_mode {
  double continuous_frequency; /* natural, rad/s */
  double continuous_ratio;     /* */
  double natural_frequency;    /* rad/s; NaN if there is none */
  double damping_ratio;        /* */
  double damped_frequency;     /* rad/s */
  int32_t kind;                /* DASHPOT_UNDERDAMPED, ... */
  int32_t reserved;            /* 0 */
} dashpot_sampled_mode;

/* The sampled loop at one tick, now and then, if the configuration asks for it
 * (analysis: sampled: interval). */
typedef struct dashpot_sampled_modes {
  uint32_t struct_size;
  uint32_t joints;                     /* n */
  int64_t time;                        /* of the state that they belong to, ns */
  uint64_t tick;                       /* likewise */
  double position[DASHPOT_MAX_JOINTS]; /* likewise, rad */
  double spectral_radius;              /* the loop is stable below 1 */
  double gain_margin; /* all gains can grow by this factor before it is unstable; infinity: any */
  int32_t status;     /* 0: all modes were found */
  uint32_t count;     /* of the modes, by falling continuous_frequency */
  dashpot_sampled_mode modes[DASHPOT_MAX_JOINTS];
} dashpot_sampled_modes;

/* Reads a YAML file (see controller/examples/panda.yaml) and the URDF that it names. NULL on
 * failure: dashpot_last_error says why, in one line with file, key and line. Gains that
 * dashpot_set_gains would refuse are a failure. */
dashpot_controller* dashpot_create(const char* config_path);

/* NULL is fine. */
void dashpot_destroy(dashpot_controller* controller);

/* What the last call of dashpot_create, dashpot_start, dashpot_set_setpoint, dashpot_set_gains,
 * dashpot_judge_gains, dashpot_release, dashpot_read_snapshot, ..._modes or ..._sampled_modes in
 * this thread had to complain of, in one line; "" if nothing. Valid until the next such call in
 * this thread. */
const char* dashpot_last_error(void);

/* n; 0 if `controller` is NULL */
uint32_t dashpot_joints(const dashpot_controller* controller);
/* Of joint 0 to n - 1, from the base to the tip, as in the URDF; NULL if there is no such joint.
 * Valid until dashpot_destroy. */
const char* dashpot_joint_name(const dashpot_controller* controller, uint32_t joint);
/* Of the loop, s; 0 if `controller` is NULL */
double dashpot_period(const dashpot_controller* controller);

/* One tick, on the real-time thread: takes bounded time, allocates nothing, waits for nothing.
 * `setpoint` NULL: the latest of dashpot_set_setpoint; the last one if there is no new one; until
 * there is one at all, the robot is held where it is. Use one of the two ways, not both. New gains
 * count from the next set-point that is new, by its time, or NULL.
 * Returns a status, or a negative code: then `output` is not written, and the host has to bring
 * the robot to a stop. A state that is NULL or wrong is no refusal: it gives a torque and a
 * status. A set-point that is wrong is rejected, and the last one stays. */
int32_t dashpot_update(dashpot_controller* controller, const dashpot_state* state,
                       const dashpot_setpoint* setpoint, dashpot_output* output);

/* Before the loop begins, with the robot at rest at `position` (n, rad): judges the gains of the
 * configuration there, as dashpot_set_gains does, and then does what dashpot_reset does, but that
 * `torque` NULL stands for the arm's weight there (zero where the robot compensates it). Takes some
 * milliseconds and allocates. Returns DASHPOT_OK or a negative code; dashpot_last_error says more.
 * A loop that never called it starts from the weight too, but with gains that nobody judged at its
 * posture. */
int32_t dashpot_start(dashpot_controller* controller, const double* position, const double* torque);

/* On the real-time thread: forgets history, faults and set-point, but not the gains; the next tick
 * holds the robot where it is, as the first one did, and until modes are found again there are
 * none. The torque-rate limit counts from `torque` (n, N m), which the robot applies now; NULL:
 * from the last one put out, or, before the first tick, from the arm's weight. */
int32_t dashpot_reset(dashpot_controller* controller, const double* torque);

/* On the other thread: the next tick releases a latched fault, unless its cause is still there, and
 * holds the robot where it is until there is another set-point. Without a fault it does nothing. */
int32_t dashpot_release(dashpot_controller* controller);

/* On the other thread. The next tick takes it up; of several, the latest. dashpot_set_gains refuses
 * gains (DASHPOT_UNSTABLE_GAINS) with which the loop as it is sampled, at the posture of the latest
 * tick, would have less than limits.gain_margin: in either mode, with the delay and the filters of
 * analysis.sampled. Before dashpot_start and the first tick, it refuses those that have it at none
 * of eight postures spread over the position limits. A motion that needs more than 6 s to swing or
 * to grow e-fold does not count. It judges gains that are new, which takes some milliseconds and
 * allocates. */
int32_t dashpot_set_setpoint(dashpot_controller* controller, const dashpot_setpoint* setpoint);
int32_t dashpot_set_gains(dashpot_controller* controller, const dashpot_gains* gains);

/* On any thread, for instance the one that receives gains: judges them as dashpot_set_gains would,
 * at `position` (n, rad; NULL: at the posture of the latest tick, if there was one), and sets
 * `margin` (NULL: not wanted) to the factor by which they could grow, or to limits.gain_margin if
 * it is more. What is NULL in `gains` is that of the configuration. What it has accepted last
 * dashpot_set_gains does not judge again, within 0.1 rad of that posture. */
int32_t dashpot_judge_gains(dashpot_controller* controller, const dashpot_gains* gains,
                            const double* position, double* margin);

/* On the other thread: the latest finished tick, the latest modes, and the latest of the sampled
 * loop. The caller sets struct_size, the rest is written. */
int32_t dashpot_read_snapshot(dashpot_controller* controller, dashpot_snapshot* snapshot);
int32_t dashpot_read_modes(dashpot_controller* controller, dashpot_modes* modes);
int32_t dashpot_read_sampled_modes(dashpot_controller* controller, dashpot_sampled_modes* modes);

/* A short English text for what a function returned ("torque limited"), and for the kind of a mode
 * ("underdamped"). Never NULL. */
const char* dashpot_status_text(int32_t status);
const char* dashpot_kind_text(int32_t kind);

/* All of the above, for hosts that load the library at run time. */
typedef struct dashpot_plugin {
  uint32_t struct_size;
  uint32_t version; /* DASHPOT_PLUGIN_VERSION */
  dashpot_controller* (*create)(const char*);
  void (*destroy)(dashpot_controller*);
  const char* (*last_error)(void); /* NOLINT(modernize-redundant-void-arg): C needs it */
  uint32_t (*joints)(const dashpot_controller*);
  const char* (*joint_name)(const dashpot_controller*, uint32_t);
  double (*period)(const dashpot_controller*);
  int32_t (*update)(dashpot_controller*, const dashpot_state*, const dashpot_setpoint*,
                    dashpot_output*);
  int32_t (*start)(dashpot_controller*, const double*, const double*);
  int32_t (*reset)(dashpot_controller*, const double*);
  int32_t (*release)(dashpot_controller*);
  int32_t (*set_setpoint)(dashpot_controller*, const dashpot_setpoint*);
  int32_t (*set_gains)(dashpot_controller*, const dashpot_gains*);
  int32_t (*judge_gains)(dashpot_controller*, const dashpot_gains*, const double*, double*);
  int32_t (*read_snapshot)(dashpot_controller*, dashpot_snapshot*);
  int32_t (*read_modes)(dashpot_controller*, dashpot_modes*);
  int32_t (*read_sampled_modes)(dashpot_controller*, dashpot_sampled_modes*);
  const char* (*status_text)(int32_t);
  const char* (*kind_text)(int32_t);
} dashpot_plugin;

/* NULL if the library does not know this version. The struct lives as long as the library. */
const dashpot_plugin* dashpot_plugin_interface(uint32_t version);

#ifdef __cplusplus
}
#endif
/* NOLINTEND(readability-identifier-naming,modernize-use-using,modernize-deprecated-headers) */
