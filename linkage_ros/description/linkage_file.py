# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Read a linkage file into a `Linkage`, or all its assemblies; shorthands expand to one form."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import chain, product, repeat
from math import inf
from os import PathLike
from pathlib import Path
from typing import Any

from linkage_ros.description.section import Section
from linkage_ros.description.units import ANGLES, LENGTHS, Units
from linkage_ros.description.yaml_file import read_yaml
from linkage_ros.errors import DefinitionError, FileError, list_names, quote
from linkage_ros.kinematics import (
    assembly_sides,
    AssemblyPose,
    assur_groups,
    check_closes,
    check_limits,
    check_turns,
    Closure,
    GROUND,
    Input,
    Limits,
    Linkage,
    Mass,
    Ratio,
    RevoluteJoint,
    SlideJoint,
    Slider,
    without_drawn_pose,
)
from linkage_ros.resources import linkage_names, named_file

_KEYS = (
    'units',
    'angles',
    'links',
    'input',
    'assembly',
    'sliders',
    'joints',
    'ratios',
    'traced',
    'pose',
    'masses',
)
_MOST_LINKS, _MOST_POINTS = 400, 10_000
"""Bounds on the links, and on the points of all links; at these a check takes seconds."""

_MOST_SIDES = 5
"""Most sides to choose for all assemblies: 32 linkages."""

FARTHEST = 1e9
"""Bound on coordinates, in [m]; below it no square overflows."""

HEAVIEST = 1e12
"""Bound on masses, in [kg], and on moments of inertia, in [kg·m²]."""

STRONGEST = 1e12
"""Bound on efforts, in [N·m] or [N]."""

_DRIVEN_CRANK = Input('crank_joint', GROUND, 'crank')
"""The input of every shorthand."""


def looks_like_linkage(content: Section) -> bool:
    """Return whether a file of unknown kind has the keys of a linkage."""
    return any(key in content for key in ('links', *_SHORTHANDS))


def load(linkage: str | PathLike[str]) -> Closure:
    """
    Load a linkage as a closure.

    Parameters
    ----------
    linkage
        Path of a linkage file, or the name of a linkage that comes with the package, such as
        ``'jansen_leg'``; `linkage_names` lists them.

    Raises
    ------
    FileError
        There is no such file or name, or the file is wrong: with file, line, key and remedy.
    TypeError
        The argument is neither a name nor a path.

    """
    file = named_file(linkage, 'linkages')
    return read_closure(linkage_content(file), file.stem)


def linkage_content(file: Path) -> Section:
    """Return the content of a linkage file; refuse a scene, and name its linkage."""
    content, _ = read_yaml(file)
    if 'linkage' in content or 'linkages' in content:
        raise content.error('', 'is a scene', f'name {_linkage_of(content, file)}')
    return content


def _linkage_of(scene: Section, file: Path) -> str:
    """Return how to name the linkage of a scene in its place."""
    name = scene.mapping.get('linkage')
    if not isinstance(name, str):
        return 'the file of one of its linkages'
    known = name in linkage_names()
    return f'its linkage, {name if known else file.parent / name}'


def read_linkage(content: Section) -> Linkage:
    """Read a linkage and check that it closes; errors as in `read_closure`."""
    return read_closure(content).linkage


def read_closure(content: Section, name: str = '', *, publish_inputs: bool = False) -> Closure:
    """
    Read a linkage and check that it closes.

    Parameters
    ----------
    content
        The linkage file.
    name
        Name for the linkage.
    publish_inputs
        Whether to publish its input joints too, before the others.

    Raises
    ------
    FileError
        The file is wrong; the error has file, line and key.

    """
    linkage, shorthand = written_linkage(content, publish_inputs=publish_inputs)
    return checked_closure(content, linkage, name, shorthand)


def written_linkage(content: Section, *, publish_inputs: bool = False) -> tuple[Linkage, str]:
    """Return a linkage as it is written, and the shorthand that it is written in, or ''."""
    content.units = Units(
        content.choice('units', tuple(LENGTHS), 'm'),
        content.choice('angles', ANGLES, ANGLES[0]),
    )
    for shorthand, expand in _SHORTHANDS.items():
        if shorthand in content:
            short = content.section(shorthand)
            written_out = Section(
                content.file, '', _add_pose(_add_limits(expand(short), short), short)
            )
            short.finish()
            content.finish()
            return _parse_linkage(written_out, publish_inputs), shorthand
    for key in _KEYS:
        content.remove_key(key)
    content.finish(tuple(_SHORTHANDS))
    return _parse_linkage(content, publish_inputs), ''


