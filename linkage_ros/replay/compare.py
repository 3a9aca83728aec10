# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Compare a recorded run with a second run of the same ticks, message by message.

Two messages are equal if their bytes are. Otherwise their numbers are compared one by one: the
difference is given in their unit and in ulps, counted as the doubles between the two.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import copysign, isfinite, isnan, sqrt, tau, ulp
from struct import Struct
from typing import NamedTuple

from linkage_ros.messages import Key, MessageContent, MessageValues, POSITION

_DOUBLE, _BITS = Struct('<d'), Struct('<q')


class TickPlace(NamedTuple):
    """A tick of the bag: its number, counted from 1, and the time it is solved for, in [ns]."""

    tick: int
    time: int


class FirstDifference(NamedTuple):
    """A difference between the two runs."""

    at: TickPlace  # The tick
    topic: str  # The topic
    what: str  # Description, or the quantity of a joint
    joint: str = ''  # Name of the joint; '' if the difference does not concern one joint
    # The two numbers; None if the difference does not concern numbers.
    recorded: float | None = None
    now: float | None = None


class Deviation:
    """Deviation of one number of a joint from the recorded one, over all ticks."""

    __slots__ = ('_squares', 'at', 'compared', 'differing', 'greatest', 'ulps', 'ulps_at')

    def __init__(self) -> None:
        self.compared = self.differing = 0
        self.greatest, self.at = 0.0, TickPlace(0, 0)
        """The greatest difference, without its sign; infinite where one is not a number."""
        self.ulps, self.ulps_at = 0, TickPlace(0, 0)
        self._squares = 0.0

    @property
    def rms(self) -> float:
        """Return the root mean square of the differences."""
        return sqrt(self._squares / self.compared) if self.compared else 0.0

    def add_difference(self, recorded: float, now: float, at: TickPlace) -> None:
        """Add two numbers that differ."""
        self.differing += 1
        difference = abs(now - recorded)
        if not isfinite(difference):
            difference = float('inf')
        self._squares += difference * difference
        if difference > self.greatest:
            self.greatest, self.at = difference, at
        between = ulp_distance(recorded, now)
        if between > self.ulps:
            self.ulps, self.ulps_at = between, at


class TopicComparison:
    """Comparison of the recorded messages of a topic with the reproduced ones."""

    def __init__(self, name: str, message_type: str) -> None:
        self.name = name
        self.recorded = self.same = self.same_but_for_turns = self.different = 0
        """Messages in the bag: the same, the same up to whole turns, and different."""
        self.not_made_now = self.not_recorded = 0
        """Messages in the bag that were not reproduced, and the reverse."""
        self.deviations: dict[Key, Deviation] = {}
        self.only_recorded: dict[str, None] = {}
        self.only_now: dict[str, None] = {}
        """Joints that only one of the two runs has."""
        self._then, self._now = MessageValues(message_type), MessageValues(message_type)
        self._last: tuple[Key, ...] = ()
        self._in_last = 0

    def add_same(self, message: bytes) -> None:
        """Add a message that was reproduced."""
        self.same += 1
        values = self._then.read(message)
        if isinstance(values, str):
            return
        # Look deviations up only when the layout changes, which is rare.
        if values.keys is not self._last:
            self.update_deviations()
            self._last = values.keys
        self._in_last += 1

    def update_deviations(self) -> None:
        """Include the reproduced messages in the deviations."""
        for key in self._last if self._in_last else ():
            self.deviations.setdefault(key, Deviation()).compared += self._in_last
        self._in_last = 0

    def add_different(
        self, recorded: bytes, now: bytes, at: TickPlace, turning: Mapping[str, bool]
    ) -> FirstDifference | None:
        """
        Add two different messages of a tick; return their first difference.

        Positions of the joints in ``turning`` may differ by whole turns: if the messages differ by
        nothing else, the result is None.
        """
        then, again = self._then.read(recorded), self._now.read(now)
        if isinstance(then, str) or isinstance(again, str):
            self.different += 1
            return FirstDifference(at, self.name, f'a message that cannot be read: {then}')
        numbers = dict(zip(again.keys, again.numbers, strict=True))
        numbers |= _without_turns(then, numbers, turning)
        apart = [
            (key, number, numbers[key])
            for key, number in zip(then.keys, then.numbers, strict=True)
            if key in numbers and not _is_identical(number, numbers[key])
        ]
        if not apart and turning and (then.stamp, then.keys) == (again.stamp, again.keys):
            self.same_but_for_turns += 1
            return None
        self.different += 1
        for key in then.keys:
            if key in numbers:
                self.deviations.setdefault(key, Deviation()).compared += 1
        for key, number, second in apart:
            self.deviations[key].add_difference(number, second, at)
        if then.names != again.names:
            self.only_recorded |= dict.fromkeys(n for n in then.names if n not in again.names)
            self.only_now |= dict.fromkeys(n for n in again.names if n not in then.names)
        if apart:
            (joint, quantity), number, second = apart[0]
            return FirstDifference(at, self.name, quantity, joint, number, second)
        return FirstDifference(at, self.name, _difference_text(then, again))


