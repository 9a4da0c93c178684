"""Finds what gains really do on an arm: audit_gains.py URDF BASE TIP

The gains are a common choice, D = 2 sqrt(K), which is critical for a mass of 1 kg.
"""
import sys

import numpy as np

import dashpot


def main(urdf: str, base: str, tip: str) -> None:
    robot = dashpot.Robot.from_urdf(urdf, base, tip)
    middle = np.clip((robot.lower + robot.upper) / 2, -np.pi, np.pi)
    found = dashpot.audit(robot, np.nan_to_num(middle), task_stiffness=[200] * 3 + [20] * 3,
                          damping_factor=2, period=0.001, damping_ratio=0.7, samples=2000)
    assert found.posture and found.workspace and found.suggestion
    print("In the middle of the joint ranges:")
    print(found.posture.modes)
    ratio, margin = found.workspace.smallest_ratio, found.workspace.gain_margin
    print(f"Over {found.workspace.samples} postures the smallest damping ratio is {ratio.median:.3g} "
          f"(median), {ratio.p05:.3g} (5 %), {ratio.worst:.3g} (worst)")
    print(f"and the gains could grow by {margin.median:.3g} (median), {margin.worst:.3g} (worst).")
    print("Worst posture, rad:", np.array2string(ratio.worst_q, precision=3))
    print("A diagonal damping for a ratio of 0.7 in the middle:",
          np.array2string(found.suggestion.diagonal, precision=3))


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
