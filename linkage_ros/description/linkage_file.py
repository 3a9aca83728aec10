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
from dataclasses import dataclass, MISSING, replace
from functools import partial
from itertools import chain, product, repeat
from math import inf
from os import PathLike
from pathlib import Path
from typing import Any

from linkage_ros.description.grammar import (
    DIALECT,
    Interval,
    LENGTH_UNIT,
    ListOf,
    Named,
    OneOrMore,
    OnlyWith,
    optional_keys,
)
from linkage_ros.description.parameters import (
    CHARACTER,
    choice,
    ChoiceOf,
    declare,
    Keys,
    Number,
    number,
    ParameterGroup,
    parameters_schema,
    Parts,
    Point,
    point,
    read_parameters,
    Rule,
    Schema,
    text,
    TextOf,
)
from linkage_ros.description.section import Section
from linkage_ros.description.units import ANGLES, Units
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

_Values = dict[str, Any]


class _SliderOrLinks(Rule):
    """A joint is a slider, or it turns a child relative to its parent."""

    def check(self, content: Section) -> None:
        content.units = replace(content.units, slides='slider' in content)

    def needed_keys(self, content: Section) -> Sequence[str]:
        return ('slider',) if 'slider' in content else ('parent', 'child')

    def unknown_keys(self, content: Section) -> Sequence[str]:
        return ('parent', 'child') if 'slider' in content else ()

    def json_schema(self) -> Schema:
        return {
            'if': {'required': ['slider']},
            'then': {'properties': {'parent': False, 'child': False}},
            'else': {'required': ['parent', 'child']},
        }


@dataclass(frozen=True, slots=True)
class _Moves(Rule):
    """The joint of these limits turns or slides."""

    slides: bool = False

    def check(self, content: Section) -> None:
        content.units = replace(content.units, slides=self.slides)


@dataclass(frozen=True, slots=True)
class _Side(ChoiceOf):
    """The side of a pin, or of a slider."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> str:
        return content.choice(key, _AHEAD if key in parts['slider'] else _LEFT)


@dataclass(frozen=True, slots=True)
class _InputValues(ListOf):
    """A value for each input; a wrong number of them is refused with the other parts."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> tuple[float, ...]:
        values = content.numbers(key, most=FARTHEST)
        return tuple(map(content.units.to_si, values, chain(parts['unit'], repeat(''))))


def _refuse_mass(content: Section, name: str, parts: Parts) -> None:
    """Refuse the mass of what is not a moving link."""
    if name == GROUND:
        raise content.error(name, 'the ground does not move', 'leave its mass out')
    if name not in parts['link']:
        moving = sorted({*parts['link']} - {GROUND})
        reason = f'{quote(name)} is not a link'
        raise content.error(name, reason, f'name one of {list_names(moving)}')


def _refuse_input(content: Section, name: str, parts: Parts) -> None:
    """Refuse the input among the published joints."""
    if name in parts['input']:
        raise content.error(name, 'is the input joint', 'publish the dependent joints')


def _length(meaning: str) -> Any:
    return number(meaning, unit='m', above=0.0, most=FARTHEST)


def _bounded(meaning: str, default: float, unit: str = '') -> Any:
    return number(meaning, default, unit=unit, least=-FARTHEST, most=FARTHEST)


_LEFT, _AHEAD = ('left', 'right'), ('ahead', 'behind')
_LIMITS = {
    'limits': declare(
        Interval(
            'limits of the joint: [low, high] [rad or m]; -.inf or .inf for no limit on a side',
            'rad or m',
            FARTHEST,
        ),
        None,
    ),
    'velocity': number('its highest rate', None, unit='rad/s or m/s', above=0.0, most=FARTHEST),
    'effort': number(
        'its highest torque or force', None, unit='N·m or N', above=0.0, most=STRONGEST
    ),
}


def _split_limits(values: _Values) -> Limits:
    """Return the limits of a joint and take their keys out; `kinematics.checks` judges them."""
    low, high = values.pop('limits', (-inf, inf))
    return Limits(low, high, values.pop('velocity', inf), values.pop('effort', inf))


def _build_input(**values: Any) -> Input:
    return Input(limits=_split_limits(values), **values)


