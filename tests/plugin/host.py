"""A host in Python that loads the plugin at run time: host.py LIBRARY CONFIG.

Holds a Panda that does not move, lets a wrong configuration and wrong calls be refused, changes
gains, and reads modes. Needs nothing but Python itself.
"""
import ctypes as c
import math
import sys
import tempfile
from time import sleep

MAX_JOINTS = 16
UNFINISHED = 9  # status of modes
Doubles = c.POINTER(c.c_double)


class State(c.Structure):
    _fields_ = [("struct_size", c.c_uint32), ("joints", c.c_uint32), ("time", c.c_int64),
                ("position", Doubles), ("velocity", Doubles), ("external_wrench", Doubles)]


class Setpoint(c.Structure):
    _fields_ = [("struct_size", c.c_uint32), ("joints", c.c_uint32), ("time", c.c_int64),
                ("mode", c.c_int32), ("joint_position", Doubles), ("tip_position", Doubles),
                ("tip_rotation", Doubles), ("wrench", Doubles)]


class Gains(c.Structure):
    _fields_ = [("struct_size", c.c_uint32), ("joints", c.c_uint32),
                ("joint_stiffness", Doubles), ("joint_damping", Doubles),
                ("task_stiffness", Doubles), ("task_damping", Doubles),
                ("task_damping_ratio", Doubles),
                ("null_stiffness", Doubles), ("null_damping", Doubles),
                ("frame", c.POINTER(c.c_int32)), ("directions", c.POINTER(c.c_uint8)),
                ("joint_damping_ratio", Doubles), ("null_damping_ratio", Doubles)]


class Output(c.Structure):
    _fields_ = [("struct_size", c.c_uint32), ("joints", c.c_uint32), ("torque", Doubles)]


class Snapshot(c.Structure):
    _fields_ = [("struct_size", c.c_uint32), ("joints", c.c_uint32), ("time", c.c_int64),
                ("tick", c.c_uint64), ("restarts", c.c_uint64), ("status", c.c_int32),
                ("fault", c.c_int32), ("mode", c.c_int32), ("reserved", c.c_int32),
                ("position", c.c_double * MAX_JOINTS),
                ("velocity", c.c_double * MAX_JOINTS), ("torque", c.c_double * MAX_JOINTS),
                ("tip_position", c.c_double * 3), ("tip_rotation", c.c_double * 9),
                ("reference_joint_position", c.c_double * MAX_JOINTS),
                ("reference_tip_position", c.c_double * 3), ("reference_tip_rotation", c.c_double * 9),
                ("law_torque", c.c_double * MAX_JOINTS), ("tip_error", c.c_double * 6),
                ("tip_wrench", c.c_double * 6),
                ("joint_damping_ratio", c.c_double), ("task_damping_ratio", c.c_double),
                ("damping_level", c.c_double),
                ("energy_store", c.c_double),
                ("spring_share", c.c_double),
                ("payload_mass", c.c_double), ("payload_center", c.c_double * 3),
                ("payload_inertia", c.c_double * 9), ("tool_position", c.c_double * 3),
                ("tool_rotation", c.c_double * 9)]


class Mode(c.Structure):
    _fields_ = [("natural_frequency", c.c_double), ("natural_frequency_bound", c.c_double),
                ("damping_ratio", c.c_double), ("damping_ratio_bound", c.c_double),
                ("damped_frequency", c.c_double), ("eigenvalues", c.c_double * 4),
                ("eigenvalue_bound", c.c_double),
                ("kind", c.c_int32), ("label", c.c_int32),
                ("shape_real", c.c_double * MAX_JOINTS), ("shape_imag", c.c_double * MAX_JOINTS)]


class Modes(c.Structure):
    _fields_ = [("struct_size", c.c_uint32), ("joints", c.c_uint32), ("time", c.c_int64),
                ("tick", c.c_uint64), ("position", c.c_double * MAX_JOINTS),
                ("status", c.c_int32), ("zero_modes", c.c_uint32), ("count", c.c_uint32),
                ("origin", c.c_int32), ("tracked", c.c_uint64), ("reused", c.c_uint64),
                ("direct", c.c_uint64), ("unchanged", c.c_uint64), ("no_springs", c.c_uint64),
                ("failed", c.c_uint64), ("missed", c.c_uint64), ("no_zero_modes", c.c_uint64),
                ("no_wrench", c.c_uint64), ("no_shapes", c.c_uint64), ("at_rest", c.c_uint64),
                ("modes", Mode * MAX_JOINTS)]


