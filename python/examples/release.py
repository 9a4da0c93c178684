"""Fig. 1 of Kao and Saldarriaga (ROBOMECH Journal 8:12, 2021): release.py PANDA_URDF [PICTURE]

A Panda is displaced by 2 cm along y and let go, with the two damping matrices of the paper and with
ratio damping. Draws a picture if matplotlib is installed.
"""
import sys

import numpy as np

import dashpot

HOME = np.array([0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4])
STIFFNESS = [2000, 600, 2000, 100, 100, 100]
DAMPINGS = {"C1": {"task_damping": [5, 3, 5, 1, 1, 1]},
            "C2": {"task_damping": [22.5, 23.5, 45, 2, 12, 1]},
            "ratio 0.7": {"task_damping_ratio": 0.7}}


def main(urdf: str, picture: str = "") -> None:
    robot = dashpot.Robot.from_urdf(urdf, "panda_link0", "panda_hand_tcp",
                                    viscous_friction=np.zeros(7))
    J, M = robot.jacobian(HOME), robot.mass(HOME)
    displaced = np.linalg.solve(M, J.T) @ np.linalg.solve(J @ np.linalg.solve(M, J.T),
                                                          [0, 0.02, 0, 0, 0, 0])
    times = np.linspace(0, 5, 1001)
    motions = {}
    for name, damping in DAMPINGS.items():
        loop = dashpot.closed_loop(robot, HOME, task_stiffness=STIFFNESS, **damping)
        motion = dashpot.response(loop.mass, loop.damping, loop.stiffness, times,
                                  initial_position=displaced)
        motions[name] = 1000 * motion.position @ J[1]
        moving = times[np.abs(motions[name]) > 0.4]
        settled = f"{moving[-1]:.2f} s" if moving[-1] < times[-1] else "more than 5 s"
        print(f"{name}: to within 2 % of 20 mm in {settled}, "
              f"swings {-motions[name].min():.1f} mm beyond")
        print(loop.modes)
    if picture:
        draw(times, motions, picture)


def draw(times: np.ndarray, motions: dict, picture: str) -> None:
    import matplotlib.pyplot as plot

    for name, y in motions.items():
        plot.plot(times, y, label=name)
    plot.xlabel("time, s")
    plot.ylabel("y of the tip, mm")
    plot.legend()
    plot.savefig(picture)
    print("Wrote", picture)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    main(*sys.argv[1:])
