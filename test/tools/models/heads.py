# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A head on six motors, as a desktop robot has it: on rods whose balls are three hinges each."""

from itertools import pairwise
from math import cos, pi, sin

import numpy as np

ARM, HEIGHT = 0.04, 0.17

WAYS = ('ball', 'weld', 'hinge', 'sleeve', 'slide')
"""
How a leg is written: with a ball at its end, of two rods that are welded, that a hinge along them
joins, or a sleeve between two such hinges, or that slide in each other and are driven.
"""

IDLE_TURNS = {'ball': 1, 'weld': 1, 'hinge': 2, 'sleeve': 3, 'slide': 1}


def head(rng, ways=('ball',) * 6):
    """
    Return the text of a robot, in any order; its tree goes up the first leg to the head.

    The first leg has one rod, or two that slide.
    """
    text = [_link('base'), _link('head'), _link('neck')]
    for number, way in enumerate(ways):
        low = 2 * pi * (number // 2) / 3 + (-1) ** number * 0.2
        high = 2 * pi * (number // 2) / 3 + (-1) ** number * 0.85
        pivot = np.array([0.1 * cos(low), 0.1 * sin(low), 0.0])
        tip = pivot + ARM * np.array([-sin(low), cos(low), 0.0]) * (-1) ** number
        top = np.array([0.06 * cos(high), 0.06 * sin(high), HEIGHT])
        name, middle = str(number + 1), 0.6 * tip + 0.4 * top
        motor, rod, end = f'motor{name}', f'rod{name}', f'rod{name}'
        text.append(_link(rod))
        if way == 'slide':
            end = f'end{name}'
            text += [_link(end), *_ball(f'low{name}', 'base', rod, tip, rng)]
            way_up = (top - tip) / np.linalg.norm(top - tip)
            text.append(_joint(motor, rod, end, middle - tip, way_up, 'prismatic'))
        else:
            axis = [-cos(low), -sin(low), 0.0]
            text += [_link(f'arm{name}'), _joint(motor, 'base', f'arm{name}', pivot, axis)]
            text += _ball(f'low{name}', f'arm{name}', rod, tip - pivot, rng)
        at = middle if way == 'slide' else tip
        if not number:
            text += _ball('top1', end, 'neck', top - at, rng)
            text.append(_joint('fix', 'neck', 'head', [0, 0, HEIGHT] - top, kind='fixed'))
        elif way in ('ball', 'slide'):
            text.append(_loop(f'top{name}', 'spherical', (end, top - at), top - [0, 0, HEIGHT]))
        else:
            text += _ball(f'top{name}', 'head', f'upper{name}', top - [0, 0, HEIGHT], rng)
            text.append(_link(f'upper{name}'))
            if way == 'sleeve':
                end = f'sleeve{name}'
                text += [_link(end), _joint(f'turn{name}', rod, end, middle - tip, top - tip)]
            kind = 'fixed' if way == 'weld' else 'revolute'
            beside = middle - tip if end == rod else np.zeros(3)
            lower, upper = (end, beside), middle - top
            text.append(_loop(f'mid{name}', kind, lower, upper, f'upper{name}', top - tip))
    return '\n'.join(['<robot name="head">', *rng.permutation(text), '</robot>'])


def _ball(name, parent, child, at, rng):
    """Return three hinges through one point, along the axes of their parent in any order."""
    links = [parent, f'{name}_1', f'{name}_2', child]
    axes = rng.permutation(np.eye(3))
    return [
        *(_link(link) for link in links[1:3]),
        *(
            _joint(f'{name}_{letter}', *ends, [0, 0, 0] if number else at, axis)
            for number, (letter, ends, axis) in enumerate(
                zip('abc', pairwise(links), axes, strict=True)
            )
        ),
    ]


def _link(name):
    return f'<link name="{name}"/>'


def _joint(name, parent, child, at, axis=(1, 0, 0), kind='continuous'):
    limit = '<limit lower="-1" upper="1" effort="0" velocity="0"/>' * (kind == 'prismatic')
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_numbers(at)}"/><axis xyz="{_numbers(axis)}"/>{limit}</joint>'
    )


def _loop(name, kind, lower, upper, on='head', axis=(1, 0, 0)):
    link, place = lower
    return (
        f'<loop_joint name="{name}" type="{kind}">'
        f'<link1 link="{link}" xyz="{_numbers(place)}" rpy="0 0 0"/>'
        f'<link2 link="{on}" xyz="{_numbers(upper)}" rpy="0 0 0"/>'
        f'<parent_axis xyz="{_numbers(axis)}"/></loop_joint>'
    )


def _numbers(vector):
    return ' '.join(repr(float(number)) for number in vector)
