"""A host in Python that loads the plugin: plugin.py LIBRARY CONFIG.

The arm never moves, for a second. Needs nothing but Python itself.
"""
import ctypes as c
import sys

Doubles = c.POINTER(c.c_double)


class State(c.Structure):  # the structs of controller/plugin.h that are used here
    _fields_ = [("struct_size", c.c_uint32), ("joints", c.c_uint32), ("time", c.c_int64),
                ("position", Doubles), ("velocity", Doubles), ("external_wrench", Doubles)]


class Output(c.Structure):
    _fields_ = [("struct_size", c.c_uint32), ("joints", c.c_uint32), ("torque", Doubles)]


def main(path, config):
    plugin = c.CDLL(path)
    plugin.dashpot_create.restype = c.c_void_p
    plugin.dashpot_last_error.restype = plugin.dashpot_status_text.restype = c.c_char_p
    plugin.dashpot_period.restype = c.c_double
    plugin.dashpot_period.argtypes = plugin.dashpot_destroy.argtypes = [c.c_void_p]
    plugin.dashpot_start.argtypes = [c.c_void_p, Doubles, Doubles]
    plugin.dashpot_update.argtypes = [c.c_void_p, c.POINTER(State), c.c_void_p, c.POINTER(Output)]

    arm = plugin.dashpot_create(config.encode())
    if not arm:
        sys.exit(plugin.dashpot_last_error().decode())
    position = (c.c_double * 7)(0, -0.785, 0, -2.356, 0, 1.571, 0.785)  # rad
    velocity, torque = (c.c_double * 7)(), (c.c_double * 7)()
    if plugin.dashpot_start(arm, position, None) != 0:
        sys.exit(plugin.dashpot_last_error().decode())
    state = State(c.sizeof(State), 7, 0, position, velocity, None)
    output = Output(c.sizeof(Output), 7, torque)
    for tick in range(1, 1001):  # every period, with what the robot reports
        state.time = round(1e9 * plugin.dashpot_period(arm)) * tick
        status = plugin.dashpot_update(arm, state, None, output)
        if status < 0:  # no torque was written: stop the robot
            sys.exit(plugin.dashpot_status_text(status).decode())
        if status != 0:
            print(f"tick {tick}: {plugin.dashpot_status_text(status).decode()}")
    print("torque, N m:", *(f"{value:.3f}" for value in torque))
    plugin.dashpot_destroy(arm)


if len(sys.argv) != 3:
    sys.exit("usage: plugin.py LIBRARY CONFIG")
main(*sys.argv[1:])
