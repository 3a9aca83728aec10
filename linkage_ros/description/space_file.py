# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Read a spatial linkage file into a `SpaceLinkage`, or into its closure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from linkage_ros.description.linkage_grammar import is_rod, ratio_in_si, read_units
from linkage_ros.description.parameters import read_parameters
from linkage_ros.description.section import Section
from linkage_ros.description.space_grammar import SPACE
from linkage_ros.errors import DefinitionError, did_you_mean, list_names, quote
from linkage_ros.kinematics import (
    check_limits,
    check_weighed,
    Closure,
    closure_as_drawn,
    GROUND,
    GROUND_FRAME,
    SpaceLinkage,
    SpatialJoint,
    SpatialMass,
    thin_rod,
    Vector,
)


def read_space_closure(
    content: Section, name: str, *, publish_inputs: bool, publish_model_joints: bool
) -> Closure:
    """Read a spatial linkage and check that its pose closes, as `read_any_closure` does."""
    try:
        linkage = _read_linkage(content, publish_inputs)
        closure = closure_as_drawn(linkage, name, publish_model_joints=publish_model_joints)
        check_limits(closure)
    except DefinitionError as error:
        where = _own_key(content, error.where)
        raise content.locate_error(DefinitionError(where, error.reason, error.remedy)) from None
    return closure


def _own_key(content: Section, where: str) -> str:
    """Return a key of a planar file, as checks of both name it, as a spatial file has it."""
    section, _, part = where.partition('.')
    if section == 'joints' and part:
        name = part.partition('.')[0]
        for kind in ('hinges', 'slides', 'struts'):
            if name in _names(content, kind):
                return f'{kind}.{part}' if kind != 'struts' else f'{kind}.{name}'
        return f'balls.{name[:-2]}'
    return {'pose': 'points', 'input': 'input'}.get(section, where)


def _read_linkage(content: Section, publish_inputs: bool) -> SpaceLinkage:
    read_units(content)
    sliding = [*_names(content, 'slides'), *_names(content, 'struts')]
    if 'input' not in content:
        joint = next(iter([*_names(content, 'hinges'), *sliding]), 'JOINT')
        raise content.error('', "the key 'input' is missing", f'add input: {joint}')
    values = read_parameters(content, SPACE, {'slide': sliding})
    points, massless = values['points'], []
    links = {link: tuple(names) for link, names in values.get('links', {}).items()}
    _refuse_single_ends(content, values)
    joints: dict[str, dict[str, SpatialJoint]] = {}
    for kind in ('hinges', 'slides'):
        joints[kind] = {}
        for joint, values_of in values.get(kind, {}).items():
            of = dict(values_of)
            if through := of.pop('through', None):
                of |= _axis_through(content, f'{kind}.{joint}.through', through, points)
                for link in (of['parent'], of['child']):
                    links[link] = tuple(dict.fromkeys((*links.get(link, ()), *through)))
            joints[kind][joint] = SpatialJoint(**of)
    for ball, ball_values in values.get('balls', {}).items():
        for joint, made in _hinges_of_ball(ball, **ball_values).items():
            if joint in joints['hinges'] or joint in links:
                reason = f'{quote(joint)} is a hinge or a link of the file already'
                raise content.error(f'balls.{ball}', reason, 'name the ball differently')
            joints['hinges'][joint] = made
            massless += [made.parent] if made.parent != ball_values['parent'] else []
    struts = values.get('struts', {})
    names = [*joints['hinges'], *joints['slides'], *struts]
    for name in names:
        if names.count(name) > 1:
            raise content.error('', f'two joints are named {quote(name)}', 'name each differently')
    units = {name: 'm' if name in sliding else 'rad' for name in names}
    driven = values['input']
    published = values.get('joints') or tuple(name for name in names if name not in driven)
    for name in driven:
        if name in published:
            raise content.error('joints', f'{quote(name)} is an input', 'publish the others')
    linkage = SpaceLinkage(
        points=points,
        links=links,
        hinges=joints['hinges'],
        slides=joints['slides'],
        struts=struts,
        driven=driven,
        published=(*driven, *published) if publish_inputs else published,
        ratios={
            name: ratio_in_si(ratio, name, units, content.units)
            for name, ratio in values.get('ratios', {}).items()
        },
        traced=values.get('traced', ()),
    )
    weighed = values.get('masses', {})
    if not {point for carried in links.values() for point in carried} <= {*points}:
        return linkage  # Which cannot be closed: its points are checked first
    check_weighed(linkage.link_names, weighed)
    masses = {
        link: _mass_of(content, link, mass, [points[name] for name in links.get(link, ())])
        for link, mass in weighed.items()
    }
    return linkage.with_masses(masses, massless=massless)


def _mass_of(
    content: Section, link: str, values: dict[str, Any], places: Sequence[Vector]
) -> SpatialMass:
    """Return the mass of a link, which may be written as that of a rod."""
    if is_rod(content, link, values, places):
        return thin_rod(values['mass'], places[0], places[1])
    return SpatialMass(**values)


def _refuse_single_ends(content: Section, values: Mapping[str, Any]) -> None:
    """Refuse a link that one joint alone names, almost as another is: a typo, but of gears."""
    ratios = values.get('ratios', {})
    geared = {*ratios, *(of for ratio in ratios.values() for of in ratio.terms)}
    ends = [
        (kind, joint, end, ends_of[end])
        for kind in ('hinges', 'slides', 'balls')
        for joint, ends_of in values.get(kind, {}).items()
        for end in ('parent', 'child')
    ]
    named = Counter(link for *_, link in ends)
    known = [GROUND, *values.get('links', {}), *(link for link in named if named[link] > 1)]
    for kind, joint, end, link in ends:
        is_single = link not in known and joint not in geared
        if is_single and (remedy := did_you_mean(link, known, '')):
            reason = f'{quote(link)} has no points and no other joint'
            raise content.error(f'{kind}.{joint}.{end}', reason, remedy)


def _hinges_of_ball(name: str, parent: str, child: str, at: Any) -> dict[str, SpatialJoint]:
    """Return the three hinges of a ball, with two links between them."""
    hinges = [f'{name}_{axis}' for axis in 'xyz']
    ends = pairwise((parent, *hinges[:2], child))
    return {
        hinge: SpatialJoint(on, link, axis, at)
        for hinge, (on, link), axis in zip(hinges, ends, GROUND_FRAME[:3], strict=True)
    }


def _axis_through(
    content: Section, key: str, names: Sequence[str], points: Mapping[str, Any]
) -> dict[str, Any]:
    """Return a point and the direction of an axis through two points."""
    for name in names:
        if name not in points:
            remedy = did_you_mean(name, points, f'name one of {list_names(sorted(points))}')
            raise content.error(key, f'there is no point {quote(name)}', remedy)
    first, second = (points[name] for name in names)
    if first == second:
        reason = f'{quote(names[0])} and {quote(names[1])} are in one place'
        raise content.error(key, reason, 'name two points apart')
    return {'at': first, 'axis': tuple(b - a for a, b in zip(first, second, strict=True))}


def _names(content: Section, key: str) -> list[str]:
    """Return the names in a section before it is read."""
    named = content.mapping.get(key)
    return list(named) if isinstance(named, dict) else []
