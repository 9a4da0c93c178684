#!/usr/bin/env python3
"""How the modes of the demo's Panda, damped by design, answer to single entries: tables for trends.gp.

usage: trends.py DASHPOT DIR

Writes DIR/trends_damping.txt (percent that each ratio changes by for one percent of a diagonal entry of
C_C), DIR/trends_stiffness.txt (percent of each frequency for one percent of a diagonal entry of K_C) and
DIR/trends_inertia.txt (percent of each frequency for 0.001 kg m^2 more in a joint, and for 0.1 kg more at
the tip); a row for each mode. Everything comes from `dashpot design --sensitivity`.
"""
import json
import subprocess
import sys

STIFFNESS = [2000, 600, 2000, 100, 100, 100]
COMMAND = ["design", "--urdf", "sim/models/panda.urdf", "--base", "panda_link0", "--tip",
           "panda_hand_tcp", "--q", "0,-0.785398,0,-2.356194,0,1.570796,0.785398",
           "--task-stiffness", ",".join(map(str, STIFFNESS)), "--damping-ratio", "0.7",
           "--sensitivity", "--json"]


def main():
    program, directory = sys.argv[1:]
    result = json.loads(subprocess.run([program, *COMMAND], check=True, text=True,
                                       stdout=subprocess.PIPE).stdout)
    damping = [row[i] for i, row in enumerate(result["task_damping"])]
    tables = {"damping": [], "stiffness": [], "inertia": []}
    for mode, by in zip(result["modes"], result["sensitivity"]):
        ratio, omega = mode["damping_ratio"], mode["natural_frequency"]
        of_ratio, of_omega = by["damping_ratio"], by["natural_frequency"]
        tables["damping"].append([of_ratio["task_damping"][i][i] * c / ratio
                                  for i, c in enumerate(damping)])
        tables["stiffness"].append([of_omega["task_stiffness"][i][i] * k / omega
                                    for i, k in enumerate(STIFFNESS)])
        tables["inertia"].append([0.1 * value / omega for value in of_omega["reflected_inertia"]] +
                                 [10 * of_omega["payload"] / omega])
    for name, rows in tables.items():
        with open(f"{directory}/trends_{name}.txt", "w", encoding="ascii") as file:
            file.writelines(" ".join(f"{round(value, 3) + 0.0:.6g}" for value in row) + "\n" for row in rows)


if __name__ == "__main__":
    main()
