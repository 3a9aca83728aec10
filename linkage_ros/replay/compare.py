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
A recorded run against another one of the same ticks, message by message and number by number.

Two messages are the same where their bytes are. Else their numbers are compared one by one: how
far they are apart, in their unit and in units in the last place, which are counted as the doubles
between the two.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import copysign, isfinite, isnan, sqrt, tau, ulp
from struct import Struct
from typing import NamedTuple

from linkage_ros.messages.joint_values import Key, MessageValues, POSITION, Values

_DOUBLE, _BITS = Struct('<d'), Struct('<q')


class At(NamedTuple):
    """A tick of the bag: its number, counted from 1, and the time that it solved for, in [ns]."""

    tick: int
    time: int


class First(NamedTuple):
    """
    A difference.

    Attributes
    ----------
    at
        Where.
    topic
        On which topic.
    what
        In words, or the quantity of a joint.
    joint
        '' where it is not one joint's.
    recorded, now
        The numbers; nothing where it is not about numbers.

    """

    at: At
    topic: str
    what: str
    joint: str = ''
    recorded: float | None = None
    now: float | None = None


class Deviation:
    """How far a number of a joint is from what was recorded, over all ticks."""

    __slots__ = ('_squares', 'at', 'compared', 'differing', 'greatest', 'ulps', 'ulps_at')

    def __init__(self) -> None:
        self.compared = self.differing = 0
        self.greatest, self.at = 0.0, At(0, 0)
        """The greatest difference, without its sign; infinite where one is no number."""
        self.ulps, self.ulps_at = 0, At(0, 0)
        self._squares = 0.0

    @property
    def rms(self) -> float:
        """Return the root of the mean of the squares of the differences."""
        return sqrt(self._squares / self.compared) if self.compared else 0.0

    def add(self, recorded: float, now: float, at: At) -> None:
        """Add two numbers that differ."""
        self.differing += 1
        difference = abs(now - recorded)
        if not isfinite(difference):
            difference = float('inf')
        self._squares += difference * difference
        if difference > self.greatest:
            self.greatest, self.at = difference, at
        between = ulps(recorded, now)
        if between > self.ulps:
            self.ulps, self.ulps_at = between, at


class TopicComparison:
    """
    What was recorded on a topic against what is published on it now.

    Parameters
    ----------
    name, message_type
        Of the topic.

    """

    def __init__(self, name: str, message_type: str) -> None:
        self.name = name
        self.recorded = self.same = self.but_turns = self.different = 0
        """Messages in the bag; of these the same, the same but for whole turns, and others."""
        self.gone = self.not_recorded = 0
        """Messages in the bag of which there is none now, and the other way round."""
        self.deviations: dict[Key, Deviation] = {}
        self.only_recorded: dict[str, None] = {}
        self.only_now: dict[str, None] = {}
        """Joints that only one of the two has."""
        self._then, self._now = MessageValues(message_type), MessageValues(message_type)
        self._last: tuple[Key, ...] = ()
        self._in_last = 0

    def add_same(self, message: bytes) -> None:
        """Add a message that came again."""
        self.same += 1
        values = self._then.read(message)
        if isinstance(values, str):
            return
        # Deviations are looked up where the layout changes only, which is seldom.
        if values.keys is not self._last:
            self.settle()
            self._last = values.keys
        self._in_last += 1

    def settle(self) -> None:
        """Count what came again into the deviations."""
        for key in self._last if self._in_last else ():
            self.deviations.setdefault(key, Deviation()).compared += self._in_last
        self._in_last = 0

    def add_different(
        self, recorded: bytes, now: bytes, at: At, turning: Mapping[str, bool]
    ) -> First | None:
        """
        Add two messages that are not the same; return their first difference.

        Parameters
        ----------
        recorded, now
            The messages.
        at
            Where.
        turning
            Joints whose positions may differ by whole turns; where they differ by nothing else,
            nothing is returned.

        """
        then, again = self._then.read(recorded), self._now.read(now)
        if isinstance(then, str) or isinstance(again, str):
            self.different += 1
            return First(at, self.name, f'a message that cannot be read: {then}')
        numbers = dict(zip(again.keys, again.numbers, strict=True))
        numbers |= _unturned(then, numbers, turning)
        apart = [
            (key, number, numbers[key])
            for key, number in zip(then.keys, then.numbers, strict=True)
            if key in numbers and not _equal(number, numbers[key])
        ]
        if not apart and turning and (then.stamp, then.keys) == (again.stamp, again.keys):
            self.but_turns += 1
            return None
        self.different += 1
        for key in then.keys:
            if key in numbers:
                self.deviations.setdefault(key, Deviation()).compared += 1
        for key, number, other in apart:
            self.deviations[key].add(number, other, at)
        if then.names != again.names:
            self.only_recorded |= dict.fromkeys(n for n in then.names if n not in again.names)
            self.only_now |= dict.fromkeys(n for n in again.names if n not in then.names)
        if apart:
            (joint, quantity), number, other = apart[0]
            return First(at, self.name, quantity, joint, number, other)
        return First(at, self.name, _why(then, again))


