#pragma once
/* The Dashpot controller for hosts in any language: plain C99, arrays and numbers.
 *
 *   dashpot_controller* c = dashpot_create("panda.yaml");
 *   if (!c || dashpot_start(c, q, NULL)) { puts(dashpot_last_error()); return 1; }
 *   ... every millisecond:
 *   dashpot_state state = {sizeof state, n, time_ns, q, qd, NULL};
 *   dashpot_output output = {sizeof output, n, torque};
 *   int32_t status = dashpot_update(c, &state, NULL, &output);   (stays where it is)
 *   ... send torque, whatever the status
 *
 * Link with libdashpot_plugin.so, or load it and ask it for dashpot_plugin_interface.
 *
 * Units are SI: m, rad, kg, s, N, N m; time in nanoseconds. For a prismatic joint read m for rad
 * and N for N m. n is the number of joints, from the base to the tip. Matrices are given row by
 * row. Frames: B is the base link, T the tip or the tool's frame. Twists and wrenches have the
 * linear part first, are taken at T's origin, in B's axes.
 *
 * Threads. One thread, the real-time thread, calls dashpot_update, dashpot_needs_brakes,
 * dashpot_stop and dashpot_reset. One other thread at a time, "the other thread" below, calls
 * dashpot_set_setpoint, dashpot_set_gains, dashpot_set_payload, dashpot_limit_tip_speed and
 * dashpot_release. One thread, always the same, calls dashpot_read_snapshot, dashpot_read_modes and
 * dashpot_read_sampled_modes; it may be the real-time thread. None of these calls ever waits for
 * the real-time thread or makes it wait. dashpot_start is called before the loop begins. Any thread
 * may call the remaining functions, but dashpot_destroy only once no other call is under way.
 * Controllers are independent of each other. dashpot_update, dashpot_stop and dashpot_reset never
 * change the text of dashpot_last_error; of the other functions, the first call in a thread may
 * allocate that thread's text.
 *
 * Every struct begins with struct_size, which the caller sets to the sizeof of the struct; a
 * function refuses any other value. No exception leaves the library. */

/* NOLINTBEGIN(readability-identifier-naming,modernize-deprecated-headers) */
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Version of this interface. It increases whenever a function or struct changes. A library
 * serves the versions that it knows. */
#define DASHPOT_PLUGIN_VERSION 12u
/* Largest n. */
#define DASHPOT_MAX_JOINTS 16

/* A controller of one robot; dashpot_create returns it. */
typedef struct dashpot_controller dashpot_controller;

/* What functions return.
 *
 * Zero and above: the status of a tick. If several conditions hold, the most severe, the last in
 * this list, is returned. Before DASHPOT_SETPOINT_STALE the torque comes from springs, dampers and
 * feed-forward, within the limits. From there on each status names its output:
 *   hold: the springs stop where they are, whatever the set-point says; no commanded wrench.
 *   damp: a brake, which holds the arm once it stands, and the weight of the arm where the
 *         controller compensates it.
 *   ramp: the last torque for watchdog.longest_gap; then the last known weight, and a brake for the
 *         motion that the model predicts; after 2 s the torque goes to zero within 0.1 s.
 * Where damp and ramp take torque away, it fades evenly, in all joints alike.
 *
 * Faults latch. After any "damp" but DASHPOT_SETPOINT_LOST, after DASHPOT_STATE_FROZEN, and after a
 * "ramp" longer than watchdog.longest_gap, the arm stays braked, with its weight held (the weight
 * alone as long as the state is frozen, and after DASHPOT_BRAKE_DOUBTED), and the status is at
 * least DASHPOT_FAULT_LATCHED. dashpot_snapshot.fault names the fault. This ends with
 * dashpot_release or dashpot_reset, or, if the configuration sets watchdog.release_after, once the
 * arm has been at rest for that long. Springs then start where the robot is. docs/safety.md
 * describes each fault.
 *
 * Below zero: the call was refused and did nothing. */