class Dynamics(c.Structure):
    _fields_ = [("struct_size", c.c_uint32), ("joints", c.c_uint32),
                ("mass", c.c_double * MAX_JOINTS ** 2), ("coriolis", c.c_double * MAX_JOINTS),
                ("gravity", c.c_double * MAX_JOINTS), ("jacobian", c.c_double * (6 * MAX_JOINTS)),
                ("jacobian_dot_qd", c.c_double * 6), ("tip_position", c.c_double * 3),
                ("tip_rotation", c.c_double * 9)]


class ClosedLoop(c.Structure):
    _fields_ = [("struct_size", c.c_uint32), ("joints", c.c_uint32),
                ("mass", c.c_double * MAX_JOINTS ** 2), ("damping", c.c_double * MAX_JOINTS ** 2),
                ("stiffness", c.c_double * MAX_JOINTS ** 2)]


Handle = c.c_void_p


class Plugin(c.Structure):
    _fields_ = [("struct_size", c.c_uint32), ("version", c.c_uint32),
                ("create", c.CFUNCTYPE(Handle, c.c_char_p)),
                ("create_from_text", c.CFUNCTYPE(Handle, c.c_char_p, c.c_char_p)),
                ("destroy", c.CFUNCTYPE(None, Handle)),
                ("last_error", c.CFUNCTYPE(c.c_char_p)),
                ("joints", c.CFUNCTYPE(c.c_uint32, Handle)),
                ("joint_name", c.CFUNCTYPE(c.c_char_p, Handle, c.c_uint32)),
                ("period", c.CFUNCTYPE(c.c_double, Handle)),
                ("update", c.CFUNCTYPE(c.c_int32, Handle, c.POINTER(State), c.POINTER(Setpoint),
                                       c.POINTER(Output))),
                ("start", c.CFUNCTYPE(c.c_int32, Handle, Doubles, Doubles)),
                ("reset", c.CFUNCTYPE(c.c_int32, Handle, Doubles)),
                ("stop", c.CFUNCTYPE(c.c_int32, Handle)),
                ("release", c.CFUNCTYPE(c.c_int32, Handle)),
                ("set_setpoint", c.CFUNCTYPE(c.c_int32, Handle, c.POINTER(Setpoint))),
                ("set_gains", c.CFUNCTYPE(c.c_int32, Handle, c.POINTER(Gains))),
                ("judge_gains", c.CFUNCTYPE(c.c_int32, Handle, c.POINTER(Gains), Doubles,
                                            Doubles)),
                ("set_payload", c.CFUNCTYPE(c.c_int32, Handle, c.c_void_p)),
                ("limit_tip_speed", c.CFUNCTYPE(c.c_int32, Handle, c.c_double, c.c_double,
                                                c.c_double)),
                ("evaluate", c.CFUNCTYPE(c.c_int32, Handle, Doubles, Doubles, c.POINTER(Dynamics))),
                ("analyze", c.CFUNCTYPE(c.c_int32, Handle, Doubles, c.c_int32, c.POINTER(Gains),
                                        c.POINTER(ClosedLoop), c.POINTER(Modes))),
                ("read_snapshot", c.CFUNCTYPE(c.c_int32, Handle, c.POINTER(Snapshot))),
                ("read_modes", c.CFUNCTYPE(c.c_int32, Handle, c.POINTER(Modes))),
                ("read_sampled_modes", c.CFUNCTYPE(c.c_int32, Handle, c.c_void_p)),
                ("status_text", c.CFUNCTYPE(c.c_char_p, c.c_int32)),
                ("needs_brakes", c.CFUNCTYPE(c.c_int32, Handle)),
                ("kind_text", c.CFUNCTYPE(c.c_char_p, c.c_int32))]


def load(path):
    library = c.CDLL(path)
    library.dashpot_plugin_interface.restype = c.POINTER(Plugin)
    library.dashpot_plugin_interface.argtypes = [c.c_uint32]
    assert not library.dashpot_plugin_interface(999)
    plugin = library.dashpot_plugin_interface(12).contents
    assert plugin.version == 12 and plugin.struct_size == c.sizeof(Plugin)
    return plugin


def expect(plugin, code, wanted=0):
    assert code == wanted, (code, plugin.status_text(code), plugin.last_error())


