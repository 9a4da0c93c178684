#!/usr/bin/env python3
"""Where a struck arm comes to rest: what its zero mode predicts, beside scenes of `dashpot run`.

usage: push.py DASHPOT SCENE_JSON FREE_CSV HELD_CSV TABLE

FREE_CSV and HELD_CSV are what `dashpot run --csv` wrote of the arm without and with springs that hold
its posture. SCENE_JSON names the robot, position and velocity at the start, the stiffness and damping
ratio of the tip's springs, and the joints' friction. A zero mode u, for which K u = 0, keeps
u' (M q' + C q) as it is, so that the free arm stops at q + u (u' M v) / (u' C u). TABLE gets the time
(s) and the angles of joints 1 and 3 from their start (deg): free, free as the modes predict, held.
Prints the postures.
"""
import csv
import json
import math
import sys

from release import dashpot, diagonal

JOINTS = (0, 2)
STEP = 20  # rows of the CSV for one of the table


def product(a, b):
    return sum(x * y for x, y in zip(a, b))


def times(matrix, vector):
    return [product(row, vector) for row in matrix]


def angles(path, rest):
    with open(path, encoding="ascii") as file:
        return [[float(row["time [s]"])] +
                [float(row[f"q{i + 1} [rad]"]) - q for i, q in enumerate(rest)]
                for row in [*csv.DictReader(file)][::STEP]]


def main():
    program, scene_text, free_csv, held_csv, table = sys.argv[1:]
    scene = json.loads(scene_text)
    rest, velocity = scene["position"], scene["velocity"]
    arm = dashpot(program, "inspect", "--urdf", scene["urdf"], "--base", scene["base"], "--tip",
                  scene["tip"], "--q", ",".join(map(repr, rest)))
    friction = diagonal([scene["friction"]] * len(rest))
    system = {"mass": arm["mass_matrix"], "jacobian": arm["jacobian"],
              "task_stiffness": diagonal(scene["stiffness"])}
    damping = dashpot(program, "design", "-", "--damping-ratio", str(scene["damping_ratio"]),
                      text=json.dumps(system))["task_damping"]
    free, held = angles(free_csv, rest), angles(held_csv, rest)
    system |= {"task_damping": damping, "damping": friction, "initial_velocity": velocity,
               "times": [row[0] for row in free]}
    result = dashpot(program, "analyze", "-", text=json.dumps(system))
    [u] = result["zero_modes"]
    amount = product(u, times(arm["mass_matrix"], velocity)) / product(u, times(friction, u))
    print("joint, deg     predicted    reached    with springs")
    for i, x in enumerate(u):
        print(f"{i + 1:5d} {math.degrees(amount * x):17.3f} {math.degrees(free[-1][i + 1]):10.3f} "
              f"{math.degrees(held[-1][i + 1]):13.3f}")
    with open(table, "w", encoding="ascii") as file:
        for row, q, other in zip(free, result["response"]["position"], held):
            numbers = [x for i in JOINTS for x in (row[i + 1], q[i], other[i + 1])]
            print(f"{row[0]:.4f}", *(f"{math.degrees(x):.5f}" for x in numbers), file=file)


if __name__ == "__main__":
    main()