enum {
  DASHPOT_OK = 0,
  DASHPOT_TORQUE_LIMITED = 1,     /* a limit of torque, its rate, power, speed or energy acts */
  DASHPOT_NEAR_JOINT_LIMIT = 2,   /* a joint is kept from going beyond a position limit */
  DASHPOT_LITTLE_MARGIN = 3,      /* springs too stiff for the sampled loop: no damping ratio, or no
                                      lower one, keeps limits.gain_margin here */
  DASHPOT_WRENCH_NOT_FINITE = 4,  /* NaN or infinity in the external wrench; the last finite one
                                     stays. With limits.external_force: a collision */
  DASHPOT_SETPOINT_REJECTED = 5,  /* the set-point is not possible; the last good one stays */
  DASHPOT_WEIGHT_NOT_HELD = 6,    /* the weight needs more than a torque limit: the arm sinks */
  DASHPOT_SETPOINT_STALE = 7,     /* the set-point is old: hold */
  DASHPOT_SETPOINT_LOST = 8,      /* the set-point is very old: damp */
  DASHPOT_FAULT_LATCHED = 9,      /* a fault is over, but was not released: damp */
  DASHPOT_TOO_MANY_RESTARTS = 10, /* the springs restarted too often: damp */
  DASHPOT_TIME_GAP = 11,          /* more than watchdog.longest_gap since the last state: damp */
  DASHPOT_WRONG_RATE = 12,        /* the loop runs at another rate than the configured one: damp */
  DASHPOT_COLLISION = 13,         /* an external torque or force above its threshold: damp */
  DASHPOT_INSTABILITY = 14,       /* a vibration, or a torque that reverses all the time: damp */
  DASHPOT_TIP_SPEED_LIMIT = 15,   /* the tip is too fast: damp */
  DASHPOT_VELOCITY_LIMIT = 16,    /* a joint is too fast: damp */
  DASHPOT_WALL = 17,              /* the tip is beyond a wall of limits.walls: damp */
  DASHPOT_POSITION_LIMIT = 18,    /* a joint is outside its position limits: damp; slow return */
  DASHPOT_STATE_FROZEN = 19,      /* the state never changes though it should: weight alone */
  DASHPOT_STATE_CONTRADICTORY = 20, /* positions do not move as the velocities say: damp, with
                                       velocities from the positions */
  DASHPOT_TIME_BACKWARD = 21,       /* times that do not go forward count as a period: no torque
                                       changes, but damp after watchdog.longest_gap of them */
  DASHPOT_BRAKE_DOUBTED = 22,       /* the brake acts, and the arm gets faster or vibrates: weight
                                       alone. Engage the robot's own brakes */
  DASHPOT_STATE_NOT_FINITE = 23,    /* NaN or infinity in position or velocity: ramp */
  DASHPOT_STATE_WRONG_SIZE = 24,    /* the state is missing or not one of n joints: ramp */
  DASHPOT_STATE_JUMP = 25,          /* further from the last state than the robot can move: ramp */
  DASHPOT_NOT_FINITE = 26,          /* the torque would not be finite: ramp */

  DASHPOT_NULL_ARGUMENT = -1,     /* a required pointer is NULL */
  DASHPOT_WRONG_STRUCT_SIZE = -2, /* struct_size is not the size of the struct in this version */
  DASHPOT_WRONG_JOINTS = -3,      /* the member `joints` is not n */
  DASHPOT_WRONG_VALUE = -4,       /* a value is not finite, not semidefinite, beyond a limit, ... */
  DASHPOT_NOTHING_YET = -5,       /* there is nothing to read so far */
  DASHPOT_UNSTABLE_GAINS = -6     /* the sampled loop would have less than limits.gain_margin */
};

/* Where the springs are fixed: to a joint position, or to a pose of the tip. */
enum { DASHPOT_MODE_JOINT = 0, DASHPOT_MODE_CARTESIAN = 1 };
/* The axes in which the gains of the task are given: B's or T's. */
enum { DASHPOT_FRAME_BASE = 0, DASHPOT_FRAME_TOOL = 1 };
enum {
  DASHPOT_PROJECTOR_DYNAMIC = 0,
  DASHPOT_PROJECTOR_KINEMATIC = 1,
  DASHPOT_PROJECTOR_WEIGHTED = 2,
  DASHPOT_PROJECTOR_NONE = 3
};

/* How a mode moves; docs/concepts.md has the terms. */
enum {
  DASHPOT_UNDERDAMPED = 0,
  DASHPOT_CRITICAL = 1,
  DASHPOT_OVERDAMPED = 2,
  DASHPOT_UNDAMPED = 3,
  DASHPOT_UNSTABLE = 4,
  DASHPOT_SOFT = 5,
  DASHPOT_ALTERNATING = 6 /* of the sampled loop: it changes its sign with every tick */
};

/* Where modes come from. */
enum {
  DASHPOT_TRACKED = 0, /* the last modes were refined */
  DASHPOT_REUSED = 1,  /* the last modes, because the system is the same to the last bit */
  DASHPOT_DIRECT = 2   /* the modes were solved directly */
};

/* Value of dashpot_setpoint.time: the set-point counts as given at the tick that takes it up. */
#define DASHPOT_ON_ARRIVAL INT64_MIN

