# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The keys of a linkage file, declared once: how each is read, and its JSON Schema."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, MISSING, replace
from functools import partial
from itertools import chain, repeat
from math import inf
from typing import Any

from linkage_ros.description.grammar import (
    InsteadOf,
    LENGTH_UNIT,
    LimitPair,
    ListOf,
    Named,
    OneOrMore,
    OnlyWith,
    optional_keys,
    Together,
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
    Rule,
    Schema,
    text,
    TextOf,
    whole_number,
)
from linkage_ros.description.section import Section
from linkage_ros.description.units import ANGLES, Units
from linkage_ros.errors import DefinitionError, quote
from linkage_ros.kinematics import (
    AssemblyPose,
    check_weighed,
    Input,
    Limits,
    Ratio,
    RevoluteJoint,
    SlideJoint,
    Slider,
)

MOST_LINKS = 400
"""Bound on the links, sliders, joints and ratios; at it a check takes seconds."""

FARTHEST = 1e9
"""Bound on coordinates, in [m]; below it no square overflows."""

HEAVIEST = 1e12
"""Bound on masses, in [kg], and on moments of inertia, in [kg·m²]."""

STRONGEST = 1e12
"""Bound on efforts, in [N·m] or [N]."""

_Values = dict[str, Any]


class _SlidesOnSlider(Rule):
    """A joint with a slider slides."""

    def check(self, content: Section) -> None:
        content.units = replace(content.units, slides='slider' in content)


@dataclass(frozen=True, slots=True)
class Moves(Rule):
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
    try:
        check_weighed(parts['link'], (name,))
    except DefinitionError as error:
        raise content.error(name, error.reason, error.remedy) from None


def _refuse_input(content: Section, name: str, parts: Parts) -> None:
    """Refuse the input among the published joints."""
    if name in parts['input']:
        raise content.error(name, 'is the input joint', 'publish the dependent joints')


def _length(meaning: str) -> Any:
    return number(meaning, unit='m', above=0.0, most=FARTHEST)


def _coordinate(meaning: str, default: float, unit: str = '') -> Any:
    return number(meaning, default, unit=unit, least=-FARTHEST, most=FARTHEST)


