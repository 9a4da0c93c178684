"""The transcripts of docs/franka.md, mujoco.md and ros.md: each command runs and prints what it says.
Left out is what installs and builds: the test has the packages, or is skipped."""

import doctest
import importlib.util
import itertools
import os
import re
import subprocess
import sys
import time

import pytest

from conftest import ROOT

INSTALLS = re.compile(r"python3 -m venv|pip install|\./run build")
SERVERS = ("franky-sim", "python -m dashpot.ros")  # run until the rest is done
counter = itertools.count(1)


def transcript(name, heading):
    """The commands of the section, in order, each with what it prints."""
    text = (ROOT / "docs" / name).read_text().split(f"## {heading}\n")[1].split("\n## ")[0]
    found = []
    for block in re.findall(r"```\n(.*?)```", text, re.S):
        for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
            command, _, output = part.partition("\n")
            found.append((command, output))
    assert found
    return found


def follow(name, heading, needs, **replaced):
    for package in needs:
        if importlib.util.find_spec(package) is None:
            pytest.skip(f"{package} is not installed")
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "ROS_DOMAIN_ID": str(
        102 + os.getpid() % 100), "PATH": os.pathsep.join(
            (os.path.dirname(sys.executable), str(ROOT / "build/release"), os.environ["PATH"]))}
    servers, ran, exports = [], 0, ""
    try:
        for command, output in transcript(name, heading):
            if INSTALLS.search(command):
                continue
            for old, new in replaced.items():
                command, output = (text.replace(old.replace("_", "."), new)
                                   for text in (command, output))
            if command.startswith("export "):
                exports += command + "\n"
                continue
            if command.startswith(SERVERS):
                server = subprocess.Popen("exec " + command, shell=True, cwd=ROOT, env=environment,
                                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
                servers.append(server)
                last = output.strip().rsplit("\n", 1)[-1]
                while last and (line := server.stdout.readline()):
                    if line.strip() == last:
                        break
                if not last:
                    time.sleep(0.5)
                assert server.poll() is None, command
                continue
            done = subprocess.run(["bash", "-c", exports + command], cwd=ROOT, env=environment,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                  timeout=1200, check=False)
            assert done.returncode == 0, done.stdout
            squeezed = (" ".join(text.split()) for text in (output, done.stdout))
            assert doctest.OutputChecker().check_output(*squeezed, doctest.ELLIPSIS), \
                f"{command}\n{done.stdout}\nbut in docs/{name}:\n{output}"
            ran += 1
    finally:
        for server in servers:
            server.kill()
            server.communicate()
    return ran


def test_libfranka():
    pid = os.getpid()
    address = f"127.{90 + next(counter)}.{pid // 250 % 250}.{1 + pid % 250}"
    assert follow("franka.md", "A simulated FR3 in five commands", ["pylibfranka", "franky_sim"],
                  **{"127_0_0_1": address}) == 2


def test_mujoco():
    if not (ROOT / "build/release/libdashpot_mujoco.so").exists():
        pytest.skip("libdashpot_mujoco.so was not built (DASHPOT_MUJOCO)")
    assert follow("mujoco.md", "An arm from MuJoCo Menagerie in five commands",
                  ["mujoco", "franky_sim"]) == 1


def test_ros():
    assert follow("ros.md", "A node in five commands",
                  ["rclpy", "sensor_msgs", "diagnostic_msgs", "visualization_msgs"]) == 1


def test_gains_of_public_controllers(program):
    assert follow("ros.md", "Gains of public controllers in two commands", []) == 2
