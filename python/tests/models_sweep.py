"""Every arm of the models in robosuite, franky-sim and example-robot-data (PyPI): read, or refused
with the reason, with its numbers beside the numbers of MuJoCo and Pinocchio.

    python python/tests/models_sweep.py

prints the table of docs/models.md. What is not installed is named and left out.
"""

import collections
import importlib.util
import itertools
import pathlib
import re
import site
import sys
import warnings

import numpy as np

import dashpot

POSTURES = 5


def folder_of(package):
    """Where a package has its files, without importing it; None if it is not installed."""
    spec = importlib.util.find_spec(package)
    return None if spec is None else pathlib.Path(spec.submodule_search_locations[0])


def mjcf_models():
    """Name and path of the models of robosuite and franky-sim."""
    found = []
    if folder := folder_of("robosuite"):
        found += [(f"robosuite {path.parent.name}", path)
                  for path in sorted(folder.glob("models/assets/robots/*/robot.xml"))]
    if folder := folder_of("franky_sim"):
        found += [(f"franky-sim {path.stem}", path) for path in sorted(folder.glob("assets/*.xml"))]
    return found


def mjcf_arms(model):
    """Base and tip of each chain that ends in a body on which none with a joint hangs: from the
    last body before its first joint that is a hinge or slides, after any free joint."""
    import mujoco
    jointed = {int(body) for body in model.jnt_bodyid}
    moving_above = set()
    for body in jointed:
        at = int(model.body_parentid[body])
        while at:
            moving_above.add(at)
            at = int(model.body_parentid[at])
    arms = []
    for tip in sorted(jointed - moving_above):
        path, count = [], 0
        at = tip
        while at:
            kinds = model.jnt_type[model.body_jntadr[at]:][:model.body_jntnum[at]]
            if any(kind in (int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL))
                   for kind in kinds):
                break
            count += len(kinds)
            path.append(at)
            at = int(model.body_parentid[at])
        if count >= 3:
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, at)
            arms.append((name, mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, tip), count))
    return arms


