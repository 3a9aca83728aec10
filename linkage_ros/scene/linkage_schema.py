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


"""The JSON Schema of a linkage file: what `linkage_ros.scene.linkage_file` reads."""

from __future__ import annotations

from linkage_ros.scene.schema import (
    CHARACTER,
    DIALECT,
    mapping,
    named,
    number,
    point,
    Schema,
    text,
)

_FARTHEST = 1e9
_HEAVIEST = 1e12
_STRONGEST = 1e12

_SHORTHANDS = ('four_bar', 'inverted_slider_crank')
_WRITTEN_OUT = ('links', 'input', 'joints')


def linkage_schema() -> Schema:
    """Return the schema of a linkage file."""
    whole = mapping('A planar linkage.', {**_keys(), **_shorthands()})
    return {
        '$schema': DIALECT,
        'title': 'Linkage',
        **whole,
        'if': {'anyOf': [{'required': [shorthand]} for shorthand in _SHORTHANDS]},
        'then': {'maxProperties': 1},
        'else': {'required': list(_WRITTEN_OUT)},
    }


def _keys() -> dict[str, Schema]:
    place = point('where the point lies in the frame of its link: [x, y] [m]', _FARTHEST)
    return {
        'links': named(
            'Links, each with its points; a point on two links is a pin; one link is the ground.',
            named('points of the link, by name', place),
        ),
        'input': _input(),
        'assembly': named(
            'Of each pin or slider that closes a dyad, the side on which it lies.',
            _choice('the side', ('left', 'right', 'ahead', 'behind')),
        ),
        'sliders': named('Points that stay on lines of other links, by name.', _slider()),
        'joints': {
            **named('What is published, in this order, by name.', _joint()),
            'minProperties': 1,
        },
        'traced': {
            'description': 'Points whose paths are drawn.',
            'type': 'array',
            'items': text('a point'),
        },
        'pose': _pose(),
        'masses': named('What the links weigh, by their names.', _mass()),
    }


def _shorthands() -> dict[str, Schema]:
    lengths = {
        key: number(f'{link} [m]', above=0.0, most=_FARTHEST)
        for key, link in zip('abcd', ('crank', 'coupler', 'rocker', 'ground'), strict=True)
    }
    left, ahead = ('left', 'right'), ('ahead', 'behind')
    return {
        'four_bar': mapping(
            'A four-bar by the lengths of its links; stands for a file written out.',
            {
                **lengths,
                'assembly': _choice('side of A→O4 on which B lies', left, left[0]),
                **_limits_of('coupler_joint', 'rocker_joint'),
            },
            required=tuple(lengths),
        ),
        'inverted_slider_crank': mapping(
            'A crank whose rod slides through a swivel; stands for a file written out.',
            {
                'a': number('crank [m]', above=0.0, most=_FARTHEST),
                'swivel': point("the swivel from the crank's pivot: [x, y] [m]", _FARTHEST),
                'assembly': _choice('side of B on which the swivel lies', ahead, ahead[0]),
                **_limits_of('rod_joint', 'rod_slide'),
            },
            required=('a', 'swivel'),
        ),
    }


def _input() -> Schema:
    """Return the schema of one input, or a list of them."""
    one = {
        **mapping(
            'The driven joint; several in a list.',
            {
                'joint': text('its name in crank messages'),
                'parent': text('the link that carries the motor'),
                'child': text('the link that is turned'),
                'slider': text('the slider that is driven, in the place of parent and child'),
                **_limits(),
            },
            required=('joint',),
        ),
        **_either_slider,
    }
    return {
        'description': one['description'],
        'if': {'type': 'array'},
        'then': {'minItems': 1, 'items': one},
        'else': one,
    }


def _joint() -> Schema:
    return {
        **mapping(
            "The child's angle less the parent's [rad], or the slide of a slider [m].",
            {
                'parent': text('the link from which the angle is measured'),
                'child': text('the link whose angle it is'),
                'slider': text('the slider, in the place of parent and child'),
                **_limits(),
            },
        ),
        **_either_slider,
    }


def _limits() -> dict[str, Schema]:
    """Return the schemas of what a joint of the machine can do."""
    return {
        'limits': {
            'description': 'between which the joint stays: [low, high] [rad or m]; '
            '-.inf or .inf for no limit on a side',
            'type': 'array',
            'minItems': 2,
            'maxItems': 2,
            # The lower one may be -.inf, the upper one .inf: JSON Schema knows them as numbers.
            'items': {'type': 'number'},
        },
        'velocity': number('its greatest rate [rad/s or m/s]', above=0.0, most=_FARTHEST),
        'effort': number('its greatest torque or force [N·m or N]', above=0.0, most=_STRONGEST),
    }


def _limits_of(*joints: str) -> dict[str, Schema]:
    """Return the schemas by which a shorthand gives its joints limits."""
    return {
        'input': mapping('What the driven joint can do.', _limits()),
        'joints': mapping(
            'What the published joints can do, by their names.',
            {name: mapping('What the joint can do.', _limits()) for name in joints},
        ),
    }


_either_slider: Schema = {
    'if': {'required': ['slider']},
    'then': {'properties': {'parent': False, 'child': False}},
    'else': {'required': ['parent', 'child']},
}


def _slider() -> Schema:
    return {
        **mapping(
            'A point that stays on a line of the link `along`.',
            {
                'point': text('the point; no point of `along`'),
                'along': text('the link that carries the line'),
                'through': text('point of `along` on the line; the slide is measured from it'),
                'direction': point('of the line, in the frame of `along`: [x, y]', _FARTHEST),
                'block': {
                    **text('the link that slides without turning', f'^{CHARACTER}*$'),
                    'default': '',
                },
                'angle': {
                    **number(
                        'angle of the block less that of `along` [rad]',
                        least=-_FARTHEST,
                        most=_FARTHEST,
                    ),
                    'default': 0,
                },
            },
            required=('point', 'along', 'through', 'direction'),
        ),
        'if': {'required': ['block']},
        'else': {'properties': {'angle': False}},
    }


def _pose() -> Schema:
    return mapping(
        'Where the linkage starts; with points, where the iteration of links does that no dyad '
        'covers.',
        {
            'inputs': {
                'description': 'a value for each input [rad or m]',
                'type': 'array',
                'items': number('a value', least=-_FARTHEST, most=_FARTHEST),
            },
            'points': named(
                'points of iterated links in the frame of the ground, roughly',
                point('[x, y] [m]', _FARTHEST),
            ),
        },
        required=('inputs',),
    )


def _mass() -> Schema:
    return mapping(
        'What a link weighs.',
        {
            'mass': number('mass [kg]', above=0.0, most=_HEAVIEST),
            'center': point("centre of mass in the link's frame: [x, y] [m]", _FARTHEST),
            'inertia': number(
                'moment of inertia about the centre of mass [kg·m²]', least=0.0, most=_HEAVIEST
            ),
        },
        required=('mass', 'center', 'inertia'),
    )


def _choice(description: str, words: tuple[str, ...], default: str = '') -> Schema:
    schema: Schema = {'description': description, 'enum': list(words)}
    return {**schema, 'default': default} if default else schema
