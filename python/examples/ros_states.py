"""A Panda on /joint_states that stretches, and the ratios from python -m dashpot.ros.

python python/examples/ros_states.py, beside python -m dashpot.ros controller/examples/panda.yaml
"""

import time

import numpy as np
import rclpy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

HOME, STRETCHED = (0, -0.785, 0, -2.356, 0, 1.571, 0.785), (0, 0.6, 0, -1, 0, 1.6, 0)


def main():
    rclpy.init()
    node = rclpy.create_node("panda")
    publisher = node.create_publisher(JointState, "/joint_states", 10)
    heard = []
    node.create_subscription(Float64MultiArray, "/dashpot/damping_ratio",
                             lambda message: heard.append(message.data), 10)
    names = [f"panda_joint{k}" for k in range(1, 8)]
    for text, q in (("at home", HOME), ("stretched", STRETCHED)):
        end = time.monotonic() + 60
        heard.clear()
        while len(heard) < 5 and time.monotonic() < end:  # the first may be of the posture before
            state = JointState(name=names, position=np.array(q, float).tolist())
            state.header.stamp = node.get_clock().now().to_msg()
            publisher.publish(state)
            rclpy.spin_once(node, timeout_sec=0.01)
        if not heard:
            raise SystemExit("python -m dashpot.ros is not heard")
        print(f"{text}: ratios " + " ".join(f"{zeta:.3f}" for zeta in heard[-1]))
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
