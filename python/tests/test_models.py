"""Models as people have them: MJCF beside the engine, xacro, doubtful URDFs, files that are saved."""

import json
import subprocess

import numpy as np
import pytest

import dashpot

# Two joints in one body, anchors, references, a slide, a turned base, and bodies off the chain.
MJCF = """
<mujoco model="odd"><compiler angle="radian" autolimits="true"/><option gravity="0 0 -9.7"/>
<worldbody><body name="base" pos="0.1 0.2 0.3" euler="0.3 -0.5 1.1">
 <geom type="sphere" size="0.1" mass="3"/>
 <body name="side" pos="0 0.3 0"><joint name="aside" axis="1 0 0"/><geom type="sphere" size="0.1"/></body>
 <body name="upper" pos="0.1 0 0.2" quat="0.8 0.1 -0.3 0.5">
  <joint name="one" axis="0.3 0.2 1" pos="0.05 -0.02 0.1" ref="0.4" range="-1 2" damping="0.7"
   frictionloss="0.2" armature="0.11" actuatorfrcrange="-35 35"/>
  <joint name="two" axis="0 1 0.2" pos="-0.1 0.02 0.03" armature="0.05" actuatorfrcrange="-40 30"/>
  <geom type="capsule" size="0.05 0.2" pos="0.1 0 0.1" euler="0.4 0.2 0" mass="2.5"/>
  <body name="camera" pos="0.1 0.1 0" euler="0 0 1"><joint name="pan" axis="0 0 1" ref="0.3"/>
   <geom type="box" size="0.03 0.05 0.02" mass="0.4"/></body>
  <body name="mount" pos="0 0 0.3" euler="0.1 0.2 0.3"><geom type="sphere" size="0.05" mass="0.6"/>
   <body name="lower" pos="0.05 0 0.1" euler="0.3 0 0.7">
    <joint name="three" type="slide" axis="1 0.5 0" ref="0.1" range="-0.2 0.5" armature="0.9"/>
    <geom type="box" size="0.1 0.05 0.07" pos="0.02 0.03 0.04" mass="1.2"/>
    <body name="tip" pos="0.1 0.02 0.2" euler="1 0.4 0.2"><joint name="four" axis="1 0 0" damping="0.1"/>
     <geom type="box" size="0.02 0.05 0.03" mass="0.3"/>
     <site name="tool" pos="0.1 0 0.05" euler="0 1.5707963267948966 0.3"/>
    </body></body></body></body></body></worldbody>
<actuator><motor joint="one" gear="20" ctrlrange="-2 2"/><position joint="three" kp="100"/>
 <motor joint="four" forcerange="-5 5"/></actuator></mujoco>"""


@pytest.fixture(scope="module")
def mujoco():
    return pytest.importorskip("mujoco")


@pytest.fixture
def odd(mujoco):
    return mujoco.MjModel.from_xml_string(MJCF)


def beside_engine(mujoco, model, base, tip, robot):
    """Largest difference of M, g and J from the engine's, each relative to its largest entry."""
    data = mujoco.MjData(model)
    joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
              for name in robot.joint_names]
    dofs, places = model.jnt_dofadr[joints], model.jnt_qposadr[joints]
    lower, upper = np.maximum(robot.lower, -3), np.minimum(robot.upper, 3)
    random = np.random.default_rng(1)
    worst = np.zeros(3)
    base_id = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, base)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, tip)
    place = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, tip) if body < 0 else -1
    for _ in range(5):
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


@pytest.mark.parametrize("tip", ["tip", "tool", "lower"])
@pytest.mark.parametrize("base", ["base", "upper", "world"])
def test_an_odd_arm_equals_the_engines(mujoco, odd, base, tip):
    robot = dashpot.Robot.from_mujoco(odd, base, tip)
    names = ["one", "two", "three", "four"][2 if base == "upper" else 0:3 if tip == "lower" else 4]
    assert list(robot.joint_names) == names
    assert max(beside_engine(mujoco, odd, base, tip, robot)) < 1e-12


