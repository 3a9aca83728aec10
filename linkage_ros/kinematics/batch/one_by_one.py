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


"""What has no formula for arrays: a scalar step, state by state."""

from __future__ import annotations

from typing import Any

from linkage_ros.kinematics.batch.arrays import Block, CLOSED, CODES, TOGGLE
from linkage_ros.kinematics.step import State, Step
import numpy as np


class OneByOne:
    """
    A scalar step.

    Parameters
    ----------
    step
        The step.
    coordinates, pins
        How many of each it appends.

    """

    __slots__ = ('_appended', '_step')

    def __init__(self, step: Step, coordinates: int, pins: int) -> None:
        self._step = step
        self._appended = (coordinates, pins)

    def solve(self, block: Block) -> None:
        """Append what the step finds, where the steps before have found something."""
        known, speeds, changes, status = block[:4]
        count = len(status)
        given: list[Any] = [s for s in (known, speeds, changes) if s is not None]
        rows = [[_rows(s.coordinates, count), _rows(s.pins, count)] for s in given]
        x_before, pins_before = len(known.coordinates), len(known.pins)
        found: list[Any] = [self._room(count) for _ in given]
        codes = np.full(count, CLOSED, np.uint8)
        for k in np.flatnonzero(status <= TOGGLE).tolist():
            states = [State(coordinates[k], pins[k]) for coordinates, pins in rows]
            pose = self._step.close(states[0])
            codes[k] = CODES[pose[0]]
            if codes[k] > TOGGLE:
                continue
            done = 1
            if max(status[k], codes[k]) < TOGGLE and len(states) > 1:
                rates = self._step.rates(pose, *states[:2])
                done = 2
                if len(states) > 2:
                    self._step.accelerations(pose, rates, *states)
                    done = 3
            for state, (coordinates, pins) in zip(states[:done], found, strict=False):
                coordinates[:, k] = state.coordinates[x_before:]
                pins[:, k] = state.pins[pins_before:]
        for state, room in zip(given, found, strict=True):
            for values, new_ones in zip(state, room, strict=True):
                values.extend(new_ones)
        block.note(codes)

    def _room(self, count: int) -> tuple[Any, Any]:
        coordinates, pins = self._appended
        return (
            np.full((coordinates, count), np.nan),
            np.full((pins, count), np.nan, np.complex128),
        )


def _rows(values: list[Any], count: int) -> list[list[Any]]:
    """Return for each state a list of the values."""
    if not values:
        return [[] for _ in range(count)]
    columns = [np.broadcast_to(value, count).tolist() for value in values]
    return list(map(list, zip(*columns, strict=True)))