def _build_joint(**values: Any) -> RevoluteJoint | SlideJoint:
    limits = _split_limits(values)
    build: Any = SlideJoint if 'slider' in values else RevoluteJoint
    return build(limits=limits, **values)


_ENDS = {
    'parent': text('the link from which the angle is measured', None),
    'child': text('the link whose angle it is', None),
    'slider': text('the slider, instead of parent and child', None),
    **_LIMITS,
}
_INPUT = Keys(
    'The driven joint; several in a list.',
    _build_input,
    {'joint': text('a name for the driven joint, as in crank messages'), **_ENDS},
    (_SliderOrLinks(),),
)
_JOINT = Keys(
    "The child's angle less the parent's [rad], or the slide of a slider [m].",
    _build_joint,
    _ENDS,
    (_SliderOrLinks(),),
)
_SLIDER = Keys(
    'A point that stays on a line of the link `along`.',
    Slider,
    {
        'point': text('the point that stays on the line'),
        'along': text('the link that carries the line'),
        'through': text('a point of that link on the line; the slide is measured from it'),
        'direction': point(
            'direction of the line, in the frame of `along`: [x, y]', most=FARTHEST
        ),
        'block': text('the link that slides without turning', '', pattern=f'^{CHARACTER}*$'),
        'angle': _bounded('angle of the block relative to `along`', 0.0, 'rad'),
    },
    (OnlyWith('angle', 'block'),),
)
_RATIO = Keys(
    'A published joint, as ratio · other joint + offset.',
    Ratio,
    {
        'of': text('an input or a published joint, which this one follows'),
        'ratio': _bounded(
            'its displacement [rad or unit of length] when the other joint moves by 1', 1.0
        ),
        'offset': _bounded('its value where the other joint is at 0', 0.0, 'rad or m'),
    },
)
_POSE = Keys(
    'The pose as drawn, where the linkage starts. Points and angles select the assembly: as '
    'few as are needed; for links outside dyads they start the iteration.',
    partial(AssemblyPose, points={}),
    {
        'inputs': declare(
            _InputValues(
                'a value for each input [rad or m]',
                Number('a value', 'rad or m', -FARTHEST, FARTHEST),
            )
        ),
        'points': declare(
            Named('points in the frame of the ground, roughly', Point('[x, y]', 'm', FARTHEST)),
            None,
        ),
        'angles': declare(
            Named(
                'angles of links to the ground, roughly',
                Number('the angle', 'rad', -FARTHEST, FARTHEST),
            ),
            None,
        ),
    },
)
_MASS = Keys(
    'Mass properties of a link.',
    Mass,
    {
        'mass': number('mass; 0: the link is massless', unit='kg', least=0.0, most=HEAVIEST),
        'center': point("centre of mass in the link's frame: [x, y]", unit='m', most=FARTHEST),
        'inertia': number(
            'moment of inertia about the centre of mass', unit='kg·m²', least=0.0, most=HEAVIEST
        ),
    },
)
_PLACE = Point('where the point lies in the frame of its link: [x, y]', 'm', FARTHEST)


def _named(meaning: str, of: Keys, default: Any = None, **rules: Any) -> Any:
    return declare(Named(meaning, ParameterGroup(of.meaning, of), **rules), default)


_WRITTEN_OUT = {
    'links': declare(
        Named(
            'Links, each with its points; a point on two links is a pin; one link is the ground.',
            Named('points of the link, by name', _PLACE),
            _MOST_LINKS,
        )
    ),
    'input': declare(OneOrMore(_INPUT.meaning, _INPUT)),
    'assembly': declare(
        Named(
            'Side of each pin or slider that closes a dyad; not needed if `pose` gives it.',
            _Side('the side', (*_LEFT, *_AHEAD)),
        ),
        None,
    ),
    'sliders': _named(
        'Points that stay on lines of other links, by name.', _SLIDER, most=_MOST_LINKS
    ),
    'joints': _named(
        'Published joints, in this order, by name.',
        _JOINT,
        MISSING,
        least=1,
        most=_MOST_LINKS,
        check=_refuse_input,
    ),
    'ratios': _named(
        'Joints that follow others: gears, belts, racks, mimic.', _RATIO, most=_MOST_LINKS
    ),
    'traced': declare(ListOf('Points whose paths are drawn.', TextOf('a point')), None),
    'pose': optional_keys(_POSE),
    'masses': _named('Masses of the links, by link name.', _MASS, check=_refuse_mass),
}


