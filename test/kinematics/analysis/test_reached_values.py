# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What joints reach within the limits of others: against the geometry of an ankle by hand."""

from itertools import product
from math import atan2, cos, hypot, pi, sin

from linkage_ros.description import parse_yaml, read_any_closure
from linkage_ros.kinematics import find_reached_values
import numpy as np
import pytest

from ...support.scenes import FOUR_BAR, LINKAGES

ANKLE = (LINKAGES / 'space' / 'ankle_motors.yaml').read_text()
RODS = {
    'm1': ((0.0165, 0.146 - 0.150, 0.035, 0.150), (0.022, 0.015, -0.010)),
    'm2': ((-0.0165, 0.211 - 0.215, 0.040, 0.215), (0.022, -0.015, -0.010)),
}
"""Each bar's end about its motor (y, z), the motor's place (x, z), and the rod's other end."""
LOW, HIGH = -0.6, 0.6


def reached(text):
    return find_reached_values(read_any_closure(parse_yaml(text.encode(), 'linkage.yaml')))


def foot_end(foot, pitch, roll):
    """Return a point of the foot at pitch about y, then roll about x, 18 mm below."""
    x, y, z = foot[0], foot[1], foot[2] + 0.018
    y, z = y * cos(roll) - z * sin(roll), y * sin(roll) + z * cos(roll) - 0.018
    return x * cos(pitch) + z * sin(pitch), y, z * cos(pitch) - x * sin(pitch)


def rod_miss(name, motor, pitch, roll):
    """Return by how much the square of a rod's length is off."""
    (y, z, at_x, at_z), foot = RODS[name]
    bar = at_x, y * cos(motor) - z * sin(motor), at_z + y * sin(motor) + z * cos(motor)
    length = sum((a - b) ** 2 for a, b in zip((at_x, y, at_z + z), foot, strict=True))
    there = foot_end(foot, pitch, roll)
    return sum((a - b) ** 2 for a, b in zip(bar, there, strict=True)) - length


def motor_of(name, pitch, roll):
    """Return the motor's angle that is nearest to 0: of a·cos m + b·sin m = c."""
    (y, z, at_x, at_z), foot = RODS[name]
    x, fy, fz = foot_end(foot, pitch, roll)
    a, b = fy * y + (fz - at_z) * z, (fz - at_z) * y - fy * z
    length = sum((p - q) ** 2 for p, q in zip((at_x, y, at_z + z), foot, strict=True))
    c = 0.5 * (y * y + z * z + fy * fy + (fz - at_z) ** 2 + (x - at_x) ** 2 - length)
    middle, off = atan2(b, a), np.arccos(c / hypot(a, b))
    turns = [(middle + s * off + pi) % (2.0 * pi) - pi for s in (-1, 1)]
    return min(turns, key=abs)


def check(found, samples):
    """Hold a range against the extremes of samples of a fine grid, which lie within it."""
    for one, values in zip(found, samples, strict=True):
        assert one.low <= min(values) + 1e-9
        assert one.high >= max(values) - 1e-9
        assert (one.low, one.high) == pytest.approx((min(values), max(values)), abs=2e-3)


def test_ankle_pitch_and_roll_within_its_motors_limits():
    found = reached(ANKLE)
    assert [one.joint for one in found] == ['pitch', 'roll']
    assert all(one.within == ('m1', 'm2') and one.closes for one in found)
    ways = np.linspace(LOW, HIGH, 25)
    joints, near = [], {}
    for i, j in product(range(25), repeat=2):
        start = near.get((i, j - 1), near.get((i - 1, j)))
        if start is None:  # The corner is led to from the pose.
            start = (0.0, 0.0)
            for part in np.linspace(0.0, 1.0, 20):
                start = solve(start, part * LOW, part * LOW)
        near[i, j] = solve(start, ways[i], ways[j])
        joints.append(near[i, j])
    check(found, [*zip(*joints, strict=True)])


def solve(start, one, other):
    """Return pitch and roll near a start."""

    def misses(joints):
        return np.array([rod_miss('m1', one, *joints), rod_miss('m2', other, *joints)])

    pose = np.array(start)
    for _ in range(8):
        ways = [(misses(pose + step), misses(pose - step)) for step in 1e-6 * np.eye(2)]
        slopes = np.array([np.subtract(*ends) / 2e-6 for ends in ways]).T
        pose = pose - np.linalg.solve(slopes, misses(pose))
    assert max(map(abs, misses(pose))) < 1e-11
    return tuple(pose.tolist())


def test_ankle_motors_within_the_limits_of_its_angles():
    text = ANKLE.replace(', limits: [-0.6, 0.6]', '')
    for name, limits in (('pitch', '[-0.3, 0.2]'), ('roll', '[-0.25, 0.35]')):
        line = next(line for line in text.splitlines() if line.startswith(f'  {name}:'))
        text = text.replace(line, line.replace('}', f', limits: {limits}}}'))
    found = reached(text)
    assert [(one.joint, one.within) for one in found] == [
        (name, ('pitch', 'roll')) for name in RODS
    ]
    box = [*product(np.linspace(-0.3, 0.2, 60), np.linspace(-0.25, 0.35, 60))]
    check(found, [[motor_of(name, *joints) for joints in box] for name in RODS])


def test_reached_values_need_several_limited_inputs():
    assert reached(f'{FOUR_BAR[:-1]}, input: {{limits: [0.5, 2]}}}}') == []
    assert reached(ANKLE.replace(', limits: [-0.6, 0.6]', '')) == []