class Comparison:
    """Comparison of a recorded run with a second one, by topic."""

    def __init__(
        self, topics: Sequence[tuple[str, str]], turning: Mapping[str, bool] | None = None
    ) -> None:
        self.topics = [TopicComparison(name, kind) for name, kind in topics]
        self.ticks = self.differing = 0
        """Numbers of compared and of different ticks."""
        self.suppressed = 0
        """Numbers of ticks without a message, recorded and now."""
        self.first: FirstDifference | None = None
        self.last: TickPlace | None = None
        """Last tick that differs."""
        self._turning = turning or {}

    def add_tick(self, at: TickPlace, recorded: Sequence[bytes], now: Sequence[bytes]) -> None:
        """Add a tick: a message for each topic, empty if there is none."""
        self.ticks += 1
        first_difference: FirstDifference | None = None
        silent = not any(recorded)
        if silent and not any(now):
            self.suppressed += 1
            return
        for topic, then, again in zip(self.topics, recorded, now, strict=True):
            difference: FirstDifference | None = None
            if not then:
                if again:
                    topic.not_recorded += 1
                    # If other messages of the tick are there, the recorder had to drop this one.
                    if silent:
                        difference = FirstDifference(
                            at, topic.name, 'withheld then, published now'
                        )
            else:
                topic.recorded += 1
                if then == again:
                    topic.add_same(then)
                elif again:
                    difference = topic.add_different(then, again, at, self._turning)
                else:
                    topic.not_made_now += 1
                    difference = FirstDifference(at, topic.name, 'published then, nothing now')
            first_difference = first_difference or difference
        if first_difference:
            self.differing += 1
            self.first = self.first or first_difference
            self.last = at

    def update_deviations(self) -> None:
        """Bring the deviations up to date; call this before reading them."""
        for topic in self.topics:
            topic.update_deviations()


def ulp_distance(a: float, b: float) -> int:
    """Return the number of steps from one double to another; 0 between -0 and 0."""
    return abs(_ulp_rank(a) - _ulp_rank(b))


def _ulp_rank(value: float) -> int:
    (bits,) = _BITS.unpack(_DOUBLE.pack(value))
    return int(bits) if bits >= 0 else -(int(bits) + 2**63)


def _is_identical(a: float, b: float) -> bool:
    """Return whether two numbers are the same, including the sign of zero."""
    return (a == b and copysign(1.0, a) == copysign(1.0, b)) or (isnan(a) and isnan(b))


def _without_turns(
    then: MessageContent, numbers: Mapping[Key, float], turning: Mapping[str, bool]
) -> dict[Key, float]:
    """Return the positions, with whole-turn differences replaced by the recorded values."""
    unturned = {}
    for key, recorded in zip(then.keys, then.numbers, strict=True):
        if key[1] == POSITION and turning.get(key[0]) and key in numbers:
            apart = recorded - numbers[key]
            turns = round(apart / tau) if isfinite(apart) else 0
            # Both are the same angle plus turns, each rounded once.
            rounding = 2.0 * ulp(max(abs(recorded), abs(numbers[key])))
            if turns and abs(apart - turns * tau) <= rounding:
                unturned[key] = recorded
    return unturned


def _difference_text(then: MessageContent, again: MessageContent) -> str:
    """Return the difference of two messages whose numbers are equal, as text."""
    if then.names != again.names:
        return f'joints: {", ".join(then.names)} then, {", ".join(again.names)} now'
    if then.keys != again.keys:
        had, has = (
            ', '.join(dict.fromkeys(f'{quantity}s' for _, quantity in values.keys))
            for values in (then, again)
        )
        return f'{had} then, {has} now'
    if then.stamp != again.stamp:
        return f'stamp: {then.stamp} ns then, {again.stamp} ns now'
    return 'bytes outside of the numbers of joints'
