"""An arm that Drake simulates behind the LCM messages of its driver, a period for each answer."""
import math
import time

import numpy as np
from drake import lcmt_iiwa_command, lcmt_iiwa_status, lcmt_panda_command, lcmt_panda_status
from pydrake.lcm import DrakeLcm

from pydrake.manipulation import (  # isort: skip
    IiwaCommandReceiver, IiwaControlMode, IiwaStatusSender, PandaCommandReceiver, PandaControlMode, PandaStatusSender)
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.controllers import InverseDynamics
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.lcm import LcmPublisherSystem, LcmSubscriberSystem
from pydrake.systems.primitives import Adder, ConstantVectorSource, Demultiplexer, LinearSystem

PERIOD = 1e-3  # s
N = 7


class DrakeArm:
    """Gravity is compensated here, as by the drivers. A command acts a period after its status. It
    passes a low-pass of `cutoff` Hz, or none if `cutoff` is 0.

    `rows` has for each period: q, qd, the torque beyond gravity that acted in it, whether its
    status was answered, and whether the arm was tapped.
    """

    def __init__(self, kind, urdf, base, url, start, cutoff):
        builder = DiagramBuilder()
        self.plant = builder.AddSystem(MultibodyPlant(0.0))
        Parser(self.plant).AddModels(str(urdf))
        self.plant.WeldFrames(self.plant.world_frame(), self.plant.GetFrameByName(base))
        self.plant.Finalize()
        self.lcm = DrakeLcm(url)
        if kind == "iiwa":
            status, command, velocity = lcmt_iiwa_status, lcmt_iiwa_command, "velocity_estimated"
            sender = builder.AddSystem(IiwaStatusSender())
            self.clock = sender.GetInputPort("time_measured")
            receiver = builder.AddSystem(IiwaCommandReceiver(N, IiwaControlMode.kTorqueOnly))
        else:
            status, command, velocity = lcmt_panda_status, lcmt_panda_command, "velocity_measured"
            sender = builder.AddSystem(PandaStatusSender())
            self.clock = None
            receiver = builder.AddSystem(PandaCommandReceiver(N, PandaControlMode.kTorque))
        inlet = builder.AddSystem(LcmSubscriberSystem.Make(
            f"{kind.upper()}_COMMAND", command, self.lcm, use_cpp_serializer=True))
        self.outlet = builder.AddSystem(LcmPublisherSystem.Make(
            f"{kind.upper()}_STATUS", status, self.lcm, publish_period=1e6,  # on request
            use_cpp_serializer=True))
        # The simulator takes a message up in the period after the one in which it came.
        gain = PERIOD / (PERIOD + 1 / (2 * math.pi * cutoff)) if cutoff else 1.0  # as libfranka
        one, zero = np.eye(N), np.zeros((N, N))
        self.drives = builder.AddSystem(  # torque += gain (command - torque)
            LinearSystem((1 - gain) * one, gain * one, one, zero, PERIOD))
        self.tap = builder.AddSystem(ConstantVectorSource(np.zeros(N)))
        gravity = builder.AddSystem(
            InverseDynamics(self.plant, InverseDynamics.InverseDynamicsMode.kGravityCompensation))
        torque = builder.AddSystem(Adder(3, N))
        measured = builder.AddSystem(Demultiplexer(2 * N, N))
        state = self.plant.get_state_output_port()
        commanded = receiver.GetOutputPort("torque")
        for output, to in [
                (inlet.get_output_port(), receiver.get_input_port(0)),
                (commanded, self.drives.get_input_port()),
                (self.drives.get_output_port(), torque.get_input_port(0)),
                (self.tap.get_output_port(), torque.get_input_port(1)),
                (gravity.get_output_port(), torque.get_input_port(2)),
                (torque.get_output_port(), self.plant.get_applied_generalized_force_input_port()),
                (state, gravity.get_input_port(0)), (state, measured.get_input_port()),
                (measured.get_output_port(0), sender.GetInputPort("position_measured")),
                (measured.get_output_port(0), sender.GetInputPort("position_commanded")),
                (measured.get_output_port(1), sender.GetInputPort(velocity)),
                (commanded, sender.GetInputPort("torque_commanded")),
                (sender.get_output_port(), self.outlet.get_input_port())]:
            builder.Connect(output, to)
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.root = self.simulator.get_mutable_context()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)
        self.plant.SetPositions(self.context, start)
        integrator = self.simulator.get_mutable_integrator()
        integrator.set_target_accuracy(1e-9)
        integrator.set_maximum_step_size(PERIOD)
        self.simulator.Initialize()
        self.rows = []

    @property
    def position(self):
        return self.plant.GetPositions(self.context)

    def mass(self):
        return self.plant.CalcMassMatrixViaInverseDynamics(self.context)

    def begin(self):
        """Moves in real time until a command comes, for 10 s at most. Returns whether one came."""
        for _ in range(10_000):
            if self.step(PERIOD):
                while self.lcm.HandleSubscriptions(100) > 0:  # what was sent meanwhile
                    pass
                return True
        return False

    def step(self, patience=0.2, tap=None):
        """Sends a status, waits for its answer, for `patience` s at most, and moves by a period.

        Returns whether an answer came.
        """
        while self.lcm.HandleSubscriptions(0) > 0:  # to the status before, and too late
            pass
        if self.clock:  # the sender cuts off what is less than a microsecond
            self.clock.FixValue(self.clock.get_system().GetMyMutableContextFromRoot(self.root),
                                [PERIOD * len(self.rows) + 5e-7])
        self.outlet.ForcedPublish(self.outlet.GetMyContextFromRoot(self.root))
        end = time.monotonic() + patience
        answered = self.lcm.HandleSubscriptions(1) > 0
        while not answered and time.monotonic() < end:
            answered = self.lcm.HandleSubscriptions(5) > 0
        tapping = self.tap.GetMyMutableContextFromRoot(self.root)
        self.tap.get_mutable_source_value(tapping).set_value(np.zeros(N) if tap is None else tap)
        q, qd = self.position, self.plant.GetVelocities(self.context)
        self.simulator.AdvanceTo(PERIOD * (len(self.rows) + 1))
        torque = self.drives.get_output_port().Eval(self.drives.GetMyContextFromRoot(self.root))
        self.rows.append((q.copy(), qd.copy(), torque.copy(), answered, tap is not None))
        return answered


def eigenvalues(rows, differenced):
    """Returns log(z) / period of the linear map from period to period that fits `rows` best.

    The state is q, qd, the torque, and if velocities are differenced the q before.
    """
    q, qd, torque = (np.array([row[i] for row in rows]) for i in range(3))
    quiet = np.array([answered and not tapped for *_, answered, tapped in rows])
    state = np.hstack([q[1:], qd[1:], torque[1:], np.ones((len(q) - 1, 1))])
    if differenced:
        state = np.hstack([q[:-1], state])
    good = np.flatnonzero(quiet[:-3] & quiet[1:-2] & quiet[2:-1] & quiet[3:])
    scale = np.ptp(state, axis=0) + 1e-12
    offset = state.mean(axis=0)
    offset[-1], scale[-1] = 0, 1
    state = (state - offset) / scale
    matrix, _, rank, _ = np.linalg.lstsq(state[good], state[good + 1], rcond=None)
    assert rank == state.shape[1]
    z = np.linalg.eigvals(matrix[:-1, :-1].T)
    return np.log(z.astype(complex)) / PERIOD
