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
Where methods are compared: easy poses, poses next to trouble, and linkages that come as guests.

Inputs are doubles, and taken for exactly what they are: the error of a method does not hold what
rounding of its input would make. States follow each other as a path there and back, so that a
method that starts from its last state has a neighbour for one.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, sqrt, tau
from typing import NamedTuple

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import GROUND, Input, Linkage, RevoluteJoint
from linkage_ros.kinematics.ranges import reach
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.survey import grid, Way
from linkage_ros.scene.linkage_file import read_linkage
from linkage_ros.scene.yaml_file import read_yaml
from linkage_ros.shipped import shipped

DISTANCES = tuple(10.0 ** (-k / 3.0) for k in range(6, 28))
"""From trouble, in [rad], or of the size of a linkage whose input slides: 1e-2 to 1e-9."""

WITH_TOGGLE, WITH_CHANGE_POINT, CLASS_3 = 'double_rocker', 'parallelogram', 'class_3'
"""Shipped linkages that stand in where the scene's own has no such pose."""

FIVE_DYADS = 'chain of five four-bars'

_CLEAR = 0.05
"""How far an easy pose is from a toggle or change point, in [rad]; of a slide, of its range."""

_GOLDEN = 0.5 * (sqrt(5.0) - 1.0)

_EASY = 0.2
"""Conditioning of an easy pose, of the best pose's."""


class Poses(NamedTuple):
    """
    States of a linkage.

    Attributes
    ----------
    key
        'easy', 'toggle', 'change_point', 'five_dyads' or 'class_3'.
    title
        In words.
    name
        Of the linkage.
    linkage
        The linkage.
    inputs
        Of each state.
    distances
        Of each state from the toggle or change point, in [rad] or [m]; none of easy poses.
    own
        Whether the linkage is the scene's.

    """

    key: str
    title: str
    name: str
    linkage: Linkage
    inputs: tuple[tuple[float, ...], ...]
    distances: tuple[float, ...] = ()
    own: bool = True


def pose_sets(name: str, linkage: Linkage, count: int) -> list[Poses]:
    """
    Return all sets for a linkage.

    Parameters
    ----------
    name, linkage
        The scene's.
    count
        Easy poses; of each guest half as many.

    """
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
    """Return inputs that are spread over all that closes, away from trouble."""
    if len(closure.linkage.inputs) > 1:
        lines = 2 + int((8 * count) ** (1.0 / len(closure.linkage.inputs)))
        candidates = [inputs for inputs, _ in grid(closure, lines)]
        clear = candidates
    else:
        interval = Way(closure).widest_range
        assert interval is not None, 'reading the file has proved that it closes somewhere'
        low, span = interval.lowest, interval.highest - interval.lowest
        # Parts of the golden ratio: evenly spread, and on the knots of no table.
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
    Return a way through all of a single input's range; a whole turn where it turns fully.

    Parameters
    ----------
    poses
        Easy ones of the linkage; a turn begins at the first.
    count
        States after the first.

    """
    closure = Closure(poses.linkage)
    if len(poses.linkage.inputs) > 1:
        return None
    interval = Way(closure).widest_range
    assert interval is not None, 'reading the file has proved that it closes somewhere'
    low, span = poses.inputs[0][0], tau
    if not interval.whole:
        span = interval.highest - interval.lowest
        low, span = interval.lowest + _CLEAR * span, (1.0 - 2.0 * _CLEAR) * span
    inputs = tuple((low + span * k / count,) for k in range(count + 1))
    title = 'one turn' if interval.whole else 'one way through the range'
    return Poses('path', title, poses.name, poses.linkage, inputs)


def there_and_back(states: Sequence[tuple[float, ...]]) -> tuple[tuple[float, ...], ...]:
    """Return a row of states in an order that comes back to the first with no leap."""
    return (*states[::2], *states[1::2][::-1])


def near_toggle(closure: Closure) -> tuple[tuple[tuple[float, ...], ...], tuple[float, ...]]:
    """Return inputs next to where the input's widest range ends, and how far from it."""
    interval = Way(closure).widest_range if len(closure.linkage.inputs) == 1 else None
    if interval is None or interval.whole or not any(interval.limited):
        return (), ()
    upper = interval.limited[1]
    end, sign = (interval.highest, -1.0) if upper else (interval.lowest, 1.0)
    unit = 1.0 if interval.turning else reach(closure)
    return _next_to(closure, end, [sign * unit * distance for distance in DISTANCES])


def near_change_point(closure: Closure) -> tuple[tuple[tuple[float, ...], ...], tuple[float, ...]]:
    """Return inputs on both sides of a change point, on the way through it, and how far off."""
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
    """Return the unit of the first input, and so of distances from trouble."""
    return 'm' if poses.linkage.inputs[0].slider else 'rad'


def five_dyads() -> Linkage:
    """
    Return a chain of five four-bars, each rocker the crank of the next.

    The lengths are those of config/linkages/four_bar.yaml: the crank and the longest link are
    shorter than the other two, so that each closes wherever the one before it puts its crank.
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
    return closure.nearness(position).conditioning
