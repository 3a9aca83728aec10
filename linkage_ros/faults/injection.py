# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Activation of faults: at the times in the scene, or by service calls.

Time here is the true time: a `time_jump` changes the clock, but not its own end.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any, NamedTuple

from linkage_ros.faults.fault import Fault, FAULTS, Switch


class Change(NamedTuple):
    """Begin or end of a fault, by its name in the scene."""

    name: str
    on: bool


class Injection:
    """The faults of a scene with their switches; it outlives a reset of the pipeline."""

    def __init__(self, faults: Mapping[str, Fault]) -> None:
        self.faults = faults
        self.switches = {name: Switch() for name in faults}
        self.injected = dict.fromkeys(faults, 0)
        """Number of times that each fault has begun."""
        self._begun: int | None = None
        self._asked: list[Change] = []
        changes = [
            (time, name, on)
            for name, fault in faults.items()
            for begin, end in _windows(fault)
            for time, on in ((begin, True), (end, False))
        ]
        # At the same instant an end comes before a begin: windows that touch stay two.
        self._timeline = sorted(changes, key=lambda entry: (entry[0], entry[2]))
        self._next = 0
        self._clocks = [
            import_module(FAULTS[fault.kind]).clock(fault.parameters, self.switches[name])
            for name, fault in faults.items()
            if fault.kind == 'time_jump'
        ]

    def ask(self, name: str, on: bool) -> None:
        """Let a fault begin or end at the next tick; callable from any thread."""
        self._asked.append(Change(name, on))

    def advance(self, now: int) -> list[Change]:
        """Set the switches for a time, in [ns]; return the changes."""
        if self._begun is None:
            self._begun = now
        due = []
        timeline, since = self._timeline, now - self._begun
        while self._next < len(timeline) and timeline[self._next][0] <= since:
            _, name, on = timeline[self._next]
            due.append(Change(name, on))
            self._next += 1
        while self._asked:
            due.append(self._asked.pop(0))
        return [change for change in due if self.turn(*change)]

    def turn(self, name: str, on: bool) -> bool:
        """Turn a fault on or off; return whether that changed it."""
        switch = self.switches[name]
        if switch.on == on:
            return False
        switch.on = on
        self.injected[name] += on
        return True

    def clock(self, now: int) -> int:
        """Return the time of the tick for the true time, in [ns]."""
        for clock in self._clocks:
            now = clock(now)
        return now

    def build(self, function: str, *arguments: Any) -> list[Any]:
        """Build the functions of all faults for one place of the pipeline, named by `function`."""
        built = []
        for name, fault in self.faults.items():
            module = import_module(FAULTS[fault.kind])
            if hasattr(module, function):
                build = getattr(module, function)
                built.append(build(fault.parameters, self.switches[name], *arguments))
        return [each for each in built if each is not None]


def _windows(fault: Fault) -> list[tuple[int, int]]:
    """Return the windows of a fault, in [ns]; overlapping windows are merged."""
    windows: list[tuple[int, int]] = []
    for at in sorted(fault.at):
        begin, end = round(at * 1e9), round((at + fault.seconds) * 1e9)
        if windows and begin < windows[-1][1]:
            begin, end = windows[-1][0], max(end, windows.pop()[1])
        windows.append((begin, end))
    return windows
