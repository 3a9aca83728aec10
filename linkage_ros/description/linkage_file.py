# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Read a linkage file into a `Linkage`, or all its assemblies; shorthands expand to one form."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from os import PathLike
from pathlib import Path
from typing import Any

from linkage_ros.description.file_kinds import CLOSINGS, ROBOTS
from linkage_ros.description.linkage_grammar import (
    is_rod,
    LINKAGE,
    ratio_in_si,
    read_units,
    SHORTHANDS,
    WRITTEN_OUT,
)
from linkage_ros.description.parameters import read_parameters
from linkage_ros.description.section import Section
from linkage_ros.description.yaml_file import read_yaml
from linkage_ros.errors import DefinitionError, FileError, list_names, read_each
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
    Linkage,
    Mass,
    PLANAR_ONLY,
    PlanarClosure,
    Point,
    RevoluteJoint,
    SlideJoint,
    without_drawn_pose,
)
from linkage_ros.resources import linkage_names, named_file

_MOST_POINTS = 10_000
"""Bound on the points of all links; at it a check takes seconds."""

_MOST_SIDES = 5
"""Most sides to choose for all assemblies: 32 linkages."""


def looks_like_linkage(content: Section) -> bool:
    """Return whether a file of unknown kind has the keys of a linkage, or is a robot's."""
    return any(key in content for key in ('links', 'points', 'urdf', *SHORTHANDS))


def load(linkage: str | PathLike[str], robot: Mapping[str, Any] | None = None) -> Closure:
    """
    Load a linkage as a closure: a `PlanarClosure`, or a `SpaceClosure` if it is spatial.

    Parameters
    ----------
    linkage
        Path of a linkage file, or the name of a linkage that comes with the package, such as
        ``'jansen_leg'``; `linkage_names` lists them. Or a URDF with loops, which ends in
        ``.urdf``.
    robot
        What a scene says of a robot that its URDF does not: ``{'input': ['m1', 'm2']}``, and
        ``at`` and ``close``.

    Raises
    ------
    FileError
        There is no such file or name, or the file is wrong: with file, line, key and remedy.
    TypeError
        The argument is neither a name nor a path.

    """
    file = named_file(linkage, 'linkages')
    return read_any_closure(linkage_content(file, robot), file.stem)


def read_content(file: Path, robot: Mapping[str, Any] | None = None) -> tuple[Section, bytes]:
    """Return the content of a file, also of a robot, and its bytes."""
    if file.suffix.lower() not in ROBOTS:
        content, data = read_yaml(file)
        if CLOSINGS not in content:
            if robot:
                raise FileError(file, '', 'is not a robot', f'leave out {list_names(robot)}')
            if 'urdf' in content:
                remedy = 'name the URDF itself, or write linkage: {urdf: FILE} for a scene'
                raise content.error('urdf', 'is not a key of a linkage', remedy)
            return content, data
    content = urdf_content(file, robot or {})
    return content, content.named_data


def linkage_content(file: Path, robot: Mapping[str, Any] | None = None) -> Section:
    """Return the content of a linkage file or a robot; refuse a scene, and name its linkage."""
    content, _ = read_content(file, robot)
    if 'linkage' in content or 'linkages' in content:
        raise content.error('', 'is a scene', f'name {_linkage_of(content, file)}')
    return content


def urdf_content(file: Path, robot: Mapping[str, Any]) -> Section:
    """Return the content of a robot, with what its URDF does not say, as in a scene."""
    return robot_content(Section(str(file), '', {'urdf': str(file), **robot}), file)


def robot_content(content: Section, file: Path) -> Section:
    """Return a section that names a robot, with the content of its URDF."""
    from linkage_ros.description.robot_formats import read_as_urdf  # local import: for robots

    content.named_data = read_as_urdf(file)
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


def read_any_closure(
    content: Section,
    name: str = '',
    *,
    publish_inputs: bool = False,
    publish_model_joints: bool = False,
) -> Closure:
    """
    Read a planar or a spatial linkage; errors as in `read_closure`.

    With ``publish_model_joints`` a robot, or a spatial file, publishes joints that place every
    link, as a robot model needs them.
    """
    if is_planar_file(content):
        return read_closure(content, name, publish_inputs=publish_inputs)
    if 'urdf' in content:
        from linkage_ros.description.robot_file import (
            read_robot_closure as read,  # local import: few linkages are robots
        )
    else:
        from linkage_ros.description.space_file import (
            read_space_closure as read,  # local import: a planar file does without space
        )
    return read(
        content, name, publish_inputs=publish_inputs, publish_model_joints=publish_model_joints
    )


