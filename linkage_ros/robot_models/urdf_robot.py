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


"""What a URDF says: links and joints by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from linkage_ros.kinematics.linkage import Limits

Vector = tuple[float, float, float]

MOVING = ('revolute', 'continuous', 'prismatic')


class Inertial(NamedTuple):
    """Mass [kg], its centre and the turn of its axes [m, rad], and ixx ixy ixz iyy iyz izz."""

    mass: float
    xyz: Vector
    rpy: Vector
    tensor: tuple[float, float, float, float, float, float]


class UrdfLink(NamedTuple):
    """
    A link.

    Attributes
    ----------
    inertial
        Its mass, if it has one.
    bodied
        Whether anything is to be seen of it, or to be weighed.
    marks
        Names of what is to be seen, with their places, in [m].

    """

    inertial: Inertial | None
    bodied: bool
    marks: tuple[tuple[str, Vector], ...]


class UrdfJoint(NamedTuple):
    """
    A joint.

    Attributes
    ----------
    name, kind
        As the file has them.
    parent, child
        Links.
    xyz, rpy
        Of the child's frame in the parent's where the joint is at 0, in [m] and [rad].
    axis
        In the child's frame, of any length but 0.
    mimics, multiplier, offset
        The joint that it follows, '' for none, and how.
    limits
        As ``<limit>`` has them, but for those that ``linkage urdf`` has made up.

    """

    name: str
    kind: str
    parent: str
    child: str
    xyz: Vector
    rpy: Vector
    axis: Vector
    mimics: str
    multiplier: float
    offset: float
    limits: Limits


class UrdfFile(NamedTuple):
    """
    A robot.

    Attributes
    ----------
    file
        Name of the file, for messages.
    name
        Of the robot.
    root
        The link that no joint leads to.
    links
        By name.
    joints
        By name; in an order in which parents come before what hangs on them.
    order
        Names of the joints as they stand in the file.
    inputs
        Of joints that are driven, where the file is one of ours.
    start
        Likewise the values of joints in a pose in which all loops close.

    """

    file: str
    name: str
    root: str
    links: Mapping[str, UrdfLink]
    joints: Mapping[str, UrdfJoint]
    order: tuple[str, ...]
    inputs: tuple[str, ...]
    start: Mapping[str, float]
