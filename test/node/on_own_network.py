# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
``python on_own_network.py SCENE PROGRAM…``: a node and a client on defaults, on a network alone.

Run within `unshare --map-root-user --net`, so that the discovery range may be SUBNET, as on a
robot, and no packet leaves the machine. It prints a line of JSON: whether the node and the client
have shared memory of Fast DDS; the numbers that the publisher gave the messages which the client
heard; and the node's `tick` diagnostics. Variables of the environment that begin with `NODE_` are
the node's, without it.
"""

from array import array
import fcntl
import json
import os
from pathlib import Path
import signal
import socket
import struct
import subprocess
import sys
import time

SIOCGIFFLAGS, SIOCSIFFLAGS, IFF_UP = 0x8913, 0x8914, 1
PATIENCE = 20.0
ENOUGH = 500


def loopback_up():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        request = array('b', struct.pack('16sh22x', b'lo', 0))
        fcntl.ioctl(any_socket, SIOCGIFFLAGS, request)
        (flags,) = struct.unpack_from('h', request, 16)
        struct.pack_into('h', request, 16, flags | IFF_UP)
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, request)


def shared(pid):
    return '/fastrtps_port' in Path(f'/proc/{pid}/maps').read_text()


def main():
    os.environ |= {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', 'ROS_STATIC_PEERS': '127.0.0.1'}
    from diagnostic_msgs.msg import DiagnosticArray
    import rclpy
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import JointState

    loopback_up()
    rclpy.init()
    client = rclpy.create_node('client')
    joint_states, diagnostics = (
        client.create_subscription(kind, topic, lambda _: None, QoSProfile(depth=2000)).handle
        for kind, topic in ((JointState, 'joint_states'), (DiagnosticArray, '/diagnostics'))
    )
    scene, *program = sys.argv[1:]
    own = {key.removeprefix('NODE_'): value for key, value in os.environ.items()
           if key.startswith('NODE_')}  # fmt: skip
    command = [sys.executable, *program, '--ros-args', '-p', f'scene:={scene}']
    environment = {k: v for k, v in os.environ.items() if k != '_ROS_WHEELS_BOOTSTRAP_COMPLETE'}
    node = subprocess.Popen(command, env={**environment, **own}, stdout=sys.stderr)
    numbers, tick, end = [], {}, time.monotonic() + PATIENCE
    try:
        while (len(numbers) < ENOUGH or not tick) and time.monotonic() < end:
            while (taken := joint_states.take_message(JointState, True)) is not None:
                numbers.append(taken[1]['publication_sequence_number'])
            while (taken := diagnostics.take_message(DiagnosticArray, False)) is not None:
                tick = {pair.key: pair.value for pair in taken[0].status[0].values}
            time.sleep(0.005)
        found = {'node': shared(node.pid), 'client': shared('self'), 'numbers': numbers}
    finally:
        node.send_signal(signal.SIGINT)
        try:
            node.wait(PATIENCE)
        finally:
            node.kill()
    print(json.dumps({**found, 'tick': tick}))


if __name__ == '__main__':
    main()
