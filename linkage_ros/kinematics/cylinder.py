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
Cylinders: driven slides whose length has a mirror image below zero.

A rod that slides in a tube, each pinned to the rest by one pin that lies on the line, holds the
two pins apart by a length. With the tube turned about, minus that length holds them just so, and
nothing else of the linkage moves: every pose has a second one that no machine has.
"""

from __future__ import annotations

from cmath import rect
from typing import TYPE_CHECKING

from linkage_ros.kinematics.linkage import GROUND
from linkage_ros.kinematics.rounding import ROUNDING

if TYPE_CHECKING:
    from linkage_ros.kinematics.linkage import Linkage
    from linkage_ros.kinematics.ranges import InputRange
    from linkage_ros.kinematics.structure import Structure


def zero_length(linkage: Linkage, structure: Structure, index: int) -> float | None:
    """
    Return at which slide the two pins of a cylinder meet.

    Parameters
    ----------
    linkage, structure
        The linkage.
    index
        Number of the input.

    Returns
    -------
    zero : float or None
        In [m]; None where the input is not a cylinder.

    """
    name = linkage.inputs[index].slider
    if not name:
        return None
    slider = linkage.sliders[name]
    tube, rod = slider.along, structure.blocks[name]
    turned = {link for given in linkage.inputs for link in (given.parent, given.child)}
    if GROUND in (tube, rod) or not turned.isdisjoint((tube, rod)):
        return None
    places = []
    for link in (tube, rod):
        joints = [joint for joint in structure.joints if link in (joint.link, joint.to)]
        pins = {joint.name for joint in joints if joint.kind == 'R'}
        if len(pins) != 1 or sum(joint.kind == 'P' for joint in joints) != 1:
            return None
        places.append(complex(*structure.links[link][pins.pop()]))
    at_tube, at_rod = places
    through = complex(*structure.links[tube][slider.through])
    along = complex(*slider.direction) / abs(complex(*slider.direction))
    arm = at_rod - complex(*structure.links[rod][slider.point])
    angle = slider.angle if slider.block else 0.0
    # From pin to pin where the slide is 0, along the line and across it.
    between = (through - at_tube + rect(1.0, angle) * arm) * along.conjugate()
    size = abs(through) + abs(at_tube) + abs(arm)
    return -between.real if abs(between.imag) <= ROUNDING * size else None


def without_mirrored(
    linkage: Linkage, structure: Structure, index: int, ranges: tuple[InputRange, ...]
) -> tuple[InputRange, ...]:
    """
    Return the ranges of an input, of a cylinder those in which its length is positive.

    They are the others where its pose or its limits say so, and where there are no such ones.

    Parameters
    ----------
    linkage, structure
        The linkage.
    index
        Number of the input.
    ranges
        All ranges.

    """
    zero = zero_length(linkage, structure, index)
    if zero is None:
        return ranges
    positive = tuple(
        one._replace(lowest=max(one.lowest, zero)) for one in ranges if one.highest > zero
    )
    negative = tuple(
        one._replace(highest=min(one.highest, zero)) for one in ranges if one.lowest < zero
    )
    pose, limits = linkage.pose, linkage.inputs[index].limits
    if limits.high <= zero or (pose and pose.inputs[index] < zero):
        return negative or positive
    return positive or negative
