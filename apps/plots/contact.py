#!/usr/bin/env python3
"""The contact stiffness that public gains tolerate on a Panda and an FR3, as tables in Markdown.

usage: contact.py DASHPOT [SAMPLES]

Everything comes from `dashpot contact`, at the home posture and over SAMPLES (100) postures within 1.4 rad
of it, with the published drives, in a loop of 1 kHz whose torque comes a tick late; then with a low-pass of
30 Hz, and with gears of 1e4 N m/rad whose links are measured.
"""
import json
import subprocess
import sys

from audit import FRANKAS, LATE, PRESETS, table

GEARS = ["--gear-stiffness", "1e4", "--gear-damping", "5", "--position-sensor", "link"]


def contact(arm, *more):
    done = subprocess.run([sys.argv[1], "contact", *arm, *LATE, "--touch", "1e5", *more, "--json"], text=True,
                          check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout)


def stiffness(value):
    return "none" if value is None else f"{value:.3g}"


def row(name, preset, samples):
    arm = [*FRANKAS[name], "--drives", name, "--preset", preset]
    rigid = contact(arm, "--samples", samples, "--spread", "1.4")
    filtered, bending = contact(arm, "--cutoff", "30"), contact(arm, *GEARS)
    posture, limit = rigid["posture"], rigid["workspace"]["limit"]
    least = min(posture["hold"]["forces"], key=lambda one: one["force"])
    return [f"`{preset}`", stiffness(posture["limit"]), stiffness(limit["p05"]), stiffness(limit["worst"]),
            stiffness(filtered["posture"]["limit"]), stiffness(bending["posture"]["limit"]),
            ", ".join("yes" if one["asked"]["stable"] else "no" for one in (rigid, filtered, bending)),
            f"{posture['passivity']['missing_friction']:.3g}",
            f"{least['force']:.0f}, {1e3 * least['deflection']:.0f}"]


def main():
    samples = sys.argv[2] if len(sys.argv) > 2 else "100"
    for name in FRANKAS:
        print(f"{name}, its drives `{name}`:\n")
        table(["preset", "limit at home, N/m", "5 % of postures below", "least",
               "with a low-pass", "with gears", "stable at 1e5", "friction it lacks, N m s/rad",
               "least force, N, and springs in, mm"],
              *(row(name, preset, samples) for preset in PRESETS if preset != "polymetis"))
        print()


main()
