#!/usr/bin/env python3
"""Damping ratios of a Panda whose tip goes a straight way of 0.44 m: with the damping designed at its
start and kept, with one matrix designed for the whole way, and with the design of each place, which is
what the controller holds.

usage: path.py DASHPOT DIR

Writes DIR/path.txt (way in m; smallest and largest ratio of each of the three) and DIR/path.yaml, the
configurations as a file for `dashpot design --region`. Mass and Jacobian come from `dashpot inspect`.
"""
import json
import subprocess
import sys

ARM = ["--urdf", "sim/models/panda.urdf", "--base", "panda_link0", "--tip", "panda_hand_tcp"]
START = [0, -0.785398, 0, -2.356194, 0, 1.570796, 0.785398]
WAY = [0.25, 0.3, 0.2, 0, 0, 0]  # m
POINTS = 12
STEPS = 4  # between two points
STIFFNESS = [2000, 600, 2000, 100, 100, 100]
RATIO = 0.7


def dashpot(*arguments, text=None):
    # Standard error is not shown, because steps of a search are outside the limits.
    done = subprocess.run([sys.argv[1], *arguments, "--json"], input=text, text=True, check=True, capture_output=True)
    return json.loads(done.stdout)


def diagonal(values):
    return [[value if i == j else 0 for j in range(len(values))] for i, value in enumerate(values)]


def solve(A, b):
    """x with A x = b, by elimination with row exchanges."""
    n = len(b)
    rows = [list(row) + [value] for row, value in zip(A, b)]
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(n):
            if i != k:
                factor = rows[i][k] / rows[k][k]
                rows[i] = [a - factor * c for a, c in zip(rows[i], rows[k])]
    return [rows[k][n] / rows[k][k] for k in range(n)]


def inspect(q):
    return dashpot("inspect", *ARM, "--q", ",".join(map(repr, q)))


def moved(q, twist):
    """The joints after a small motion of the tip, with the least of their own."""
    J = inspect(q)["jacobian"]
    JJ = [[sum(a * b for a, b in zip(row, other)) for other in J] for row in J]
    f = solve(JJ, twist)
    return [value + sum(J[i][j] * f[i] for i in range(6)) for j, value in enumerate(q)]


def configurations():
    q = START
    for k in range(POINTS):
        arm = inspect(q)
        yield {"mass": arm["mass_matrix"], "jacobian": arm["jacobian"],
               "task_stiffness": diagonal(STIFFNESS)}
        for _ in range(STEPS if k + 1 < POINTS else 0):
            q = moved(q, [value / (STEPS * (POINTS - 1)) for value in WAY])


def ranges(places, damping):
    systems = [place | {"task_damping": damping} for place in places]
    for result in dashpot("analyze", "-", text=json.dumps(systems)):
        ratios = [mode["damping_ratio"] for mode in result["modes"]]
        yield min(ratios), max(ratios)


def main():
    directory = sys.argv[2]
    places = list(configurations())
    with open(directory + "/path.yaml", "w", encoding="ascii") as file:
        json.dump(places, file)
    file_text = json.dumps(places)
    designs = dashpot("design", "-", "--damping-ratio", str(RATIO), text=file_text)
    region = dashpot("design", "-", "--damping-ratio", str(RATIO), "--region", text=file_text)
    designed = [(min(r), max(r)) for r in ([mode["damping_ratio"] for mode in one["modes"]]
                                           for one in designs)]
    kept = list(ranges(places, designs[0]["task_damping"]))
    one = list(ranges(places, region["task_damping"]))
    length = sum(value * value for value in WAY) ** 0.5
    print("           damping of the start   one for the way       designed at each place")
    print("  way, m   ratios                 ratios                ratios")
    with open(directory + "/path.txt", "w", encoding="ascii") as file:
        for k, row in enumerate(zip(kept, one, designed)):
            way = length * k / (POINTS - 1)
            print(f"  {way:.3f}   " + "   ".join(f"{low:7.4f} to {high:7.4f}" for low, high in row))
            file.write(f"{way} " + " ".join(f"{low} {high}" for low, high in row) + "\n")


if __name__ == "__main__":
    main()
