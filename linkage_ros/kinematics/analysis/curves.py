# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Curves over the range of an input: joints, paths of points, travels of sliders."""

from __future__ import annotations

from collections.abc import Sequence
from math import remainder, tau
from typing import Any, NamedTuple

from linkage_ros.kinematics.analysis.ranges import sample_inputs
from linkage_ros.kinematics.analysis.sweep_analysis import InputSweep
from linkage_ros.kinematics.plane.linkage import Linkage
from linkage_ros.kinematics.results import InputRange

_SAME_PATH = 0.01
"""Largest distance of paths that are drawn as one, relative to their length."""


class Curve(NamedTuple):
    """
    A joint over the input, in [rad] or [m].

    Angles are continuous, and begin in (−π, π].
    """

    name: str
    turning: bool
    x: tuple[float, ...]
    y: tuple[float, ...]


class RangeSweep(NamedTuple):
    """
    The motion of a linkage while its input goes through a range.

    Paths are of the traced points, travels the lowest and highest slides of the sliders, all in
    [m].
    """

    joints: tuple[Curve, ...]
    paths: dict[str, tuple[complex, ...]]
    travels: dict[str, tuple[float, float]]


def traced_carriers(linkage: Linkage) -> dict[str, str]:
    """Return for each traced point a link that carries it."""
    return {
        point: next(link for link, points in linkage.links.items() if point in points)
        for point in linkage.traced
    }


def sweep_range(input_sweep: InputSweep, interval: InputRange) -> RangeSweep:
    """Move a linkage through a range."""
    closure: Any = input_sweep.closure
    linkage = closure.linkage
    planar = isinstance(linkage, Linkage)
    carriers = traced_carriers(linkage) if planar else {}
    x: list[float] = []
    values: list[tuple[float, ...]] = []
    paths: dict[str, list[complex]] = {point: [] for point in carriers}
    slides: dict[str, list[float]] = {name: [] for name in linkage.sliders} if planar else {}
    for value in sample_inputs(interval):
        position = input_sweep.position_at(value)
        if not position.joints:
            continue
        x.append(value)
        values.append(position.joints)
        if not planar:
            continue
        points = closure.points(position)
        for point, path in paths.items():
            path.append(points[carriers[point], point])
        for name, slide in closure.slide_values(position).items():
            slides[name].append(slide)
    joints = []
    for i, (name, turning) in enumerate(zip(linkage.joints, closure.turning, strict=True)):
        y = [value[i] for value in values]
        joints.append(Curve(name, turning, tuple(x), tuple(unwrap_angles(y) if turning else y)))
    return RangeSweep(
        tuple(joints),
        {point: drawn_once(path) for point, path in paths.items()},
        {name: (min(s), max(s)) for name, s in slides.items()},
    )


def unwrap_angles(angles: Sequence[float]) -> list[float]:
    """Return angles without jumps: the first in (−π, π], each next within π of the one before."""
    values: list[float] = []
    for angle in angles:
        last = values[-1] if values else 0.0
        values.append(last + remainder(angle - last, tau))
    return values


def drawn_once(path: Sequence[complex]) -> tuple[complex, ...]:
    """Return a path; if it comes back on itself, only one way, so that dashes do not overlap."""
    if len(path) < 3:
        return tuple(path)
    far = max(range(len(path)), key=lambda i: abs(path[i] - path[0]))
    farthest = max(range(len(path)), key=lambda i: abs(path[i] - path[far]))
    first, last = min(far, farthest), max(far, farthest) + 1
    there = path[first:last]
    near = _SAME_PATH * abs(path[far] - path[farthest])
    back = (*path[:first], *path[last:])
    if all(min(abs(place - known) for known in there) <= near for place in back[::4]):
        return tuple(there)
    return tuple(path)