class _ShorthandOrLinks(Rule):
    """A linkage is written out, or by one shorthand; the written-out keys are read elsewhere."""

    def json_schema(self) -> Schema:
        needed = [key for key, entry in _WRITTEN_OUT.items() if entry.default is MISSING]
        return {
            'if': {'anyOf': [{'required': [shorthand]} for shorthand in _SHORTHANDS]},
            'then': {
                'propertyNames': {'enum': [*_UNITS, *_SHORTHANDS]},
                'not': {'required': list(_SHORTHANDS)},
            },
            'else': {'required': needed},
        }


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
    content.units = Units(*(_LINKAGE.read_key(content, key, {}) for key in _UNITS))
    for shorthand, keys in _SHORTHANDS.items():
        if shorthand in content:
            short = content.section(shorthand)
            written_out = read_parameters(short, keys, {'unit': ('rad',)})
            pose = written_out.pop('pose', None)
            if pose is not None and pose.is_drawn and 'assembly' not in short:
                del written_out['assembly']
            content.finish()
            expanded = Section(content.file, '', written_out)
            return _parse_linkage(expanded, publish_inputs, pose), shorthand
    for key in _WRITTEN_OUT:
        content.remove_key(key)
    content.finish(tuple(_SHORTHANDS))
    return _parse_linkage(content, publish_inputs), ''


def _parse_linkage(
    content: Section, publish_inputs: bool, pose: AssemblyPose | None = None
) -> Linkage:
    parts: dict[str, Sequence[str]] = {}

    def read(key: str) -> Any:
        return _LINKAGE.read_key(content, key, parts)

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
    assembly = read('assembly') or {}
    joints = published = read('joints')
    if not joints:
        raise content.error('joints', 'publishes nothing', 'name a joint')
    if publish_inputs:
        published = {driven.joint: _published_joint(driven) for driven in inputs} | joints
    traced, masses = read('traced') or (), read('masses') or {}
    pose = pose or read('pose')
    units = {name: joint.unit for name, joint in joints.items()}
    units |= {driven.joint: driven.unit for driven in inputs}
    parts['slide'] = [name for name, unit in units.items() if unit == 'm']
    ratios = {
        name: replace(one, ratio=_ratio_in_si(one, units.get(name), units.get(one.of), content))
        for name, one in (read('ratios') or {}).items()
    }
    return Linkage(points, inputs, assembly, published, sliders, traced, pose, masses, ratios)


def _ratio_in_si(ratio: Ratio, unit: str | None, driving: str | None, content: Section) -> float:
    """Return a ratio of the file's units of length: metres for a radian, radians for a metre."""
    found = content.units.to_si(ratio.ratio, 'm' if unit == 'm' else '')
    return found / content.units.to_si(1.0, 'm') if driving == 'm' else found


def _input_line(points: Mapping[str, Collection[str]]) -> str:
    """Return the line of an input for a file without one."""
    pins = {*points.get(GROUND, ())}
    crank = next((link for link in points if link != GROUND and pins & {*points[link]}), 'crank')
    return f'input: {{joint: {crank}_joint, parent: {GROUND}, child: {crank}}}'


def _published_joint(driven: Input) -> RevoluteJoint | SlideJoint:
    if driven.slider:
        return SlideJoint(driven.slider)
    return RevoluteJoint(driven.parent, driven.child)


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


def _expand(written_out: _Values, values: _Values) -> _Values:
    """Return an expanded shorthand, with the limits that it gives to its joints, and its pose."""
    written_out['input'] |= values.get('input', {})
    for name, limits in values.get('joints', {}).items():
        written_out['joints'][name] |= limits
    return written_out | {key: values[key] for key in ('pose',) if key in values}


def _four_bar(**values: Any) -> _Values:
    """Expand crank a, coupler b, rocker c and ground d."""
    a, b, c, d = (values[side] for side in 'abcd')
    written_out = {
        'links': {
            'ground': {'O2': [0, 0], 'O4': [d, 0]},
            'crank': {'O2': [0, 0], 'A': [a, 0]},
            'coupler': {'A': [0, 0], 'B': [b, 0]},
            'rocker': {'O4': [0, 0], 'B': [c, 0]},
        },
        'input': {'joint': 'crank_joint', 'parent': 'ground', 'child': 'crank'},
        'assembly': {'B': values['assembly']},
        'joints': {
            'coupler_joint': {'parent': 'crank', 'child': 'coupler'},
            'rocker_joint': {'parent': 'ground', 'child': 'rocker'},
        },
    }
    return _expand(written_out, values)


