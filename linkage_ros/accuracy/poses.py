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
The poses at which methods are compared, and the errors of a method there.

The sets hold easy poses, poses next to a toggle or change point, and linkages added for
comparison. Inputs are doubles and are taken as exact: the error of a method contains no rounding
of its input. States follow a path forward and back, so that a method which starts from its last
state has a neighbour to start from.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from math import inf, sqrt, tau
from statistics import median
from typing import Any, NamedTuple

from linkage_ros.accuracy.methods import Method
from linkage_ros.accuracy.reference import Truth
from linkage_ros.files.linkage_file import read_linkage
from linkage_ros.files.yaml_file import read_yaml
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import GROUND, Input, Linkage, RevoluteJoint
from linkage_ros.kinematics.ranges import reach
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.sweep_analysis import grid, InputSweep
from linkage_ros.measuring import Spread
from linkage_ros.resources import shipped
import numpy as np

DISTANCES = tuple(10.0 ** (-k / 3.0) for k in range(6, 28))
"""Distances from a singular pose, 1e-2 to 1e-9, in [rad], or for slides relative to the size."""

WITH_TOGGLE, WITH_CHANGE_POINT, CLASS_3 = 'double_rocker', 'parallelogram', 'class_3'
"""Shipped linkages used if the scene's own has no such pose."""

FIVE_DYADS = 'chain of five four-bars'

_CLEAR = 0.05
"""Minimum distance of an easy pose from a singular one, in [rad]; for slides, of the range."""

_GOLDEN = 0.5 * (sqrt(5.0) - 1.0)

_EASY = 0.2
"""Minimum conditioning of an easy pose, as a fraction of the best pose's."""

BATCH = 4096
"""Number of states of an array: the poses, repeated."""


class Poses(NamedTuple):
    """States of a linkage."""

    key: str  # 'easy', 'toggle', 'change_point', 'five_dyads' or 'class_3'
    title: str  # Title of the set
    name: str  # Name of the linkage
    linkage: Linkage  # The linkage
    inputs: tuple[tuple[float, ...], ...]  # Inputs of each state
    # Distance of each state from the toggle or change point, in [rad] or [m]; empty if easy.
    distances: tuple[float, ...] = ()
    own: bool = True  # Whether the linkage is the scene's


