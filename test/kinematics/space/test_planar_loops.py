# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Planar loops of spatial linkages: in any plane, on any link, through their change points.

The linkages are those of the gallery, and those of `flat_linkages`, whose links all lie in line at
some angles of the crank. They are put into random planes, on none to two hips, their coordinates
rounded to some digits.
"""

from math import pi, tau
import os
import random
from typing import NamedTuple

from linkage_ros.kinematics import (
    Closure,
    GROUND,
    Linkage,
    links_by_point,
    SpaceClosure,
    SpaceLinkage,
    SpatialJoint,
    Status,
)
import numpy as np
from numpy.typing import NDArray
import pytest

from ..flat_linkages import FLAT, Flat
from ..test_gallery import closure_of as planar_closure, inputs_of, KINDS
from ...support.scenes import size_of

Array = NDArray[np.float64]

STATES = int(os.environ.get('LINKAGE_STATES', '600'))
"""Number of states of each linkage; `make planar_loops` takes 40,000."""

BESIDE = [10.0**-digits for digits in range(1, 16)]


class Placed(NamedTuple):
    """A planar linkage in space: its plane on the base, and the base on hips."""

    closure: SpaceClosure
    axes: Array  # Rows: x and y of the plane, and its normal, as the base stands in the pose
    origin: Array
    hips: list[tuple[Array, Array]]  # Axis and a place on it, in the pose
    height: float  # Largest height over the plane, of rounded coordinates

    def base(self, hips: list[float]) -> tuple[Array, Array]:
        """Return how the base has turned and moved from the pose."""
        turn, shift = np.eye(3), np.zeros(3)
        for (axis, at), value in zip(self.hips, hips, strict=True):
            one = rotation(axis, value)
            turn, shift = turn @ one, turn @ (at - one @ at) + shift
        return turn, shift

    def flat(self, place: tuple[float, ...], hips: list[float]) -> complex:
        """Return a place in the plane; its height must be that of the pose."""
        turn, shift = self.base(hips)
        x, y, height = self.axes @ (turn.T @ (np.array(place) - shift) - self.origin)
        assert abs(height) < self.height
        return complex(x, y)


def rotation(axis: Array, angle: float) -> Array:
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def random_axes(rng: random.Random) -> Array:
    if rng.random() < 0.2:
        return np.roll(np.eye(3), rng.randrange(3), axis=0)
    return np.linalg.qr(np.array([[rng.gauss(0, 1) for _ in range(3)] for _ in range(3)]))[0].T


def place_in_space(
    plane: Closure, start: tuple[float, ...], rng: random.Random, digits: int, hips: int
) -> Placed:
    """Return a planar linkage in a random plane, drawn at some inputs, which have its values."""
    linkage, position = plane.linkage, plane.position(*start)
    axes, origin = random_axes(rng), np.array([rng.uniform(-1, 1) for _ in range(3)])
    axes[2] = np.cross(axes[0], axes[1])

    def lift(place: complex) -> tuple[float, ...]:
        spot = origin + place.real * axes[0] + place.imag * axes[1]
        return tuple(float(f'{value:.{digits}g}') for value in spot)

    places, angles = plane.points(position), plane.link_angles(position)
    base = 'base' if hips else GROUND
    on = {link: base if link == GROUND else link for link in linkage.links}
    normal = tuple(map(float, axes[2]))
    back = tuple(map(float, -axes[2]))
    turned = {frozenset((i.parent, i.child)): i for i in linkage.inputs if not i.slider}
    values = dict(zip(plane.input_names, start, strict=True))
    hinges: dict[str, SpatialJoint] = {}
    for pin, links in links_by_point(linkage.links).items():
        pairs = [(links[0], other) for other in links[1:]]
        for pair in turned:
            if pair <= {*links}:  # The input is a hinge of its own.
                one, other = pair
                pairs = [(one, other), *((one, link) for link in links if link not in pair)]
        for one, other in pairs:
            at, given = lift(places[one, pin]), turned.get(frozenset((one, other)))
            if given is None:
                hinges[f'{pin} {one} {other}'] = SpatialJoint(on[one], on[other], normal, at)
                continue
            ends, axis = (on[given.parent], on[given.child]), normal
            if given.child == GROUND:
                ends, axis = (ends[1], ends[0]), back
            value = values[given.joint]
            hinges[given.joint] = SpatialJoint(*ends, axis, at, value)
    slides, slid = {}, {given.slider: given.joint for given in linkage.inputs if given.slider}
    for name, slider in linkage.sliders.items():
        carrier = next(link for link, points in linkage.links.items() if slider.point in points)
        way = slider.unit * np.exp(1j * angles[slider.along])
        axis = tuple(float(way.real * x + way.imag * y) for x, y in zip(*axes[:2], strict=True))
        block = slider.block or f'{name} block'
        if not slider.block:
            at = lift(places[carrier, slider.point])
            hinges[f'{name} pin'] = SpatialJoint(on[carrier], block, normal, at)
        value = plane.slide_values(position)[name]
        slides[slid.get(name, name)] = SpatialJoint(
            on[slider.along], on.get(block, block), axis, value=value
        )
    carried = [
        (np.array([rng.gauss(0, 1) for _ in range(3)]), origin + 0.5 * axes[number])
        for number in range(hips)
    ]
    links = [GROUND, *(f'hip {number}' for number in range(1, hips)), base]
    legs = {
        f'hip {number} joint': SpatialJoint(
            links[number], links[number + 1], tuple(map(float, axis)), tuple(map(float, at))
        )
        for number, (axis, at) in enumerate(carried)
    }
    driven = (*legs, *plane.input_names)
    space = SpaceLinkage(
        points={name: lift(place) for (_, name), place in places.items()},
        links={on[link]: tuple(points) for link, points in linkage.links.items()},
        hinges={**legs, **hinges},
        slides=slides,
        struts={},
        driven=driven,
        published=tuple(name for name in (*hinges, *slides) if name not in driven),
    )
    height = 1e-12 + 40.0 * 10.0**-digits
    return Placed(SpaceClosure(space), axes, origin, carried, height)


def start_of(plane: Closure, rng: random.Random) -> tuple[float, ...]:
    """Return inputs away from toggles and change points."""
    while True:
        start = (rng.uniform(-pi, pi),)
        position = plane.position(*start)
        if position.status is Status.CLOSED and abs(np.sin(start[0])) > 0.2:
            return start


def flat_places(
    placed: Placed, inputs: tuple[float, ...], hips: list[float]
) -> dict[str, complex]:
    position = placed.closure.position(*hips, *inputs)
    assert position.status.has_pose, (position, inputs)
    assert placed.closure.residual(position) < placed.height
    points = placed.closure.points(position)
    return {name: placed.flat(place, hips) for name, place in points.items()}


def mirrored(kind: str, linkage: Linkage, at: dict[str, complex]) -> dict[str, complex]:
    """Return the places in the other assembly at the same angle of the crank."""
    if kind == 'RRP':
        level = at['B'].imag
        return {**at, 'B': complex(2.0 * at['A'].real - at['B'].real, level)}
    line = at['D'] - at['A']
    unit = line / abs(line)
    moved = {'B', 'Q', 'T'} - {*linkage.links[GROUND], *linkage.links['crank']}
    return {
        name: at['A'] + unit * ((place - at['A']) / unit).conjugate() if name in moved else place
        for name, place in at.items()
    }


@pytest.mark.sample(4)
@pytest.mark.parametrize('hips', [0, 1, 2])
@pytest.mark.parametrize('kind', FLAT)
def test_planar_loop_passes_change_points_without_a_jump(kind, hips):
    rng = random.Random(f'{kind} {hips}')
    made: Flat = FLAT[kind](rng)
    plane = Closure(made.linkage)
    placed = place_in_space(plane, start_of(plane, rng), rng, 17, hips)
    turned = [rng.uniform(-1.0, 1.0) for _ in range(hips)]
    step = 2.0 * tau / STATES
    # No state lies at a change point, which the steps pass in the middle.
    cranks = [0.37 * step + step * number for number in range(STATES)]
    before: list[dict[str, complex]] = []
    for crank in cranks:
        if not plane.position(made.sign * crank).status.has_pose:
            before = []
            continue
        here = flat_places(placed, (made.sign * crank,), turned)
        if len(before) == 2:
            other = mirrored(kind, made.linkage, here)
            ahead = {name: 2.0 * before[1][name] - before[0][name] for name in here}
            off, off_other = (
                max(abs(at[name] - ahead[name]) for name in here) for at in (here, other)
            )
            assert off < max(off_other, 4.0 * step * step), crank
        before = [*before[-1:], here]


# A swivel may be passed closely, so that lengths are as they are written.
@pytest.mark.sample(4)
@pytest.mark.parametrize(
    ('kind', 'digits'),
    [
        (kind, digits)
        for kind in FLAT
        for digits in (17, 16, 13, 11)
        if kind != 'RPR' or digits > 15
    ],
)
def test_planar_loop_with_rounded_coordinates_equals_the_planar_linkage(kind, digits):
    rng = random.Random(f'{kind} {digits}')
    for hips in range(3):
        made: Flat = FLAT[kind](rng)
        while digits < 16 and len(made.at) < 2:
            # So rounded, only lengths that are equal in pairs are known to have been equal.
            made = FLAT[kind](rng)
        plane = Closure(made.linkage)
        placed = place_in_space(plane, start_of(plane, rng), rng, digits, hips)
        turned = [rng.uniform(-1.0, 1.0) for _ in range(hips)]
        for _ in range(STATES // 4):
            crank = rng.uniform(-tau, tau)
            expected = plane.position(made.sign * crank)
            if (
                expected.status.has_rates
                and plane.singularity_margin(expected).transmission_angle > 1e-3
            ):
                places = flat_places(placed, (made.sign * crank,), turned)
                for name, place in places.items():
                    assert abs(place - expected.points[name]) < 1e5 * placed.height, (crank, name)


@pytest.mark.parametrize('hips', [0, 2])
@pytest.mark.parametrize('kind', FLAT)
def test_planar_loop_near_change_points_equals_the_planar_linkage(kind, hips):
    rng = random.Random(f'{kind} {hips}')
    made: Flat = FLAT[kind](rng)
    plane = Closure(made.linkage)
    placed = place_in_space(plane, start_of(plane, rng), rng, 17, hips)
    turned = [rng.uniform(-1.0, 1.0) for _ in range(hips)]
    for at in made.at:
        for apart in (*BESIDE, *(-one for one in BESIDE)):
            places = flat_places(placed, (made.sign * (at + apart),), turned)
            expected = plane.position(made.sign * (at + apart)).points
            for name, place in places.items():
                assert abs(place - expected[name]) < 1e-12, (at, apart, name)


@pytest.mark.parametrize('with_rod', [False, True])
@pytest.mark.parametrize('crank', [0.0, pi])
def test_parallelogram_drawn_flat_moves_as_a_parallelogram(crank, with_rod):
    rng = random.Random(48)
    for _ in range(5):
        axes, origin = random_axes(rng), np.array([rng.uniform(-1, 1) for _ in range(3)])
        normal, (a, d) = tuple(axes[2].tolist()), (rng.uniform(0.1, 0.5), rng.uniform(0.6, 1.5))
        pivots = [origin, origin + d * axes[0]]
        pins = [tuple((pivot + a * np.cos(crank) * axes[0]).tolist()) for pivot in pivots]
        hinges = {
            name: SpatialJoint(GROUND, link, normal, tuple(pivot.tolist()))
            for name, link, pivot in zip(('driver', 'driven'), 'ab', pivots, strict=True)
        }
        points, links = {}, {}
        if with_rod:
            points = dict(zip('pq', pins, strict=True))
            links = {'a': ('p',), 'b': ('q',), 'rod': ('p', 'q')}
        else:
            ends = zip(('first', 'second'), 'ab', pins, strict=True)
            hinges |= {name: SpatialJoint(link, 'rod', normal, pin) for name, link, pin in ends}
        linkage = SpaceLinkage(points, links, hinges, {}, {}, ('driver',), ('driven',))
        closure = SpaceClosure(linkage)
        for driver in (0.0, *np.linspace(-6.0, 6.0, 40).tolist()):
            (driven,) = closure.position(driver).joints
            assert abs(np.remainder(driven - driver + pi, tau) - pi) < 1e-13


def tilted(angle: float) -> SpaceClosure:
    """Return a parallelogram one of whose axes is tilted."""
    axis = (0.0, 1.0, 0.0)
    hinges = {
        'driver': SpatialJoint(GROUND, 'crank', axis, (0.0, 0.0, 0.0)),
        'coupler': SpatialJoint('crank', 'rod', axis, (0.1, 0.0, 0.2)),
        'end': SpatialJoint('rod', 'rocker', (angle, 1.0, 0.0), (1.1, 0.0, 0.2)),
        'driven': SpatialJoint(GROUND, 'rocker', axis, (1.0, 0.0, 0.0)),
    }
    return SpaceClosure(SpaceLinkage({}, {}, hinges, {}, {}, ('driver',), ('driven',)))


@pytest.mark.parametrize('angle', [0.0, 1e-18, 1e-12, 1e-9, 0.9e-6])
def test_nearly_parallel_axes_are_corrected_and_reported(angle):
    closure = tilted(angle)
    assert closure.groups[0].kind == 'planar loop'
    assert closure.linkage.corrections.tilted_by == pytest.approx(angle, rel=1e-6, abs=1e-15)
    for driver in np.linspace(0.1, 6.1, 40).tolist():
        (driven,) = closure.position(driver).joints
        assert abs(np.remainder(driven - driver + pi, tau) - pi) < 1e-14 + angle


def test_clearly_tilted_axes_make_a_spatial_loop():
    assert {group.kind for group in tilted(1e-5).groups}.isdisjoint({'planar loop'})


GALLERY = [name for name in KINDS if name not in ('class_3', 'gripper')]
"""Linkages of the gallery without links that are iterated, and without gears."""


@pytest.mark.sample(8)
@pytest.mark.parametrize('hips', [0, 1])
@pytest.mark.parametrize('name', GALLERY)
def test_gallery_linkage_in_space_equals_the_planar_one(name, hips):
    rng = random.Random(f'{name} {hips}')
    plane = planar_closure(name)
    start, *others = [
        inputs for inputs in inputs_of(plane, name, 60) if plane.position(*inputs).status.has_rates
    ][7:]
    placed = place_in_space(plane, start, rng, 17, hips)
    assert [group.kind for group in placed.closure.groups].count('planar loop') > 0
    turned = [rng.uniform(-1.0, 1.0) for _ in range(hips)]
    for inputs in others:
        expected = plane.position(*inputs).points
        for point, place in flat_places(placed, inputs, turned).items():
            assert abs(place - expected[point]) < 1e-12 * size_of(plane), (inputs, point)
