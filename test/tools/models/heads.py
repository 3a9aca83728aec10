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


def head(rng):
    """Return the text of a robot; its tree goes up the first rod, and balls close the others."""
    text = ['<robot name="head"><link name="base"/>', _link('head')]
    for number in range(6):
        low = 2 * pi * (number // 2) / 3 + (-1) ** number * 0.2
        high = 2 * pi * (number // 2) / 3 + (-1) ** number * 0.85
        pivot = np.array([0.1 * cos(low), 0.1 * sin(low), 0.0])
        tip = pivot + ARM * np.array([-sin(low), cos(low), 0.0]) * (-1) ** number
        top = np.array([0.06 * cos(high), 0.06 * sin(high), HEIGHT])
        name = str(number + 1)
        axis = [-cos(low), -sin(low), 0.0]
        text += [_link(f'arm{name}'), _link(f'rod{name}')]
        text.append(_joint(f'motor{name}', 'base', f'arm{name}', pivot, axis))
        text += _ball(f'low{name}', f'arm{name}', f'rod{name}', tip - pivot, rng)
        if number:
            text.append(
                f'<loop_joint name="top{name}" type="spherical">'
                f'<link1 link="rod{name}" xyz="{_numbers(top - tip)}" rpy="0 0 0"/>'
                f'<link2 link="head" xyz="{_numbers(top - [0, 0, HEIGHT])}" rpy="0 0 0"/>'
                '</loop_joint>'
            )
        else:
            text += _ball('top1', 'rod1', 'neck', top - tip, rng)
            text.append(_link('neck'))
            text.append(
                '<joint name="fix" type="fixed"><parent link="neck"/><child link="head"/>'
                f'<origin xyz="{_numbers([0, 0, HEIGHT] - top)}"/></joint>'
            )
    return '\n'.join([*text, '</robot>'])


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


def _joint(name, parent, child, at, axis):
    return (
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_numbers(at)}"/><axis xyz="{_numbers(axis)}"/></joint>'
    )


def _numbers(vector):
    return ' '.join(repr(float(number)) for number in vector)