def test_what_an_engine_says_of_joints_is_taken(odd):
    robot = dashpot.Robot.from_mujoco(odd, "base", "tool")
    assert list(robot.reflected_inertia) == [0.11, 0.05, 0.9, 0]
    assert list(robot.viscous_friction) == [0.7, 0, 0, 0.1]
    assert list(robot.coulomb_friction) == [0.2, 0, 0, 0]
    assert list(robot.lower) == [-1, -np.inf, -0.2, -np.inf]
    assert list(robot.upper) == [2, np.inf, 0.5, np.inf]
    assert list(robot.effort) == [35, 30, np.inf, 5]
    assert np.all(robot.velocity == np.inf)
    assert list(dashpot.Robot.from_mujoco(odd, "base", "tool",
                                          reflected_inertia=[1, 2, 3, 4]).reflected_inertia) == [1, 2, 3, 4]


def test_gravity_can_be_off_and_names_can_coincide(mujoco, odd):
    assert abs(dashpot.Robot.from_mujoco(odd, "base", "tool").gravity([0.1] * 4)).max() > 1
    still = mujoco.MjModel.from_xml_string(MJCF.replace(
        '<option gravity="0 0 -9.7"/>', '<option><flag gravity="disable"/></option>'))
    assert not dashpot.Robot.from_mujoco(still, "base", "tool").gravity([0.1] * 4).any()
    named = mujoco.MjModel.from_xml_string(MJCF.replace('name="camera"', 'name="link of one"'))
    robot = dashpot.Robot.from_mujoco(named, "base", "tool")
    assert max(beside_engine(mujoco, named, "base", "tool", robot)) < 1e-12


def test_positions_are_those_of_the_engine(mujoco, odd):
    robot = dashpot.Robot.from_mujoco(odd, "base", "tool")
    data = mujoco.MjData(odd)
    q = [0.7, -0.4, 0.25, 1.1]
    for name, value in zip(robot.joint_names, q):
        data.joint(name).qpos[:] = value
    mujoco.mj_forward(odd, data)
    R = data.body("base").xmat.reshape(3, 3)
    pose = robot.pose(q)
    assert np.allclose(pose[:3, 3], R.T @ (data.site("tool").xpos - data.body("base").xpos),
                       atol=1e-14, rtol=0)
    assert np.allclose(pose[:3, :3], R.T @ data.site("tool").xmat.reshape(3, 3), atol=1e-14, rtol=0)


def test_a_saved_arm_is_read_by_the_program(odd, program, tmp_path):
    robot = dashpot.Robot.from_mujoco(odd, "base", "tool", payload_mass=0.5,
                                      payload_center=(0, 0, 0.1))
    urdf, config = robot.save(tmp_path / "arm.urdf")
    controller = dashpot.Controller(config)
    assert controller.joints == len(robot)
    with open(config, encoding="utf-8") as file:
        written = json.load(file)["robot"]
    q = np.array([0.7, -0.4, 0.25, 1.1])
    told = json.loads(subprocess.run(
        [program, "inspect", "--urdf", urdf, "--base", "base", "--tip", "tool", "--json", "--q",
         ",".join(map(str, q)), "--reflected-inertia",
         ",".join(map(str, written["reflected_inertia"])), "--gravity",
         ",".join(map(str, written["gravity"]))], check=True, capture_output=True).stdout)
    bare = dashpot.Robot.from_mujoco(odd, "base", "tool")
    assert np.allclose(told["mass_matrix"], bare.mass(q), atol=1e-14, rtol=0)
    assert np.allclose(told["gravity"], bare.gravity(q), atol=1e-13, rtol=0)
    again = dashpot.Robot.from_urdf(urdf, "base", "tool",
                                    reflected_inertia=written["reflected_inertia"],
                                    gravity=written["gravity"], payload_mass=0.5,
                                    payload_center=(0, 0, 0.1))
    assert np.array_equal(again.mass(q), robot.mass(q))


def test_what_is_no_chain_of_an_engine_is_refused(mujoco, odd, tmp_path):
    for base, tip, text in (("bas", "tip", "there is no body 'bas'; its bodies are world, base"),
                            ("base", "tp", "there is no body or site 'tp'"),
                            ("tip", "upper", "'upper' is not beyond the base, 'tip'"),
                            ("base", "base", "no joint moves it")):
        with pytest.raises(dashpot.Error, match=text):
            dashpot.Robot.from_mujoco(odd, base, tip)
    free = MJCF.replace('<joint name="four" axis="1 0 0" damping="0.1"/>', '<joint name="four" type="ball"/>')
    with pytest.raises(dashpot.Error, match="joint 'four': ball and free joints"):
        dashpot.Robot.from_mujoco(mujoco.MjModel.from_xml_string(free.replace(
            '<motor joint="four" forcerange="-5 5"/>', "")), "base", "tip")
    with pytest.raises(dashpot.Error, match="broken.xml: "):
        (tmp_path / "broken.xml").write_text("<mujoco><worldbody>")
        dashpot.Robot.from_mujoco(tmp_path / "broken.xml", "base", "tip")
    springs = MJCF.replace('name="two"', 'name="two" stiffness="3"')
    with pytest.warns(UserWarning, match="springs of joints"):
        dashpot.Robot.from_mujoco(mujoco.MjModel.from_xml_string(springs), "base", "tip")


