#!/usr/bin/env python3
"""The modes of Table 1 of the paper beside modes of possible variants of its Panda, in Markdown.

usage: paper.py DASHPOT

Kao and Saldarriaga (ROBOMECH Journal 8:12, 2021) print K_C, C1 and C2 of a Panda, but neither its mass
matrix nor what it carried. Everything here comes from `dashpot design` with sim/models/panda.urdf, or
that file without the inertia of its hand.
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile

MODEL = pathlib.Path("sim/models/panda.urdf")
STIFFNESS = "2000,600,2000,100,100,100"
DAMPING = {"C1": "5,3,5,1,1,1", "C2": "22.5,23.5,45,2,12,1"}
VARIANTS = [("the model", []), ("with the fingers, 30 g", ["--payload", "0.03,0,0,-0.045"]),
            ("without the hand", None), ("with drives `panda`", ["--drives", "panda"]),
            ("with drives `fr3`", ["--drives", "fr3"]),
            ("with drives `fr3_drake`", ["--drives", "fr3_drake"])]


def modes(urdf, damping, more):
    done = subprocess.run(
        [sys.argv[1], "design", "--urdf", urdf, "--base", "panda_link0", "--tip", "panda_hand_tcp", "--q",
         "0,-45 deg,0,-135 deg,0,90 deg,45 deg", "--task-stiffness", STIFFNESS, "--task-damping", damping,
         "--damping-ratio", "1", *more, "--json"], text=True, check=True, stdout=subprocess.PIPE)
    found = json.loads(done.stdout)["before"]["modes"]
    found = [(mode["natural_frequency"], mode["damping_ratio"]) for mode in found]
    return [f"{omega:.4g} / {zeta:.3g}" for omega, zeta in sorted(found)]


def main():
    print("| arm | damping | slow modes, rad/s / ratio | | | fast modes | | |")
    print("|---|---|---|---|---|---|---|---|")
    print("| paper, Table 1 | C1 | 9.755 / 0.0294 | 10.98 / 0.0316 | 20.25 / 0.0255 | 73.17 / 0.2483 |"
          " 90.89 / 0.4075 | - / 1 |")
    print("| paper, Table 1 | C2 | 11.17 / 0.2288 | 10.95 / 0.2032 | 20.23 / 0.2235 | - / 1 | - / 1 |"
          " 125.45 / 0.94 |")
    with tempfile.TemporaryDirectory() as folder:
        bare = pathlib.Path(folder) / "panda.urdf"
        bare.write_text(re.sub(r'(<link name="panda_hand">).*?(</link>)', r"\1\2", MODEL.read_text(),
                               flags=re.DOTALL))
        for what, more in VARIANTS:
            urdf = bare if more is None else MODEL
            for name, damping in DAMPING.items():
                print("| " + " | ".join([what, name, *modes(urdf, damping, more or [])]) + " |")


main()