def _parse_linkage(content: Section, publish_inputs: bool) -> Linkage:
    links = content.section('links')
    _check_count(content, links, 'links', _MOST_LINKS)
    points = {}
    for name in links:
        link = links.section(name)
        points[name] = {point: link.point(point, most=FARTHEST, unit='m') for point in link}

    count = sum(map(len, points.values()))
    if count > _MOST_POINTS:
        raise content.error(
            'links', f'have {count} points', f'write at most {_MOST_POINTS} points'
        )

    if 'input' not in content:
        raise content.error('', "the key 'input' is missing", f'add {_input_line(points)}')
    inputs = tuple(_read_input(driven) for driven in content.sections('input'))

    sliders = content.section('sliders', required=False)
    assembly = content.section('assembly', required=False)
    sides = {
        name: assembly.choice(name, ('ahead', 'behind') if name in sliders else ('left', 'right'))
        for name in assembly
    }

    joints = content.section('joints')
    _check_count(content, sliders, 'sliders', _MOST_LINKS)
    _check_count(content, joints, 'joints', _MOST_LINKS)
    if not list(joints):
        raise content.error('joints', 'publishes nothing', 'name a joint')
    for driven in inputs:
        if driven.joint in joints:
            raise joints.error(driven.joint, 'is the input joint', 'publish the dependent joints')
    published = {name: _read_joint(joints.section(name)) for name in joints}
    if publish_inputs:
        published = {driven.joint: _published_joint(driven) for driven in inputs} | published
    return Linkage(
        points,
        inputs,
        sides,  # type: ignore[arg-type]  # one of the words of the Literal, by `choice`
        published,
        {name: _read_slider(sliders.section(name)) for name in sliders},
        tuple(content.texts('traced')),
        _read_pose(content.section('pose'), inputs) if 'pose' in content else None,
        _read_masses(content.section('masses', required=False), tuple(points)),
        _read_ratios(content.section('ratios', required=False), inputs, published),
    )


def _check_count(content: Section, named: Section, key: str, most: int) -> None:
    count = len(named.mapping)
    if count > most:
        raise content.error(key, f'there are {count}', f'write at most {most}')


def _input_line(points: Mapping[str, Collection[str]]) -> str:
    """Return the line of an input for a file without one."""
    pins = {*points.get(GROUND, ())}
    crank = next((link for link in points if link != GROUND and pins & {*points[link]}), 'crank')
    return f'input: {{joint: {crank}_joint, parent: {GROUND}, child: {crank}}}'


def _read_input(content: Section) -> Input:
    joint = content.text('joint', expected='a name for the driven joint, as in crank messages')
    if 'slider' in content:
        driven = Input(
            joint, slider=content.text('slider'), limits=_read_limits(content, slides=True)
        )
    else:
        driven = Input(joint, *_read_ends(content), limits=_read_limits(content))
    content.finish(('slider',))
    return driven


def _published_joint(driven: Input) -> RevoluteJoint | SlideJoint:
    if driven.slider:
        return SlideJoint(driven.slider)
    return RevoluteJoint(driven.parent, driven.child)


def _read_ends(content: Section) -> tuple[str, str]:
    """Return parent and child of a joint."""
    return (
        content.text('parent', expected='the link from which the angle is measured'),
        content.text('child', expected='the link whose angle it is'),
    )


def _read_limits(content: Section, *, slides: bool = False) -> Limits:
    """Return the limits of a joint; `kinematics.checks` decides whether they are possible."""
    content.units = replace(content.units, slides=slides)
    low, high = content.interval('limits', most=FARTHEST, unit='rad or m')
    return Limits(
        low,
        high,
        content.number('velocity', inf, above=0.0, most=FARTHEST, unit='rad/s or m/s')
        if 'velocity' in content
        else inf,
        content.number('effort', inf, above=0.0, most=STRONGEST, unit='N·m or N')
        if 'effort' in content
        else inf,
    )


def _read_pose(content: Section, driven: Sequence[Input]) -> AssemblyPose:
    # A wrong number of values is refused with the other parts that do not match.
    values = content.numbers('inputs', most=FARTHEST)
    units = chain((given.unit for given in driven), repeat(''))
    inputs = tuple(map(content.units.to_si, values, units))
    points = content.section('points', required=False)
    angles = content.section('angles', required=False)
    pose = AssemblyPose(
        inputs,
        {name: points.point(name, most=FARTHEST, unit='m') for name in points},
        {name: angles.number(name, least=-FARTHEST, most=FARTHEST, unit='rad') for name in angles},
    )
    content.finish()
    return pose


