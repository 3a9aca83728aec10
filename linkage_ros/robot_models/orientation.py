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
How far joints go: what a published joint comes to while the input goes through its range.

Of a single input, the range is the one that the linkage starts in (`usual_inputs`). It is sampled;
between two samples a joint is taken to go no farther than it goes from one to the next, and a
margin is added. An angle that passes π on the way has no limit: what the node publishes begins in
(−π, π] wherever the input is then, so that it can be on either side, and a wrapped one is on both.
With several inputs nobody can say: angles have no limit then, slides that of the linkage's reach.
"""

from __future__ import annotations

from collections.abc import Iterator
from heapq import heappop, heappush
from math import pi, remainder, tau
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Linkage, RevoluteJoint, SlideJoint
from linkage_ros.kinematics.ranges import reach
from linkage_ros.kinematics.results import InputRange
from linkage_ros.kinematics.sweep_analysis import InputSweep, samples, usual_inputs

if TYPE_CHECKING:
    from linkage_ros.kinematics.batch import Array


# The orientation of one link against another, as a sum of published joints.
#
# A published angle is that of its child less that of its parent, whether or not the two are pinned
# together; a block keeps its angle to what it slides along. So every link whose angle can be told
# from messages hangs in a graph together with the ground, and the way between two links in it is
# the sum.


class Turn(NamedTuple):
    """
    A term of an orientation.

    Attributes
    ----------
    joint
        Name of the published joint; '' for a constant.
    sign
        With which the joint counts, +1 or −1.
    constant
        In [rad]; 0 for a joint.

    """

    joint: str
    sign: int
    constant: float = 0.0


def named_joints(linkage: Linkage) -> dict[str, RevoluteJoint | SlideJoint]:
    """Return all joints that messages name: the inputs, then what is published."""
    inputs: dict[str, RevoluteJoint | SlideJoint] = {
        given.joint: SlideJoint(given.slider)
        if given.slider
        else RevoluteJoint(given.parent, given.child)
        for given in linkage.inputs
    }
    return inputs | dict(linkage.joints)


class Orientations:
    """
    What messages say of the angles of links against each other.

    Parameters
    ----------
    linkage
        The linkage.

    """

    def __init__(self, linkage: Linkage) -> None:
        self._links = tuple(linkage.links)
        self._next: dict[str, list[tuple[str, Turn]]] = {link: [] for link in linkage.links}
        for slider in linkage.sliders.values():
            if slider.block:
                self._join(slider.along, slider.block, '', slider.angle)
        for name, joint in named_joints(linkage).items():
            if isinstance(joint, RevoluteJoint):
                self._join(joint.parent, joint.child, name, 0.0)

    def _join(self, one: str, other: str, joint: str, constant: float) -> None:
        self._next[one].append((other, Turn(joint, 1, constant)))
        self._next[other].append((one, Turn(joint, -1, -constant)))

    def between(self, link: str, other: str) -> tuple[Turn, ...] | None:
        """
        Return the angle of the other link less that of the link, by as few joints as will do.

        None where messages do not tell it. After each term stands the orientation of some link.
        """
        return self._from(link).get(other)

    def known_from(self, link: str) -> Iterator[str]:
        """Yield the links whose angles against this one are told, in the order of the linkage."""
        known = self._from(link)
        return (other for other in self._links if other in known)

    def _from(self, link: str) -> dict[str, tuple[Turn, ...]]:
        """Search from a link, the fewest joints first; a constant is no joint."""
        found: dict[str, tuple[Turn, ...]] = {}
        ahead: list[tuple[int, int, str, tuple[Turn, ...]]] = [(0, 0, link, ())]
        count = 0
        while ahead:
            joints, _, reached, turns = heappop(ahead)
            if reached in found:
                continue
            found[reached] = turns
            for other, turn in self._next[reached]:
                if other not in found:
                    count += 1
                    more = joints + bool(turn.joint)
                    heappush(ahead, (more, count, other, (*turns, turn)))
        return found


_SAMPLES = 2880
_MARGIN = 1e-3
"""Added at both ends, in [rad] or of the linkage's reach."""


class Span(NamedTuple):
    """
    Where a joint can be.

    Attributes
    ----------
    lowest, highest
        In [rad] or [m]; of an angle without limits −π and π.
    limited
        Whether these are limits.

    """

    lowest: float
    highest: float
    limited: bool = True

    @property
    def passes_pi(self) -> bool:
        """Whether an angle that goes so far leaves (−π, π]."""
        return self.lowest < -pi or self.highest > pi


_ROUND = Span(-pi, pi, False)
"""Of an angle without limits."""


def spans(closure: Closure) -> dict[str, Span]:
    """Return how far each joint goes that messages name."""
    joints = named_joints(closure.linkage)
    if len(closure.linkage.inputs) > 1:
        far = reach(closure)
        return {
            name: Span(-far, far) if isinstance(joint, SlideJoint) else _ROUND
            for name, joint in joints.items()
        }
    (start,) = usual_inputs(closure)
    interval = InputSweep(closure).range_about(start)
    assert interval is not None, 'what is usual lies in a range'
    found = dict(zip(closure.linkage.joints, _published(closure, start, interval), strict=True))
    (given,) = closure.linkage.inputs
    margin = _MARGIN * (1.0 if interval.turning else reach(closure))
    own = Span(interval.lowest - margin, interval.highest + margin)
    if interval.whole or (interval.turning and own.passes_pi):
        own = _ROUND
    found.setdefault(given.joint, own)
    return {name: found[name] for name in joints}


def _published(closure: Closure, start: float, interval: InputRange) -> list[Span]:
    import numpy as np  # local import: the batch alone needs it

    values = np.array(samples(interval, _SAMPLES))
    rows = closure.solve(values, derivatives=0).positions
    for i in np.flatnonzero(np.isnan(rows).any(axis=0)):
        # A batch leaves out toggles, and so the ends of most ranges; the node publishes them.
        if joints := closure.position(float(values[i])).joints:
            rows[:, i] = joints
    closed = ~np.isnan(rows).any(axis=0)
    values, rows = values[closed], rows[:, closed]
    first = int(np.argmin(np.abs(values - start)))
    found = []
    for row, turning in zip(rows, closure.turning, strict=True):
        found.append(_span(np.unwrap(row) if turning else row, first, turning, closure, interval))
    return found


def _span(row: Array, first: int, turning: bool, closure: Closure, interval: InputRange) -> Span:
    low, high = int(row.argmin()), int(row.argmax())
    if turning and interval.whole and abs(row[-1] - row[0]) > pi:
        return _ROUND
    margin = _MARGIN * (1.0 if turning else reach(closure))

    def beyond(i: int) -> float:
        sides = [abs(row[j] - row[i]) for j in (i - 1, i + 1) if 0 <= j < len(row)]
        # At an end of a limited range the last sample is the limit itself.
        inner = 0 < i < len(row) - 1 or interval.whole
        return margin + (max(sides, default=0.0) if inner else 0.0)

    begun = remainder(row[first], tau) - row[first] if turning else 0.0
    span = Span(float(row[low] + begun - beyond(low)), float(row[high] + begun + beyond(high)))
    return _ROUND if turning and span.passes_pi else span
