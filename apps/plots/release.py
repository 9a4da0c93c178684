#!/usr/bin/env python3
"""What the modes predict of the release that a scene of `dashpot run` shows.

usage: release.py DASHPOT SCENE_JSON CSV

CSV is what `dashpot run --csv` wrote; SCENE_JSON names the robot, K_C, C_C (or the damping ratio that
the controller holds) and the joint position at which the springs are fixed. Mass and Jacobian there
come from `dashpot inspect`, the closed-form response from `dashpot analyze`. Prints a table: time (s),
displacement of the tip along y (mm) as simulated, and as predicted; after a line with the smallest
damping ratio that is predicted.
"""
import csv
import json
import subprocess
import sys

STEP = 5  # rows of the CSV for one of the table


def dashpot(program, *arguments, text=None):
    done = subprocess.run([program, *arguments, "--json"], input=text, text=True, check=True,
                          stdout=subprocess.PIPE)
    return json.loads(done.stdout)


def diagonal(values):
    return [[value if i == j else 0 for j in range(len(values))] for i, value in enumerate(values)]


def task_damping(program, scene, system):
    if "damping" in scene:
        return diagonal(scene["damping"])
    return dashpot(program, "design", "-", "--damping-ratio", str(scene["damping_ratio"]),
                   text=json.dumps(system))["task_damping"]


def main():
    program, scene_text, csv_path = sys.argv[1:]
    scene = json.loads(scene_text)
    rest = scene["position"]
    arm = dashpot(program, "inspect", "--urdf", scene["urdf"], "--base", scene["base"], "--tip",
                  scene["tip"], "--q", ",".join(map(repr, rest)))
    with open(csv_path, encoding="ascii") as file:
        rows = [{name.split(" [")[0]: cell for name, cell in row.items()}
                for row in [*csv.DictReader(file)][::STEP]]
    start = [float(rows[0][f"q{i + 1}"]) - q for i, q in enumerate(rest)]
    times = [float(row["time"]) for row in rows]
    system = {"mass": arm["mass_matrix"], "jacobian": arm["jacobian"],
              "task_stiffness": diagonal(scene["stiffness"])}
    system |= {"task_damping": task_damping(program, scene, system),
               "initial_position": start, "times": times}
    result = dashpot(program, "analyze", "-", text=json.dumps(system))
    response = result["response"]
    y = arm["jacobian"][1]
    print(f"# smallest_ratio {min(mode['damping_ratio'] for mode in result['modes'])!r}")
    for time, row, q in zip(times, rows, response["position"]):
        simulated = 1e3 * (float(row["y"]) - arm["tip_position"][1])
        predicted = 1e3 * sum(a * b for a, b in zip(y, q))
        print(f"{time:.4f} {simulated:.5f} {predicted:.5f}")


if __name__ == "__main__":
    main()
