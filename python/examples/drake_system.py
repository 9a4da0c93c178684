"""Dashpot as a LeafSystem of Drake: drake_system.py CONFIG URDF

Its input is the state of the arm, q and qd, its output the torque. The arm begins 0.05 rad away from
where the springs are fixed.
"""
import sys

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

import dashpot

HOME = np.array([0, -0.785, 0, -2.356, 0, 1.571, 0.785])


class DashpotSystem(LeafSystem):
    """A controller that ticks at its own period; the torque is held in between."""

    def __init__(self, controller: dashpot.Controller) -> None:
        LeafSystem.__init__(self)
        self.controller = controller
        n = controller.joints
        self.DeclareVectorInputPort("state", 2 * n)
        torque = self.DeclareDiscreteState(n)
        self.DeclareStateOutputPort("torque", torque)
        self.DeclarePeriodicDiscreteUpdateEvent(controller.period, 0.0, self.tick)

    def tick(self, context, values) -> None:
        n = self.controller.joints
        state = self.get_input_port().Eval(context)
        torque, status = self.controller.update(context.get_time(), state[:n], state[n:])
        if status >= dashpot.Status.SETPOINT_STALE:
            raise RuntimeError(status.text)
        values.set_value(torque)


def main(config: str, urdf: str) -> None:
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.0005)
    Parser(plant).AddModels(urdf)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("panda_link0"))
    plant.Finalize()
    controller = dashpot.Controller(config)
    system = builder.AddSystem(DashpotSystem(controller))
    builder.Connect(plant.get_state_output_port(), system.get_input_port())
    builder.Connect(system.get_output_port(), plant.get_applied_generalized_force_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositions(context, HOME + 0.05)
    controller.start(HOME + 0.05)
    controller.set_setpoint(joint_position=HOME, mode="joint")
    for _ in range(6):  # a set-point grows old, so it is given again and again
        simulator.AdvanceTo(simulator.get_context().get_time() + 0.4)
        controller.set_setpoint(joint_position=HOME, mode="joint")
    print(controller.modes())
    away = np.abs(plant.GetPositions(context) - HOME).max()
    print(f"{simulator.get_context().get_time():.1f} s later {1000 * away:.2f} mrad away")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
