"""Reads a log with the types that the stock generator makes for Python, and nothing else but the
standard library: read_log.py TYPES LOG, where TYPES holds the package dashpot. Checks that every
mode's frequency and damping ratio agree with its eigenvalues, and prints one JSON object."""
import json
import math
import struct
import sys

sys.path.insert(0, sys.argv[1])
from dashpot import modes_t, state_t  # noqa: E402

TYPES = {"DASHPOT_STATE": state_t, "DASHPOT_MODES": modes_t}
HEADER = struct.Struct(">IqqII")  # sync word, number, time in us, lengths of channel and data
SYNC = 0xEDA1DA01


def events(path):
    with open(path, "rb") as log:
        while header := log.read(HEADER.size):
            sync, number, utime, channel_size, size = HEADER.unpack(header)
            assert sync == SYNC, "not the start of an event"
            yield number, utime, log.read(channel_size).decode(), log.read(size)


def check_eigenvalues(message):
    for i in range(message.num_modes):
        l1, l2 = map(complex, message.eigenvalue_real[i], message.eigenvalue_imag[i])
        frequency, ratio = message.natural_frequency[i], message.damping_ratio[i]
        assert math.isclose(frequency**2, (l1 * l2).real, rel_tol=1e-9)
        assert math.isclose(-2 * ratio * frequency, (l1 + l2).real, rel_tol=1e-9)
        assert math.isclose(message.damped_frequency[i], l1.imag, rel_tol=1e-9)


def main():
    states, modes = [], []
    for expected, (number, utime, channel, data) in enumerate(events(sys.argv[2])):
        assert number == expected
        message = TYPES[channel].decode(data)
        assert message.utime == utime
        assert message.encode() == data
        if channel == "DASHPOT_MODES":
            check_eigenvalues(message)
            modes.append({"q": message.joint_position, "frequency": message.natural_frequency,
                          "shape": message.shape_real, "label": message.label})
        else:
            states.append({"tick": message.tick, "q": message.joint_position,
                           "torque": message.joint_torque, "quaternion": message.tip_quaternion})
    json.dump({"states": states, "modes": modes}, sys.stdout)


main()