/* What the robot reports at the beginning of a tick. */
typedef struct dashpot_state {
  uint32_t struct_size;
  uint32_t joints;               /* n */
  int64_t time;                  /* ns, of any clock that does not run backward */
  const double* position;        /* n, rad */
  const double* velocity;        /* n, rad/s */
  const double* external_wrench; /* 6, wrench that the world exerts on the tip, N and N m; NULL:
                                    zero. Only the analysis and limits.external_force use it. With
                                    limits.external_force, a wrench that is not finite is a
                                    collision; otherwise no torque depends on the wrench. */
} dashpot_state;

/* Where the robot is to go; the controller moves there smoothly. */
typedef struct dashpot_setpoint {
  uint32_t struct_size;
  uint32_t joints;              /* n */
  int64_t time;                 /* ns, when the set-point was given, on the clock of dashpot_state,
                                   or DASHPOT_ON_ARRIVAL. dashpot_update takes a set-point with
                                   the time of the last one for the same set-point. */
  int32_t mode;                 /* DASHPOT_MODE_JOINT or DASHPOT_MODE_CARTESIAN */
  const double* joint_position; /* n, rad. Joint mode: the goal, required. Cartesian mode: the
                                   posture of the null-space springs, or NULL to keep the current
                                   one, which is where the robot is when this mode begins. */
  const double* tip_position;   /* 3, of T in B, m. Cartesian mode: the goal, required. Joint mode:
                                   not used. */
  const double* tip_rotation;   /* 3 x 3, turns T's axes into B's; required as tip_position is */
  const double* wrench;         /* 6, wrench that the tip exerts in addition, N and N m; NULL:
                                   zero */
} dashpot_setpoint;

/* Springs and dampers. Matrices are symmetric positive semidefinite. A member that is NULL keeps
 * its current value. */
typedef struct dashpot_gains {
  uint32_t struct_size;
  uint32_t joints;                   /* n */
  const double* joint_stiffness;     /* n x n, N m/rad */
  const double* joint_damping;       /* n x n, N m s/rad */
  const double* task_stiffness;      /* 6 x 6, N/m, N/rad and N m/rad */
  const double* task_damping;        /* 6 x 6, N s/m, N s/rad and N m s/rad */
  const double* task_damping_ratio;  /* 1, from 0 to 2. Above 0, C_C is designed at every tick so
                                        that every mode of the task has this damping ratio, and
                                        task_damping has to be NULL. 0: C_C is task_damping.
                                        task_damping without a ratio sets the ratio to 0.
                                        Where no spring acts, there is nothing to design: there
                                        the task_damping given last, or the configuration's, acts
                                        with a ratio, too. */
  const double* null_stiffness;      /* n, not negative, N m/rad, toward the posture */
  const double* null_damping;        /* n, not negative, N m s/rad */
  const int32_t* frame;              /* axes of the 6 x 6: DASHPOT_FRAME_BASE or _TOOL */
  const uint8_t* directions;         /* 6; an entry that is not zero gives the task springs and
                                        dampers in this direction of `frame` */
  const double* joint_damping_ratio; /* 1, from 0 to 2: the same for joint_damping and the modes of
                                        the joint mode */
  const double* null_damping_ratio;  /* 1, from 0 to 2: the same for null_damping and the motions
                                        that the task leaves free, with null_stiffness */
  const int32_t* null_projector;     /* DASHPOT_PROJECTOR_..., through which these act */
} dashpot_gains;

/* What the arm carries, in the axes of the tip link, and its tool. */
typedef struct dashpot_payload {
  uint32_t struct_size;
  uint32_t reserved;           /* 0 */
  double mass;                 /* kg */
  double center[3];            /* of mass, from the tip link's origin, m */
  double inertia[9];           /* 3 x 3, about the centre of mass, kg m^2 */
  const double* tool_position; /* 3, of the tool's frame T in the tip link, m; NULL: as it is */
  const double* tool_rotation; /* 3 x 3, turns T's axes into the tip link's; NULL: as it is */
  const dashpot_gains* gains;  /* that come with it, in the same tick; NULL: as they are */
} dashpot_payload;

/* The torque that the robot's joints are to exert. */
typedef struct dashpot_output {
  uint32_t struct_size;
  uint32_t joints; /* n */
  double* torque;  /* n, N m; dashpot_update writes the n numbers it points to */
} dashpot_output;

/* What one tick measured and put out. Entries from n on are zero. With a status whose output is
 * "ramp", position and velocity are the given ones where they are numbers; tip, reference,
 * law_torque, tip_error and tip_wrench belong to the last good state. */
