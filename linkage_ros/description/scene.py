# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Content of a scene, as frozen types."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TYPE_CHECKING

from linkage_ros.bag import COMPRESSIONS, Storage
from linkage_ros.description.parameters import choice, number, Parts, whole_number
from linkage_ros.description.section import Section
from linkage_ros.description.units import Units
from linkage_ros.dynamics import Loads
from linkage_ros.kinematics import (
    Closure,
    GROUND,
    JointedLinkage,
    Linkage,
    SlideJoint,
)

if TYPE_CHECKING:
    from linkage_ros.kinematics import SpaceLinkage
    from linkage_ros.stages.faults import FaultEntry

SPLITS = ('split_bytes', 'split_seconds')
"""
What makes files of a bag.

Each file begins with the scene, the linkages and the types, and costs the disk some ten waits.
"""

LEAST_FLUSH_PERIOD = 0.05
"""Least flush period, in [s]."""

AS_THE_RUN_GOES = ('queue', 'flush_period', *SPLITS, 'keep_files')
"""Settings without effect if the run is kept in memory and written at once."""

_DEFAULT = Storage()


@dataclass(frozen=True, slots=True)
class StorageParameters(Storage):
    """How the bag is stored."""

    flush_period: float = number(
        'the most that a power cut may lose; the disk is synchronised a little more often',
        _DEFAULT.flush_period,
        unit='s',
        least=LEAST_FLUSH_PERIOD,
        most=60.0,
    )
    split_bytes: int = whole_number(
        'size at which the next file begins; 0: never',
        _DEFAULT.split_bytes,
        unit='bytes',
        least=0,
        most=10**15,
        unless_zero=1_000_000,
    )
    split_seconds: float = number(
        'time after which the next file begins; 0: never',
        _DEFAULT.split_seconds,
        unit='s',
        least=0.0,
        most=1e9,
        unless_zero=1.0,
    )
    keep_files: int = whole_number(
        'number of files to keep: a new file replaces the oldest one; 0: all',
        _DEFAULT.keep_files,
        least=0,
        most=1_000_000,
    )
    min_free_bytes: int = whole_number(
        'free space to leave on the disk: below it the recording ends; 0: no limit',
        _DEFAULT.min_free_bytes,
        unit='bytes',
        least=0,
        most=10**15,
    )
    compression: str = choice('compression of messages', COMPRESSIONS, _DEFAULT.compression)
    snapshot_seconds: float = number(
        'time to keep in memory instead of recording a bag; ~/snapshot writes it to a bag; 0: off',
        _DEFAULT.snapshot_seconds,
        unit='s',
        least=0.0,
        most=86_400.0,
        unless_zero=0.1,
    )
    snapshot_bytes: int = whole_number(
        'memory for snapshot_seconds: if it is too little, less time is kept; twice as much while '
        'a snapshot is written',
        _DEFAULT.snapshot_bytes,
        unit='bytes',
        least=1_000_000,
        most=10**12,
    )


@dataclass(frozen=True, slots=True)
class RecordParameters:
    """How a run is recorded."""

    directory: str  # Parent folder of the bags, relative to the working directory of the node
    # Name of the bag's folder; '' for the scene's name and the time. If it exists, a number is
    # added: NAME_2.
    name: str
    # Messages of up to 16 KiB that may wait for the disk before more are dropped; a larger message
    # counts as several.
    queue: int
    # Files of the bag: size, compression, flush period.
    storage: Storage = field(default_factory=StorageParameters)


@dataclass(frozen=True, slots=True)
class SceneLinkage:
    """A linkage of a scene, with its drive and its effects."""

    name: str  # Name of the linkage; '' if it is the only one of the scene
    # The linkage, and its closure. Published input joints come first among its joints. In space
    # they are a SpaceLinkage and its closure, which have all that such a scene may call for.
    linkage: Linkage
    closure: Closure = field(compare=False, repr=False)
    drive: tuple[str, Any]  # Name and parameters of the drive
    # Parameters of each effect in the scene, by name, in physical order.
    effects: Mapping[str, Any]
    loads: Loads | None  # Loads on it; None if the scene has none
    prefix: str  # Before the names of its joints and links, as messages have them
    # Sections for error messages: in the scene, and in the linkage file.
    content: Section = field(compare=False, repr=False)
    linkage_content: Section = field(compare=False, repr=False)
    # Whether nothing is published while a joint is beyond its limits.
    silent_beyond_limits: bool = False
    # User-defined effects that the scene names but that were not imported, so that the linkage
    # cannot run.
    not_imported: tuple[str, ...] = ()

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the published names of its joints."""
        return tuple(self.prefix + joint for joint in self.linkage.joints)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Return the names of its driven joints, as in messages."""
        return tuple(self.prefix + driven.joint for driven in self.linkage.inputs)

    @property
    def sampled_joints(self) -> tuple[str, ...]:
        """Return the joints that samples for its drive name: the driven ones, or others."""
        return tuple(self.prefix + joint for joint in self.instead_of_inputs) or self.input_names

    @property
    def instead_of_inputs(self) -> tuple[str, ...]:
        """Return the joints that samples name instead of the inputs; none if the inputs."""
        joints: tuple[str, ...] = self.drive[1].instead_of_inputs
        return joints