def pose_sets(name: str, linkage: Linkage, count: int) -> list[Poses]:
    """Return all sets of poses for a linkage: so many easy ones, half of each added linkage."""
    sets = [Poses('easy', 'easy poses', name, linkage, easy(Closure(linkage), count))]
    for key, title, find, guest in (
        ('toggle', 'near a toggle', near_toggle, WITH_TOGGLE),
        ('change_point', 'at a change point', near_change_point, WITH_CHANGE_POINT),
    ):
        inputs, distances = find(Closure(linkage))
        if inputs:
            sets.append(Poses(key, title, name, linkage, inputs, distances))
        else:
            other = shipped_linkage(guest)
            sets.append(Poses(key, title, guest, other, *find(Closure(other)), own=False))
    for key, title, guest, other in (
        ('five_dyads', 'five dyads', FIVE_DYADS, five_dyads()),
        ('class_3', 'class III', CLASS_3, shipped_linkage(CLASS_3)),
    ):
        inputs = easy(Closure(other), count // 2)
        sets.append(Poses(key, title, guest, other, inputs, own=False))
    return sets


def easy(closure: Closure, count: int) -> tuple[tuple[float, ...], ...]:
    """Return inputs spread over all ranges where the loops close, away from singular poses."""
    if len(closure.linkage.inputs) > 1:
        lines = 2 + int((8 * count) ** (1.0 / len(closure.linkage.inputs)))
        candidates = [inputs for inputs, _ in grid(closure, lines)]
        clear = candidates
    else:
        interval = InputSweep(closure).widest_range
        assert interval is not None, 'reading the file has proved that it closes somewhere'
        low, span = interval.lowest, interval.highest - interval.lowest
        # Multiples of the golden ratio: evenly spread, and never on the knots of a table.
        parts = sorted(_GOLDEN * (i + 1) % 1.0 for i in range(8 * count))
        candidates = [(low + span * part,) for part in parts]
        apart = _CLEAR if interval.turning else _CLEAR * span
        clear = [
            (x,) for (x,) in candidates if all(
                _away(x, critical, interval.turning) > apart for critical in _troubles(closure)
            )
        ]  # fmt: skip
    eases = [_ease(closure, inputs) for inputs in clear]
    enough = _EASY * max(eases, default=0.0)
    kept = [inputs for inputs, ease in zip(clear, eases, strict=True) if ease > enough]
    chosen = [kept[i * len(kept) // count] for i in range(min(count, len(kept)))]
    return there_and_back(chosen)


def path(poses: Poses, count: int) -> Poses | None:
    """
    Return so many states through the whole range of a single input, or one full turn.

    The turn begins at the first of the easy poses.
    """
    closure = Closure(poses.linkage)
    if len(poses.linkage.inputs) > 1:
        return None
    interval = InputSweep(closure).widest_range
    assert interval is not None, 'reading the file has proved that it closes somewhere'
    low, span = poses.inputs[0][0], tau
    if not interval.whole:
        span = interval.highest - interval.lowest
        low, span = interval.lowest + _CLEAR * span, (1.0 - 2.0 * _CLEAR) * span
    inputs = tuple((low + span * k / count,) for k in range(count + 1))
    title = 'one turn' if interval.whole else 'one way through the range'
    return Poses('path', title, poses.name, poses.linkage, inputs)


def there_and_back(states: Sequence[tuple[float, ...]]) -> tuple[tuple[float, ...], ...]:
    """Return states in an order that ends next to the first, without a jump."""
    return (*states[::2], *states[1::2][::-1])


def near_toggle(closure: Closure) -> tuple[tuple[tuple[float, ...], ...], tuple[float, ...]]:
    """Return inputs next to an end of the widest range, and their distances from it."""
    interval = InputSweep(closure).widest_range if len(closure.linkage.inputs) == 1 else None
    if interval is None or interval.whole or not any(interval.limited):
        return (), ()
    upper = interval.limited[1]
    end, sign = (interval.highest, -1.0) if upper else (interval.lowest, 1.0)
    unit = 1.0 if interval.turning else reach(closure)
    return _next_to(closure, end, [sign * unit * distance for distance in DISTANCES])


def near_change_point(closure: Closure) -> tuple[tuple[tuple[float, ...], ...], tuple[float, ...]]:
    """Return inputs on both sides of a change point, and their distances from it."""
    if len(closure.linkage.inputs) > 1:
        return (), ()
    inner = [
        singular.value
        for singular in closure.singular_inputs
        if singular.status is Status.CHANGE_POINT
    ]
    if not inner:
        return (), ()
    offsets = [*(-d for d in DISTANCES), *reversed(DISTANCES)]
    return _next_to(closure, min(inner, key=abs), offsets)


def unit_of(poses: Poses) -> str:
    """Return the unit of the first input, and so of distances from a singular pose."""
    return poses.linkage.inputs[0].unit


def five_dyads() -> Linkage:
    """
    Return a chain of five four-bars, each rocker the crank of the next.

    The lengths are those of config/linkages/four_bar.yaml: the sum of the crank and the longest
    link is less than that of the other two, so each four-bar closes at every angle of its crank.
    """
    links: dict[str, dict[str, tuple[float, float]]] = {GROUND: {'O0': (0.0, 0.0)}}
    links['crank'] = {'O0': (0.0, 0.0), 'A1': (0.04, 0.0)}
    joints: dict[str, RevoluteJoint] = {}
    for k in range(1, 6):
        links[GROUND][f'O{k}'] = (0.1 * k, 0.0)
        links[f'coupler_{k}'] = {f'A{k}': (0.0, 0.0), f'B{k}': (0.12, 0.0)}
        links[f'rocker_{k}'] = {f'O{k}': (0.0, 0.0), f'B{k}': (0.08, 0.0)}
        if k < 5:
            links[f'rocker_{k}'][f'A{k + 1}'] = (0.0, -0.04)
        before = f'rocker_{k - 1}' if k > 1 else 'crank'
        joints[f'coupler_joint_{k}'] = RevoluteJoint(before, f'coupler_{k}')
        joints[f'rocker_joint_{k}'] = RevoluteJoint(GROUND, f'rocker_{k}')
    return Linkage(
        links=links,
        inputs=(Input('crank_joint', GROUND, 'crank'),),
        assembly={f'B{k}': 'left' for k in range(1, 6)},
        joints=joints,
        sliders={},
    )


def shipped_linkage(name: str) -> Linkage:
    """Return a linkage of config/linkages."""
    return read_linkage(read_yaml(shipped(f'linkages/{name}.yaml'))[0])


def _next_to(
    closure: Closure, place: float, offsets: Sequence[float]
) -> tuple[tuple[tuple[float, ...], ...], tuple[float, ...]]:
    inputs, distances = [], []
    for offset in offsets:
        if closure.position(place + offset).status is Status.CLOSED:
            inputs.append((place + offset,))
            distances.append(abs(offset))
    return tuple(inputs), tuple(distances)


def _troubles(closure: Closure) -> list[float]:
    ends = [end for one in closure.input_ranges if not one.whole for end in one[:2]]
    return [*(singular.value for singular in closure.singular_inputs), *ends]


def _away(value: float, critical: float, turning: bool) -> float:
    apart = abs(value - critical)
    return min(apart % tau, -apart % tau) if turning else apart


def _ease(closure: Closure, inputs: Sequence[float]) -> float:
    position = closure.position(*inputs)
    if position.status is not Status.CLOSED:
        return -inf
    return closure.singularity_margin(position).conditioning


FAR = 0.1
"""
Largest error of an answer, in [rad] or relative to the size; a larger one means another pose.
Next to a change point it is a fraction of the distance: the other assembly is equally near.
"""


class Errors(NamedTuple):
    """The errors of a method."""

    # For each state the maximum over the joints, in [rad], for slides relative to the linkage's
    # size; None if it failed. Rates and accelerations above 1 have relative errors.
    each: tuple[float | None, ...]
    failed: float  # Fraction of the states without an answer, or with that of another pose

    @property
    def worst(self) -> float | None:
        """Return the maximum error where it did not fail."""
        return max(self._known, default=None)

    @property
    def middle(self) -> float | None:
        """Return the median error where it did not fail."""
        return median(self._known) if self._known else None

    @property
    def _known(self) -> list[float]:
        return [error for error in self.each if error is not None]


class Measured(NamedTuple):
    """A method on a set of poses."""

    # The set and the method.
    poses: Poses
    method: Method
    # Errors of positions; of positions, rates and accelerations; and of arrays.
    position: Errors
    motion: tuple[Errors, Errors, Errors] | None
    batch: tuple[Errors, Errors, Errors] | None
    # Time per state, in [s], by 'position', 'motion', 'batch' (positions in an array) and
    # 'batch_motion' (motions in an array).
    times: dict[str, Spread]


def size_of(linkage: Linkage) -> float:
    """Return the greatest distance between two points of a link, in [m]."""
    return max(
        abs(complex(*one) - complex(*other))
        for points in linkage.links.values()
        for one, other in combinations(points.values(), 2)
    )


def position_errors(method: Method, poses: Poses, truths: Sequence[Truth]) -> Errors:
    """
    Return the errors of a method's positions.

    A method that starts from its last state runs twice and is judged the second time.
    """
    solve = method.position
    assert solve is not None
    _gone_through(method, poses)
    return _errors(poses, [solve(*inputs) for inputs in poses.inputs], truths, 0)


def motion_errors(
    method: Method, poses: Poses, truths: Sequence[Truth]
) -> tuple[Errors, Errors, Errors]:
    """Return the errors of a method's positions, rates and accelerations."""
    solve = method.motion
    assert solve is not None
    _gone_through(method, poses)
    found = [solve(*inputs) for inputs in poses.inputs]
    one, two, three = (
        _errors(poses, [motion[order] for motion in found], truths, order) for order in range(3)
    )
    return one, two, three


def batch_errors(
    solve: Callable[[Sequence[Any], int], Sequence[Any]], poses: Poses, truths: Sequence[Truth]
) -> tuple[Errors, Errors, Errors]:
    """Return the errors of a method that solves arrays."""
    found = solve([np.array(row) for row in zip(*poses.inputs, strict=True)], 2)
    one, two, three = (
        _errors(poses, [*zip(*rows, strict=True)], truths, order)
        for order, rows in enumerate(found)
    )
    return one, two, three


def off(linkage: Linkage, found: Sequence[Any], truth: Truth, order: int = 0) -> float:
    """Return the greatest error of the published joints, or of the derivatives of an order."""
    size, worst, greatest = size_of(linkage), 0.0, 1.0
    for joint, value, true in zip(
        linkage.joints.values(), found, truth.orders[order], strict=True
    ):
        difference = true - (value if hasattr(value, '_mpf_') else float(value))
        if isinstance(joint, RevoluteJoint):
            unit = 1.0
            if not order:
                turn = 2 * true.context.pi
                difference -= turn * true.context.nint(difference / turn)
        else:
            unit = size
        worst = max(worst, float(abs(difference)) / unit)
        greatest = max(greatest, float(abs(true)) / unit)
    return worst / greatest if order else worst


def _gone_through(method: Method, poses: Poses) -> None:
    if method.remembers and method.position is not None:
        for inputs in poses.inputs:
            method.position(*inputs)


def _errors(
    poses: Poses, found: Sequence[Sequence[Any]], truths: Sequence[Truth], order: int
) -> Errors:
    each: list[float | None] = []
    limits = [FAR] * len(truths)
    if poses.key == 'change_point' and not order:
        limits = [FAR * distance for distance in poses.distances]
    for joints, truth, limit in zip(found, truths, limits, strict=True):
        finite = len(joints) > 0 and all(abs(value) < float('inf') for value in joints)
        error = off(poses.linkage, joints, truth, order) if finite else None
        each.append(error if error is not None and error <= limit else None)
    return Errors(tuple(each), each.count(None) / len(each))