typedef struct dashpot_snapshot {
  uint32_t struct_size;
  uint32_t joints;   /* n */
  int64_t time;      /* of the state, ns */
  uint64_t tick;     /* counts from 1 */
  uint64_t restarts; /* how often the springs restarted, the first time included */
  int32_t status;    /* DASHPOT_OK, ... */
  int32_t fault;     /* the latched fault, as a status; DASHPOT_OK: none */
  int32_t mode;      /* DASHPOT_MODE_JOINT or DASHPOT_MODE_CARTESIAN */
  int32_t reserved;  /* 0 */
  double position[DASHPOT_MAX_JOINTS]; /* rad */
  double velocity[DASHPOT_MAX_JOINTS]; /* rad/s */
  double torque[DASHPOT_MAX_JOINTS];   /* N m */
  double tip_position[3];              /* of T in B, m */
  double tip_rotation[9];              /* 3 x 3, turns T's axes into B's */
  /* Where the joint springs are fixed just now; in the Cartesian mode the posture; rad. While no
   * springs act, `position`. */
  double reference_joint_position[DASHPOT_MAX_JOINTS];
  /* Where the Cartesian springs are fixed just now, m; while none acts, where T is. */
  double reference_tip_position[3];
  double reference_tip_rotation[9];      /* 3 x 3, likewise */
  double law_torque[DASHPOT_MAX_JOINTS]; /* torque of the impedance law, or of "damp", before the
                                            limits, N m */
  double tip_error[6];  /* from tip to reference: difference of positions, m, and rotation
                           vector, rad */
  double tip_wrench[6]; /* wrench of Cartesian springs, dampers and feed-forward, N and N m */
  /* The damping ratios for which the damping of the active springs is designed; 0: given. */
  double joint_damping_ratio;
  double task_damping_ratio;
  double damping_level; /* smallest share of its damping ratio that the sampled loop leaves a mode,
                           also in the null space; 1: it keeps its margin with all ratios */
  double energy_store;  /* left in the energy tank, J; infinite if control.energy is free */
  double spring_share;  /* of the springs' torque that the energy in the tank allows; 1: all */
  /* Payload and tool at this tick, on their way to the arguments of dashpot_set_payload: */
  double payload_mass;       /* kg */
  double payload_center[3];  /* from the tip link's origin, in its axes, m */
  double payload_inertia[9]; /* 3 x 3, about the centre of mass, kg m^2 */
  double tool_position[3];   /* of T in the tip link, m */
  double tool_rotation[9];   /* 3 x 3, turns T's axes into the tip link's */
} dashpot_snapshot;

/* A vibration mode; docs/concepts.md explains the numbers. A bound is proved: the number differs
 * from the true one by at most this. It is infinite if none could be proved. */
typedef struct dashpot_mode {
  double natural_frequency;              /* rad/s; NaN if there is none */
  double natural_frequency_bound;        /* rad/s */
  double damping_ratio;                  /* no unit; above 1 if overdamped */
  double damping_ratio_bound;            /* no unit */
  double damped_frequency;               /* rad/s */
  double eigenvalues[2][2];              /* real and imaginary part, 1/s */
  double eigenvalue_bound;               /* 1/s */
  int32_t kind;                          /* DASHPOT_UNDERDAMPED, ... */
  int32_t label;                         /* a mode keeps it as long as it can be followed */
  double shape_real[DASHPOT_MAX_JOINTS]; /* real part of u: how far each joint moves, u^H M u = 1,
                                            then the motors of elastic joints, in order;
                                            zero if the configuration asks for no shapes */
  double shape_imag[DASHPOT_MAX_JOINTS]; /* imaginary part of u */
} dashpot_mode;

/* The modes at one tick, by falling natural frequency. */
typedef struct dashpot_modes {
  uint32_t struct_size;
  uint32_t joints;                     /* n */
  int64_t time;                        /* of the state that the modes belong to, ns */
  uint64_t tick;                       /* of that state */
  double position[DASHPOT_MAX_JOINTS]; /* of that state, rad */
  int32_t status;                      /* 0: all numbers have a proved bound */
  uint32_t zero_modes;                 /* number of motions that no spring resists */
  uint32_t count;                      /* number of modes, more than n with elastic joints */
  int32_t origin;                      /* DASHPOT_TRACKED, ... */
  /* Numbers of ticks since the start or the last reset. Each tick that is to be analysed
   * (analysis.every) counts once in these: */
  uint64_t tracked;    /* the last modes were refined */
  uint64_t reused;     /* the last modes, because the system is the same to the last bit */
  uint64_t direct;     /* the modes were solved directly */
  uint64_t unchanged;  /* joints and gains did not move at all, so nothing was computed */
  uint64_t no_springs; /* nothing vibrates, so nothing was solved */
  uint64_t failed;     /* there are no modes */
  uint64_t missed;     /* the background thread was busy */
  /* What some of these ticks could leave out: */
  uint64_t no_zero_modes; /* springs resist every motion, so no zero modes were kept apart */
  uint64_t no_wrench;     /* control.load is on, but there is no external wrench */
  uint64_t no_shapes;     /* the configuration asks for no shapes */
  uint64_t at_rest;       /* jacobian_rate is on, but the robot stands still */
  dashpot_mode modes[DASHPOT_MAX_JOINTS];
} dashpot_modes;

