# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Send crank samples to several nodes in turn and measure the time until the joint state arrives.

An answer has the stamp of its sample. Arguments: the rate of all samples together, in [Hz];
the number of samples per node in a part; the number of parts; then the namespaces of the nodes.
For every part it prints a line of JSON: for each namespace the round trips, in [ns], and the
number of samples without an answer.
"""

from __future__ import annotations

import json
from math import tau
import sys
from time import monotonic_ns, sleep, time_ns

from bench.raw_node import node, publisher, subscription, taker, waiter
from linkage_ros.messages import JointStateWriter, NANOSECONDS
from linkage_ros.signals import stop_on_signals
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data

_PATIENCE = 50_000_000
"""Time limit for an answer, in [ns]."""

_MATCHING = 10.0
"""Time limit for the discovery of the nodes, in [s]."""

_SPEED = tau


class Target:
    """A node to probe, by the namespace of its topics."""

    def __init__(self, owner: Node, namespace: str) -> None:
        self._crank = publisher(owner, f'{namespace}/crank_states', qos_profile_sensor_data)
        self._joints = subscription(owner, f'{namespace}/joint_states')
        self._publish = self._crank.handle.publish_raw
        self._take = taker(self._joints)
        self._wait = waiter(owner, self._joints)

    def found(self) -> bool:
        """Whether discovery is complete in both directions."""
        heard = self._crank.get_subscription_count() > 0
        return heard and bool(self._joints.handle.get_publisher_count())

    def probe(self, message: bytes) -> int | None:
        """Return the round trip of a message, in [ns]; None without an answer."""
        stamp = message[4:12]
        begin = monotonic_ns()
        self._publish(message)
        while (left := begin + _PATIENCE - monotonic_ns()) > 0:
            if self._wait(left):
                while (taken := self._take()) is not None:
                    if taken[0][4:12] == stamp:
                        return monotonic_ns() - begin
        return None


def main() -> None:
    """Probe, print and end."""
    stop = stop_on_signals()
    period = NANOSECONDS / float(sys.argv[1])
    size, parts, names = int(sys.argv[2]), int(sys.argv[3]), sys.argv[4:]
    writer = JointStateWriter(['crank_joint'])
    with node('prober') as prober:
        targets = {name: Target(prober, name) for name in names}
        until = monotonic_ns() + _MATCHING * NANOSECONDS
        while not all(target.found() for target in targets.values()):
            if monotonic_ns() > until or stop.is_set():
                sys.exit('the nodes were not found')
            sleep(0.05)
        begin = monotonic_ns()
        number = 0
        for _ in range(parts):
            trips: dict[str, list[int]] = {name: [] for name in names}
            missing = dict.fromkeys(names, 0)
            for _ in range(size):
                for name, target in targets.items():
                    if stop.is_set():
                        return
                    number += 1
                    wait = begin + round(number * period) - monotonic_ns()
                    if wait > 0:
                        sleep(wait * 1e-9)
                    angle = _SPEED * (monotonic_ns() - begin) * 1e-9
                    trip = target.probe(writer.write(time_ns(), (angle,), (_SPEED,)))
                    if trip is None:
                        missing[name] += 1
                    else:
                        trips[name].append(trip)
            print(json.dumps({name: [trips[name], missing[name]] for name in names}), flush=True)


if __name__ == '__main__':
    main()