def check_refusals(plugin):
    assert plugin.create(b"no-such-file.yaml") is None
    assert b"no-such-file.yaml: cannot be opened" in plugin.last_error()
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
        file.write("robot:\n  urdf: a.urdf\n  weight: 3\n")
        file.flush()
        assert plugin.create(file.name.encode()) is None
    assert b"robot.weight: unknown key" in plugin.last_error()
    assert b"(line 3)" in plugin.last_error()


def main(library, config):
    plugin = load(library)
    check_refusals(plugin)
    arm = plugin.create(config.encode())
    assert arm, plugin.last_error()
    n = plugin.joints(arm)
    assert n == 7 and plugin.joint_name(arm, 0) == b"panda_joint1"
    period = round(1e9 * plugin.period(arm))

    position = (c.c_double * n)(0, -0.785, 0, -2.356, 0, 1.571, 0.785)
    velocity = (c.c_double * n)()
    torque = (c.c_double * n)()
    state = State(c.sizeof(State), n, 0, position, velocity, None)
    output = Output(c.sizeof(Output), n, torque)
    modes = Modes(struct_size=c.sizeof(Modes))
    snapshot = Snapshot(struct_size=c.sizeof(Snapshot))
    expect(plugin, plugin.read_snapshot(arm, snapshot), -5)

    def run(ticks):
        for _ in range(ticks):
            state.time += period
            status = plugin.update(arm, state, None, output)
            assert status in (0, 1), plugin.status_text(status)  # 1: torque limited, at the start

    def product_of_frequencies():
        for _ in range(1000):  # on a busy machine a thread may still be at work on them
            expect(plugin, plugin.read_modes(arm, modes))
            if modes.status != UNFINISHED:
                break
            sleep(0.01)
            expect(plugin, plugin.set_setpoint(arm, goal))
            run(1)
        return math.prod(modes.modes[i].natural_frequency for i in range(modes.count))

#Joint mode, then eight times the stiffness : n frequencies, each sqrt(8) as high on average.
    goal = Setpoint(c.sizeof(Setpoint), n, -2**63, 0, position)
    expect(plugin, plugin.set_setpoint(arm, goal))

    def set_stiffness(value):
        stiffness = (c.c_double * (n * n))(*[value * (i % (n + 1) == 0) for i in range(n * n)])
        gains = Gains(struct_size=c.sizeof(Gains), joints=n, joint_stiffness=stiffness)
        expect(plugin, plugin.set_gains(arm, gains))

    set_stiffness(50)
    run(1)
    expect(plugin, plugin.set_setpoint(arm, goal))
    run(450)
    expect(plugin, plugin.set_setpoint(arm, goal))
    run(450)
    before = product_of_frequencies()

#Of all eigenvalues the product is det K / det M, whatever the damping.
    loop = ClosedLoop(struct_size=c.sizeof(ClosedLoop))
    here = Modes(struct_size=c.sizeof(Modes))
    expect(plugin, plugin.analyze(arm, position, 0, None, loop, here))
    first = math.prod(here.modes[i].natural_frequency for i in range(n))
    stiffness = math.prod(loop.stiffness[i * (n + 1)] for i in range(n))
    assert abs(before / first * (stiffness / 50 ** n) ** 0.5 - 1) < 1e-9
    weight = Dynamics(struct_size=c.sizeof(Dynamics))
    expect(plugin, plugin.evaluate(arm, position, None, weight))
    assert list(weight.mass[:n * n]) == list(loop.mass[:n * n])
    assert all(abs(weight.gravity[i] - torque[i]) < 1e-9 for i in range(n))

    set_stiffness(400)
    for _ in range(3):
        expect(plugin, plugin.set_setpoint(arm, goal))
        run(300)
    assert abs(product_of_frequencies() / before / 8 ** (n / 2) - 1) < 1e-6

    expect(plugin, plugin.read_snapshot(arm, snapshot))
    assert list(snapshot.torque[:n]) == list(torque)
    assert plugin.status_text(snapshot.status) == b"ok"
    state.joints = 3
    state.time += period
    assert plugin.status_text(plugin.update(arm, state, None, output)).startswith(b"state")
    output.struct_size = 1
    expect(plugin, plugin.update(arm, state, None, output), -2)
    plugin.destroy(arm)


main(*sys.argv[1:])
