# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Every linkage of the gallery turns through its whole range, where an independent solver has it.

`gallery.json` holds, for each file, the range of the input and the places of all points at some
inputs, in the frame of the ground. They come from Newton's method on the poses of all links, in
80-bit arithmetic and from random starts on the named sides, with a reader of its own: nothing of
this package. Every constraint is met there to 1e-16 m.
"""

from functools import cache
import json
from math import radians, remainder, sqrt, tau
from pathlib import Path

from linkage_ros.description import load
from linkage_ros.kinematics import Closure, Dyad, Iterated, Status
import pytest

from ..support.scenes import size_of

FOLDER = Path(__file__).parents[2] / 'config' / 'linkages'
EXPECTED = json.loads((Path(__file__).parent / 'gallery.json').read_text('utf-8'))

# The known dyads of each linkage, and the source.
KINDS = {
    'andrews_squeezer': 'RRR RRR RRR',
    'class_3': 'iterated',
    'double_rocker': 'RRR',
    'drag_link': 'RRR',
    'elliptic_trammel': 'RRP',
    'excavator_bucket': 'RRR RRR',
    'five_bar': 'RRR',
    'four_bar': 'RRR',
    'gripper': 'RRR RRR',
    'hoeken': 'RRR',
    'inverted_slider_crank': 'RPR',
    'jansen_leg': 'RRR RRR RRR',
    'klann_leg': 'RRR RRR',
    'parallelogram': 'RRR',
    'peaucellier': 'RRR RRR RRR',
    'scotch_yoke': 'RPP',
    'slider_crank': 'RRP',
    'stephenson_3': 'RRR RRR',
    'watt_1': 'RRR RRR',
    'whitworth_quick_return': 'RPR RRP',
    'windscreen_wiper': 'RRR RRR',
}


@cache
def closure_of(name: str) -> Closure:
    """Return a shipped linkage, built once in a process."""
    closure: Closure = load(name)
    return closure


def inputs_of(closure: Closure, name: str, count: int) -> list[tuple[float, ...]]:
    """Return inputs spread over the range that the independent solver found."""
    low, high = EXPECTED[f'{name}.yaml']['range']
    if len(closure.linkage.inputs) == 1:
        # Clear of the ends, where a limit has its last floats.
        return [(low + (high - low) * (i + 0.5) / count,) for i in range(count)]
    side = round(sqrt(count))
    steps = [(i + 0.5) / side for i in range(side)]
    return [tuple(a + (b - a) * t for a, b, t in zip(low, high, (s, t), strict=True))
            for s in steps for t in steps]  # fmt: skip


def test_every_gallery_linkage_is_tested():
    files = {file.stem for file in FOLDER.glob('*.yaml')}
    assert files == set(KINDS)
    assert files == {name.removesuffix('.yaml') for name in EXPECTED}


@pytest.mark.parametrize('name', KINDS)
def test_gallery_linkage_has_its_known_dyads(name):
    groups = closure_of(name).structure.groups
    kinds = [
        group.kind if isinstance(group, Dyad) else 'iterated'
        for group in groups
        if isinstance(group, Dyad | Iterated)
    ]
    assert ' '.join(kinds) == KINDS[name]


@pytest.mark.parametrize('name', KINDS)
def test_gallery_points_equal_the_independent_solver(name):
    closure = closure_of(name)
    expected = EXPECTED[f'{name}.yaml']
    size = size_of(closure)
    for inputs, places in zip(expected['inputs'], expected['points'], strict=True):
        values = inputs if isinstance(inputs, list) else [inputs]
        position = closure.position(*values)
        assert position.status is Status.CLOSED, values
        points = closure.points(position)
        for key, (x, y) in places.items():
            link, point = key.split('.')
            assert abs(points[link, point] - complex(x, y)) < 1e-14 * size, (values, key)


@pytest.mark.parametrize('name', KINDS)
def test_gallery_linkage_closes_to_rounding_over_its_range(name):
    closure = closure_of(name)
    size = size_of(closure)
    worst = 0.0
    for values in inputs_of(closure, name, 400):
        position = closure.position(*values)
        assert position.status is Status.CLOSED, values
        worst = max(worst, closure.residual(position))
    assert worst < 2e-15 * size


@pytest.mark.parametrize('name', [name for name in KINDS if name != 'five_bar'])
def test_gallery_range_equals_the_independent_solver(name):
    closure = closure_of(name)
    low, high = EXPECTED[f'{name}.yaml']['range']
    if closure.input_ranges[0].is_whole:
        assert high - low == pytest.approx(tau)
        return
    # The other ranges are mirror images, or the same on the far side.
    near = min(
        closure.input_ranges,
        key=lambda r: abs(remainder(0.5 * (r.lowest + r.highest - low - high), tau)),
    )
    assert near.highest - near.lowest == pytest.approx(high - low, abs=1e-9)
    shift = near.lowest - low
    assert (remainder(shift, tau) if near.turning else shift) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('name', KINDS)
def test_gallery_velocities_and_accelerations_equal_numerical_derivatives(name):
    closure = closure_of(name)
    size = size_of(closure)
    count = len(closure.linkage.inputs)
    turning = not closure.linkage.inputs[0].slider
    step = 1e-4 if turning else 1e-4 * size
    for values in inputs_of(closure, name, 9):
        position = closure.position(*values)
        rates = (1.0,) * count
        velocity = closure.velocity(position, *rates)
        motion = closure.point_motion(
            position, velocity, closure.acceleration(position, velocity, *(0.0,) * count)
        )
        around = [
            closure.points(closure.position(*(v + k * step for v in values)))
            for k in (-2, -1, 1, 2)
        ]
        speed = max(abs(m.velocity) for m in motion.values())
        pull = max(abs(m.acceleration) for m in motion.values())
        for key, (place, found, bent) in motion.items():
            before, last, following, after = (points[key] for points in around)
            slope = (8.0 * (following - last) - (after - before)) / (12.0 * step)
            curve = (16.0 * (following + last) - (after + before) - 30.0 * place) / (
                12.0 * step * step
            )
            # What the differences leave out, and the rounding that they divide by the step.
            assert abs(slope - found) < 1e-9 * (speed + size / step * 1e-6), (values, key)
            assert abs(curve - bent) < 1e-5 * (pull + size), (values, key)


def test_andrews_squeezer_equals_its_published_initial_values():
    # Hairer and Wanner, and the Bari test set: consistent initial values.
    joints = closure_of('andrews_squeezer').linkage.joints
    position = closure_of('andrews_squeezer').position(-0.0617138900142764496358948458001)
    found = dict(zip(joints, position.joints, strict=True))
    published = {
        'theta': 0.0,
        'gamma': 0.455279819163070380255912382449,
        'phi': 0.222668390165885884674473185609,
        'delta': 0.487364979543842550225598953530,
        'omega': -0.222668390165885884674473185609,
        'epsilon': 1.23054744454982119249735015568,
    }
    for name, value in published.items():
        assert remainder(found[name] - value, tau) == pytest.approx(0.0, abs=3e-15), name


def test_peaucellier_draws_a_straight_line():
    closure = closure_of('peaucellier')
    for (value,) in inputs_of(closure, 'peaucellier', 200):
        place = closure.points(closure.position(value))['far_upper_bar', 'P']
        # (0.125² − 0.05²)/(2·0.05) m from O.
        assert place.real == pytest.approx(0.13125, abs=3e-16)


def test_elliptic_trammel_draws_an_ellipse():
    closure = closure_of('elliptic_trammel')
    (traced,) = closure.linkage.traced
    points = []
    for (value,) in inputs_of(closure, 'elliptic_trammel', 100):
        found = closure.points(closure.position(value))
        points.append(next(place for (_, name), place in found.items() if name == traced))
    half_axes = max(abs(p.real) for p in points), max(abs(p.imag) for p in points)
    # An ellipse about the origin through the first and the last point has all the others on it.
    (x1, y1), (x2, y2) = ((p.real**2, p.imag**2) for p in (points[3], points[50]))
    determinant = x1 * y2 - x2 * y1
    a, b = (y2 - y1) / determinant, (x1 - x2) / determinant
    for p in points:
        assert a * p.real**2 + b * p.imag**2 == pytest.approx(1.0, abs=1e-13)
    assert half_axes[0] != pytest.approx(half_axes[1], rel=0.1)


def test_hoeken_linkage_draws_a_nearly_straight_line():
    closure = closure_of('hoeken')
    heights = [
        closure.points(closure.position(radians(90 + i)))['coupler', 'P'].imag for i in range(181)
    ]
    # 0.195 mm over 80 mm: D. G. Hoeken's proportions 1 : 2.5 : 2.5 : 2.
    assert max(heights) - min(heights) == pytest.approx(0.000195, abs=1e-6)


def test_linkage_does_not_drift_over_a_million_turns():
    for name in ('jansen_leg', 'class_3'):
        closure = closure_of(name)
        start = closure.points(closure.position(1.0))
        for turns in (1, -1, 1000, 10**6):
            # 1 + 2π·turns rounded; the linkage is asked at the angle that it was rounded to.
            angle = 1.0 + tau * turns
            off = abs(turns) * 2.5e-16 + abs(angle) * 2.0**-53
            moved = closure.points(closure.position(angle))
            for key, place in start.items():
                assert abs(moved[key] - place) < 20.0 * size_of(closure) * (off + 1e-15), key