def _read_masses(content: Section, links: tuple[str, ...]) -> dict[str, Mass]:
    masses = {}
    for name in content:
        if name == GROUND:
            raise content.error(name, 'the ground does not move', 'leave its mass out')
        if name not in links:
            moving = sorted({*links} - {GROUND})
            raise content.error(
                name, f'{quote(name)} is not a link', f'name one of {list_names(moving)}'
            )
        link = content.section(name)
        masses[name] = Mass(
            link.number('mass', least=0.0, most=HEAVIEST, unit='kg'),
            link.point('center', most=FARTHEST, unit='m'),
            link.number('inertia', least=0.0, most=HEAVIEST, unit='kg·m²'),
        )
        link.finish()
    return masses


def _read_ratios(
    content: Section,
    inputs: Sequence[Input],
    joints: Mapping[str, RevoluteJoint | SlideJoint],
) -> dict[str, Ratio]:
    units = {name: joint.unit for name, joint in joints.items()}
    units |= {given.joint: given.unit for given in inputs}
    _check_count(content, content, '', _MOST_LINKS)
    ratios = {}
    for name in content:
        one = content.section(name)
        of = one.text('of', expected='an input or a published joint, which this one follows')
        unit = units.get(name, 'rad')
        # In the file's units of length: metres for a radian, or radians for a metre.
        ratio = one.number('ratio', 1.0, least=-FARTHEST, most=FARTHEST)
        ratio = one.units.to_si(ratio, unit if unit == 'm' else '')
        if units.get(of) == 'm':
            ratio /= one.units.to_si(1.0, 'm')
        offset = one.number('offset', 0.0, least=-FARTHEST, most=FARTHEST, unit=unit)
        ratios[name] = Ratio(of, ratio, offset)
        one.finish()
    return ratios


def _read_slider(content: Section) -> Slider:
    block = content.text('block', '')
    slider = Slider(
        content.text('point', expected='the point that stays on the line'),
        content.text('along', expected='the link that carries the line'),
        content.text('through', expected='a point of that link on the line'),
        content.point('direction', most=FARTHEST),
        block,
        content.number('angle', 0.0, least=-FARTHEST, most=FARTHEST, unit='rad') if block else 0.0,
    )
    content.finish(('block', 'angle'))
    return slider


def _read_joint(content: Section) -> RevoluteJoint | SlideJoint:
    joint: RevoluteJoint | SlideJoint
    if 'slider' in content:
        joint = SlideJoint(content.text('slider'), _read_limits(content, slides=True))
    else:
        joint = RevoluteJoint(*_read_ends(content), _read_limits(content))
    content.finish(('slider',))
    return joint


def checked_closure(content: Section, linkage: Linkage, name: str, shorthand: str = '') -> Closure:
    """Return a linkage of a file as a closure, and check that it closes."""
    try:
        closure = Closure(linkage, name)
        check_closes(closure)
        check_turns(closure)
        check_limits(closure)
    except DefinitionError as error:
        where = error.where
        if shorthand:
            # Of the expanded file, the author of a shorthand wrote only limits, side and pose.
            own = where.endswith('.limits') or where.partition('.')[0] in ('assembly', 'pose')
            where = f'{shorthand}.{where}' if own else shorthand
        remedy = error.remedy
        if where == 'assembly':
            remedy += f'; linkage draw {content.file} --assemblies draws the choices'
        raise content.locate_error(DefinitionError(where, error.reason, remedy)) from None
    return closure


def _add_limits(written_out: dict[str, Any], content: Section) -> dict[str, Any]:
    """Return an expanded shorthand, with the limits that the shorthand gives to its joints."""
    driven, joints = written_out['input'], written_out['joints']
    limited = content.section('joints', required=False)
    for name in limited:
        if name not in joints:
            raise limited.error(
                name,
                f'{quote(name)} is not a joint of the linkage',
                f'name one of {list_names(joints)}',
            )
    places = [(driven, content.section('input', required=False))]
    places += [(joints[name], limited.section(name)) for name in limited]
    for joint, of in places:
        limits = _read_limits(of, slides='slider' in joint)
        of.finish()
        in_si = {
            'limits': [limits.low, limits.high],
            'velocity': limits.velocity,
            'effort': limits.effort,
        }
        joint.update({key: value for key, value in in_si.items() if key in of})
    return written_out