@dataclass(frozen=True, slots=True)
class Scene:
    """
    Linkages with their drives and effects, faults, and recording.

    Attributes
    ----------
    name
        Name of the scene file without its suffix.
    linkages
        The linkages; most scenes have one.
    rate
        Tick rate, in [Hz]; 0 for one tick per crank sample.
    wrapped
        Whether published angles are wrapped to (−π, π]; else they continue beyond a turn.
    seed
        Seed of all random numbers.
    faults
        Faults that can be injected, by name.
    record
        Settings of the recording; None for no bag.
    files
        Content of the scene and linkage files, by name.
    folder
        Folder for the relative paths in the scene.
    robot_description
        Whether the node publishes the linkages as URDF.
    units
        Units of its tables: those of the scene file; if these are SI, those of its linkages'
        files, where all have the same.

    """

    name: str
    linkages: tuple[SceneLinkage, ...]
    rate: float
    wrapped: bool
    seed: int
    faults: Mapping[str, FaultEntry]
    record: RecordParameters | None
    files: Mapping[str, bytes]
    folder: str = field(compare=False)
    robot_description: bool = False
    units: Units = field(default=Units(), compare=False)

    def __repr__(self) -> str:
        linkages = 'linkage' if len(self.linkages) == 1 else 'linkages'
        return f'<Scene {self.name}: {len(self.linkages)} {linkages}, {self.rate:g} Hz>'

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of all published joints, in order."""
        return tuple(
            joint for scene_linkage in self.linkages for joint in scene_linkage.joint_names
        )

    @property
    def dependent_joints(self) -> frozenset[str]:
        """Return the names of the published joints that depend on others."""
        return frozenset(self.joint_names).difference(
            *(scene_linkage.input_names for scene_linkage in self.linkages)
        )

    @property
    def not_imported(self) -> tuple[str, ...]:
        """Return the names of the user-defined effects that were not imported."""
        named = (
            effect for scene_linkage in self.linkages for effect in scene_linkage.not_imported
        )
        return tuple(dict.fromkeys(named))


def parts_of(linkage: Linkage | SpaceLinkage) -> Parts:
    """Return the parts of a linkage that parameters can name, by kind."""
    links, carried = linkage.link_names, linkage.links.items()
    parts = {
        **_joints_of(linkage),
        'link': tuple(link for link in links if link != GROUND),
        'body': links,
        'point': tuple(f'{link}.{point}' for link, points in carried for point in points),
    }
    if not isinstance(linkage, Linkage):
        carried_points = [point for _, points in carried for point in points]
        balls = [point for point in linkage.points if carried_points.count(point) > 1]
        joints = {'pin': parts['any_joint'], 'slider': parts['slide']}
        return {
            **parts,
            **joints,
            'hole': tuple(f'{link}.{name}' for link, name in linkage.holes),
            'bearing': (*linkage.pair_joints, *balls),
            'axis': ('x', 'y', 'z'),
        }
    points = [point for _, points in carried for point in points]
    # A point in a slot is a pin between its link and the block of the slot.
    points += [slider.point for slider in linkage.sliders.values() if not slider.block]
    pins = {point: None for point in points if points.count(point) > 1}
    return {
        **parts,
        'hole': parts['point'],
        'axis': ('x', 'y'),
        'pin': (*pins, *linkage.sliders),
        'bearing': (*pins, *linkage.sliders),
        'slider': tuple(linkage.sliders),
    }


def _joints_of(linkage: JointedLinkage) -> dict[str, tuple[str, ...]]:
    joints = linkage.named_joints
    return {
        'joint': tuple(linkage.joints),
        'input': tuple(driven.joint for driven in linkage.inputs),
        'any_joint': tuple(joints),
        'slide': tuple(name for name, joint in joints.items() if isinstance(joint, SlideJoint)),
    }
