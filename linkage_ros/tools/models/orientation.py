# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Range of each published joint while the input goes through its range.

For a single input, the range is the one that contains the linkage's start (`usual_inputs`). It is
sampled. Between two samples a joint is assumed to go no farther than its step from one to the
next, and a margin is added. An angle that passes π has no limit: the node first publishes it in
(−π, π], wherever the input is then, so it may start on either side; a wrapped angle is on both.
With several inputs the ranges are unknown: angles have no limit, slides the linkage's reach.
"""

from __future__ import annotations

from collections.abc import Iterator
from heapq import heappop, heappush
from math import pi, remainder, tau
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics import (
    InputRange,
    InputSweep,
    Linkage,
    PlanarClosure,
    RevoluteJoint,
    sample_inputs,
    SlideJoint,
    usual_inputs,
)

if TYPE_CHECKING:
    from linkage_ros.kinematics import Array


_SAMPLES = 2880
_MARGIN = 1e-3
"""Margin at both ends, in [rad] or as a fraction of the linkage's reach."""


# The orientation of one link relative to another, as a sum of published joints.
#
# A published angle is its child's angle minus its parent's, whether or not a pin joins the
# two; a block keeps its angle to the link it slides along. So the links whose angles messages
# determine form a connected graph with the ground, and the path between two links is the sum.


class Turn(NamedTuple):
    """A term of an orientation."""

    joint: str  # Name of the published joint; '' for a constant
    sign: int  # Sign of the joint in the sum, +1 or −1
    constant: float = 0.0  # In [rad]; 0 for a joint


class Orientations:
    """The relative angles of links that messages determine."""

    def __init__(self, linkage: Linkage) -> None:
        self._links = tuple(linkage.links)
        self._next: dict[str, list[tuple[str, Turn]]] = {link: [] for link in linkage.links}
        for slider in linkage.sliders.values():
            if slider.block:
                self._add_turn(slider.along, slider.block, '', slider.angle)
        for name, joint in linkage.named_joints.items():
            if isinstance(joint, RevoluteJoint):
                self._add_turn(joint.parent, joint.child, name, 0.0)

    def _add_turn(self, link: str, neighbour: str, joint: str, constant: float) -> None:
        self._next[link].append((neighbour, Turn(joint, 1, constant)))
        self._next[neighbour].append((link, Turn(joint, -1, -constant)))

    def angle_between(self, link: str, other: str) -> tuple[Turn, ...] | None:
        """
        Return the angle of ``other`` minus the angle of ``link``, with the fewest joints.

        None if messages do not determine it. Each partial sum is the orientation of some link.
        """
        return self._paths_from(link).get(other)

    def known_from(self, link: str) -> Iterator[str]:
        """Yield the links whose angles relative to this one are known, in the linkage's order."""
        known = self._paths_from(link)
        return (link for link in self._links if link in known)

    def _paths_from(self, link: str) -> dict[str, tuple[Turn, ...]]:
        """Search from a link, fewest joints first; a constant does not count as a joint."""
        paths: dict[str, tuple[Turn, ...]] = {}
        ahead: list[tuple[int, int, str, tuple[Turn, ...]]] = [(0, 0, link, ())]
        count = 0
        while ahead:
            joints, _, reached, turns = heappop(ahead)
            if reached in paths:
                continue
            paths[reached] = turns
            for neighbour, turn in self._next[reached]:
                if neighbour not in paths:
                    count += 1
                    more = joints + bool(turn.joint)
                    heappush(ahead, (more, count, neighbour, (*turns, turn)))
        return paths


class AngleSpan(NamedTuple):
    """The range of a joint in [rad] or [m]; −π and π for an angle without limits."""

    lowest: float
    highest: float
    limited: bool = True

    @property
    def passes_pi(self) -> bool:
        """Whether an angle with this range leaves (−π, π]."""
        return self.lowest < -pi or self.highest > pi


ROUND = AngleSpan(-pi, pi, False)
"""Range of an angle without limits."""


def joint_spans(closure: PlanarClosure) -> dict[str, AngleSpan]:
    """Return the range of each joint that has a name in messages."""
    joints = closure.linkage.named_joints
    if len(closure.linkage.inputs) > 1:
        far = closure.slide_bound
        return {
            name: AngleSpan(-far, far) if isinstance(joint, SlideJoint) else ROUND
            for name, joint in joints.items()
        }
    (start,) = usual_inputs(closure)
    interval = InputSweep(closure).range_about(start)
    assert interval is not None, 'what is usual lies in a range'
    ranges = dict(
        zip(closure.linkage.joints, _published_spans(closure, start, interval), strict=True)
    )
    (driven,) = closure.linkage.inputs
    margin = _MARGIN * (1.0 if interval.turning else closure.slide_bound)
    own = AngleSpan(interval.lowest - margin, interval.highest + margin)
    if interval.is_whole or (interval.turning and own.passes_pi):
        own = ROUND
    ranges.setdefault(driven.joint, own)
    return {name: ranges[name] for name in joints}


def _published_spans(
    closure: PlanarClosure, start: float, interval: InputRange
) -> list[AngleSpan]:
    import numpy as np  # local import: only the batch needs it

    values = np.array(sample_inputs(interval, _SAMPLES))
    rows = closure.solve(values, derivatives=0).positions
    for i in np.flatnonzero(np.isnan(rows).any(axis=0)):
        # The batch leaves out toggles, and so the ends of most ranges; the node publishes them.
        if joints := closure.position(float(values[i])).joints:
            rows[:, i] = joints
    closed = ~np.isnan(rows).any(axis=0)
    values, rows = values[closed], rows[:, closed]
    first = int(np.argmin(np.abs(values - start)))
    spans = []
    for row, turning in zip(rows, closure.turning, strict=True):
        spans.append(
            _joint_span(np.unwrap(row) if turning else row, first, turning, closure, interval)
        )
    return spans


def _joint_span(
    row: Array, first: int, turning: bool, closure: PlanarClosure, interval: InputRange
) -> AngleSpan:
    low, high = int(row.argmin()), int(row.argmax())
    if turning and interval.is_whole and abs(row[-1] - row[0]) > pi:
        return ROUND
    margin = _MARGIN * (1.0 if turning else closure.slide_bound)

    def highest_beyond(i: int) -> float:
        sides = [abs(row[j] - row[i]) for j in (i - 1, i + 1) if 0 <= j < len(row)]
        # At an end of a limited range the last sample is the limit itself.
        inner = 0 < i < len(row) - 1 or interval.is_whole
        return margin + (max(sides, default=0.0) if inner else 0.0)

    begun = remainder(row[first], tau) - row[first] if turning else 0.0
    span = AngleSpan(
        float(row[low] + begun - highest_beyond(low)),
        float(row[high] + begun + highest_beyond(high)),
    )
    return ROUND if turning and span.passes_pi else span
