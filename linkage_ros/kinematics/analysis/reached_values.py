# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Limits of joints as those of others: what is reached while some joints stay within their limits.

Inputs with limits span a box: each joint has a least and a greatest value there. They are sought
on a grid over the box, and from its best places on in ever shorter steps along each input.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import product
from math import isfinite, remainder, tau
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.errors import DefinitionError

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure
    from linkage_ros.kinematics.plane.linkage import Limits

_COUNTS = {2: 13, 3: 7}
"""States along each input, by the number of inputs; more are not searched."""

_MOST_JOINTS = 8
"""Most joints that are searched for."""

_LEAST_STEP, _MOST_ROUNDS = 1e-7, 200
"""The last steps, in parts of a range of limits, and most rounds of them along each input."""


class ReachedValues(NamedTuple):
    """Between which values a joint stays while others stay within their limits."""

    joint: str
    low: float  # In [rad] or [m]
    high: float
    within: tuple[str, ...]  # The others
    closes: bool  # Whether the loops close everywhere within these limits


class ReachBox(NamedTuple):
    """Limits of the inputs of a linkage, and the joints whose values are sought within them."""

    closure: Closure
    joints: tuple[str, ...]
    limits: tuple[Limits, ...]  # Of each input

    def values(self) -> Callable[[Sequence[float]], list[float]]:
        """
        Return what solves for these joints where each input has a part of its range, 0 to 1.

        It returns nothing where the linkage is open. Angles are near those in the middle.
        """
        closure, of_joints = self.closure, [*map(self.closure.joint_names.index, self.joints)]
        middle = closure.close_unlimited(*(0.5 * (of.low + of.high) for of in self.limits)).joints

        def values_at(parts: Sequence[float]) -> list[float]:
            ends = zip(self.limits, parts, strict=True)
            at = (of.low + part * (of.high - of.low) for of, part in ends)
            joints = closure.close_unlimited(*at).joints
            if not joints:
                return []
            return [
                middle[k] + remainder(joints[k] - middle[k], tau)
                if middle and closure.turning[k]
                else joints[k]
                for k in of_joints
            ]

        return values_at


def find_reached_values(closure: Closure) -> list[ReachedValues]:
    """Return what is reached within each of the `reach_boxes`."""
    return [reached for box in reach_boxes(closure) for reached in _search_box(box)]


def reach_boxes(closure: Closure) -> Iterator[ReachBox]:
    """
    Yield the limits of inputs with the joints to seek, and those of joints with the inputs.

    Inputs are taken if all have limits and there are two or three; joints with limits, if they are
    as many. Of a single input the branches tell it.
    """
    linkage, inputs = closure.linkage, closure.input_names
    limits = {name: of for name, of in linkage.limits.items() if _is_between(of)}
    limited = [name for name in closure.joint_names if name in limits and name not in inputs]
    others = [name for name in closure.joint_names if name not in inputs]
    if {*inputs} <= {*limits} and len(inputs) in _COUNTS:
        wanted = (limited or others)[:_MOST_JOINTS]
        yield ReachBox(closure, tuple(wanted), tuple(limits[name] for name in inputs))
    if len(inputs) == len(limited) and len(inputs) in _COUNTS:
        with suppress(DefinitionError):
            inverse = closure.driven_by(*limited)
            yield ReachBox(inverse, inputs, tuple(limits[name] for name in limited))


def _is_between(limits: Limits) -> bool:
    return isfinite(limits.low) and isfinite(limits.high)


def _search_box(box: ReachBox) -> Iterator[ReachedValues]:
    """Yield the least and greatest value of joints within limits of the inputs."""
    count, values_at = _COUNTS[len(box.limits)], box.values()
    ways = [k / (count - 1) for k in range(count)]
    grid = {parts: values_at(parts) for parts in product(ways, repeat=len(box.limits))}
    closed = {parts: values for parts, values in grid.items() if values}

    def greatest(row: int, sign: float) -> float:
        """Return the greatest value of a joint times a sign."""
        at = max(closed, key=lambda parts: sign * closed[parts][row])
        best, step = sign * closed[at][row], 1.0 / (count - 1)
        for _ in range(_MOST_ROUNDS):
            if step <= _LEAST_STEP:
                break
            moved = False
            for k, way in product(range(len(box.limits)), (-step, step)):
                there = tuple(
                    min(max(part + way * (i == k), 0.0), 1.0) for i, part in enumerate(at)
                )
                values = values_at(there)
                if values and sign * values[row] > best:
                    at, best, moved = there, sign * values[row], True
            step = step if moved else 0.5 * step
        return sign * best

    for row, name in enumerate(box.joints) if closed else ():
        ends = greatest(row, -1.0), greatest(row, 1.0)
        yield ReachedValues(name, *ends, box.closure.input_names, len(closed) == len(grid))