def read_closure(
    content: Section, name: str = '', *, publish_inputs: bool = False
) -> PlanarClosure:
    """
    Read a planar linkage and check that it closes.

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


def is_planar_file(content: Section) -> bool:
    """Return whether a linkage is written as a planar one: neither a robot nor in space."""
    return not ('points' in content or 'urdf' in content)


def written_linkage(content: Section, *, publish_inputs: bool = False) -> tuple[Linkage, str]:
    """Return a linkage as it is written, and the shorthand that it is written in, or ''."""
    if not is_planar_file(content):
        key = 'urdf' if 'urdf' in content else 'points'
        raise content.error(key, 'make it a spatial linkage', PLANAR_ONLY)
    read_units(content)
    for shorthand, keys in SHORTHANDS.items():
        if shorthand in content:
            short = content.section(shorthand)
            written_out = read_parameters(short, keys, {'unit': ('rad',)})
            pose = written_out.pop('pose', None)
            if pose is not None and pose.is_drawn and 'assembly' not in short:
                del written_out['assembly']
            content.finish()
            expanded = Section(content.file, '', written_out)
            return _parse_linkage(expanded, publish_inputs, pose), shorthand
    for key in WRITTEN_OUT:
        content.remove_key(key)
    readers: dict[str, Callable[[], Any]] = {
        '': partial(content.finish, tuple(SHORTHANDS)),
        'linkage': partial(_parse_linkage, content, publish_inputs),
    }
    return read_each(readers)['linkage'], ''


def _parse_linkage(
    content: Section, publish_inputs: bool, pose: AssemblyPose | None = None
) -> Linkage:
    parts: dict[str, Sequence[str]] = {}

    def read(key: str) -> Any:
        return LINKAGE.read_key(content, key, parts)

    points = read('links')
    count = sum(map(len, points.values()))
    if count > _MOST_POINTS:
        raise content.error(
            'links', f'have {count} points', f'write at most {_MOST_POINTS} points'
        )
    if 'input' not in content:
        raise content.error('', "the key 'input' is missing", f'add {_input_line(points)}')
    inputs = tuple(read('input'))
    sliders = read('sliders') or {}
    parts.update(
        link=tuple(points),
        input=[driven.joint for driven in inputs],
        unit=[driven.unit for driven in inputs],
        slider=tuple(sliders),
    )
    of_linkage = read_each(
        {
            key: partial(LINKAGE.read_key, content, key, parts)
            for key in ('assembly', 'joints', 'traced', 'masses', 'pose', 'axes')
        }
    )
    assembly = of_linkage['assembly'] or {}
    joints = published = of_linkage['joints']
    if not joints:
        raise content.error('joints', 'publishes nothing', 'name a joint')
    if publish_inputs:
        published = {driven.joint: _published_joint(driven) for driven in inputs} | joints
    traced = of_linkage['traced'] or ()
    masses = {
        link: _mass_of(content, link, mass, points[link])
        for link, mass in (of_linkage['masses'] or {}).items()
    }
    pose = pose or of_linkage['pose']
    units = {name: joint.unit for name, joint in joints.items()}
    units |= {driven.joint: driven.unit for driven in inputs}
    parts['slide'] = [name for name, unit in units.items() if unit == 'm']
    ratios = {
        name: ratio_in_si(ratio, name, units, content.units)
        for name, ratio in (read('ratios') or {}).items()
    }
    x, y = of_linkage['axes']
    return Linkage(
        points, inputs, assembly, published, sliders, traced, pose, masses, ratios, axes=(x, y)
    )


def _mass_of(
    content: Section, link: str, values: dict[str, Any], points: Mapping[str, Point]
) -> Mass:
    """Return the mass of a link, which may be written as that of a rod."""
    mass = values['mass']
    if not is_rod(content, link, values, [*points]):
        return Mass(mass, values.get('center', (0.0, 0.0)), values.get('inertia', 0.0))
    (x, y), (to_x, to_y) = points.values()
    square = (to_x - x) * (to_x - x) + (to_y - y) * (to_y - y)
    return Mass(mass, (0.5 * (x + to_x), 0.5 * (y + to_y)), mass / 12.0 * square)


def _input_line(points: Mapping[str, Collection[str]]) -> str:
    """Return the line of an input for a file without one."""
    pins = {*points.get(GROUND, ())}
    crank = next((link for link in points if link != GROUND and pins & {*points[link]}), 'crank')
    return f'input: {{joint: {crank}_joint, parent: {GROUND}, child: {crank}}}'


def _published_joint(driven: Input) -> RevoluteJoint | SlideJoint:
    if driven.slider:
        return SlideJoint(driven.slider)
    return RevoluteJoint(driven.parent, driven.child)


def checked_closure(
    content: Section, linkage: Linkage, name: str, shorthand: str = ''
) -> PlanarClosure:
    """Return a linkage of a file as a closure, and check that it closes."""
    try:
        closure = PlanarClosure(linkage, name)
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


def find_closures(content: Section, name: str) -> dict[str, PlanarClosure]:
    """
    Return a linkage in each choice of assembly sides in which it closes; errors as in `load`.

    Keys are texts for the file, such as ``'assembly: {B: left}'``. Sides that the file writes are
    kept if it leaves others out, else all are chosen. A FileError says that there is no side to
    choose, or that there are too many.
    """
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
    closures = {}
    errors = []
    written = without_drawn_pose(written, structure)
    for chosen in product(*(sides[name] for name in free)):
        assembly = dict(written.assembly) | dict(zip(free, chosen, strict=True))
        choice = replace(written, assembly=assembly)  # type: ignore[arg-type]  # sides, as above
        # A shorthand has one side, without the name of its pin or slider.
        text = ', '.join(chosen if shorthand else (f'{k}: {v}' for k, v in assembly.items()))
        text = f'assembly: {text if shorthand else f"{{{text}}}"}'
        try:
            closures[text] = checked_closure(content, choice, name, shorthand)
        except FileError as error:
            errors.append(error)
    if not closures:
        raise errors[0]
    return closures
