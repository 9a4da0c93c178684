"""Dashpot controls an arm that MuJoCo simulates: mujoco_loop.py CONFIG URDF

The arm is pushed at its tip for a tenth of a second, and swings with the modes that Dashpot prints.
"""
import sys

import mujoco
import numpy as np

import dashpot

HOME = np.array([0, -0.785, 0, -2.356, 0, 1.571, 0.785])


def main(config: str, urdf: str) -> None:
    controller = dashpot.Controller(config)
    model = mujoco.MjModel.from_xml_path(urdf)
    model.opt.timestep = controller.period
    data = mujoco.MjData(model)
    data.qpos[:] = HOME
    last = model.nbody - 1  # the tip's body
    controller.start(data.qpos)
    for tick in range(3000):
        torque, status = controller.update(data.time, data.qpos, data.qvel)
        if status >= dashpot.Status.SETPOINT_STALE:
            sys.exit(f"tick {tick}: {status.text}")
        data.qfrc_applied[:] = torque
        data.xfrc_applied[last, :3] = [0, 20, 0] if 0.5 <= data.time < 0.6 else 0  # N
        mujoco.mj_step(model, data)
        if tick == 600:
            print(f"at the end of the push {1000 * np.abs(data.qpos - HOME).max():.1f} mrad away")
    print(controller.modes())
    print(f"{data.time:.1f} s later {1000 * np.abs(data.qpos - HOME).max():.3f} mrad away")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: mujoco_loop.py CONFIG URDF")
    main(*sys.argv[1:])
