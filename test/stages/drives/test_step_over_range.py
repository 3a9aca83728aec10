# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The step of the torque drive is judged over the whole range of the crank, not where it starts.

The reference is the textbook's four-bar: a spring on the rocker has the lever ω4/ω2 = a·sin(θ2 −
θ3) / (c·sin(θ4 − θ3)) (R. L. Norton, Design of Machinery, ch. 6), which is 0 at a dead centre.
"""

from math import acos, pi, sin
import re

from linkage_ros.errors import FileError
import numpy as np
import pytest

from ...support.four_bar import four_bar_angles, GALLERY
from ...support.scenes import four_bar_text, pipeline_of

LENGTHS = a, b, c, d = GALLERY
DEAD_CENTRE = acos(((a + b) ** 2 + d**2 - c**2) / (2.0 * (a + b) * d))
"""Crank and coupler in line, stretched: the rocker stands still."""
SMALL = 1e-12
"""Mass and inertia of links that are not meant to count."""
INERTIA = 1e-3


def lever(crank):
    """Return the rate of the rocker at a crank rate of 1."""
    coupler, rocker = four_bar_angles(crank)
    return a * sin(crank - coupler) / (c * sin(rocker - coupler))


def fastest(drive, loads, start, limits='', rocker_inertia=SMALL):
    """Return what a scene is refused for: how fast its motion changes, in [1/s]."""
    masses = [(SMALL, 0.0, INERTIA), (SMALL, 0.0, SMALL), (SMALL, 0.0, rocker_inertia)]
    linkage = four_bar_text(*LENGTHS, masses, crank=limits)
    text = f'drive: {{torque: {{start: {start!r}, step: 0.1{drive}}}}}\n{loads}'
    with pytest.raises(FileError) as refused:
        pipeline_of(text, linkage)
    (rate,) = re.findall(r'motion changes at ([\d.e+]+)/s there', str(refused.value))
    return float(rate)


# The range of the crank, as the limits of its joint and the angles that they leave.
RANGES = {
    'a whole turn': ('', (-pi, pi)),
    'a narrow range about the dead centre': (
        f', limits: [{DEAD_CENTRE - 0.1}, {DEAD_CENTRE + 0.2}]',
        (DEAD_CENTRE - 0.1, DEAD_CENTRE + 0.2),
    ),
}


@pytest.mark.parametrize('name', RANGES)
@pytest.mark.parametrize('away', [0.0, 0.05])
def test_step_check_uses_the_longest_spring_lever(name, away):
    limits, (low, high) = RANGES[name]
    springs = 'loads: {{joint_springs: {{{}: {{stiffness: 1.0e4}}}}}}'
    start = DEAD_CENTRE + away
    of_crank = fastest('', springs.format('crank_joint'), start, limits)
    of_rocker = fastest('', springs.format('rocker_joint'), start, limits)
    longest = max(abs(lever(crank)) for crank in np.linspace(low, high, 20_000))
    assert of_rocker / of_crank == pytest.approx(longest, rel=0.01)


@pytest.mark.parametrize('start', [DEAD_CENTRE, 0.0, -2.0])
def test_step_check_uses_the_least_inertia(start):
    """The rocker turns no inertia at the dead centre, wherever the crank starts."""
    motor = ', motor: {torque_constant: 1.0, command: voltage, resistance: 1.0}'
    alone = fastest(motor, '', start)
    with_rocker = fastest(motor, '', start, rocker_inertia=INERTIA)
    assert with_rocker == pytest.approx(alone, rel=0.01)
