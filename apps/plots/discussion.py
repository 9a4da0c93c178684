#!/usr/bin/env python3
"""The task of the Discussion of Kao and Saldarriaga (2021), with the damping that they begin with, the
one that they propose, and a designed one.

usage: discussion.py DASHPOT

K_C = diag(3000, 3000, 3000, 100, 100, 100). The paper names no robot and no configuration; here they
are a Panda and a Baxter arm, bent. Everything comes from `dashpot inspect` and `dashpot design`, whose
`before` has the modes with the matrix given.
"""
import json
import subprocess
import sys

RATIO = 0.7
STIFFNESS = [3000, 3000, 3000, 100, 100, 100]
ARMS = {
    "Panda": ("sim/models/panda.urdf", "panda_link0", "panda_hand_tcp", "0.1,-0.7,0.2,-1.9,0.1,1.4,0.6"),
    "Baxter": ("sim/models/baxter_left.urdf", "left_arm_mount", "left_gripper",
               "0.1,-0.6,0.2,1.4,0.1,0.9,0.3"),
}


def dashpot(*arguments, text=None):
    done = subprocess.run([sys.argv[1], *arguments, "--json"], input=text, text=True, check=True,
                          stdout=subprocess.PIPE)
    return json.loads(done.stdout)


def diagonal(values):
    return [[value if i == j else 0 for j in range(6)] for i, value in enumerate(values)]


def paper_damping():
    C = diagonal([0.1, 0.1, 0.1, 10, 10, 1])
    C[2][4] = C[4][2] = 10
    return C


def smallest(modes):
    return min(mode["damping_ratio"] for mode in modes)


def main():
    print("  arm     damping        smallest ratio")
    for name, (urdf, base, tip, q) in ARMS.items():
        arm = dashpot("inspect", "--urdf", urdf, "--base", base, "--tip", tip, "--q", q)
        system = {"mass": arm["mass_matrix"], "jacobian": arm["jacobian"],
                  "task_stiffness": diagonal(STIFFNESS)}
        for label, damping in (("C_C0 = I", diagonal([1] * 6)), ("paper's C_C1", paper_damping())):
            result = dashpot("design", "-", "--damping-ratio", str(RATIO),
                             text=json.dumps(system | {"task_damping": damping}))
            flag = "".join("  no damping matrix: " + note for note in result["notes"])
            print(f"  {name:7} {label:14} {smallest(result['before']['modes']):9.4f}{flag}")
        print(f"  {name:7} {'designed':14} {smallest(result['modes']):9.4f}  positive semidefinite,"
              f" smallest eigenvalue {result['smallest_eigenvalue']:.3g}")


if __name__ == "__main__":
    main()