def _inverted_slider_crank(a: float, swivel: Sequence[float], **values: Any) -> _Values:
    """Expand crank a and the position of the swivel relative to the crank's pivot."""
    written_out = {
        'links': {
            'ground': {'O': [0, 0], 'C': list(swivel)},
            'crank': {'O': [0, 0], 'B': [a, 0]},
            'rod': {'B': [0, 0], 'end': [a + (swivel[0] ** 2 + swivel[1] ** 2) ** 0.5, 0]},
        },
        'sliders': {'swivel': {'point': 'C', 'along': 'rod', 'through': 'B', 'direction': [1, 0]}},
        'input': {'joint': 'crank_joint', 'parent': 'ground', 'child': 'crank'},
        'assembly': {'swivel': values['assembly']},
        'joints': {
            'rod_joint': {'parent': 'crank', 'child': 'rod'},
            'rod_slide': {'slider': 'swivel'},
        },
    }
    return _expand(written_out, values)


@dataclass(frozen=True, slots=True)
class _Swivel(Point):
    """A point that is not the pivot."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> tuple[float, float]:
        place = content.point(key, most=self.most, unit=self.unit)
        if place == (0.0, 0.0):
            remedy = 'give the swivel another place'
            raise content.error(key, "[0, 0] is the crank's pivot", remedy)
        return place


def _joint_limits(meaning: str, slides: bool) -> Keys:
    # In SI, as an expanded shorthand has them: infinite ends as they are.
    return Keys(meaning, _written_limits, _LIMITS, (_Moves(slides),))


def _written_limits(**values: Any) -> _Values:
    return {key: list(value) if key == 'limits' else value for key, value in values.items()}


def _common_keys(side: Any, **joints: bool) -> _Values:
    """Return the keys of every shorthand, with the joints that it publishes, sliding or not."""
    each = {name: _joint_limits('Limits of the joint.', slides) for name, slides in joints.items()}
    limited = Keys(
        'Limits of the published joints, by name.',
        dict,
        {name: optional_keys(of) for name, of in each.items()},
    )
    return {
        'assembly': side,
        'pose': optional_keys(_POSE),
        'input': optional_keys(_joint_limits('Limits of the driven joint.', slides=False)),
        'joints': optional_keys(limited),
    }


_SHORTHANDS = {
    'four_bar': Keys(
        'A four-bar by the lengths of its links; shorthand for a full file.',
        _four_bar,
        {
            **dict(
                zip('abcd', map(_length, ('crank', 'coupler', 'rocker', 'ground')), strict=True)
            ),
            **_common_keys(
                choice('side of A→O4 on which B lies', _LEFT, _LEFT[0]),
                coupler_joint=False,
                rocker_joint=False,
            ),
        },
    ),
    'inverted_slider_crank': Keys(
        'A crank whose rod slides through a swivel; shorthand for a full file.',
        _inverted_slider_crank,
        {
            'a': _length('crank'),
            'swivel': declare(_Swivel("the swivel from the crank's pivot: [x, y]", 'm', FARTHEST)),
            **_common_keys(
                choice('side of B on which the swivel lies', _AHEAD, _AHEAD[0]),
                rod_joint=False,
                rod_slide=True,
            ),
        },
    ),
}
_UNITS = {
    'units': LENGTH_UNIT,
    'angles': choice('Unit of the angles.', ANGLES, ANGLES[0]),
}
_LINKAGE = Keys(
    'A planar linkage.',
    dict,
    {
        **_UNITS,
        **_WRITTEN_OUT,
        **{name: optional_keys(keys) for name, keys in _SHORTHANDS.items()},
    },
    (_ShorthandOrLinks(),),
)


def linkage_schema() -> Schema:
    """Return the schema of a linkage file."""
    whole = parameters_schema(_LINKAGE)
    del whole['required']  # in the rule: a shorthand needs none of them
    return {'$schema': DIALECT, 'title': 'Linkage', **whole}


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
