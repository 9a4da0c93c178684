"""Listens to a controller's modes with nothing but the standard library and the types that the
stock generator makes, and compares each with a computation of its own:

    own_modes.py TYPES SOURCE URDF BASE TIP STIFFNESS DAMPING COUNT

TYPES holds the package dashpot. SOURCE is an LCM log, or udpm://ADDRESS:PORT?ttl=0. STIFFNESS and
DAMPING are the diagonals of K_C and C_C, comma-separated; the null space is free. From the URDF and
the joint position in a message follow M and J by plain vector algebra, and K = J' K_C J,
C = J' C_C J. A published eigenvalue l and shape u have to satisfy (l^2 M + l C + K) u = 0, the
modes have to be as many as J has rows, and the sum of all eigenvalues has to be -trace(M^-1 C).
Ends after COUNT modes messages with one JSON object: how many, and the largest errors."""
import json
import math
import socket
import struct
import sys
import xml.etree.ElementTree as Xml

sys.path.insert(0, sys.argv[1])
from dashpot import modes_t  # noqa: E402

CHANNEL = b"DASHPOT_MODES"


# --- Where messages come from


def from_log(path):
    header = struct.Struct(">IqqII")
    with open(path, "rb") as log:
        while start := log.read(header.size):
            _, _, _, channel_size, size = header.unpack(start)
            channel, data = log.read(channel_size), log.read(size)
            if channel == CHANNEL:
                yield data


def from_bus(url):
    address, port = url.removeprefix("udpm://").split("?")[0].split(":")
    bus = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bus.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    bus.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 21)
    bus.bind(("", int(port)))
    bus.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
                   struct.pack("4sl", socket.inet_aton(address), socket.INADDR_ANY))
    bus.settimeout(20)
    print("listening", file=sys.stderr, flush=True)
    parts = {}
    while True:
        packet, sender = bus.recvfrom(65536)
        if packet[:4] == b"LC02":  # a message in one piece
            channel, data = packet[8:].split(b"\0", 1)
            if channel == CHANNEL:
                yield data
        elif packet[:4] == b"LC03":  # a piece of one
            sequence, size, offset, number, count = struct.unpack(">IIIHH", packet[4:20])
            data = packet[20:]
            pieces = parts.setdefault((sender, sequence), {"size": size, "got": {}})
            if number == 0:
                pieces["channel"], data = data.split(b"\0", 1)
            pieces["got"][offset] = data
            if len(pieces["got"]) == count:
                del parts[(sender, sequence)]
                if pieces["channel"] == CHANNEL:
                    yield b"".join(data for _, data in sorted(pieces["got"].items()))


# --- Vectors and matrices as lists


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def plus(a, b):
    return [x + y for x, y in zip(a, b)]


def minus(a, b):
    return [x - y for x, y in zip(a, b)]


def apply(A, x):
    return [dot(row, x) for row in A]


def transposed(A):
    return [list(column) for column in zip(*A)]


def product(A, B):
    columns = transposed(B)
    return [[dot(row, column) for column in columns] for row in A]


def weighted(J, weights):
    """J' diag(weights) J"""
    return product(transposed(J), [[w * x for x in row] for w, row in zip(weights, J)])


def solve(A, B):
    """A^-1 B by elimination; A is positive definite."""
    rows = [a[:] + b[:] for a, b in zip(A, B)]
    n = len(A)
    for i in range(n):
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for k in range(n):
            if k != i:
                rows[k] = [x - rows[k][i] * y for x, y in zip(rows[k], rows[i])]
    return [row[n:] for row in rows]


# --- The robot


def numbers(element, key, default):
    return [float(x) for x in element.get(key, default).split()] if element is not None else [
        float(x) for x in default.split()]


def from_rpy(rpy):
    (cr, cp, cy), (sr, sp, sy) = map(math.cos, rpy), map(math.sin, rpy)
    return [[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr]]


def about(axis, angle):
    (x, y, z), c, s = axis, math.cos(angle), math.sin(angle)
    v = 1 - c
    return [[c + x * x * v, x * y * v - z * s, x * z * v + y * s],
            [x * y * v + z * s, c + y * y * v, y * z * v - x * s],
            [x * z * v - y * s, y * z * v + x * s, c + z * z * v]]