def _add_pose(written_out: dict[str, Any], content: Section) -> dict[str, Any]:
    """Return an expanded shorthand with its pose; a drawn pose determines the side."""
    if 'pose' in content:
        pose = _read_pose(content.section('pose'), [_DRIVEN_CRANK])
        if pose.is_drawn and 'assembly' not in content:
            del written_out['assembly']
        written_out['pose'] = {
            'inputs': [*pose.inputs],
            'points': {name: [*place] for name, place in pose.points.items()},
            'angles': dict(pose.angles),
        }
    return written_out


def _four_bar(content: Section) -> dict[str, Any]:
    """Expand crank a, coupler b, rocker c and ground d."""
    a, b, c, d = (content.number(side, above=0.0, most=FARTHEST, unit='m') for side in 'abcd')
    side = content.choice('assembly', ('left', 'right'), 'left')
    return {
        'links': {
            'ground': {'O2': [0, 0], 'O4': [d, 0]},
            'crank': {'O2': [0, 0], 'A': [a, 0]},
            'coupler': {'A': [0, 0], 'B': [b, 0]},
            'rocker': {'O4': [0, 0], 'B': [c, 0]},
        },
        'input': {'joint': 'crank_joint', 'parent': 'ground', 'child': 'crank'},
        'assembly': {'B': side},
        'joints': {
            'coupler_joint': {'parent': 'crank', 'child': 'coupler'},
            'rocker_joint': {'parent': 'ground', 'child': 'rocker'},
        },
    }


def _inverted_slider_crank(content: Section) -> dict[str, Any]:
    """Expand crank a and the position of the swivel relative to the crank's pivot."""
    a = content.number('a', above=0.0, most=FARTHEST, unit='m')
    swivel = content.point('swivel', most=FARTHEST, unit='m')
    if swivel == (0.0, 0.0):
        raise content.error(
            'swivel', "[0, 0] is the crank's pivot", 'give the swivel another place'
        )
    side = content.choice('assembly', ('ahead', 'behind'), 'ahead')
    return {
        'links': {
            'ground': {'O': [0, 0], 'C': list(swivel)},
            'crank': {'O': [0, 0], 'B': [a, 0]},
            'rod': {'B': [0, 0], 'end': [a + (swivel[0] ** 2 + swivel[1] ** 2) ** 0.5, 0]},
        },
        'sliders': {'swivel': {'point': 'C', 'along': 'rod', 'through': 'B', 'direction': [1, 0]}},
        'input': {'joint': 'crank_joint', 'parent': 'ground', 'child': 'crank'},
        'assembly': {'swivel': side},
        'joints': {
            'rod_joint': {'parent': 'crank', 'child': 'rod'},
            'rod_slide': {'slider': 'swivel'},
        },
    }


_SHORTHANDS = {'four_bar': _four_bar, 'inverted_slider_crank': _inverted_slider_crank}


def find_assemblies(linkage: str | PathLike[str]) -> dict[str, Closure]:
    """
    Return a linkage in each choice of assembly sides in which it closes; errors as in `load`.

    Keys are texts for the file, such as ``'assembly: {B: left}'``. Sides that the file writes are
    kept if it leaves others out, else all are chosen. A FileError says that there is no side to
    choose, or that there are too many.
    """
    file = named_file(linkage, 'linkages')
    return find_closures(linkage_content(file), file.stem)


def find_closures(content: Section, name: str) -> dict[str, Closure]:
    """Return the closures of a linkage file by name, as `find_assemblies` does."""
    written, shorthand = written_linkage(content)
    try:
        structure = assur_groups(written)
        sides = assembly_sides(structure)
    except DefinitionError as error:
        raise content.error(shorthand or error.where, error.reason, error.remedy) from None
    free = [name for name in sides if name not in written.assembly] or list(sides)
    if not free:
        reason = 'no dyad of this linkage has two assemblies'
        raise content.error('', reason, 'draw it without --assemblies')
    if len(free) > _MOST_SIDES:
        reason = f'{len(free)} sides are to be chosen'
        raise content.error('assembly', reason, f'leave out only {_MOST_SIDES} of them')
    found = {}
    errors = []
    written = without_drawn_pose(written, structure)
    for chosen in product(*(sides[name] for name in free)):
        assembly = dict(written.assembly) | dict(zip(free, chosen, strict=True))
        one = replace(written, assembly=assembly)  # type: ignore[arg-type]  # sides, as above
        # A shorthand has one side, without the name of its pin or slider.
        text = ', '.join(chosen if shorthand else (f'{k}: {v}' for k, v in assembly.items()))
        text = f'assembly: {text if shorthand else f"{{{text}}}"}'
        try:
            found[text] = checked_closure(content, one, name, shorthand)
        except FileError as error:
            errors.append(error)
    if not found:
        raise errors[0]
    return found
