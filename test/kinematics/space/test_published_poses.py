# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Poses of a delta robot and of a hexapod are those that others have published."""

import csv
from math import cos, degrees, radians, sin, sqrt
from pathlib import Path

import linkage_ros as lr
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
import yaml


def load_points(folder, points, **parts):
    """Return the closure of a spatial file."""
    listed = {name: [*map(float, place)] for name, place in points.items()}
    path = folder / 'linkage.yaml'
    path.write_text(yaml.safe_dump({'points': listed, **parts}))
    return lr.load(path)


SLIDES = {
    'x': {'parent': 'ground', 'child': 'xs', 'axis': [1, 0, 0]},
    'y': {'parent': 'xs', 'child': 'ys', 'axis': [0, 1, 0]},
    'z': {'parent': 'ys', 'child': 'platform', 'axis': [0, 0, 1]},
}

# R. L. Williams II, The Delta Parallel Robot: Kinematics Solutions, Ohio University 2016, with
# the dimensions of an ABB IRB 360-1/1600: "snapshot examples" of both problems. There an arm is
# at 0 where it is level, and turns down.
W_BASE, UPPER, LOWER, U_PLATFORM = 0.164, 0.524, 1.244, 0.044
FORWARD = [
    ((0.0, 0.0, 0.0), (0.0, 0.0, -1.065)),
    ((10.0, 20.0, 30.0), (0.108, -0.180, -1.244)),
]
INVERSE = [
    ((0.0, 0.0, -0.9), (-20.5, -20.5, -20.5)),
    ((0.3, 0.5, -1.1), (47.5, -11.6, 21.4)),
]


def delta(folder, **parts):
    points, hinges, links = {}, {}, {}
    depth = -sqrt(LOWER**2 - (W_BASE + UPPER - U_PLATFORM) ** 2)
    for number, azimuth in enumerate((-90.0, 30.0, 150.0), 1):
        way = np.array([cos(radians(azimuth)), sin(radians(azimuth)), 0.0])
        points[f'elbow{number}'] = (W_BASE + UPPER) * way
        points[f'ball{number}'] = U_PLATFORM * way + [0.0, 0.0, depth]
        links[f'arm{number}'] = [f'elbow{number}']
        links[f'rod{number}'] = [f'elbow{number}', f'ball{number}']
        hinges[f'a{number}'] = {
            'parent': 'ground', 'child': f'arm{number}',
            'at': (W_BASE * way).tolist(), 'axis': [-float(way[1]), float(way[0]), 0],
        }  # fmt: skip
    links['platform'] = ['ball1', 'ball2', 'ball3']
    slides = SLIDES | {'z': SLIDES['z'] | {'value': depth}}
    return load_points(folder, points, links=links, hinges=hinges, slides=slides, **parts)


@pytest.mark.parametrize(('angles', 'platform'), FORWARD)
def test_delta_platform_equals_published_poses(tmp_path, angles, platform):
    closure = delta(tmp_path, input=['a1', 'a2', 'a3'], joints=['x', 'y', 'z'])
    found = closure.position(*map(radians, angles)).joints
    # The dimensions of the source are rounded to a millimetre, each by itself.
    assert found == pytest.approx(platform, abs=1e-3)


@pytest.mark.parametrize(('platform', 'angles'), INVERSE)
def test_delta_arm_angles_equal_published_values(tmp_path, platform, angles):
    closure = delta(tmp_path, input=['x', 'y', 'z'], joints=['a1', 'a2', 'a3'])
    found = closure.position(*platform).joints
    assert [*map(degrees, found)] == pytest.approx(angles, abs=0.05)


# P. Dietmaier, The Stewart-Gough platform of general geometry can have 40 real postures, in
# Advances in Robot Kinematics 1998; the postures to 15 digits from PHCpack's demonstration
# stewgou40: the platform's first point n and axes a1, a2; rco is the inverse of the condition of
# the equations.
BASE = np.array([
    [0.0, 0.0, 0.0], [1.107915, 0.0, 0.0], [0.549094, 0.756063, 0.0],
    [0.735077, -0.223935, 0.525991], [0.514188, -0.526063, -0.368418],
    [0.590473, 0.094733, -0.205018],
])  # fmt: skip
PLATFORM = np.array([
    [0.0, 0.0, 0.0], [0.542805, 0.0, 0.0], [0.956919, -0.528915, 0.0],
    [0.665885, -0.353482, 1.402538], [0.478359, 1.158742, 0.107672],
    [-0.137087, -0.235121, 0.353913],
])  # fmt: skip
LEGS = (1.0, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071)

with (Path(__file__).parent / 'forty_postures.csv').open(newline='') as _file:
    POSTURES = [{name: float(cell) for name, cell in row.items()} for row in csv.DictReader(_file)]


def hexapod(folder, place, turn):
    numbers = range(1, 7)
    points = {f'p{k}': BASE[k - 1] for k in numbers}
    points |= {f'q{k}': place + turn.apply(PLATFORM[k - 1]) for k in numbers}
    names = [f'leg{k}' for k in numbers]
    return load_points(
        folder,
        points,
        links={'ground': [f'p{k}' for k in numbers], 'platform': [f'q{k}' for k in numbers]},
        slides=SLIDES | {'z': SLIDES['z'] | {'child': 'zs'}},
        balls={'r': {'parent': 'zs', 'child': 'platform', 'at': points['q1'].tolist()}},
        struts={f'leg{k}': [f'p{k}', f'q{k}'] for k in numbers},
        input=names,
        joints=['x', 'y', 'z', 'r_x', 'r_y', 'r_z'],
    )


@pytest.mark.sample(2)
@pytest.mark.parametrize('number', range(1, len(POSTURES) + 1))
def test_hexapod_reaches_all_forty_published_postures(tmp_path, number):
    """Each is reached from a pose that is drawn beside it: two digits of it, or four."""
    posture = POSTURES[number - 1]
    place, first, second = (
        np.array([posture[f'{vector}{axis}'] for axis in (1, 2, 3)])
        for vector in ('n', 'a1', 'a2')
    )
    axes = np.column_stack([first, second, np.cross(first, second)])
    expected = place + PLATFORM @ axes.T
    legs = np.linalg.norm(expected - BASE, axis=1)
    # The equations of the source have ten digits.
    assert legs == pytest.approx(LEGS, abs=1e-9)
    digits = 4 if posture['rco'] < 1e-4 else 2
    drawn = Rotation.from_rotvec(np.round(Rotation.from_matrix(axes).as_rotvec(), digits))
    closure = hexapod(tmp_path, np.round(place, digits), drawn)
    position = closure.position(*legs)
    found = [position.points[f'q{k}'] for k in range(1, 7)]
    assert np.array(found) == pytest.approx(expected, abs=2e-15 / posture['rco'])