class Arm:
    """Revolute joints from BASE to TIP; everything else is rigid."""

    def __init__(self, path, base, tip):
        robot = Xml.parse(path).getroot()
        self.links = {link.get("name"): link for link in robot.iter("link")}
        self.joints = [joint for joint in robot.findall("joint")]
        self.base, self.tip = base, tip
        parent = {joint.find("child").get("link"): joint for joint in self.joints}
        self.chain, link = [], tip
        while link != base:
            if parent[link].get("type") in ("revolute", "continuous"):
                self.chain.insert(0, parent[link].get("name"))
            link = parent[link].find("parent").get("link")

    def place(self, q):
        """(link, rotation, position, axes and origins of the chain's joints below it)"""
        stack = [(self.base, [[1, 0, 0], [0, 1, 0], [0, 0, 1]], [0, 0, 0], [])]
        while stack:
            link, R, p, moved_by = stack.pop()
            yield link, R, p, moved_by
            for joint in self.joints:
                if joint.find("parent").get("link") != link:
                    continue
                origin = joint.find("origin")
                at = plus(p, apply(R, numbers(origin, "xyz", "0 0 0")))
                turn = product(R, from_rpy(numbers(origin, "rpy", "0 0 0")))
                joints = moved_by
                if joint.get("name") in self.chain:
                    axis = numbers(joint.find("axis"), "xyz", "1 0 0")
                    axis = [x / math.sqrt(dot(axis, axis)) for x in axis]
                    joints = moved_by + [(apply(turn, axis), at)]
                    turn = product(turn, about(axis, q[self.chain.index(joint.get("name"))]))
                stack.append((joint.find("child").get("link"), turn, at, joints))

    def matrices(self, q):
        n = len(q)
        M, J = [[0.0] * n for _ in range(n)], None
        for link, R, p, moved_by in self.place(q):
            if link == self.tip:
                J = self.jacobian(moved_by, p, n)
            inertial = self.links[link].find("inertial")
            if inertial is None or not moved_by:
                continue
            origin = inertial.find("origin")
            center = plus(p, apply(R, numbers(origin, "xyz", "0 0 0")))
            turn = product(R, from_rpy(numbers(origin, "rpy", "0 0 0")))
            of = {key: float(value) for key, value in inertial.find("inertia").items()}
            inertia = [[of["ixx"], of["ixy"], of["ixz"]], [of["ixy"], of["iyy"], of["iyz"]],
                       [of["ixz"], of["iyz"], of["izz"]]]
            inertia = product(product(turn, inertia), transposed(turn))
            mass = float(inertial.find("mass").get("value"))
            moving = self.jacobian(moved_by, center, n)
            linear, angular = moving[:3], moving[3:]
            own = product(transposed(angular), product(inertia, angular))
            by_mass = weighted(linear, [mass] * 3)
            M = [plus(plus(a, b), c) for a, b, c in zip(M, own, by_mass)]
        return M, J

    @staticmethod
    def jacobian(moved_by, point, n):
        columns = [cross(axis, minus(point, at)) + axis for axis, at in moved_by]
        return transposed(columns + [[0.0] * 6] * (n - len(columns)))


# --- The comparison


def largest(values):
    return max(abs(value) for value in values)


def compare(message, arm, stiffness, damping):
    """The largest relative errors of eigenpairs and of the eigenvalues' sum."""
    M, J = arm.matrices(list(message.joint_position))
    K, C = weighted(J, stiffness), weighted(J, damping)
    assert message.num_modes == len(J), "not as many modes as directions with springs"
    norms = [math.sqrt(sum(dot(row, row) for row in A)) for A in (M, C, K)]
    worst = 0.0
    for i in range(message.num_modes):
        u = [complex(x, y) for x, y in zip(message.shape_real[i], message.shape_imag[i])]
        value = complex(message.eigenvalue_real[i][0], message.eigenvalue_imag[i][0])
        parts = [apply(A, u) for A in (M, C, K)]
        residual = [value * value * m + value * c + k for m, c, k in zip(*parts)]
        size = (abs(value)**2 * norms[0] + abs(value) * norms[1] + norms[2]) * largest(u)
        worst = max(worst, largest(residual) / size)
    total = sum(sum(pair) for pair in message.eigenvalue_real)
    rates = solve(M, C)
    trace = -sum(rates[i][i] for i in range(len(M)))
    return worst, abs(total - trace) / abs(trace)


def main():
    _, source, urdf, base, tip, stiffness, damping, count = sys.argv[1:]
    arm = Arm(urdf, base, tip)
    stiffness, damping = ([float(x) for x in text.split(",")] for text in (stiffness, damping))
    messages = from_bus(source) if source.startswith("udpm://") else from_log(source)
    done, worst, worst_sum = 0, 0.0, 0.0
    for data in messages:
        residual, difference = compare(modes_t.decode(data), arm, stiffness, damping)
        done, worst, worst_sum = done + 1, max(worst, residual), max(worst_sum, difference)
        if done == int(count):
            break
    json.dump({"messages": done, "residual": worst, "sum": worst_sum}, sys.stdout)


main()
