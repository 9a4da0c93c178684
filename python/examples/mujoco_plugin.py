"""An arm of any MJCF model under the engine plugin: it is held, and its modes are printed.

python python/examples/mujoco_plugin.py ARM.xml CONFIG.yaml [LIBRARY]
"""

import pathlib
import sys
import time

import mujoco
import numpy as np


def scene(arm, config):
    """The model in the file `arm` with the plugin, and without its own actuators."""
    spec = mujoco.MjSpec.from_file(arm)
    folder = pathlib.Path(arm).resolve().parent
    if not (folder / spec.meshdir).exists():  # a path of the program that the file was taken from
        spec.meshdir = str(folder / "meshes")
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    spec.activate_plugin("dashpot.impedance")
    plugin = spec.add_plugin(name="dashpot", plugin_name="dashpot.impedance", active=True)
    plugin.config = {"config": config}
    sensor = spec.add_sensor(name="modes", type=mujoco.mjtSensor.mjSENS_PLUGIN)
    sensor.plugin.name, sensor.plugin.plugin_name = "dashpot", "dashpot.impedance"
    sensor.plugin.active = True
    return spec.compile()


def main(arm, config, library="build/release/libdashpot_mujoco.so"):
    mujoco.mj_loadPluginLibrary(library)
    model = scene(arm, config)
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    else:
        lower, upper = model.jnt_range.T
        data.qpos[:len(lower)] = np.where(model.jnt_limited, (lower + upper) / 2, 0)
    start = data.qpos.copy()
    while data.time < 1:
        mujoco.mj_step(model, data)
    print(f"after 1 s the arm is {np.abs(data.qpos - start).max():.1g} rad from where it began")
    until = time.monotonic() + 10  # the analysis has a thread of its own
    while data.sensor("modes").data[3] == 0 and time.monotonic() < until:
        mujoco.mj_step(model, data)
    status, fault, margin, count = data.sensor("modes").data[:4]
    n = (model.sensor("modes").dim[0] - 4) // 2
    frequency, ratio = data.sensor("modes").data[4:].reshape(2, n)[:, :int(count)]
    print(f"status {status:.0f}, fault {fault:.0f}; its modes:")
    for omega, zeta in zip(frequency, ratio):
        print(f"{omega:8.3f} rad/s, ratio {zeta:.3f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
