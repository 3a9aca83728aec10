# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""
A probe that publishes the crank and measures how stale a joint state is when it is used.

It knows the exact crank at every instant, and so the exact joints. At random instants it uses the
newest joint state: as it is, or extrapolated by its rates from its stamp to now. The error shows
what an application gets at the node's rate. For each motion of the crank it prints a line of JSON
when the motion begins, and a line with the results. Its only argument is a `TableRequest` as a
JSON object.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
import json
from math import remainder, tau
from random import Random
import sys
from threading import Event
from time import monotonic_ns, sleep, time_ns
from typing import Any, NamedTuple

from linkage_ros.accuracy.ticking import CrankAt, motions_of
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.messages.joint_state import JointStateReader, JointStateWriter, Rejection
from linkage_ros.messages.layout import NANOSECONDS
from linkage_ros.node.demo_nodes import run_demo_node
from linkage_ros.node.scene_topics import OUTPUT_QOS
from linkage_ros.scene.load import load_scene
from linkage_ros.signals import stop_on_signals
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

_MATCHING = 20.0  # [s]
_LEAD = 300_000_000
"""Time that the crank rests at the start of the motion before the first use, in [ns]."""


class TableRequest(NamedTuple):
    """Settings of a measurement."""

    scene: str  # Scene file that the node runs
    seconds: float  # Duration of each motion, in [s]
    # Rates of crank samples and of uses of a joint state, in [Hz].
    crank_rate: float
    use_rate: float


class StalenessProbe(Node):
    """Publishes a crank and uses joint states."""

    def __init__(self, task: TableRequest) -> None:
        super().__init__('consumer')
        self._task = task
        (member,) = load_scene(task.scene).members
        self._closure = Closure(member.linkage)
        turning = self._closure.turning
        # Angles if there are any: metres and radians are not added.
        self._counted = [k for k, turns in enumerate(turning) if turns or not any(turning)]
        self._read = JointStateReader(member.joints).read
        self._write = JointStateWriter(member.inputs).write
        self._crank = self.create_publisher(JointState, 'crank_states', qos_profile_sensor_data)
        self._states = self.create_subscription(JointState, 'joint_states', _never, OUTPUT_QOS)

    def run(self, stop: Event) -> None:
        """Run all motions."""
        until = monotonic_ns() + _MATCHING * NANOSECONDS
        while not (
            self._crank.get_subscription_count() and self._states.handle.get_publisher_count()
        ):
            if monotonic_ns() > until or stop.is_set():
                return
            sleep(0.02)
        motions = motions_of(self._closure, self._task.seconds).by_name
        # The first joint state comes some time after the first crank sample.
        (angle, rate), *_ = (crank(0) for crank in motions.values())
        while self._newest() is None:
            if monotonic_ns() > until or stop.is_set():
                return
            self._crank.handle.publish_raw(self._write(time_ns(), (angle,), (rate,)))
            sleep(0.01)
        for name, crank in motions.items():
            errors = self._use(name, crank, stop)
            if stop.is_set():
                return
            print(json.dumps(errors), flush=True)

    def _use(self, name: str, crank: CrankAt, stop: Event) -> dict[str, Any]:
        """Turn the crank through a motion and return the errors of the joint states."""
        task, random = self._task, Random(name)
        begin = time_ns() + _LEAD
        end = begin + round(task.seconds * NANOSECONDS)
        period = NANOSECONDS / task.crank_rate
        next_crank, next_use, sent = begin - _LEAD, begin, 0
        ages: list[int] = []
        held: list[float] = []
        carried: list[float] = []
        newest, unused, announced = None, 0, False
        while (now := time_ns()) < end and not stop.is_set():
            if not announced and now >= begin:
                print(json.dumps({'begun': name}), flush=True)
                announced = True
            wait = min(next_crank, next_use) - now
            if wait > 0:
                sleep(wait * 1e-9)
                continue
            if next_crank <= next_use:
                stamp = time_ns()
                angle, rate = crank(stamp - begin)
                self._crank.handle.publish_raw(self._write(stamp, (angle,), (rate,)))
                sent += 1
                next_crank = begin - _LEAD + round(sent * period)
                continue
            next_use += round(random.expovariate(task.use_rate) * NANOSECONDS)
            newest = self._newest() or newest
            now = time_ns()
            if newest is None:
                unused += 1
                continue
            stamp, values, rates = newest
            ages.append(now - stamp)
            age = (now - stamp) * 1e-9
            truth = self._closure.position(crank(now - begin)[0]).joints
            held.append(self._error(values, truth))
            forward = [value + rate * age for value, rate in zip(values, rates, strict=True)]
            carried.append(self._error(forward, truth))
        return {'motion': name, 'ages': ages, 'held': held, 'carried': carried, 'unused': unused}

    def _error(self, joints: Sequence[float], truth: Sequence[float]) -> float:
        """Return the error of the worst joint; angles as directions, the node unwraps them."""
        return max(
            abs(remainder(off, tau) if self._closure.turning[k] else off)
            for k, off in ((k, joints[k] - truth[k]) for k in self._counted)
        )

    def _newest(self) -> tuple[int, tuple[float, ...], tuple[float, ...]] | None:
        """Take all waiting states; return stamp, joints and rates of the last."""
        newest = None
        while (taken := self._states.handle.take_message(JointState, True)) is not None:
            sample = self._read(taken[0])
            if not isinstance(sample, Rejection) and sample[2] is not None:
                newest = sample[0], sample[1], sample[2]
        return newest


def _never(_: Any) -> None:
    """Serve as a callback that is never called, since nothing spins."""


def main() -> int:
    """Run the probe and return the exit code."""
    stop = stop_on_signals()
    task = TableRequest(**json.loads(sys.argv[1]))
    try:
        return run_demo_node('consumer', partial(StalenessProbe, task), StalenessProbe.run, stop)
    except LinkageError as error:
        print(error, file=sys.stderr)
        return 2


if __name__ == '__main__':
    sys.exit(main())