/* A mode of the continuous loop, and the same mode in the loop as it runs, with the torque held
 * over a period (zero-order hold), delayed and filtered. */
typedef struct dashpot_sampled_mode {
  double continuous_frequency; /* natural frequency of the continuous loop, rad/s */
  double continuous_ratio;     /* damping ratio of the continuous loop, no unit */
  double natural_frequency;    /* of the sampled loop, rad/s; NaN if there is none */
  double damping_ratio;        /* of the sampled loop, no unit */
  double damped_frequency;     /* of the sampled loop, rad/s */
  int32_t kind;                /* DASHPOT_UNDERDAMPED, ... */
  int32_t reserved;            /* 0 */
} dashpot_sampled_mode;

/* The sampled loop at one tick. A thread analyses it at the interval that the configuration sets
 * (analysis.sampled.interval). */
typedef struct dashpot_sampled_modes {
  uint32_t struct_size;
  uint32_t joints;                     /* n */
  int64_t time;                        /* of the state that the modes belong to, ns */
  uint64_t tick;                       /* of that state */
  double position[DASHPOT_MAX_JOINTS]; /* of that state, rad */
  double spectral_radius;              /* largest |z| of the loop, which is stable below 1 */
  double gain_margin; /* all gains can grow by this factor before the loop is unstable; infinity:
                         by any factor; below 1: the loop is unstable. Motions slower than 1 rad/s
                         do not count. NaN, as spectral_radius, if the analysis failed. */
  int32_t status;     /* 0: all modes were found */
  uint32_t count;     /* number of modes, by falling continuous_frequency */
  dashpot_sampled_mode modes[DASHPOT_MAX_JOINTS];
  uint32_t assumes;  /* what the loop leaves out that the arm may have: a sum of 2 gravity ideal,
                        4 delay none, 8 rotors unknown, 16 gears rigid, 32 friction none; see
                        docs/concepts.md */
  uint32_t reserved; /* 0 */
} dashpot_sampled_modes;

/* Terms of the robot's equation of motion  M(q) q'' + coriolis + gravity = torque + J' wrench, and
 * where the tip is. */
typedef struct dashpot_dynamics {
  uint32_t struct_size;
  uint32_t joints;                                      /* n */
  double mass[DASHPOT_MAX_JOINTS * DASHPOT_MAX_JOINTS]; /* M, n x n, kg m^2, in the first n n
                                                           entries */
  double coriolis[DASHPOT_MAX_JOINTS];                  /* C(q, q') q', N m */
  double gravity[DASHPOT_MAX_JOINTS];                   /* gradient of the potential energy, N m */
  double jacobian[6 * DASHPOT_MAX_JOINTS];              /* J, 6 x n: the tip's twist is J q' */
  double jacobian_dot_qd[6]; /* J' q', the tip's acceleration at q'' = 0, m/s^2 and
                                rad/s^2 */
  double tip_position[3];    /* of T in B, m */
  double tip_rotation[9];    /* 3 x 3, turns T's axes into B's */
} dashpot_dynamics;

/* The closed loop at one posture, linearised where its springs are at rest, in joint coordinates:
 * M q'' + C q' + K q = f. */
typedef struct dashpot_closed_loop {
  uint32_t struct_size;
  uint32_t joints;                                           /* n */
  double mass[DASHPOT_MAX_JOINTS * DASHPOT_MAX_JOINTS];      /* n x n, kg m^2, in the first n n
                                                                entries */
  double damping[DASHPOT_MAX_JOINTS * DASHPOT_MAX_JOINTS];   /* likewise, N m s/rad */
  double stiffness[DASHPOT_MAX_JOINTS * DASHPOT_MAX_JOINTS]; /* likewise, N m/rad */
} dashpot_closed_loop;

