"""How soon a loop in Python answers libfranka: python benchmarks/franka_loop.py ADDRESS [SECONDS].

Two loops one after the other with the robot at ADDRESS: the bare one of the maker's examples, which
writes zero torques, and Dashpot's with controller/examples/fr3_franka.yaml. Times are from the
arrival of a state in the kernel until its torque was written. For a simulated robot only, because the bare
loop does not hold the arm.
"""

import sys
import time

import pylibfranka

from dashpot import _libfranka, franka


def bare(address, seconds):
    """Returns the times of answers of a loop that does nothing, and the periods without one."""
    before = _libfranka.open_files()
    robot = pylibfranka.Robot(address, pylibfranka.RealtimeConfig.kIgnore)
    wire = _libfranka.Wire(before)
    answers, lost, last = _libfranka.Answers(), 0, None
    with _libfranka.undisturbed():
        control = robot.start_torque_control()
        for tick in range(round(1000 * seconds)):
            state, _ = control.readOnce()
            arrived = wire.arrived()
            torques = pylibfranka.Torques([0.0] * 7)
            torques.motion_finished = tick == round(1000 * seconds) - 1
            control.writeOnce(torques)
            answers.add(time.time_ns() - arrived)
            now = state.time.to_sec()
            lost += 0 if last is None else max(0, round(1e3 * (now - last)) - 1)
            last = now
    wire.close()
    return answers, lost


def main(address, seconds="20"):
    print("| us | median | 99 % | 99.9 % | longest | periods without an answer |\n|---|---|---|---|---|---|")

    def row(name, answers, lost):
        took = answers.summary()
        print(f"| {name} | " + " | ".join(f"{1e6 * took[key]:.0f}" for key in
                                          ("median", "p99", "p999", "longest"))
              + f" | {lost} of {answers.total + lost} |", flush=True)

    row("bare loop", *bare(address, float(seconds)))
    session = franka.Session("controller/examples/fr3_franka.yaml", address)
    report = session.run(float(seconds))
    if report["failure"]:
        sys.exit(report["failure"])
    row("`dashpot.franka`", session.answers, session.lost)


if __name__ == "__main__":
    main(*sys.argv[1:])