def beside_mujoco(model, base, tip, robot, seed=1):
    """Largest difference of M, g and J from the engine's, each relative to its largest entry."""
    import mujoco
    data = mujoco.MjData(model)
    joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
              for name in robot.joint_names]
    dofs, places = model.jnt_dofadr[joints], model.jnt_qposadr[joints]
    lower, upper = np.maximum(robot.lower, -3), np.minimum(robot.upper, 3)
    random = np.random.default_rng(seed)
    worst = np.zeros(3)
    base_id = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, base)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, tip)
    place = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, tip) if body < 0 else -1
    for _ in range(POSTURES):
        q = random.uniform(lower, upper)
        mujoco.mj_resetData(model, data)
        data.qpos[places] = q
        mujoco.mj_forward(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        J = np.zeros((6, model.nv))
        if body >= 0:
            mujoco.mj_jacBody(model, data, J[:3], J[3:], body)
        else:
            mujoco.mj_jacSite(model, data, J[:3], J[3:], place)
        R = data.xmat[base_id].reshape(3, 3)  # into the world
        J = np.vstack([R.T @ J[:3], R.T @ J[3:]])[:, dofs]
        for i, (ours, engine) in enumerate([
                (robot.mass(q), M[np.ix_(dofs, dofs)]), (robot.gravity(q), data.qfrc_bias[dofs]),
                (robot.jacobian(q), J)]):
            worst[i] = max(worst[i], abs(ours - engine).max() / max(1e-9, abs(engine).max(), 1))
    return worst


def urdf_models():
    """Paths of example-robot-data's URDFs."""
    for folder in site.getsitepackages():
        robots = pathlib.Path(folder) / "cmeel.prefix/share/example-robot-data/robots"
        if robots.is_dir():
            return sorted(robots.rglob("*.urdf"))
    return []


def urdf_arms(model):
    """Base and tip of each chain of 3 to 16 joints with one degree of freedom in a Pinocchio model
    that ends in a joint without another one after it."""
    parents = list(model.parents)
    leaves = [j for j in range(1, model.njoints) if j not in parents[1:]]
    arms = []
    for leaf in leaves:
        path, at = [], leaf
        while at and model.joints[at].nv == 1:
            path.append(at)
            at = parents[at]
        if 3 <= len(path) <= 16:
            arms.append(path[::-1])
    return arms


def links_of(path):
    """Parent and child link of each joint of a URDF."""
    import xml.etree.ElementTree as xml
    return {joint.get("name"): (joint.find("parent").get("link"), joint.find("child").get("link"))
            for joint in xml.parse(path).getroot().findall("joint")}


def beside_pinocchio(path, chain, base, tip, robot, model, seed=1):
    """As beside_mujoco, of M, g and J. Joints off the chain stand at zero in both."""
    import pinocchio
    data = model.createData()
    random = np.random.default_rng(seed)
    worst = np.zeros(3)
    tip_frame, base_frame = (model.getFrameId(name, pinocchio.FrameType.BODY)
                             for name in (tip, base))
    dofs = [model.joints[j].idx_v for j in chain]
    for _ in range(POSTURES):
        q = random.uniform(-1, 1, len(chain))
        full = pinocchio.neutral(model)
        for j, value in zip(chain, q):
            at = model.joints[j].idx_q
            if model.joints[j].nq == 2:
                full[at], full[at + 1] = np.cos(value), np.sin(value)
            else:
                full[at] = value
        M = pinocchio.crba(model, data, full)
        M = np.triu(M) + np.triu(M, 1).T
        g = pinocchio.computeGeneralizedGravity(model, data, full)
        pinocchio.computeJointJacobians(model, data, full)
        pinocchio.updateFramePlacements(model, data)
        J = pinocchio.getFrameJacobian(model, data, tip_frame,
                                       pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        R = data.oMf[base_frame].rotation
        J = np.vstack([R.T @ J[:3], R.T @ J[3:]])[:, dofs]
        for i, (ours, other) in enumerate([(robot.mass(q), M[np.ix_(dofs, dofs)]),
                                           (robot.gravity(q), g[dofs]), (robot.jacobian(q), J)]):
            worst[i] = max(worst[i], abs(ours - other).max() / max(1, abs(other).max()))
    return worst


def sweep_mjcf():
    """Rows (model, chain, joints, what became of it) of each arm in MJCF."""
    import mujoco
    for name, path in mjcf_models():
        try:
            spec = mujoco.MjSpec.from_file(str(path))
            if "franky" in name:  # which moves them itself
                spec.meshdir = "meshes"
            model = spec.compile()
        except ValueError as error:
            yield name, "", 0, "refused by MuJoCo: " + " ".join(str(error).split())[:80]
            continue
        for base, tip, count in mjcf_arms(model):
            try:
                robot = dashpot.Robot.from_mujoco(model, base, tip)
            except dashpot.Error as error:
                yield name, f"{base} to {tip}", count, "refused: " + str(error)
                continue
            yield name, f"{base} to {tip}", count, beside_mujoco(model, base, tip, robot)


def sweep_urdf():
    """The same of each arm in example-robot-data."""
    import pinocchio
    for path in urdf_models():
        name = "example-robot-data " + path.stem
        try:
            model = pinocchio.buildModelFromUrdf(str(path))
        except ValueError as error:
            try:
                dashpot.Robot.from_urdf(path, "base_link", "tool0")
                reason = "read, but not by Pinocchio: " + " ".join(str(error).split())
            except dashpot.Error as own:
                reason = "refused: " + str(own).replace(str(path), path.name)
            yield name, "", 0, reason
            continue
        links = links_of(path)
        for chain in urdf_arms(model):
            names = [model.names[j] for j in chain]
            base, tip = links[names[0]][0], links[names[-1]][1]
            try:
                robot = dashpot.Robot.from_urdf(path, base, tip)
            except dashpot.Error as error:
                yield name, f"{base} to {tip}", len(chain), "refused: " + str(error).replace(
                    str(path), path.name)
                continue
            assert list(robot.joint_names) == names
            bare = dashpot.Robot.from_urdf(path, base, tip, reflected_inertia=[0] * len(chain))
            yield (name, f"{base} to {tip}", len(chain),
                   beside_pinocchio(path, chain, base, tip, bare, model))


def reasons_of(refused):
    """What was refused, each reason once with the number of chains, in short."""
    counts = collections.Counter()
    for text in refused:
        if "mimics joint" in text:
            text = "a joint on the chain mimics another"
        elif "triangle inequality" in text:
            links = sorted(re.findall(r"link '([^']*)': its inertia breaks the triangle inequality"
                                      r"(?: by)? ([^:]*):", text))
            text = "triangle inequality broken: " + ", ".join(f"{link} {by}" for link, by in links[:3])
            text += f" and {len(links) - 3} more" if len(links) > 3 else ""
        elif "not positive definite" in text:
            links = re.findall(r"link '([^']*)': its inertia is not positive definite", text)
            text = "inertia not positive definite: " + ", ".join(sorted(links))
        counts[text.removeprefix("refused: ")] += 1
    return "; ".join(f"{count}: {text}" for text, count in counts.items()).replace("|", "/")


def main():
    """Prints a row for each model."""
    print("| model | chains | read | M, g, J differ by at most | refused: chains and reason |")
    print("|---|---|---|---|---|")
    rows, read, refused = 0, 0, 0
    for sweep, needed in ((sweep_mjcf, "mujoco"), (sweep_urdf, "pinocchio")):
        if importlib.util.find_spec(needed) is None:
            print(f"{needed} is not installed: its part is left out", file=sys.stderr)
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for name, group in itertools.groupby(sweep(), key=lambda row: row[0]):
                found = [row[3] for row in group]
                good = [each for each in found if not isinstance(each, str)]
                bad = [each for each in found if isinstance(each, str)]
                worst = ", ".join(f"{x:.0e}" for x in np.max(good, axis=0)) if good else ""
                print(f"| {name} | {len(found)} | {len(good)} | {worst} | {reasons_of(bad)} |")
                rows, read, refused = rows + 1, read + len(good), refused + len(bad)
    print(f"\n{rows} models, {read} chains read, {refused} refused.")


if __name__ == "__main__":
    main()
