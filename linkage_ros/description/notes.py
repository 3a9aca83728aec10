# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Notes on a scene: values that are allowed, but look like values in another unit.

A note has the form of an error; whoever reads the scene shows it and goes on.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, islice
from math import degrees, dist, hypot, inf, isfinite, pi, tau
from typing import TYPE_CHECKING

from linkage_ros.description.units import Units
from linkage_ros.errors import DefinitionError, FileError
from linkage_ros.kinematics import (
    extent_of,
    Linkage,
    links_by_point,
    RevoluteJoint,
)

if TYPE_CHECKING:
    from linkage_ros.description.scene import Scene, SceneLinkage
    from linkage_ros.description.section import Section
    from linkage_ros.kinematics import SpaceLinkage

_OTHER_UNIT = 300.0
"""Ratio of two links above which a unit was probably mistaken; mm for m make it 1000."""

_LONG, _HUGE = 3.0, 30.0
"""
Lengths above which metres were probably mistaken for millimetres, in [m]: of what moves in Hz or
is light, and of what nothing else is known of.
"""

_LIGHT = 0.1
"""Mass of a metre below which a link is not as long as it seems, in [kg/m]."""

_WEAK = 0.1
"""Gravity below which its unit was probably mistaken, in [m/s²]; 9.81 mm/s² is 0.01."""


def scene_notes(scene: Scene) -> Iterator[FileError]:
    """Yield the notes on a scene and its linkages."""
    for scene_linkage in scene.linkages:
        content = scene_linkage.linkage_content
        notes = linkage_notes(scene_linkage.linkage, content, scene.rate)
        yield from map(content.locate_error, notes)
        yield from map(scene_linkage.content.locate_error, _linkage_notes(scene_linkage))


def linkage_notes(
    linkage: Linkage | SpaceLinkage, content: Section, rate: float = 0.0
) -> Iterator[DefinitionError]:
    """Yield the notes on a linkage of a file, which ticks at a rate in [Hz]."""
    yield from _limit_notes(linkage, content.units)
    lengths = _link_lengths(linkage)
    if lengths:
        shortest, longest = (of(lengths, key=lengths.__getitem__) for of in (min, max))
        if lengths[longest] > _OTHER_UNIT * lengths[shortest]:
            ratio = float(f'{min(lengths[longest] / lengths[shortest], 1e300):.3g}')
            yield DefinitionError(
                f'links.{longest}',
                f'is {ratio:g} times as long as {shortest!r}',
                'write all lengths in metres, or all in millimetres with units: mm',
            )
            return
    if 'units' in content or 'urdf' in content:
        return
    lengths |= _lengths_with_hinges(linkage)
    for link, length in sorted(lengths.items(), key=lambda item: -item[1])[:1]:
        is_light = any(
            0.0 < of.mass < _LIGHT * lengths.get(name, 0.0)
            for name, of in getattr(linkage, 'masses', {}).items()
        )
        if length > (_LONG if rate or is_light else _HUGE):
            yield DefinitionError(
                f'links.{link}',
                f'is {length:g} m long',
                'if it is in millimetres, write units: mm; if in metres, units: m',
            )


def _limit_notes(linkage: Linkage | SpaceLinkage, units: Units) -> Iterator[DefinitionError]:
    """Yield the notes on limits of angles: on each beyond a turn, once on all below 2π degrees."""
    joints = linkage.named_joints
    ends = {
        name: max((abs(end) for end in (limits.low, limits.high) if isfinite(end)), default=0.0)
        for name, limits in linkage.limits.items()
        if joints[name].unit == 'rad'
    }
    if units.angle == 'degrees':
        widest = degrees(max(ends.values(), default=inf))
        if 0.0 < widest < tau:
            yield DefinitionError(
                'angles',
                f'no limit is wider than {widest:.4g} deg',
                'if limits are in radians, leave out angles: degrees',
            )
        return
    for name, end in ends.items():
        if end > tau:
            driven = name in (driven_joint.joint for driven_joint in linkage.inputs)
            key = 'input.limits' if driven else f'joints.{name}.limits'
            yield DefinitionError(
                key if isinstance(linkage, Linkage) else f'hinges.{name}.limits',
                f'{end:g} rad is more than a turn',
                'if it is in degrees, write angles: degrees',
            )


def _link_lengths(linkage: Linkage | SpaceLinkage) -> dict[str, float]:
    """Return for each link the greatest distance between its pins, in [m]."""
    if not isinstance(linkage, Linkage):
        places = linkage.points
        return {
            link: max(
                dist(places[first], places[second]) for first, second in combinations(points, 2)
            )
            for link, points in linkage.links.items()
            if len(points) > 1
        }
    pins = {name for name, links in links_by_point(linkage.links).items() if len(links) > 1}
    lengths = {}
    for link, points in linkage.links.items():
        joined = [place for name, place in points.items() if name in pins]
        if len(joined) > 1:
            lengths[link] = max(dist(first, second) for first, second in combinations(joined, 2))
    return lengths


def _lengths_with_hinges(linkage: Linkage | SpaceLinkage) -> dict[str, float]:
    """Return the extents of spatial links between their points and hinges, in [m]."""
    if isinstance(linkage, Linkage):
        return {}
    places = {
        link: [linkage.points[point] for point in points] for link, points in linkage.links.items()
    }
    for hinge in linkage.hinges.values():
        for link in (hinge.parent, hinge.child):
            places.setdefault(link, []).append(hinge.at)
    return {link: extent_of(of_link) for link, of_link in places.items()}


def _linkage_notes(scene_linkage: SceneLinkage) -> Iterator[DefinitionError]:
    drive, parameters = scene_linkage.drive
    if scene_linkage.content.units.angle == 'radians' and hasattr(parameters, 'amplitude'):
        for driven in scene_linkage.linkage.inputs:
            own = driven.joint in parameters.inputs
            amplitude = (parameters.inputs[driven.joint] if own else parameters).amplitude
            if not driven.slider and amplitude > tau:
                key = f'drive.{drive}{f".inputs.{driven.joint}" if own else ""}.amplitude'
                yield DefinitionError(
                    key,
                    f'{amplitude:g} rad is more than a turn',
                    'if it is in degrees, write angles: degrees',
                )
    yield from islice(_noise_notes(scene_linkage), 1)
    if scene_linkage.loads is not None and 0.0 < hypot(*scene_linkage.loads.gravity) < _WEAK:
        numbers = ', '.join(f'{part:g}' for part in scene_linkage.loads.gravity)
        yield DefinitionError(
            'loads.gravity',
            f'[{numbers}] m/s² is very small',
            'write it in the unit of the file: 9.81 [m/s²] is 9810 [mm/s²]',
        )


def _noise_notes(scene_linkage: SceneLinkage) -> Iterator[DefinitionError]:
    """Yield a note on each noise of an angle of which a reading says nothing."""
    noise = scene_linkage.effects.get('noise')
    for joint, of in noise.joints.items() if noise is not None else ():
        turns = isinstance(scene_linkage.linkage.joints.get(joint), RevoluteJoint)
        for kind in ('white', 'drift') if turns else ():
            if (deviation := getattr(of, kind)) > pi:
                yield DefinitionError(
                    f'effects.noise.joints.{joint}.{kind}',
                    f'{deviation:g} rad is more than half a turn',
                    'if it is in degrees, write angles: degrees'
                    if scene_linkage.content.units.angle == 'radians'
                    else 'write the standard deviation of a reading',
                )
