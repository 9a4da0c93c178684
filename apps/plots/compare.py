#!/usr/bin/env python3
"""Releases of `dashpot run` side by side.

usage: compare.py NAME=STEM...

STEM.csv is what `dashpot run --csv` wrote, STEM.txt what release.py printed. Prints a table: the
smallest damping ratio predicted, and of the simulated release the times after which the tip stays
within 5 % and 2 % of its first displacement (s; its distance from the springs' rest), how far it
swings past the rest along the first displacement (%), and the largest torque of a joint beyond what
it has at the end, which is its weight (N m).
"""
import csv
import math
import sys


def settled(times, distances, part):
    """When the distance is within `part` of the first one for good; nothing if it never is."""
    last = max((i for i, d in enumerate(distances) if d > part * distances[0]), default=-1)
    return times[last + 1] if last + 1 < len(times) else None


def measure(stem):
    with open(stem + ".csv", encoding="ascii") as file:
        rows = [{name.split(" [")[0]: cell for name, cell in row.items()}
                for row in csv.DictReader(file)]
    errors = [[float(row["error_" + axis]) for axis in "xyz"] for row in rows]
    times = [float(row["time"]) for row in rows]
    first = errors[0]
    size = math.hypot(*first)
    distances = [math.hypot(*error) for error in errors]
    swing = min(sum(a * b for a, b in zip(error, first)) for error in errors) / size
    joints = [name for name in rows[0] if name.startswith("torque")]
    peak = max(abs(float(row[name]) - float(rows[-1][name])) for row in rows for name in joints)
    with open(stem + ".txt", encoding="ascii") as file:
        ratio = float(file.readline().removeprefix("# smallest_ratio"))
    return {"ratio": ratio, "5": settled(times, distances, 0.05),
            "2": settled(times, distances, 0.02), "overshoot": max(0, -100 * swing / size),
            "torque": peak, "end": times[-1]}


def time_text(value, end):
    return f"{value:.3f}" if value is not None else f"> {end:.0f}"


def main():
    print("            smallest ratio  settled to, s        overshoot  peak torque of a joint")
    print("  damping        predicted     5 %       2 %             %   beyond its weight, N m")
    for argument in sys.argv[1:]:
        name, stem = argument.split("=")
        found = measure(stem)
        print(f"  {name:12} {found['ratio']:11.4f} {time_text(found['5'], found['end']):>9}"
              f" {time_text(found['2'], found['end']):>9} {found['overshoot']:13.2f}"
              f" {found['torque']:12.2f}")


if __name__ == "__main__":
    main()