/* Creates a controller from a YAML file (see controller/examples/panda.yaml) and the URDF that the
 * file names. Returns NULL on failure; dashpot_last_error then says why, in one line with file, key
 * and line. It also fails if dashpot_set_gains would refuse the gains. */
dashpot_controller* dashpot_create(const char* config_path);

/* Creates a controller from the text of such a file. A relative path of the URDF begins at
 * `directory`, or, if that is NULL, at the working directory. Otherwise as dashpot_create. */
dashpot_controller* dashpot_create_from_text(const char* text, const char* directory);

/* Destroys a controller. Does nothing if `controller` is NULL. */
void dashpot_destroy(dashpot_controller* controller);

/* Returns a one-line description of the last error in this thread; "" if the last call succeeded,
 * or a warning if dashpot_set_gains or dashpot_set_payload succeeded with one. Calls that count are
 * dashpot_create, ..._create_from_text, dashpot_start, dashpot_set_setpoint, dashpot_set_gains,
 * dashpot_judge_gains, dashpot_set_payload, dashpot_limit_tip_speed, dashpot_evaluate,
 * dashpot_analyze, dashpot_release, dashpot_read_snapshot, ..._modes and ..._sampled_modes. The
 * text is valid until the next of these calls in this thread. */
const char* dashpot_last_error(void);

/* Returns n; 0 if `controller` is NULL. */
uint32_t dashpot_joints(const dashpot_controller* controller);
/* Returns the name in the URDF of joint 0 to n - 1, counted from the base to the tip; NULL if there
 * is no such joint. The text is valid until dashpot_destroy. */
const char* dashpot_joint_name(const dashpot_controller* controller, uint32_t joint);
/* Returns the period of the loop, s; 0 if `controller` is NULL. */
double dashpot_period(const dashpot_controller* controller);

/* Does one tick on the real-time thread: takes the state and the set-point, and writes the torque.
 * Takes bounded time, allocates nothing and waits for nothing.
 *
 * If `setpoint` is NULL, the tick takes up the latest set-point of dashpot_set_setpoint; if there
 * is no new one, the last set-point stays. As long as there is none at all, the robot
 * stays where it is. Give set-points either here or to dashpot_set_setpoint, not both. New gains
 * take effect at the next tick whose set-point is NULL or new by its time.
 *
 * Returns a status, or a negative code. With a negative code `output` is not written, and the host
 * has to bring the robot to a stop. A state that is NULL or wrong, also in its struct_size, is not
 * refused: it gives a torque and a status. A wrong set-point is rejected, and the last one stays.
 * */
int32_t dashpot_update(dashpot_controller* controller, const dashpot_state* state,
                       const dashpot_setpoint* setpoint, dashpot_output* output);

/* Prepares the loop before it begins, with the robot at rest at `position` (n, rad). Judges the
 * gains of dashpot_set_gains, or else of the configuration, at `position` as dashpot_set_gains
 * does, and then resets as dashpot_reset does. `torque` (n, N m) is the torque that the robot
 * applies now; NULL stands for the arm's weight at `position` (zero if the robot compensates it).
 * Refuses a position beyond the limits of the URDF, such as one in degrees, and a torque that
 * contradicts the weight (`watchdog.start_torque`; none accepts it). Takes some milliseconds and
 * allocates. Returns DASHPOT_OK or a negative code; dashpot_last_error then says more. With
 * DASHPOT_OK it is empty, or warns that limits.torque_rate makes stops slow, or that gains look
 * like another unit or order, as dashpot_set_gains does. A loop without this call starts from the
 * weight as well, but its gains were not judged at its posture. */
int32_t dashpot_start(dashpot_controller* controller, const double* position, const double* torque);

/* Forgets history, faults and set-point, but not the gains. Called on the real-time thread. The
 * next tick keeps the robot where it is, as the first one did. There are no modes until they are
 * found again. The torque-rate limit counts from `torque` (n, N m), the torque that the robot
 * applies now. If `torque` is NULL, the limit counts from the last torque put out, or, before the
 * first tick, from the arm's weight. Returns DASHPOT_OK or a negative code. */
int32_t dashpot_reset(dashpot_controller* controller, const double* torque);

/* Stops the arm, as a host does before it ends: gives up the set-point. From the next tick on it
 * counts as lost (DASHPOT_SETPOINT_LOST), until there is a new one, such as a set-point of
 * dashpot_update with another time, or a reset. Called on the real-time thread. Returns DASHPOT_OK
 * or a negative code. */
int32_t dashpot_stop(dashpot_controller* controller);