_PLANES = ('xy', 'xz', 'yz')
_LEFT, _AHEAD = ('left', 'right'), ('ahead', 'behind')
LIMITS = {
    'limits': declare(
        LimitPair(
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


def is_rod(content: Section, link: str, values: _Values, points: Sequence[object]) -> bool:
    """Return whether a mass is that of a rod between two points; refuse one of another link."""
    if 'center' in values or not values['mass']:
        return False
    if len(points) != 2:
        count = f'{len(points)} point{"s" * (len(points) != 1)}'
        raise content.error(
            f'masses.{link}',
            f'is a mass alone, of a rod between two points, and {quote(link)} has {count}',
            'write center and inertia too',
        )
    return True


def split_limits(values: _Values) -> Limits:
    """Return the limits of a joint and take their keys out; `checks` judges them."""
    low, high = values.pop('limits', (-inf, inf))
    return Limits(low, high, values.pop('velocity', inf), values.pop('effort', inf))


def _build_input(**values: Any) -> Input:
    return Input(limits=split_limits(values), **values)


def _build_joint(**values: Any) -> RevoluteJoint | SlideJoint:
    limits = split_limits(values)
    if 'slider' in values:
        return SlideJoint(limits=limits, **values)
    return RevoluteJoint(limits=limits, **values)


_ENDS = {
    'parent': text('the link from which the angle is measured', None),
    'child': text('the link whose angle it is', None),
    'slider': text('the slider, instead of parent and child', None),
    **LIMITS,
}
_LINKS = ('parent', 'child')
_SLIDER_OR_LINKS = (InsteadOf('slider', _LINKS), _SlidesOnSlider())
_INPUT = Keys(
    'The driven joint; several in a list.',
    _build_input,
    {'joint': text('a name for the driven joint, as in crank messages'), **_ENDS},
    _SLIDER_OR_LINKS,
)
_JOINT = Keys(
    "The child's angle less the parent's [rad], or the slide of a slider [m].",
    _build_joint,
    {
        **_ENDS,
        'turns': whole_number('turns that are added to the angle', None, least=-1000, most=1000),
    },
    (InsteadOf('slider', _LINKS, ('turns',)), _SlidesOnSlider()),
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
        'angle': _coordinate('angle of the block relative to `along`', 0.0, 'rad'),
    },
    (OnlyWith('angle', 'block'),),
)
RATIO = Keys(
    'A published joint, as ratio · other joint + offset.',
    Ratio,
    {
        'of': text('an input or a published joint, which this one follows'),
        'ratio': _coordinate(
            'its displacement [rad or unit of length] when the other joint moves by 1', 1.0
        ),
        'offset': _coordinate('its value where the other joint is at 0', 0.0, 'rad or m'),
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
MASS_OF_ROD = number(
    'mass; alone that of a thin rod between the two points of the link, or 0 of a massless link',
    unit='kg',
    least=0.0,
    most=HEAVIEST,
)
WHOLE_BODY = (Together(('center', 'inertia')),)
_MASS = Keys(
    'Mass properties of a link.',
    dict,
    {
        'mass': MASS_OF_ROD,
        'center': point(
            "centre of mass in the link's frame: [x, y]", None, unit='m', most=FARTHEST
        ),
        'inertia': number(
            'moment of inertia about the centre of mass',
            None,
            unit='kg·m²',
            least=0.0,
            most=HEAVIEST,
        ),
    },
    WHOLE_BODY,
)
_PLACE = Point('where the point lies in the frame of its link: [x, y]', 'm', FARTHEST)


def by_name(meaning: str, of: Keys, default: Any = None, **rules: Any) -> Any:
    """Declare mappings by name."""
    return declare(Named(meaning, ParameterGroup(of.meaning, of), MOST_LINKS, **rules), default)


IN_BOTH = {
    'ratios': by_name('Joints that follow others: gears, belts, racks, mimic.', RATIO),
    'traced': declare(ListOf('Points whose paths are drawn.', TextOf('a point')), None),
}
"""Keys of planar and of spatial linkages."""


WRITTEN_OUT = {
    'axes': choice('Names of the axes of its plane: those of a robot.', _PLANES, _PLANES[0]),
    'links': declare(
        Named(
            'Links, each with its points; a point on two links is a pin; one link is the ground.',
            Named('points of the link, by name', _PLACE),
            MOST_LINKS,
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
    'sliders': by_name('Points that stay on lines of other links, by name.', _SLIDER),
    'joints': by_name(
        'Published joints, in this order, by name.', _JOINT, MISSING, least=1, check=_refuse_input
    ),
    **IN_BOTH,
    'pose': optional_keys(_POSE),
    'masses': by_name('Masses of the links, by link name.', _MASS, check=_refuse_mass),
}


class _ShorthandOrLinks(Rule):
    """A linkage is written out, or by one shorthand; the written-out keys are read elsewhere."""

    def json_schema(self) -> Schema:
        needed = [key for key, entry in WRITTEN_OUT.items() if entry.default is MISSING]
        return {
            'if': {'anyOf': [{'required': [shorthand]} for shorthand in SHORTHANDS]},
            'then': {
                'propertyNames': {'enum': [*UNITS, *SHORTHANDS]},
                'not': {'required': list(SHORTHANDS)},
            },
            'else': {'required': needed},
        }


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
    return Keys(meaning, _written_limits, LIMITS, (Moves(slides),))


def _written_limits(**values: Any) -> _Values:
    return {key: list(value) if key == 'limits' else value for key, value in values.items()}


def _common_keys(side: Any, **joints: bool) -> _Values:
    """Return the keys of every shorthand, with the joints that it publishes, sliding or not."""
    limits = {
        name: _joint_limits('Limits of the joint.', slides) for name, slides in joints.items()
    }
    limited = Keys(
        'Limits of the published joints, by name.',
        dict,
        {name: optional_keys(of) for name, of in limits.items()},
    )
    return {
        'assembly': side,
        'pose': optional_keys(_POSE),
        'input': optional_keys(_joint_limits('Limits of the driven joint.', slides=False)),
        'joints': optional_keys(limited),
    }


SHORTHANDS = {
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
UNITS = {'units': LENGTH_UNIT, 'angles': choice('Unit of the angles.', ANGLES, ANGLES[0])}
LINKAGE = Keys(
    'A planar linkage.',
    dict,
    {**UNITS, **WRITTEN_OUT, **{name: optional_keys(keys) for name, keys in SHORTHANDS.items()}},
    (_ShorthandOrLinks(),),
)


def ratio_in_si(ratio: Ratio, name: str, unit_of: Mapping[str, str | None], units: Units) -> Ratio:
    """
    Return the ratio of a joint in SI units: metres for a radian, radians for a metre.

    ``unit_of`` has the unit of each joint.
    """

    def factor_in_si(factor: float, of: str) -> float:
        in_si = units.to_si(factor, 'm' if unit_of.get(name) == 'm' else '')
        return in_si / units.to_si(1.0, 'm') if unit_of.get(of) == 'm' else in_si

    also = {of: factor_in_si(factor, of) for of, factor in ratio.also.items()}
    return replace(ratio, ratio=factor_in_si(ratio.ratio, ratio.of), also=also)


def read_units(content: Section) -> None:
    """Read the units of a linkage file, planar or spatial."""
    content.units = Units(*(LINKAGE.read_key(content, key, {}) for key in UNITS))


def planar_schema() -> Schema:
    """Return the schema of a planar linkage file."""
    whole = parameters_schema(LINKAGE)
    del whole['required']  # in the rule: a shorthand needs none of them
    return whole
