# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Elements of a URDF: joints with their limits, masses, and where the model starts."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from math import isfinite
from typing import NamedTuple
from xml.etree import ElementTree as ET

from linkage_ros.kinematics import Limits, Ratio, Vector, ZERO
from linkage_ros.tools.models.orientation import AngleSpan
from linkage_ros.tools.models.xml import format_number, format_numbers

EFFORT, VELOCITY = 1000.0, 100.0
"""Limits that URDF requires but are unknown, in [N·m] or [N], and [rad/s] or [m/s]: wide."""

_FARTHEST = 1e9
"""Stands for the missing limit of an angle that is limited on one side only, in [rad]."""


class WrittenJoint(NamedTuple):
    """A joint of a URDF; names are those of the model."""

    name: str
    kind: str  # ``revolute``, ``prismatic`` or ``fixed``
    parent: str
    child: str
    # The child's frame in the parent's with the joint at 0: its place, in [m], and roll, pitch
    # and yaw, in [rad].
    xyz: Vector
    rpy: Vector = ZERO
    axis: Vector = ZERO  # In the child's frame


def add_joint(
    robot: ET.Element,
    joint: WrittenJoint,
    limits: Limits,
    span: AngleSpan,
    mimic: Ratio | None,
    *,
    wrapped: bool,
) -> dict[str, str]:
    """
    Add a joint; return the limits that were made up because the linkage has none.

    Without limits it has those of its ``span``. Angles may be ``wrapped``.
    """
    kind = joint.kind
    # A wrapped angle that passes π is on both sides.
    passing = wrapped and AngleSpan(limits.low, limits.high).passes_pi
    if kind == 'revolute' and (passing if limits.is_bounded else not span.limited):
        kind = 'continuous'
    element = ET.SubElement(robot, 'joint', name=joint.name, type=kind)
    add_origin(element, joint.xyz, joint.rpy)
    ET.SubElement(element, 'parent', link=joint.parent)
    ET.SubElement(element, 'child', link=joint.child)
    if kind == 'fixed':
        return {}
    ET.SubElement(element, 'axis', xyz=format_numbers(*joint.axis))
    # A continuous angle that is limited on one side only gets a far limit on the other.
    ends = span[:2] if span.limited else (-_FARTHEST, _FARTHEST)
    return _add_limits(element, limits, ends, mimic)


def add_origin(element: ET.Element, xyz: Vector, rpy: Vector = ZERO) -> None:
    """Add the place of a frame and its orientation."""
    ET.SubElement(element, 'origin', xyz=format_numbers(*xyz), rpy=format_numbers(*rpy))


def add_inertial(link: ET.Element, mass: float, center: Vector, tensor: tuple[float, ...]) -> None:
    """Add a mass to a link, with its centre and its tensor (xx, xy, xz, yy, yz, zz) there."""
    inertial = ET.SubElement(link, 'inertial')
    add_origin(inertial, center)
    ET.SubElement(inertial, 'mass', value=format_number(mass))
    names = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
    moments = dict(zip(names, map(format_number, tensor), strict=True))
    ET.SubElement(inertial, 'inertia', moments)


def mimic_of(ratios: Mapping[str, Ratio], name: str) -> Ratio | None:
    """Return how a joint follows one that follows none; None if it follows none, or a sum."""
    ratio = ratios.get(name)
    while ratio and not ratio.also and (before := ratios.get(ratio.of)):
        if before.also:
            break
        offset = ratio.offset + ratio.ratio * before.offset
        ratio = Ratio(before.of, ratio.ratio * before.ratio, offset)
    return None if ratio is None or ratio.also else ratio


def add_start(
    robot: ET.Element,
    inputs: Collection[str],
    values: Mapping[str, float],
    computed: Mapping[str, Mapping[str, str]],
) -> None:
    """
    Add the data that URDF has no elements for: the inputs, and a pose that closes the loops.

    It also tells which joint limits were made up. Readers of URDF ignore unknown elements; every
    command reads these.
    """
    start = ET.SubElement(robot, 'linkage_start')
    for name, value in values.items():
        kind = 'input' if name in inputs else 'joint'
        joint = ET.SubElement(start, kind, name=name, value=format_number(value))
        if name in computed:
            ET.SubElement(joint, 'computed', dict(computed[name]))


def _add_limits(
    joint: ET.Element, limits: Limits, ends: tuple[float, float], mimic: Ratio | None
) -> dict[str, str]:
    """Add limits, with others where there are none, and a mimic; return what is made up."""
    known = {
        'lower': (limits.low, ends[0]),
        'upper': (limits.high, ends[1]),
        'effort': (limits.effort, EFFORT),
        'velocity': (limits.velocity, VELOCITY),
    }
    if joint.get('type') == 'continuous':
        del known['lower'], known['upper']
    written = {
        key: format_number(value if isfinite(value) else ours)
        for key, (value, ours) in known.items()
    }
    ET.SubElement(joint, 'limit', written)
    if mimic:
        multiplier, offset = format_number(mimic.ratio), format_number(mimic.offset)
        ET.SubElement(joint, 'mimic', joint=mimic.of, multiplier=multiplier, offset=offset)
    return {key: written[key] for key, (value, _) in known.items() if not isfinite(value)}