/* Releases a latched fault at the next tick, unless the cause of the fault is still present. Called
 * on the other thread. The robot then stays where it is until there is another set-point. Does
 * nothing if there is no fault. Returns DASHPOT_OK or a negative code. */
int32_t dashpot_release(dashpot_controller* controller);

/* Sets the set-point that the next tick takes up; of several, the latest. Called on the other
 * thread. Returns DASHPOT_OK or a negative code. */
int32_t dashpot_set_setpoint(dashpot_controller* controller, const dashpot_setpoint* setpoint);

/* Sets the gains that the next tick takes up; of several, the latest. Called on the other thread.
 * Returns DASHPOT_OK or a negative code.
 *
 * Judges new gains, which takes some milliseconds and allocates. Gains are refused
 * (DASHPOT_UNSTABLE_GAINS) if the sampled loop, with the delay and the filters of analysis.sampled,
 * would have less than limits.gain_margin in either mode at the latest posture: the posture of the
 * latest tick with a good state, or of dashpot_start. If both are missing, gains are refused if
 * they have this margin at none of eight postures spread over the position limits. Motions slower
 * than 1 rad/s do not count: those that need more than 6 s to swing, or a second to grow e-fold.
 * Damping that is designed for a ratio also has to leave a margin of 1.2 to the arm without its
 * payload, which may be dropped. If the margin is too small already, gains with a larger one are
 * accepted, and dashpot_last_error says what is missing. */
int32_t dashpot_set_gains(dashpot_controller* controller, const dashpot_gains* gains);

/* Judges gains as dashpot_set_gains does, without setting them. May be called on any thread, for
 * instance on one that receives gains. The posture is `position` (n, rad), or, if `position` is
 * NULL, the latest posture, as above; DASHPOT_NOTHING_YET if there is none. Sets `margin`,
 * unless it is NULL, to the factor by which the gains could grow, at most limits.gain_margin; it is
 * below 1 if the loop is unstable, and zero if it could not be analysed. A member of `gains` that
 * is NULL stands for the gain of the configuration. Gains that were accepted last within 0.1 rad of
 * the latest posture are not judged again by dashpot_set_gains. Returns DASHPOT_OK or a negative
 * code. */
int32_t dashpot_judge_gains(dashpot_controller* controller, const dashpot_gains* gains,
                            const double* position, double* margin);

/* Sets what the arm carries from now on, and where its tool is. Called on the other thread. The
 * next tick begins the change, and within motion.gain_time the weight, the inertia and all that
 * follows from them go evenly to their new values. In a fault the weight that is held follows as
 * well; dashpot_reset and dashpot_start keep the payload and end the change at once. `gains` that
 * come with it go to their values in the same time.
 *
 * A new T moves no spring: reference and goal keep their places on the tip link. The pose of a
 * set-point refers to the T set before it, on the same thread. For dashpot_update that is the T of
 * a call that an earlier tick has taken up.
 *
 * Refuses (DASHPOT_WRONG_VALUE) an impossible body, and a weight that limits.torque does not hold
 * at the latest posture, unless it is less than now. Refuses (DASHPOT_UNSTABLE_GAINS) a change that
 * leaves the new gains, or else the current ones, too little margin, as in dashpot_set_gains. A
 * refused call changes nothing. Takes some milliseconds and allocates. Returns DASHPOT_OK or a
 * negative code. */
int32_t dashpot_set_payload(dashpot_controller* controller, const dashpot_payload* payload);

/* Limits the tip's speed from the next tick on. Called on the other thread. `linear` (m/s) and
 * `angular` (rad/s) limit the reference on its way to a set-point; the speed of the tip's origin
 * beyond `limit` (m/s) is a fault. Each is 1e-4 or more, and at most the value of the configuration
 * (motion.linear_velocity, motion.angular_velocity, limits.tip_velocity), for which infinity
 * stands. With a lower `limit` the reference moves with at most 0.6 of it. In the joint mode the
 * reference keeps to the finite limits at the robot's posture. A tip that is faster at that moment
 * is a fault. Resets keep the limits. Returns DASHPOT_OK or a negative code. */
int32_t dashpot_limit_tip_speed(dashpot_controller* controller, double linear, double angular,
                                double limit);

/* Sets the members of `dynamics` at `position` (n, rad) and `velocity` (n, rad/s; NULL: at rest),
 * with the payload and the tool of the configuration. The caller sets struct_size. May be called on
 * any thread, also beside a running loop; allocates nothing. Returns DASHPOT_OK or a negative code.
 */
int32_t dashpot_evaluate(const dashpot_controller* controller, const double* position,
                         const double* velocity, dashpot_dynamics* dynamics);