class Comparison:
    """
    A recorded run against another one.

    Parameters
    ----------
    topics
        What is compared: names and types.
    turning
        As for `TopicComparison.add_different`.

    """

    def __init__(
        self, topics: Sequence[tuple[str, str]], turning: Mapping[str, bool] | None = None
    ) -> None:
        self.topics = [TopicComparison(name, kind) for name, kind in topics]
        self.ticks = self.differing = 0
        """How many ticks were compared, and how many of them differ."""
        self.withheld = 0
        """How many ticks are without a message, then and now."""
        self.first: First | None = None
        self.last: At | None = None
        """The last tick that differs."""
        self._turning = turning or {}

    def add(self, at: At, recorded: Sequence[bytes], now: Sequence[bytes]) -> None:
        """Add a tick: for each topic a message, empty where there is none."""
        self.ticks += 1
        found: First | None = None
        silent = not any(recorded)
        if silent and not any(now):
            self.withheld += 1
            return
        for topic, then, again in zip(self.topics, recorded, now, strict=True):
            difference: First | None = None
            if not then:
                if again:
                    topic.not_recorded += 1
                    # Beside other messages of the tick: the recorder had to drop it.
                    if silent:
                        difference = First(at, topic.name, 'withheld then, published now')
            else:
                topic.recorded += 1
                if then == again:
                    topic.add_same(then)
                elif again:
                    difference = topic.add_different(then, again, at, self._turning)
                else:
                    topic.gone += 1
                    difference = First(at, topic.name, 'published then, nothing now')
            found = found or difference
        if found:
            self.differing += 1
            self.first = self.first or found
            self.last = at

    def settle(self) -> None:
        """Count what is not in the deviations yet; to be called before they are read."""
        for topic in self.topics:
            topic.settle()


def ulps(a: float, b: float) -> int:
    """Return how many steps from double to double lie between two; 0 between -0 and 0."""
    return abs(_rank(a) - _rank(b))


def _rank(value: float) -> int:
    (bits,) = _BITS.unpack(_DOUBLE.pack(value))
    return int(bits) if bits >= 0 else -(int(bits) + 2**63)


def _equal(a: float, b: float) -> bool:
    """Return whether two numbers are the same, to the sign of a zero."""
    return (a == b and copysign(1.0, a) == copysign(1.0, b)) or (isnan(a) and isnan(b))


def _unturned(
    then: Values, numbers: Mapping[Key, float], turning: Mapping[str, bool]
) -> dict[Key, float]:
    """Return the positions that differ by whole turns alone, as they were recorded."""
    found = {}
    for key, recorded in zip(then.keys, then.numbers, strict=True):
        if key[1] == POSITION and turning.get(key[0]) and key in numbers:
            apart = recorded - numbers[key]
            turns = round(apart / tau) if isfinite(apart) else 0
            # Both are the same angle with turns added, each rounded once.
            rounding = 2.0 * ulp(max(abs(recorded), abs(numbers[key])))
            if turns and abs(apart - turns * tau) <= rounding:
                found[key] = recorded
    return found


def _why(then: Values, again: Values) -> str:
    """Return in words how two messages differ that have no numbers that do."""
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
    return 'bytes that are no number of a joint'
