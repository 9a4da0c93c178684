"""An FR3 of franky-sim behind libfranka's protocol, in lock-step: each state waits for its torque,
which acts a period later, as with the robot. Frictionless but for viscous friction in each joint.

python franka_arm.py ADDRESS; then lines on standard input: "push TICKS N m...", "stop" (the button),
"reflex NAME_OF_ERROR", "vanish", "pause" (half a second without a state).
"""
import select
import sys
import time

import franky_sim
from franky_sim import simulation_server
from franky_sim.franka_robot_protocol import BaseCommand, MoveStatus, RobotCommand, RobotMode, UDPCommand
from franky_sim.mujoco_simulator import MujocoSimulator

# The errors that the tests use, by their places in the robot's state.
ERRORS = {"joint_reflex": 6, "communication_constraints_violation": 25}
VISCOUS = 0.2  # N m s/rad


class Server(franky_sim.FrankaRobotServer):
    """The robot's side, which can also stop by itself."""

    mode = None
    error = None
    newest = None  # torques, which act a period later

    def start_motion(self, *args):
        self.newest = None
        super().start_motion(*args)

    def _handle_udp_command(self, command_data):
        due, self.newest = self.newest, command_data
        for data in (due, command_data):
            if data and (data is due or UDPCommand.from_bytes(data).torque_command_finished):
                super()._handle_udp_command(data)

    @property
    def robot_state(self):
        state = franky_sim.FrankaRobotServer.robot_state.fget(self)
        if self.mode is None:
            return state
        errors = tuple(k == self.error for k in range(41))
        return state.replace(robot_mode=self.mode, errors=errors, reflex_reason=errors)

    def abort(self, mode, status, error=None):
        motion = self.current_motion_id
        self.stop_motion(send_preemption_signal=False)
        self.mode, self.error = mode, error
        BaseCommand.send_response(self._tcp_socket, RobotCommand.kMove, motion, status)
        self.reset_current_motion_id()

    def wait(self):
        """Waits for the torque that answers the last state; otherwise keeps the robot's pace."""
        udp = self._FrankaServer__udp_socket
        if udp is not None and self.current_motion_id:
            select.select([udp], [], [], 0.5)
        else:
            time.sleep(0.001)


def main(address):
    simulation_server.FrankaRobotServer = Server
    push, left = [0.0] * 7, 0
    with MujocoSimulator() as sim:
        robot = sim.add_robot(initial_q=(0, -0.785, 0, -2.356, 0, 1.571, 0.785))
        with franky_sim.SimulationServer(sim, hostname_candidates=[address]) as server:
            sim.model.dof_frictionloss[:] = 0
            sim.model.dof_damping[:] = VISCOUS
            arm = server.robot_servers[0]
            print("ready", flush=True)
            while True:
                while select.select([sys.stdin], [], [], 0)[0]:
                    word, *rest = sys.stdin.readline().split() or ["end"]
                    if word == "push":
                        left, push = int(rest[0]), [float(x) for x in rest[1:]]
                    elif word == "stop":
                        arm.abort(RobotMode.kUserStopped, MoveStatus.kEmergencyAborted)
                    elif word == "reflex":
                        arm.abort(RobotMode.kReflex, MoveStatus.kReflexAborted, ERRORS[rest[0]])
                    elif word == "pause":
                        time.sleep(0.5)
                    else:
                        return
                arm.wait()
                arm.process_commands()
                if left:
                    for address_of, torque in zip(robot._dof_addrs, push):
                        sim.data.qfrc_applied[address_of] += torque
                left = max(0, left - 1)
                sim.step()
                arm.send_state()


if __name__ == "__main__":
    main(*sys.argv[1:])
