"""rosbag2 and MCAP files as arrays. Skipped without the packages that read them."""

import json
import subprocess

import numpy as np
import pytest

import dashpot

NAMES = ["elbow", "wrist"]


def _states():
    """Time, ns, and position and velocity of two joints in each message of a free decay."""
    t = 1_700_000_000_000_000_000 + np.arange(400) * 10_000_000
    s = 1e-9 * (t - t[0])
    decay = np.exp(-0.1 * 9 * s)
    return t, np.stack([decay * np.cos(9 * s), decay * np.sin(9 * s)], axis=1)


def _write_rosbag(path, plugin):
    rosbags = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kinds = store.types
    stamp, header = kinds["builtin_interfaces/msg/Time"], kinds["std_msgs/msg/Header"]
    state, pose = kinds["sensor_msgs/msg/JointState"], kinds["geometry_msgs/msg/Point"]
    with rosbags.Writer(path, version=9, storage_plugin=getattr(rosbags.StoragePlugin, plugin)) as bag:
        joints = bag.add_connection("/joint_states", state.__msgtype__, typestore=store)
        points = bag.add_connection("/point", pose.__msgtype__, typestore=store)
        for k, (ns, q) in enumerate(zip(*_states())):
            order = [1, 0] if k % 2 else [0, 1]  # publishers may differ
            message = state(header(stamp(int(ns // 10**9), int(ns % 10**9)), "base"),
                            [NAMES[i] for i in order], q[order], 2 * q[order], np.array([]))
            bag.write(joints, int(ns) + 5000, store.serialize_cdr(message, state.__msgtype__))
            if k % 100 == 0:
                bag.write(points, int(ns), store.serialize_cdr(pose(float(k), 1.5, -2), pose.__msgtype__))
        gripper = state(header(stamp(1, 0), ""), ["finger"], np.array([0.5]), np.array([]), np.array([7.0]))
        bag.write(joints, int(ns) + 10**7, store.serialize_cdr(gripper, state.__msgtype__))


@pytest.mark.parametrize("plugin", ["SQLITE3", "MCAP"])
def test_rosbags_are_read_as_joints(tmp_path, plugin):
    _write_rosbag(tmp_path / "bag", plugin)
    log = dashpot.read_log(tmp_path / "bag")
    assert sorted(log) == ["/joint_states", "/point"]
    assert log["/point"]["x"].tolist() == [0, 100, 200, 300]
    assert log["/point"]["y"].tolist() == [1.5] * 4
    joints, (t, q) = log["/joint_states"], _states()
    assert joints["name"].tolist() == NAMES + ["finger"]
    assert np.array_equal(joints["position"][:-1, :2], q)
    assert np.array_equal(joints["velocity"][:-1, :2], 2 * q)
    assert np.isnan(joints["effort"][:-1]).all() and joints["effort"][-1, 2] == 7
    assert np.isnan(joints["position"][:-1, 2]).all() and joints["position"][-1, 2] == 0.5
    assert np.array_equal(joints["log_utime"][:-1], t // 1000 + 5)
    assert abs(joints["time"][:-1] - 1e-9 * t).max() < 1e-6
    assert set(joints["header.frame_id"]) == {"base", ""}


@pytest.mark.parametrize("topics,types,found", [
    (["/point"], None, ["/point"]), (None, ["JointState"], ["/joint_states"]),
    (None, ["sensor_msgs/msg/JointState"], ["/joint_states"]),
    (["/point"], ["sensor_msgs/JointState"], ["/joint_states", "/point"]), (["/none"], None, [])])
def test_topics_are_chosen_by_name_or_type(tmp_path, topics, types, found):
    _write_rosbag(tmp_path / "bag", "SQLITE3")
    assert sorted(dashpot.read_log(tmp_path / "bag", topics=topics, types=types)) == found


def test_one_file_of_a_rosbag_in_mcap_is_enough(tmp_path):
    pytest.importorskip("mcap")
    _write_rosbag(tmp_path / "bag", "MCAP")
    file, = (tmp_path / "bag").glob("*.mcap")
    whole, part = dashpot.read_log(tmp_path / "bag"), dashpot.read_log(file)
    for name, fields in whole["/joint_states"].items():
        assert np.array_equal(fields, part["/joint_states"][name],
                              equal_nan=fields.dtype.kind == "f"), name


def test_modes_are_identified_from_a_rosbag(tmp_path):
    _write_rosbag(tmp_path / "bag", "MCAP")
    joints = dashpot.read_log(tmp_path / "bag", types=["JointState"])["/joint_states"]
    found = dashpot.identify(joints["time"][:-1] - joints["time"][0], joints["position"][:-1, :2])
    assert found.modes.natural_frequency == pytest.approx([9 * np.hypot(1, 0.1)], rel=1e-3)
    assert dashpot.identify(joints, find=True).modes.natural_frequency == pytest.approx(
        [9 * np.hypot(1, 0.1)], rel=1e-3)


def test_postures_of_a_topic_are_those_of_the_joints_by_name(panda):
    random = np.random.default_rng(3)
    order = random.permutation(8)
    names = np.array([*panda.joint_names, "finger"])
    positions = random.uniform(-0.5, 0.5, (6, 8)) + [*np.array([0, -0.8, 0, -2.3, 0, 1.6, 0.8]), 0]
    joints = {"name": names[order], "position": positions[:, order].copy()}
    gains = {"task_stiffness": [200] * 3 + [20] * 3, "damping_factor": 2}
    given = dashpot.audit(panda, postures=positions[:, :7], **gains).workspace.smallest_ratio
    found = dashpot.audit(panda, postures=joints, **gains).workspace.smallest_ratio
    assert (found.median, found.worst) == (given.median, given.worst)
    assert np.array_equal(found.worst_q, given.worst_q)
    joints["position"][2, list(order).index(4)] = np.nan
    assert dashpot.audit(panda, postures=joints, **gains).workspace.samples == 5
    joints["name"][0] = "other_joint"
    with pytest.raises(dashpot.Error, match=f"no positions of {names[order[0]]}"):
        dashpot.audit(panda, postures=joints, **gains)


def test_mcap_of_the_program_is_read_as_its_log(root, program, tmp_path):
    pytest.importorskip("mcap")
    log, mcap = tmp_path / "run.lcm", tmp_path / "run.mcap"
    subprocess.run([program, "run", root / "sim/scenes/panda_release_c2.yaml", "--duration", "0.2", "--fast",
                    "--log", log], check=True, capture_output=True)
    subprocess.run([program, "export", log, "--mcap", mcap], check=True, capture_output=True)
    before, after = dashpot.read_log(log)["DASHPOT_STATE"], dashpot.read_log(mcap)["DASHPOT_STATE"]
    for name in ("joint_position", "joint_velocity", "joint_torque", "tick"):
        assert np.array_equal(before[name], after[name]), name


def test_what_cannot_be_read_is_said(tmp_path):
    mcap = pytest.importorskip("mcap.writer")
    path = tmp_path / "a.mcap"
    with open(path, "wb") as file:
        writer = mcap.Writer(file)
        writer.start()
        schema = writer.register_schema("thing", "protobuf", b"")
        other = writer.register_schema("numbers", "jsonschema", b"{}")
        bad = writer.register_channel("/bad", "protobuf", schema)
        good = writer.register_channel("/good", "json", other)
        writer.add_message(bad, 1000, b"x", 1000)
        for k in range(3):
            writer.add_message(good, 1000 * k, json.dumps({"a": list(range(k)), "b": {"c": k}}).encode(),
                               1000 * k)
        writer.finish()
    with pytest.warns(UserWarning, match="/bad: 1 messages are not read: messages encoded as protobuf"):
        log = dashpot.read_log(path)
    assert list(log) == ["/good"]
    assert log["/good"]["b.c"].tolist() == [0, 1, 2]
    assert np.array_equal(log["/good"]["a"], [[np.nan, np.nan], [0, np.nan], [0, 1]], equal_nan=True)
    path.write_bytes(b"\x89MCAP0\r\n" + b"\xff" * 50)
    with pytest.raises(dashpot.Error, match="a.mcap: "):
        dashpot.read_log(path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(dashpot.Error, match="empty"):
        dashpot.read_log(tmp_path / "empty")
