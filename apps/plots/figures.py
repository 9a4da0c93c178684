#!/usr/bin/env python3
"""The responses of Figs. 3, 4 and 5 of Kao and Saldarriaga (2021), in closed form.

usage: figures.py DASHPOT FOLDER

Fig. 3 releases three masses that drift together, Fig. 4 strikes the first one with 1 N s, Fig. 5 releases
a Baxter arm with five springs on seven joints. `dashpot analyze` gives the responses of the systems in
apps/examples; the parts along the zero modes are drawn as well. `dashpot run` steps the masses through time
with an integrator that knows no modes: the difference is printed. Writes FOLDER/figure3.txt, figure4.txt
and figure5.txt: time (s), coordinates (m or rad), and their parts along the zero modes.
"""
import csv
import json
import os
import re
import subprocess
import sys

PROGRAM, FOLDER = sys.argv[1:]
STEPS = 500
FIGURES = {3: ("chain3", 1), 4: ("chain3_impulse", 1), 5: ("baxter7", 20)}
STARTS = {3: "position: [0, 3 cm, 0]", 4: "velocity: [0.125 m/s, 0, 0]"}  # 1 N s on 8 kg


def response(example, duration):
    with open(f"apps/examples/{example}.yaml", encoding="ascii") as file:
        system = file.read()
    times = [duration * i / STEPS for i in range(STEPS + 1)]
    system = re.sub(r"^times: .*$", f"times: {times}", system, flags=re.MULTILINE)
    done = subprocess.run([PROGRAM, "analyze", "-", "--json"], input=system, text=True, check=True,
                          stdout=subprocess.PIPE)
    return times, json.loads(done.stdout)


def simulated(figure):
    """What the integrator makes of the three masses, each millisecond."""
    with open("sim/scenes/chain3.yaml", encoding="ascii") as file:
        scene = file.read()
    path, log = (os.path.join(FOLDER, f"figure{figure}.{end}") for end in ("yaml", "csv"))
    with open(path, "w", encoding="ascii") as file:
        file.write(scene.replace(STARTS[3], STARTS[figure]))
    subprocess.run([PROGRAM, "run", path, "--fast", "--csv", log], check=True, stdout=subprocess.DEVNULL)
    with open(log, encoding="ascii") as file:
        rows = list(csv.reader(file))
    columns = [[name.split()[0] for name in rows[0]].index(f"q{i}") for i in (1, 2, 3)]
    return [[float(row[i]) for i in columns] for row in rows[1:]]


def main():
    for figure, (example, duration) in FIGURES.items():
        times, result = response(example, duration)
        position, zero = (result["response"][key] for key in ("position", "zero_mode_position"))
        with open(os.path.join(FOLDER, f"figure{figure}.txt"), "w", encoding="ascii") as file:
            for t, q, z in zip(times, position, zero):
                file.write(" ".join(f"{x:.6g}" for x in (t, *q, *z)) + "\n")
        largest = max(abs(x) for q in position for x in q)
        text = f"  Fig. {figure}: largest {largest:.4g}"
        if figure in STARTS:
            steps = simulated(figure)[::2]
            off = max(abs(a - b) for q, s in zip(position, steps) for a, b in zip(q, s))
            text += f", simulated within {off:.1g}"
        ratios = ", ".join(f"{mode['damping_ratio']:.4f}" for mode in result["modes"])
        print(f"{text}; ratios {ratios}; zero modes: {len(result['zero_modes'])}")


main()