def test_a_path_is_as_good_as_a_model(mujoco, odd, tmp_path):
    path = tmp_path / "odd.xml"
    path.write_text(MJCF)
    q = [0.1, 0.2, 0.3, 0.4]
    assert np.array_equal(dashpot.Robot.from_mujoco(path, "base", "tip").mass(q),
                          dashpot.Robot.from_mujoco(odd, "base", "tip").mass(q))
    with pytest.raises(dashpot.Error, match="is MJCF, MuJoCo's format.*from_mujoco"):
        dashpot.Robot.from_urdf(path, "base", "tip")


XACRO = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="mass" default="2"/><link name="a"/><link name="b"><inertial><origin xyz="${1/2} 0 0"/>
<mass value="$(arg mass)"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint></robot>"""


@pytest.mark.parametrize("package", ["xacro", "xacrodoc"])
def test_a_xacro_is_expanded_where_it_can_be(tmp_path, monkeypatch, package):
    pytest.importorskip(package)
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(XACRO)
    if package == "xacrodoc":
        monkeypatch.setitem(__import__("sys").modules, "xacro", None)
    robot = dashpot.Robot.from_urdf(path, "a", "b")
    assert robot.mass([0])[0, 0] == pytest.approx(1 + 2 / 4, rel=1e-14)
    robot = dashpot.Robot.from_urdf(path, "a", "b", xacro_arguments={"mass": "4"})
    assert robot.mass([0])[0, 0] == pytest.approx(1 + 4 / 4, rel=1e-14)
    path.write_text(XACRO.replace("${1/2}", "${nothing}"))
    with pytest.raises(dashpot.Error, match="arm.urdf.xacro: xacro: .*nothing"):
        dashpot.Robot.from_urdf(path, "a", "b")


def test_a_xacro_says_how_to_go_on(tmp_path, monkeypatch):
    for package in ("xacro", "xacrodoc"):
        monkeypatch.setitem(__import__("sys").modules, package, None)
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(XACRO)
    with pytest.raises(dashpot.Error, match="pip install xacro"):
        dashpot.Robot.from_urdf(path, "a", "b")


def test_doubts_are_warnings_and_inertias_are_accepted_by_name(root, tmp_path):
    text = (root / "sim/models/panda.urdf").read_text()
    path = tmp_path / "arm.urdf"
    path.write_text(text.replace('<mass value="3.587895"/>', '<mass value="3587.895"/>'))
    with pytest.warns(UserWarning, match="panda_link4.*is it in g?"):
        robot = dashpot.Robot.from_urdf(path, "panda_link0", "panda_hand_tcp")
    assert robot.warnings[0].startswith("link 'panda_link4': its mass, 3588 kg")
    path.write_text(text.replace('izz="0.0017"', 'izz="0.004"'))
    with pytest.raises(dashpot.Error, match="'panda_hand': its inertia breaks .* by 14.3 %"):
        dashpot.Robot.from_urdf(path, "panda_link0", "panda_hand_tcp")
    dashpot.Robot.from_urdf(path, "panda_link0", "panda_hand_tcp", accept_inertias=["panda_hand"])
    with pytest.raises(dashpot.Error, match="'panda_hnd': there is none whose inertia to accept"):
        dashpot.Robot.from_urdf(path, "panda_link0", "panda_hand_tcp", accept_inertias=["panda_hnd"])


def test_limits_of_version_1_2_are_there(root, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text((root / "sim/models/panda.urdf").read_text()
                    .replace('<robot name="panda">', '<robot name="panda" version="1.2">')
                    .replace('effort="12"', 'effort="12" acceleration="20" jerk="5000"'))
    robot = dashpot.Robot.from_urdf(path, "panda_link0", "panda_hand_tcp")
    assert list(robot.acceleration) == [np.inf] * 4 + [20] * 3
    assert list(robot.jerk) == [np.inf] * 4 + [5000] * 3
    assert np.all(robot.deceleration == np.inf)
