#!/usr/bin/env python3
"""A simulated Panda let go with D = 2 sqrt(K), which is called critical, and with a ratio of 0.7.

usage: critical.py DASHPOT DIRECTORY

The tip is displaced by 2 cm along x, at the home posture and at a stretched one. DIRECTORY/critical.txt
gets a line of titles, with the smallest ratio that `dashpot audit` finds, then time (s) and
displacement (mm) with either damping, for one posture after the other. Prints ratios and overshoots.
"""
import csv
import json
import math
import pathlib
import subprocess
import sys

ROBOT = {"urdf": "sim/models/panda.urdf", "base": "panda_link0", "tip": "panda_hand_tcp",
         "drives": "panda"}
POSTURES = {"home": [0, -0.785, 0, -2.356, 0, 1.571, 0.785], "stretched": [0, 0.6, 0, -1, 0, 1.6, 0]}
STIFFNESS = [200, 200, 200, 20, 20, 20]
RATIO = 0.7
START = 0.02
STEP = 20  # rows of the CSV for one of the table


def smallest_ratio(program, posture):
    options = [f"--{name}={value}" for name, value in ROBOT.items()]
    done = subprocess.run(
        [program, "audit", *options, "--q", ",".join(map(str, posture)), "--damping-factor", "2",
         "--stiffness", ",".join(map(str, STIFFNESS)), "--json"], check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout)["posture"]["smallest_ratio"]


def release(program, path, posture, gains):
    """Simulates the release; returns times (s) and displacements along x (mm)."""
    scene = {"robot": ROBOT | {"urdf": str(pathlib.Path(ROBOT["urdf"]).resolve()),
                               "viscous_friction": 0},
             "control": {"mode": "cartesian"},
             "gains": {"task": {"stiffness": STIFFNESS, **gains},
                       "null_space": {"stiffness": 0, "damping": 0}},
             "scenario": {"duration": 4, "start": {"position": posture,
                                                   "tip_displacement": [START, 0, 0, 0, 0, 0]}}}
    scene_file, table = path.with_suffix(".yaml"), path.with_suffix(".csv")
    scene_file.write_text(json.dumps(scene), encoding="ascii")
    subprocess.run([program, "run", scene_file, "--fast", "--csv", table], check=True,
                   stdout=subprocess.DEVNULL)
    with open(table, encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    goal = float(rows[0]["x [m]"]) - START
    return [float(row["time [s]"]) for row in rows], [1e3 * (float(row["x [m]"]) - goal) for row in rows]


def overshoot(displacement):
    return f"{-100 * min(displacement) / displacement[0]:.0f} %"


def main():
    program, directory = sys.argv[1], pathlib.Path(sys.argv[2])
    titles, columns = ["time"], []
    for name, posture in POSTURES.items():
        ratio = smallest_ratio(program, posture)
        constant = {"damping": [2 * math.sqrt(stiffness) for stiffness in STIFFNESS]}
        times, common = release(program, directory / f"critical_{name}", posture, constant)
        _, designed = release(program, directory / f"critical_{name}_ratio", posture,
                              {"damping_ratio": RATIO})
        titles += [f"D = 2 sqrt(K): smallest ratio {ratio:.2f}", f"ratio damping {RATIO}"]
        columns += [common, designed]
        print(f"  {name:<9}  {titles[-2]}, overshoot {overshoot(common)};"
              f" {titles[-1]}: overshoot {overshoot(designed)}")
    with open(directory / "critical.txt", "w", encoding="ascii") as file:
        print(*(f'"{title}"' for title in titles), file=file)
        for row in list(zip(times, *columns))[::STEP]:
            print(*(f"{value:.5f}" for value in row), file=file)


if __name__ == "__main__":
    main()
