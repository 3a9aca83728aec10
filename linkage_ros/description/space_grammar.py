# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""The keys of a spatial linkage file, declared once; a file with a key `points` is one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from linkage_ros.description.grammar import DIALECT, InsteadOf, ListOf, Named, NameOrNames
from linkage_ros.description.linkage_grammar import (
    by_name,
    FARTHEST,
    HEAVIEST,
    IN_BOTH,
    LIMITS,
    MASS_OF_ROD,
    MOST_LINKS,
    Moves,
    planar_schema,
    RATIO,
    split_limits,
    UNITS,
    WHOLE_BODY,
)
from linkage_ros.description.parameters import (
    declare,
    Keys,
    Number,
    number,
    NumberList,
    parameters_schema,
    Parts,
    Schema,
    text,
    TextOf,
)
from linkage_ros.description.section import Section
from linkage_ros.kinematics import Ratio

_MOMENTS = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')

_MOST_POINTS = 2000
"""Bound on the points of a spatial linkage; at it a check takes seconds."""


@dataclass(frozen=True, slots=True)
class Place(NumberList):
    """Three finite numbers [x, y, z], each within ±most."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> Any:
        return content.place(key, most=self.most, unit=self.unit)

    def json_schema(self) -> Schema:
        return {**NumberList.json_schema(self), 'minItems': 3, 'maxItems': 3}


@dataclass(frozen=True, slots=True)
class _Tensor(NumberList):
    """Six finite numbers [ixx, ixy, ixz, iyy, iyz, izz]."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> tuple[float, ...]:
        moments = NumberList.read(self, content, key, parts, folder)
        if len(moments) != len(_MOMENTS):
            raise content.error(
                key, f'has {len(moments)} numbers', f'write [{", ".join(_MOMENTS)}]'
            )
        return moments

    def json_schema(self) -> Schema:
        return {**NumberList.json_schema(self), 'minItems': 6, 'maxItems': 6}


@dataclass(frozen=True, slots=True)
class _TwoPoints(ListOf):
    """The names of two points."""

    def read(self, content: Section, key: str, parts: Parts, folder: str) -> tuple[str, ...]:
        names = content.texts(key)
        if len(names) != 2 or names[0] == names[1]:
            reason = f'{list(names)} does not name two points'
            raise content.error(key, reason, 'write [ONE, OTHER], two points')
        return tuple(names)

    def json_schema(self) -> Schema:
        return {**ListOf.json_schema(self), 'minItems': 2, 'maxItems': 2}


def _joint(**values: Any) -> dict[str, Any]:
    limits = split_limits(values)
    return {**values, 'limits': limits}


_ENDS = {
    'parent': text('the link that carries it, or the ground'),
    'child': text('the link that it moves'),
}
_HINGE = Keys(
    'An axis about which the child turns on the parent.',
    _joint,
    {
        **_ENDS,
        'at': declare(Place('a point of the axis: [x, y, z]', 'm', FARTHEST), None),
        'axis': declare(Place('direction of the axis: [x, y, z]', '', FARTHEST), None),
        'through': declare(
            _TwoPoints('two points of the axis, which leads from one to the other',
                       TextOf('a point')),
            None,
        ),
        'value': number('its angle in the pose', 0.0, unit='rad', least=-FARTHEST, most=FARTHEST),
        **LIMITS,
    },
    (InsteadOf('through', ('at', 'axis')), Moves(False)),
)  # fmt: skip
_SLIDE = Keys(
    'A direction along which the child moves on the parent, and does not turn.',
    _joint,
    {
        **_ENDS,
        'axis': declare(Place('the direction: [x, y, z]', '', FARTHEST)),
        'value': number('its length in the pose', 0.0, unit='m', least=-FARTHEST, most=FARTHEST),
        **LIMITS,
    },
    (Moves(True),),
)
_BALL = Keys(
    'A ball joint that is published: NAME_x, NAME_y and NAME_z are hinges about the axes of the '
    'ground in the pose, one after the other; singular where NAME_y is at 90°.',
    dict,
    {**_ENDS, 'at': declare(Place('its centre: [x, y, z]', 'm', FARTHEST))},
)
_MASS = Keys(
    'Mass properties of a link.',
    dict,
    {
        'mass': MASS_OF_ROD,
        'center': declare(
            Place(
                'centre of mass in the pose, in the frame of the ground: [x, y, z]', 'm', FARTHEST
            ),
            None,
        ),
        'inertia': declare(
            _Tensor(
                'moments of inertia about the centre of mass in the pose, about the axes of '
                'the ground: [ixx, ixy, ixz, iyy, iyz, izz]',
                'kg·m²',
                HEAVIEST,
            ),
            None,
        ),
    },
    WHOLE_BODY,
)
_RATIO = Keys(
    RATIO.meaning,
    Ratio,
    {
        **RATIO.entries,
        'also': declare(
            Named(
                'further joints that add to it, each with its ratio',
                Number('a ratio', '', -FARTHEST, FARTHEST),
                MOST_LINKS,
            ),
            None,
        ),
    },
)
SPACE = Keys(
    'A spatial linkage: points in one pose, and what joins the links there.',
    dict,
    {
        **UNITS,
        'points': declare(
            Named('Points in the pose, in the frame of the ground, by name.',
                  Place('[x, y, z]', 'm', FARTHEST), _MOST_POINTS),
        ),
        'links': declare(
            Named(
                'Links, each with its points; a point of two links is a ball joint, a link of two '
                'points a rod.',
                ListOf('points of the link', TextOf('a point')),
                MOST_LINKS,
            ),
            None,
        ),
        'hinges': by_name('Hinges between links, by name.', _HINGE),
        'balls': by_name('Ball joints between links that are published, by name.', _BALL),
        'slides': by_name('Slides between links, by name.', _SLIDE),
        'struts': declare(
            Named(
                'Pairs of points whose distance is a joint, such as a cylinder, by name.',
                _TwoPoints('its two points', TextOf('a point')),
                MOST_LINKS,
            ),
            None,
        ),
        'input': declare(
            NameOrNames('The driven hinge, slide or strut; several in a list.', TextOf('a joint'))
        ),
        'joints': declare(
            ListOf(
                'Published joints, in this order; all others that are not inputs if left out.',
                TextOf('a joint'),
            ),
            None,
        ),
        **IN_BOTH,
        'ratios': by_name('Joints that follow others: gears, belts, racks, mimic.', _RATIO),
        'masses': by_name('Masses of the links, by link name.', _MASS),
    },
)  # fmt: skip


def linkage_schema() -> Schema:
    """Return the schema of a linkage file, which is spatial if it has points of its own."""
    planar, spatial = planar_schema(), parameters_schema(SPACE)
    parts = planar.pop('$defs', {}) | spatial.pop('$defs', {})
    return {
        '$schema': DIALECT,
        'title': 'Linkage',
        '$defs': parts,
        'if': {'required': ['points']},
        'then': spatial,
        'else': planar,
    }
