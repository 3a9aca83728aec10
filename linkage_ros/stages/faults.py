# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Faults that a scene can inject at set times or on demand: their kinds, and what activates them.

Imported only where a scene has a section ``faults``. A kind of fault is a class that derives from
`Fault`; its fields are its parameters (see `linkage_ros.description.parameters`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from typing import Any, NamedTuple

from linkage_ros.description import number, part_name
from linkage_ros.kinematics import Position, Status
from linkage_ros.messages import TIME_END, with_every_number
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects import restamp, Sensor, SensorReading


class Fault:
    """
    A kind of fault: its parameters, and one of these methods, which builds it from its `Switch`.

    Each of several linkages calls them; they return None if it is not concerned.
    """

    __slots__ = ()

    def clock(self, _switch: Switch) -> Callable[[int], int] | None:
        """Build a function of the true time that returns the time of the tick, in [ns]."""
        return None

    def message(self, _switch: Switch) -> Callable[[bytes], bytes] | None:
        """Build a function that changes a crank message before it is read."""
        return None

    def mechanism(
        self, _switch: Switch, _context: Context
    ) -> Callable[[Position], Position] | None:
        """Build a function that changes the position after the loops are closed."""
        return None

    def sensor(self, _switch: Switch, _joints: Sequence[str]) -> Sensor | None:
        """Build a function that changes the reading after all effects, at a time in [ns]."""
        return None


@dataclass(frozen=True, slots=True)
class FaultEntry:
    """A fault that a scene can inject."""

    # Key of `FAULTS`, and an object of its class.
    kind: str
    parameters: Fault
    at: tuple[float, ...]  # Times at which it begins by itself, in [s] from the first tick
    seconds: float  # Its duration then, in [s]


class Switch:
    """Whether a fault is on."""

    __slots__ = ('on',)

    def __init__(self) -> None:
        self.on = False


@dataclass(frozen=True, slots=True)
class TimeJump(Fault):
    """
    The clock jumps, and jumps back when the fault ends.

    At a backward jump, at the begin or at the end of the fault, the node builds its pipeline
    again, as it does after a change of the system clock.
    """

    by: float = number('jump; negative for backwards', unit='s', least=-1e6, most=1e6)

    def clock(self, switch: Switch) -> Callable[[int], int]:
        """Build the clock."""
        step = round(self.by * 1e9)

        def jump_clock(now: int) -> int:
            # Stamps of messages are limited to the years 1970 to 2038.
            return max(0, min(now + step, TIME_END - 1)) if switch.on else now

        return jump_clock


@dataclass(frozen=True, slots=True)
class NotANumber(Fault):
    """
    The crank's messages hold NaN.

    It stands for every position, rate and effort. The node has to reject the messages, as it
    would from a real sensor.
    """

    def message(self, switch: Switch) -> Callable[[bytes], bytes]:
        """Build a function that corrupts the messages."""

        def corrupt(data: bytes) -> bytes:
            return with_every_number(data, nan) if switch.on else data

        return corrupt


@dataclass(frozen=True, slots=True)
class BrokenLink(Fault):
    """
    A link is broken: the linkage has no pose.

    A mechanism with a broken link has one degree of freedom more than inputs: the crank does not
    determine its pose, so nothing is published.
    """

    link: str = part_name('the broken link', 'link')

    def mechanism(self, switch: Switch, context: Context) -> Callable[[Position], Position] | None:
        """Build a function that removes the pose; None if the link is not in this linkage."""
        if self.link not in [context.prefix + link for link in context.closure.linkage.link_names]:
            return None

        def break_link(position: Position) -> Position:
            if not switch.on:
                return position
            return replace(position, status=Status.INDETERMINATE, gap=0.0, joints=())

        return break_link


@dataclass(frozen=True, slots=True)
class Stuck(Fault):
    """
    The sensor of one joint stands still.

    The others work. Its position stays as it was when the fault began; its rate and acceleration
    are 0. Without an earlier reading nothing is published.
    """

    joint: str = part_name('the joint of the sensor', 'joint')

    def sensor(self, switch: Switch, joints: Sequence[str]) -> Sensor | None:
        """Build a function that holds the joint; None if it is not among these."""
        if self.joint not in joints:
            return None
        held: float | None = None
        place = joints.index(self.joint)
        after = place + 1

        def with_one(values: tuple[float, ...], value: float) -> tuple[float, ...]:
            return (*values[:place], value, *values[after:]) if values else ()

        def stuck(_now: int, reading: SensorReading) -> SensorReading | None:
            nonlocal held
            if not switch.on:
                held = reading.joints[place]
                return reading
            if held is None:
                return None
            return reading._replace(
                joints=with_one(reading.joints, held),
                rates=with_one(reading.rates, 0.0),
                accelerations=with_one(reading.accelerations, 0.0),
            )

        return stuck


@dataclass(frozen=True, slots=True)
class Freeze(Fault):
    """
    The last reading is published again and again, with new stamps.

    This models sensor electronics that hang while their driver continues to poll, whether or not
    the linkage has a pose. Without an earlier reading nothing is published.
    """

    def sensor(self, switch: Switch, _joints: Sequence[str]) -> FrozenSensor:
        """Build the sensor stage."""
        return FrozenSensor(switch)


class FrozenSensor:
    """Sensor stage that holds the last reading; a gap does not change its state."""

    __slots__ = ('_last', '_switch')

    gap_begins = False

    def __init__(self, switch: Switch) -> None:
        self._switch = switch
        self._last: SensorReading | None = None

    def __call__(self, _now: int, reading: SensorReading) -> SensorReading | None:
        """Return the reading, or while frozen the last one before."""
        if not self._switch.on:
            self._last = reading
            return reading
        return None if self._last is None else restamp(self._last, reading.stamp)

    def gap(self, now: int) -> SensorReading | None:
        """Return the last reading before the freeze, stamped now, in [ns]; None otherwise."""
        if not self._switch.on or self._last is None:
            return None
        return restamp(self._last, now)


@dataclass(frozen=True, slots=True)
class Silence(Fault):
    """
    Nothing is published.

    This models a sensor whose cable is pulled.
    """

    def sensor(self, switch: Switch, _joints: Sequence[str]) -> Sensor:
        """Build a function that suppresses the readings."""

        def silence(_now: int, reading: SensorReading) -> SensorReading | None:
            return None if switch.on else reading

        return silence


FAULTS: Mapping[str, type[Fault]] = {
    'time_jump': TimeJump,
    'not_a_number': NotANumber,
    'broken_link': BrokenLink,
    'stuck': Stuck,
    'freeze': Freeze,
    'silence': Silence,
}
"""The kinds of faults, by name."""


class FaultChange(NamedTuple):
    """Begin or end of a fault, by its name in the scene."""

    name: str
    on: bool


class Injection:
    """
    The faults of a scene with their switches; it outlives a reset of the pipeline.

    Time here is the true time: a `TimeJump` changes the clock, but not its own end.
    """

    def __init__(self, faults: Mapping[str, FaultEntry]) -> None:
        self.faults = faults
        self.switches = {name: Switch() for name in faults}
        self.injected = dict.fromkeys(faults, 0)
        """Number of times that each fault has begun."""
        self._begun: int | None = None
        self._asked: list[FaultChange] = []
        changes = [
            (time, name, on)
            for name, fault in faults.items()
            for begin, end in _fault_windows(fault)
            for time, on in ((begin, True), (end, False))
        ]
        # At the same instant an end comes before a begin: windows that touch stay two.
        self._timeline = sorted(changes, key=lambda entry: (entry[0], entry[2]))
        self._next = 0
        self._clocks = self.build_functions('clock')

    def request_change(self, name: str, on: bool) -> None:
        """Let a fault begin or end at the next tick; callable from any thread."""
        self._asked.append(FaultChange(name, on))

    def advance(self, now: int) -> list[FaultChange]:
        """Set the switches for a time, in [ns]; return the changes."""
        if self._begun is None:
            self._begun = now
        due = []
        timeline, since = self._timeline, now - self._begun
        while self._next < len(timeline) and timeline[self._next][0] <= since:
            _, name, on = timeline[self._next]
            due.append(FaultChange(name, on))
            self._next += 1
        while self._asked:
            due.append(self._asked.pop(0))
        return [change for change in due if self.switch_fault(*change)]

    def switch_fault(self, name: str, on: bool) -> bool:
        """Turn a fault on or off; return whether that changed it."""
        switch = self.switches[name]
        if switch.on == on:
            return False
        switch.on = on
        self.injected[name] += on
        return True

    def tick_time(self, now: int) -> int:
        """Return the time of the tick for the true time, in [ns]."""
        for clock in self._clocks:
            now = clock(now)
        return now

    def build_functions(self, function: str, *arguments: Any) -> list[Any]:
        """Build the functions of all faults for one place of the pipeline, named by `function`."""
        pairs = zip(self.faults.values(), self.switches.values(), strict=True)
        built = [
            getattr(fault.parameters, function)(switch, *arguments) for fault, switch in pairs
        ]
        return [function for function in built if function is not None]


def _fault_windows(fault: FaultEntry) -> list[tuple[int, int]]:
    """Return the windows of a fault, in [ns]; overlapping windows are merged."""
    windows: list[tuple[int, int]] = []
    for at in sorted(fault.at):
        begin, end = round(at * 1e9), round((at + fault.seconds) * 1e9)
        if windows and begin < windows[-1][1]:
            begin, end = windows[-1][0], max(end, windows.pop()[1])
        windows.append((begin, end))
    return windows
