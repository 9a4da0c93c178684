#!/usr/bin/env python3
"""What the gains of public controllers do on arms with and without rotors, as tables in Markdown.

usage: audit.py DASHPOT [SAMPLES]

Everything comes from `dashpot audit`. First the presets on the Panda and the FR3: at the home posture,
over SAMPLES (20000) postures within 1.4 rad of it, and in a loop of 1 kHz with a torque that comes a tick
late. Then arms under gains that run on them: a UR3e, UR5e and UR10e under the joint PD of
Universal_Robots_Client_Library at 500 Hz, an FR3 under the defaults of crisp at 1 kHz, and an iiwa 14
with K of 1000 and 100, a damping factor of 1.4 and 2 ms. The arms of both have the drives of
`dashpot inspect --drives NAME`, or none. At last these, each with its source and doubt.
"""
import json
import math
import subprocess
import sys

PRESETS = ["libfranka", "franka_ros", "panda_py", "crisp", "cartesian_impedance_controller", "franky",
           "deoxys", "polymetis"]
HOME = "0,-45 deg,0,-135 deg,0,90 deg,45 deg"
FRANKAS = {name: ["--urdf", f"sim/models/{name}.urdf", "--base", f"{name}_link0", "--tip",
                  f"{name}_hand_tcp", "--q", HOME] for name in ("panda", "fr3")}
LATE = ["--period", "1 ms", "--delay", "1"]
UR_GAINS = {"ur3e": ("560,560,350,163,163,163", "47.32,47.32,37.42,25.5,25.5,25.5"),
            "ur5e": ("900,900,900,500,500,500", "60,60,60,44.72,44.72,44.72"),
            "ur10e": ("1300,1300,900,560,560,560", "72.11,72.11,60,47.32,47.32,47.32")}


def audit(arm, *more):
    done = subprocess.run([sys.argv[1], "audit", *arm, *more, "--json"], text=True, check=True,
                          stdout=subprocess.PIPE)
    return json.loads(done.stdout)


def rounded_up(value):
    """Rounds up to two digits, so that the value is still enough."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{unit * math.ceil(value / unit - 1e-9):.2g}"


def enough(posture):
    """The reflected inertia that would be enough, without the joints that need none."""
    inertia = posture["reflected_inertia_for_margin"]
    if inertia is None:
        return "no inertia"
    needed = [f"{i}: {rounded_up(value)}" for i, value in enumerate(inertia, 1) if value > 0]
    return ", ".join(needed) if needed else "none"


def ratios(posture):
    below = sorted(mode["damping_ratio"] for mode in posture["modes"] if mode["damping_ratio"] < 0.99)
    return ", ".join(f"{z:.3f}" for z in below)


def table(*rows):
    for i, row in enumerate(rows):
        print("| " + " | ".join(row) + " |")
        if i == 0:
            print("|" + "---|" * len(row))


def preset_row(name, preset, samples):
    arm = [*FRANKAS[name], *LATE, "--preset", preset]
    found = audit(arm, "--samples", samples, "--spread", "1.4")
    posture, workspace = found["posture"], found["workspace"]["smallest_ratio"]
    with_rotors = audit(arm, "--drives", name)["posture"]
    meant = found["intended_ratio"]
    return [f"`{preset}`", f"{meant:.3g}" if meant else "-", ratios(posture),
            f"{workspace['median']:.3f}, {workspace['p05']:.3f}", f"{posture['gain_margin']:.2f}",
            enough(posture), ratios(with_rotors), f"{with_rotors['fastest_pole']:.1f}",
            f"{with_rotors['gain_margin']:.2f}"]


def arm_row(what, arm, drives):
    posture = audit(arm)["posture"]
    with_rotors = audit(arm, "--drives", drives)["posture"]
    return [what, f"{posture['gain_margin']:.3f}", enough(posture),
            *(f"{audit(arm, '--reflected-inertia', inertia)['posture']['gain_margin']:.2f}"
              for inertia in ("0.01", "0.05", "0.1")),
            f"{with_rotors['gain_margin']:.2f}",
            f"{posture['smallest_ratio']:.3f}, {with_rotors['smallest_ratio']:.3f}"]


MODELS = {"panda": ("panda", "panda_link0", "panda_hand_tcp"), "fr3": ("fr3", "fr3_link0", "fr3_hand_tcp"),
          "iiwa7": ("iiwa7", "iiwa_link_0", "iiwa_link_ee_kuka"),
          "iiwa14": ("iiwa14", "iiwa_link_0", "iiwa_link_ee_kuka"),
          "gen3": ("gen3", "base_link", "end_effector_link"), "xarm7": ("xarm7", "link_base", "link_eef"),
          "ur": ("ur5e", "base_link", "tool0")}
DRIVES = ["panda", "fr3", "fr3_drake", "iiwa7", "iiwa14", "gen3", "xarm7", "ur3e", "ur5e", "ur10e", "ur5"]


def drives_row(name):
    kind = next(value for key, value in MODELS.items() if name.startswith(key))
    done = subprocess.run([sys.argv[1], "inspect", "--urdf", f"sim/models/{kind[0]}.urdf", "--base", kind[1],
                           "--tip", kind[2], "--drives", name, "--json"], text=True, check=True,
                          stdout=subprocess.PIPE)
    drives = json.loads(done.stdout)["drives"]
    inertia = ", ".join(f"{value:.4g}" for value in drives["reflected_inertia"])
    return [f"`{name}`", inertia, drives["source"], drives["doubt"]]


def main():
    samples = sys.argv[2] if len(sys.argv) > 2 else "20000"
    for name in FRANKAS:
        print(f"{name}, its drives `{name}`:\n")
        table(["preset", "meant", "ratios below 1 at home", "smallest ratio: median, 5 %",
               "margin without rotors", "enough for 2, kg m^2", "ratios with rotors", "pole, 1/s",
               "margin with rotors"],
              *(preset_row(name, preset, samples) for preset in PRESETS))
        print()
    rows = []
    for name, (stiffness, damping) in UR_GAINS.items():
        arm = ["--urdf", f"sim/models/{name}.urdf", "--base", "base_link", "--tip", "tool0", "--q",
               "0,-90 deg,90 deg,-90 deg,-90 deg,0", "--joint-stiffness", stiffness, "--joint-damping", damping,
               "--period", "2 ms"]
        rows.append(arm_row(f"{name}, joint PD of its maker's library, 500 Hz", arm, name))
        arm[9], arm[11] = "100", "20"
        rows.append(arm_row(f"{name}, joint PD of 100 and 20, 500 Hz", arm, name))
    rows.append(arm_row("fr3, crisp, 1 kHz",
                        [*FRANKAS["fr3"], "--preset", "crisp", "--period", "1 ms"], "fr3"))
    rows.append(arm_row("iiwa14, K 1000 and 100, factor 1.4, 2 ms", [
        "--urdf", "sim/models/iiwa14.urdf", "--base", "iiwa_link_0", "--tip", "iiwa_link_ee_kuka", "--q",
        "0,0.6,0,-1.2,0,1,0", "--stiffness", "1000,1000,1000,100,100,100", "--damping-factor", "1.4",
        "--period", "2 ms"], "iiwa14"))
    table(["arm and gains", "margin without rotors", "enough for 2, kg m^2", "with 0.01 kg m^2",
           "with 0.05", "with 0.1", "with its drives", "smallest ratio without, with its drives"], *rows)
    print()
    table(["name", "reflected inertia of the joints, kg m^2", "source", "doubt"], *map(drives_row, DRIVES))


if __name__ == "__main__":
    main()
