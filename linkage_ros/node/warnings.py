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
Rate-limited log warnings, each kind with its own limit.

The limit is not rclpy's throttle: there a suppressed log line costs 150 µs.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from time import monotonic

from linkage_ros.errors import listed
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.ranges import describe
from linkage_ros.kinematics.status import Status
from linkage_ros.messages.joint_state import Rejection
from linkage_ros.node.tick_loop import Counts
from rclpy.impl.rcutils_logger import RcutilsLogger

_REMEDIES = {
    Rejection.MALFORMED: 'the publisher must send sensor_msgs/JointState as plain CDR',
    Rejection.EMPTY: 'fill name, position and velocity',
    Rejection.UNEQUAL: 'give each joint that is named a number in every array that is filled',
    Rejection.TWICE: 'name the joint once',
    Rejection.NO_RATE: 'fill velocity, or set carry_forward: false and leave out velocity',
    Rejection.NOT_FINITE: 'look at the sensor',
    Rejection.TOO_LARGE: 'the units are rad and m',
    Rejection.NO_EFFORT: 'fill name and effort',
    Rejection.EFFORT_NOT_FINITE: 'look at the controller',
    Rejection.EFFORT_TOO_LARGE: 'the units are N·m and N',
    Rejection.STAMP_ZERO: 'stamp the messages',
    Rejection.STAMP_INVALID: 'stamp the messages with the time',
    Rejection.STAMP_FUTURE: 'synchronise the clocks, or raise max_lead',
    Rejection.STAMP_OLD: 'let one source publish, in order; ~/reset forgets the last stamp',
}


_PATIENCE = 2.0
"""Time without a warning about a missing crank, in [s]."""


class Warnings:
    """
    Warnings, with the time of the last one of each kind.

    Parameters
    ----------
    logger
        Logger of the warnings.

    """

    def __init__(self, logger: RcutilsLogger) -> None:
        self._logger = logger
        self._said: dict[str, float] = {}
        self._rejected = dict.fromkeys(Rejection, 0)
        self._unclosed = dict.fromkeys(Status, 0)
        self._lost = 0
        self._begun = monotonic()

    def wait(self, counts: Counts, crank_topic: str, inputs: Sequence[str], period: float) -> None:
        """
        Warn if no message has arrived, or none with the crank's joints.

        Parameters
        ----------
        counts
            Counts of the tick.
        crank_topic
            Topic of the crank samples.
        inputs
            Names of the joints that a sample must have.
        period
            Least time between two warnings of this kind, in [s].

        """
        names = listed(inputs)
        if counts.ignored and counts.ignored == counts.received:
            line = f'{crank_topic}: {counts.ignored} messages, none with {names}: '
            self.say('ignored', line + 'name the joint so there, or remap the topic', period)
        waited = monotonic() - self._begun
        if not counts.received and not counts.published and waited > _PATIENCE:
            self.say(
                'waiting',
                f'{crank_topic}: no message in {waited:.0f} s, so nothing is published; send '
                f'sensor_msgs/JointState with {names} there, remap the topic, or name '
                'another drive in a scene, as drive: {sine: …}',
                period,
            )

    def look(
        self, counts: Counts, closures: Sequence[Closure], crank_topic: str, period: float
    ) -> None:
        """
        Warn of events since the last warning of their kind.

        Parameters
        ----------
        counts
            Counts of the tick.
        closures
            The linkages.
        crank_topic
            Topic of the crank samples.
        period
            Least time between two warnings of a kind, in [s].

        """
        new = {
            r: n - self._rejected[r] for r, n in counts.rejected.items() if n > self._rejected[r]
        }
        if new:
            why = '; '.join(f'{r.value} ({n}): {_REMEDIES[r]}' for r, n in new.items())
            line = f'{crank_topic}: {sum(new.values())} samples rejected: {why}'
            if self.say('rejected', line, period):
                self._rejected = dict(counts.rejected)
        if counts.lost > self._lost and self.say(
            'lost', f'{counts.lost - self._lost} ticks lost; lower the rate', period
        ):
            self._lost = counts.lost
        for status, text in _UNCLOSED.items():
            ticks = counts.unclosed[status] - self._unclosed[status]
            if ticks and status in counts.last_unclosed:
                number, position = counts.last_unclosed[status]
                closure = closures[number]
                line = text.format(
                    ticks=ticks,
                    gap=position.gap,
                    reachable=describe(closure.input_ranges),
                    published='published all the same' if position.joints else 'nothing published',
                    beyond=closure.beyond(position),
                )
                if self.say(status.value, line, period):
                    self._unclosed[status] = counts.unclosed[status]

    def say(self, kind: str, line: str, period: float) -> bool:
        """Warn, unless this kind was already warned of within the period, in [s]."""
        now = monotonic()
        if now - self._said.get(kind, -inf) < period:
            return False
        self._said[kind] = now
        self._logger.warning(line)
        return True


_UNCLOSED = {
    Status.OPEN: '{ticks} ticks open by {gap:.6g} m, nothing published; reachable: {reachable}',
    Status.INDETERMINATE: (
        '{ticks} ticks without a pose (two pins in one place, or a broken link), nothing published'
    ),
    Status.TOGGLE: '{ticks} ticks at a toggle: positions published, velocities not',
    Status.LIMITED: '{ticks} ticks beyond limits, {published}: {beyond}',
}
