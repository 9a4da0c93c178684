#!/usr/bin/env python3
"""What the default gains of public controllers do on the Panda, as a table in Markdown.

usage: audit.py DASHPOT [SAMPLES]

Everything comes from `dashpot audit`: at the home posture, over SAMPLES (20000) postures within 1.4 rad
of it, and in a loop of 1 kHz with a torque that comes a tick late. The reflected inertia is 0.1, 0.5
and 0.5 kg m^2 on the joints 5 to 7.
"""
import json
import subprocess
import sys

PRESETS = ["libfranka", "franka_ros", "panda_py", "crisp", "cartesian_impedance_controller", "franky",
           "deoxys"]
ARM = ["--urdf", "sim/models/panda.urdf", "--base", "panda_link0", "--tip", "panda_hand_tcp", "--q",
       "0,-45 deg,0,-135 deg,0,90 deg,45 deg", "--period", "1 ms", "--delay", "1"]
WRIST = ["--reflected-inertia", "0,0,0,0,0.1,0.5,0.5"]


def audit(preset, *more):
    done = subprocess.run([sys.argv[1], "audit", *ARM, "--preset", preset, *more, "--json"], text=True,
                          check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout)


def row(preset, samples):
    found = audit(preset, "--samples", samples, "--spread", "1.4")
    posture, workspace = found["posture"], found["workspace"]["smallest_ratio"]
    wrist = audit(preset, *WRIST)["posture"]
    ratios = sorted(mode["damping_ratio"] for mode in posture["modes"] if mode["damping_ratio"] < 0.99)
    return [f"`{preset}`", f"{found['intended_ratio']:.3g}", ", ".join(f"{z:.3f}" for z in ratios),
            f"{workspace['median']:.3f}, {workspace['p05']:.3f}", f"{posture['fastest_pole']:.1f}",
            f"{posture['gain_margin']:.2f}", f"{wrist['fastest_pole']:.1f}",
            f"{wrist['gain_margin']:.2f}"]


def main():
    samples = sys.argv[2] if len(sys.argv) > 2 else "20000"
    print("| preset | meant | ratios below 1 at home | smallest ratio: median, 5 % | fastest pole, 1/s |"
          " gain margin | pole with reflected inertia | margin with it |")
    print("|---|---|---|---|---|---|---|---|")
    for preset in PRESETS:
        print("| " + " | ".join(row(preset, samples)) + " |")


main()