/* Finds the closed loop and its modes at `position` (n, rad), with the robot at rest there, in
 * `mode` (DASHPOT_MODE_JOINT, ...), as a loop would publish them: no loop has to run. A member of
 * `gains` that is NULL, or all if `gains` is NULL, stands for the gain of the configuration.
 * Payload and tool are the latest ones set. `loop` or `modes` may be NULL; the caller sets the
 * struct_size of the other. The modes are solved directly (`tick`, `time` and the counters are 0).
 * Position limits and the brake do not count. May be called on any thread, also beside a running
 * loop; takes some milliseconds and allocates. Returns DASHPOT_OK or a negative code. */
int32_t dashpot_analyze(const dashpot_controller* controller, const double* position, int32_t mode,
                        const dashpot_gains* gains, dashpot_closed_loop* loop,
                        dashpot_modes* modes);

/* Read the latest finished tick, the latest modes, and the latest analysis of the sampled loop.
 * Called on one thread, always the same. The caller sets struct_size; the functions write the other
 * members. They return DASHPOT_OK or a negative code, DASHPOT_NOTHING_YET if there is nothing to
 * read since the start or the last reset. */
int32_t dashpot_read_snapshot(dashpot_controller* controller, dashpot_snapshot* snapshot);
int32_t dashpot_read_modes(dashpot_controller* controller, dashpot_modes* modes);
int32_t dashpot_read_sampled_modes(dashpot_controller* controller, dashpot_sampled_modes* modes);

/* Returns 1 if, after the last dashpot_update, the host has to end the motion at once and to engage
 * the robot's own brakes, because no torque is known to be right: with DASHPOT_STATE_FROZEN,
 * DASHPOT_STATE_CONTRADICTORY or DASHPOT_BRAKE_DOUBTED, and, once the fault has latched, with
 * DASHPOT_STATE_NOT_FINITE and all after it. Otherwise 0. Called on the real-time thread. */
int32_t dashpot_needs_brakes(const dashpot_controller* controller);

/* Return a short English text for what a function returned ("torque limited"), and for the kind of
 * a mode ("underdamped"); never NULL. */
const char* dashpot_status_text(int32_t status);
const char* dashpot_kind_text(int32_t kind);

/* All functions above, for hosts that load the library at run time. */
typedef struct dashpot_plugin {
  uint32_t struct_size;
  uint32_t version; /* DASHPOT_PLUGIN_VERSION */
  dashpot_controller* (*create)(const char*);
  dashpot_controller* (*create_from_text)(const char*, const char*);
  void (*destroy)(dashpot_controller*);
  const char* (*last_error)(void);
  uint32_t (*joints)(const dashpot_controller*);
  const char* (*joint_name)(const dashpot_controller*, uint32_t);
  double (*period)(const dashpot_controller*);
  int32_t (*update)(dashpot_controller*, const dashpot_state*, const dashpot_setpoint*,
                    dashpot_output*);
  int32_t (*start)(dashpot_controller*, const double*, const double*);
  int32_t (*reset)(dashpot_controller*, const double*);
  int32_t (*stop)(dashpot_controller*);
  int32_t (*release)(dashpot_controller*);
  int32_t (*set_setpoint)(dashpot_controller*, const dashpot_setpoint*);
  int32_t (*set_gains)(dashpot_controller*, const dashpot_gains*);
  int32_t (*judge_gains)(dashpot_controller*, const dashpot_gains*, const double*, double*);
  int32_t (*set_payload)(dashpot_controller*, const dashpot_payload*);
  int32_t (*limit_tip_speed)(dashpot_controller*, double, double, double);
  int32_t (*evaluate)(const dashpot_controller*, const double*, const double*, dashpot_dynamics*);
  int32_t (*analyze)(const dashpot_controller*, const double*, int32_t, const dashpot_gains*,
                     dashpot_closed_loop*, dashpot_modes*);
  int32_t (*read_snapshot)(dashpot_controller*, dashpot_snapshot*);
  int32_t (*read_modes)(dashpot_controller*, dashpot_modes*);
  int32_t (*read_sampled_modes)(dashpot_controller*, dashpot_sampled_modes*);
  const char* (*status_text)(int32_t);
  int32_t (*needs_brakes)(const dashpot_controller*);
  const char* (*kind_text)(int32_t);
} dashpot_plugin;

/* Returns the functions of this version of the interface; NULL if the library does not know it. The
 * struct lives as long as the library. */
const dashpot_plugin* dashpot_plugin_interface(uint32_t version);

#ifdef __cplusplus
}
#endif
/* NOLINTEND(readability-identifier-naming,modernize-deprecated-headers) */
