# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Spatial linkages that fold flat, through their change points.

A rod X–B or an arc of the sphere closes each. The reference solves |X − B| = L, which is
E·cos q + F·sin q = G for a hinge and a quadratic equation for a slide, and goes on along the way
that is smooth: of both solutions it takes the one that the last two states lead to.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import combinations
from math import acos, atan2, cos, hypot, pi, remainder, sin, sqrt, tau
import random
from typing import NamedTuple

from linkage_ros.kinematics import (
    Closure,
    closure_as_drawn,
    GROUND,
    SpaceLinkage,
    SpatialJoint,
    Status,
)
import numpy as np
from numpy.typing import NDArray
import pytest

from ...support.sampling import sample_count

Vector = NDArray[np.float64]

STATES, FINER = 150, 10
"""States of a turn, and steps of the reference for each: a joint may turn fast."""

COUNT = sample_count(200, 2)
"""Linkages of each kind."""


class Folding(NamedTuple):
    """A linkage with one input, and both values of its joint at each value of the input."""

    linkage: SpaceLinkage
    joint: str
    ways: Callable[[float], tuple[float, float]]
    slides: bool = False
    drive: float = 1.0  # Value of the input, in [rad] or [m], for a value of 1 here

    def apart(self, one: float, other: float) -> float:
        """Return the difference of two values of the joint."""
        return one - other if self.slides else remainder(one - other, tau)

    def way_from(self, start: float, step: float, count: int) -> list[float]:
        """Return the values along the smooth way from the pose, where the joint is 0."""
        found = [min(self.ways(start), key=lambda way: abs(self.apart(way, 0.0)))]
        for number in range(1, FINER * (count - 1) + 1):
            ahead = found[-1] + (self.apart(found[-1], found[-2]) if number > 1 else 0.0)
            ways = self.ways(start + number * step / FINER)
            found.append(ahead + min((self.apart(way, ahead) for way in ways), key=abs))
        return found[::FINER]


def rotated(vector: Vector, axis: Vector, angle: float) -> Vector:
    along = axis * (axis @ vector)
    return along + (vector - along) * cos(angle) + np.cross(axis, vector) * sin(angle)


def unit(rng: random.Random) -> Vector:
    vector: Vector = np.array([rng.gauss(0.0, 1.0) for _ in range(3)])
    return vector / hypot(*vector)


def ways_of_hinge(
    end: Callable[[float], Vector], axis: Vector, at: Vector, tip: Vector
) -> Callable[[float], tuple[float, float]]:
    """Return both angles of a hinge whose tip is as far from a moving end as in the pose."""
    arm = tip - at
    across, beside = arm - axis * (axis @ arm), np.cross(axis, arm)
    square = float((end(0.0) - tip) @ (end(0.0) - tip))

    def ways(value: float) -> tuple[float, float]:
        to_end = end(value) - at
        e, f = 2.0 * float(across @ to_end), 2.0 * float(beside @ to_end)
        g = (
            float(arm @ arm + to_end @ to_end)
            - square
            - 2.0 * float((axis @ arm) * (axis @ to_end))
        )
        # At a change point the cosine rounds to beyond 1.
        middle, half = atan2(f, e), acos(max(-1.0, min(g / hypot(e, f), 1.0)))
        return middle - half, middle + half

    return ways


def ways_of_slide(
    end: Callable[[float], Vector], axis: Vector, tip: Vector
) -> Callable[[float], tuple[float, float]]:
    square = float((end(0.0) - tip) @ (end(0.0) - tip))

    def ways(value: float) -> tuple[float, float]:
        to_end = end(value) - tip
        foot = float(axis @ to_end)
        root = sqrt(max(0.0, square - float(to_end @ to_end) + foot * foot))
        return foot - root, foot + root

    return ways


def extreme_reach(
    end: Callable[[float], Vector], reach: Callable[[Vector], float], sign: float
) -> tuple[float, float]:
    """Return where the nearest or farthest reach of an end is extreme, and how much it is."""
    values = np.linspace(-pi, pi, 721)
    at = max(values, key=lambda value: sign * reach(end(value)))
    low, high = at - 0.02, at + 0.02
    for _ in range(100):
        third = (high - low) / 3.0
        if sign * reach(end(low + third)) < sign * reach(end(high - third)):
            low += third
        else:
            high -= third
    return low, reach(end(low))


def rod_linkage(rng: random.Random, *, folds: bool, turns: bool, slides: bool) -> Folding:
    """Return a linkage whose rod is as long as its ends' nearest or farthest way, at the most."""
    while True:
        crank, along, at = unit(rng), unit(rng), 0.2 * unit(rng)
        start, tip = 0.1 * rng.uniform(0.3, 1.0) * unit(rng), at + 0.15 * unit(rng)

        def end(value: float, start: Vector = start, crank: Vector = crank) -> Vector:
            return rotated(start, crank, value) if turns else start + 0.1 * value * crank

        def reach(
            place: Vector, tip: Vector = tip, along: Vector = along, at: Vector = at
        ) -> float:
            to_end = place - at
            height, arm = along @ to_end, along @ (tip - at)
            far = float(np.linalg.norm(to_end - height * along))
            if slides:
                return float(np.linalg.norm(np.cross(along, place - tip)))
            radius = float(np.linalg.norm(tip - at - arm * along))
            return hypot(height - arm, far - radius if folds else far + radius)

        flat, length = extreme_reach(end, reach, 1.0 if folds else -1.0)
        if not turns and abs(flat) > 2.5:
            continue  # The reach is not extreme there: the slide goes on
        # The pose is where the rod has a good angle, and the joint is 0 there.
        pose = flat + rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.2)
        place = end(pose)
        if slides:
            foot = float(along @ (place - tip))
            square = length**2 - reach(place) ** 2
            if square < (0.3 * length) ** 2:
                continue
            tip = tip + along * (foot + rng.choice([-1.0, 1.0]) * sqrt(square))
        else:
            to_end, arm = place - at, tip - at
            across = arm - along * (along @ arm)
            e, f = float(across @ to_end), float(np.cross(along, arm) @ to_end)
            height = float((along @ arm) * (along @ to_end))
            g = 0.5 * (float(arm @ arm + to_end @ to_end) - length**2) - height
            if abs(g) > 0.95 * hypot(e, f):
                continue
            turn = atan2(f, e) + rng.choice([-1.0, 1.0]) * acos(g / hypot(e, f))
            tip = at + rotated(arm, along, turn)

        def from_pose(
            value: float, end: Callable[..., Vector] = end, pose: float = pose
        ) -> Vector:
            return end(pose + value)

        joint = SpatialJoint(GROUND, 'out', tuple(along), tuple(at))
        drive = SpatialJoint(GROUND, 'crank', tuple(crank))
        linkage = SpaceLinkage(
            points={'B': tuple(place), 'X': tuple(tip)},
            links={'rod': ('B', 'X'), 'crank': ('B',), 'out': ('X',)},
            hinges=({'q': joint} if not slides else {}) | ({'drive': drive} if turns else {}),
            slides=({'q': joint} if slides else {}) | ({} if turns else {'drive': drive}),
            struts={},
            driven=('drive',),
            published=('q',),
        )
        if slides:
            return Folding(linkage, 'q', ways_of_slide(from_pose, along, tip), slides=True)
        ways = ways_of_hinge(from_pose, along, at, tip)
        return Folding(linkage, 'q', ways, drive=1.0 if turns else 0.1)


def spherical(rng: random.Random, arcs: tuple[float, float, float, float]) -> Folding:
    """Return four hinges through a point, by arcs of crank, coupler, rocker and base."""
    a, b, c, d = arcs
    while True:
        apex = np.array([rng.uniform(-0.5, 0.5) for _ in range(3)])
        first, side = unit(rng), unit(rng)
        side = side - first * (first @ side)
        up = np.cross(first, side / np.linalg.norm(side))
        last = rotated(first, up, d)
        moved = rotated(rotated(first, up, a), first, rng.uniform(0.4, 2.6))
        rest = rotated(last, up, -c)
        # The rocker's axis at the coupler, on its circle about the last axis.
        arm, along = rest - last * (last @ rest), last @ rest
        e, f = float(arm @ moved), float(np.cross(last, rest) @ moved)
        g = cos(b) - float(along * (last @ moved))
        if abs(g) > 0.95 * hypot(e, f):
            continue
        tip = rotated(rest, last, atan2(f, e) + rng.choice([-1.0, 1.0]) * acos(g / hypot(e, f)))
        axes = {'drive': first, 'coupler': moved, 'rod': tip, 'q': last}
        ends = {
            'drive': (GROUND, 'A'), 'coupler': ('A', 'B'), 'rod': ('B', 'C'), 'q': (GROUND, 'C'),
        }  # fmt: skip
        hinges = {
            name: SpatialJoint(*ends[name], tuple(axis), tuple(apex + rng.uniform(-1, 1) * axis))
            for name, axis in axes.items()
        }
        linkage = SpaceLinkage({}, {}, hinges, {}, {}, ('drive',), ('q', 'coupler', 'rod'))

        def end(value: float, moved: Vector = moved, first: Vector = first) -> Vector:
            return rotated(moved, first, value)

        return Folding(linkage, 'q', ways_of_hinge(end, last, np.zeros(3), tip))


def draw_arcs(rng: random.Random, kind: str) -> tuple[float, float, float, float]:
    """Return arcs that fold flat (C. H. Chiang, Kinematics of Spherical Mechanisms, ch. 3)."""
    while True:
        a, b, c = (rng.uniform(0.3, 1.2) for _ in range(3))
        arcs = {
            'parallelogram': (a, b, a, b),
            'parallelogram of supplements': (a, pi - b, a, pi - b),
            'kite': (a, b, b, a),
            'kite on its side': (a, a, b, b),
            'rhombus': (a, a, a, a),
            'a + b = c + d': (a, b, c, a + b - c),
            'a + c = b + d': (a, b, c, a + c - b),
            'a + d = b + c': (a, b, c, b + c - a),
        }[kind]
        # Where two arcs of a sum are nearly the same, a joint turns too fast for the reference.
        differ = all(abs(one - other) > 0.1 for one, other in combinations((a, b, c), 2))
        if min(arcs) > 0.25 and (differ or kind == 'rhombus'):
            return arcs


SPHERICAL = (
    'parallelogram', 'parallelogram of supplements', 'kite', 'kite on its side', 'rhombus',
    'a + b = c + d', 'a + c = b + d', 'a + d = b + c',
)  # fmt: skip
RODS = {
    f'{"folds" if folds else "stretches"}, {"hinge" if turns else "slide"} drives '
    f'{"slide" if slides else "hinge"}': (folds, turns, slides)
    for folds, turns, slides in (
        (True, True, False), (False, True, False), (False, False, False), (True, True, True),
    )
}  # fmt: skip


def draw(kind: str, number: int) -> Folding:
    rng = random.Random(f'{kind} {number}')
    if kind in RODS:
        folds, turns, slides = RODS[kind]
        return rod_linkage(rng, folds=folds, turns=turns, slides=slides)
    return spherical(rng, draw_arcs(rng, kind))


def change_points_of(closure: Closure) -> list[float]:
    return [place for place, status in closure.singular_inputs if status is Status.CHANGE_POINT]


@pytest.mark.sample(4)
@pytest.mark.parametrize('kind', [*SPHERICAL, *RODS])
def test_folding_linkage_follows_the_smooth_way(kind: str) -> None:
    for number in range(COUNT):
        made = draw(kind, number)
        closure = closure_as_drawn(made.linkage)
        for step in (tau / STATES, -tau / STATES):
            # No step of the reference ends at a change point.
            expected = made.way_from(0.037 * step, step, STATES)
            for count, value in enumerate(expected):
                found = closure.position(made.drive * (0.037 + count) * step)
                if not found.status.has_pose:
                    break  # The reach ends
                assert abs(made.apart(found[made.joint], value)) < 1e-7, (number, count)


@pytest.mark.sample(4)
@pytest.mark.parametrize('kind', [*SPHERICAL, *RODS])
def test_rates_at_change_points_follow_the_smooth_way(kind: str) -> None:
    step = 1e-3
    for number in range(COUNT):
        made = draw(kind, number)
        closure = closure_as_drawn(made.linkage)
        for place in change_points_of(closure):
            position = closure.position(place)
            assert position.status is Status.CHANGE_POINT
            velocity = closure.velocity(position, 1.0)
            acceleration = closure.acceleration(position, velocity, 0.0)
            # The values beside it are right by the test above; between two the way is smooth.
            beside = [
                made.apart(closure.position(place + k * step * made.drive)[made.joint], 0.0)
                for k in (-2, -1, 1, 2)
            ]
            before, just, after, then = (
                made.apart(value, position[made.joint]) for value in beside
            )
            slope = (before - 8.0 * just + 8.0 * after - then) / (12.0 * step * made.drive)
            bend = (16.0 * (just + after) - before - then) / (12.0 * (step * made.drive) ** 2)
            assert velocity[made.joint] == pytest.approx(slope, rel=1e-4, abs=1e-6)
            assert acceleration[made.joint] == pytest.approx(bend, rel=1e-3, abs=1e-3)


@pytest.mark.sample(4)
@pytest.mark.parametrize('kind', [*SPHERICAL, *RODS])
def test_singular_inputs_name_where_the_links_lie_in_line(kind: str) -> None:
    """Both ways of the reference meet there; or they are undefined, as in a kite."""
    made = draw(kind, 0)
    closure = closure_as_drawn(made.linkage)
    found = dict(closure.singular_inputs)
    passed = [status for status in found.values() if status is not Status.TOGGLE]
    two = 'parallelogram', 'parallelogram of supplements', 'kite on its side', 'rhombus'
    assert len(passed) == (2 if kind in two else 1)
    for place, status in found.items():
        if status is Status.CHANGE_POINT:
            one, other = made.ways(place / made.drive)
            assert abs(made.apart(one, other)) < 1e-6
        elif status is Status.INDETERMINATE:
            assert not closure.position(place).joints


@pytest.mark.sample(4)
@pytest.mark.parametrize('kind', [*SPHERICAL, *RODS])
def test_arrays_and_compiled_code_pass_change_points_alike(kind: str) -> None:
    made = draw(kind, 1)
    closure = closure_as_drawn(made.linkage)
    values = made.drive * np.linspace(-3.0, 3.0, 101)
    rows = closure.solve(values).positions
    compiled = closure.compile_linkage(2)
    for number, value in enumerate(values):
        position = closure.position(float(value))
        if position.status.has_rates:
            velocity = closure.velocity(position, 1.0)
            acceleration = closure.acceleration(position, velocity, 0.5)
            assert rows[:, number] == pytest.approx(position.joints, abs=1e-12)
            numbers = compiled(float(value), 1.0, 0.5).values
            assert numbers == (position.joints, velocity.joints, acceleration.joints)


def test_single_change_point_repeats_after_two_turns() -> None:
    made = draw('a + b = c + d', 1)
    closure = closure_as_drawn(made.linkage)
    once, again, twice = (closure.position(0.5 + turns * tau)['q'] for turns in range(3))
    assert made.apart(once, twice) == pytest.approx(0.0, abs=1e-12)
    assert abs(made.apart(once, again)) > 0.1


@pytest.mark.sample(3)
@pytest.mark.parametrize('kind', ['parallelogram', 'kite on its side', 'rhombus', *RODS])
def test_rounded_coordinates_pass_the_same_change_points(kind: str) -> None:
    made = draw(kind, 1)
    exact = closure_as_drawn(made.linkage)

    def shorten(vector: tuple[float, ...]) -> tuple[float, float, float]:
        x, y, z = (float(f'{part:.11f}') for part in vector)
        return x, y, z

    def with_rounded(joints: Mapping[str, SpatialJoint]) -> dict[str, SpatialJoint]:
        return {
            name: replace(joint, axis=shorten(joint.axis), at=shorten(joint.at))
            for name, joint in joints.items()
        }

    points = {name: shorten(place) for name, place in made.linkage.points.items()}
    hinges, slides = with_rounded(made.linkage.hinges), with_rounded(made.linkage.slides)
    rounded = closure_as_drawn(replace(made.linkage, points=points, hinges=hinges, slides=slides))
    assert len(change_points_of(rounded)) == len(change_points_of(exact)) > 0
    for place in change_points_of(exact):
        for off in (-0.2, -1e-3, 1e-3, 0.2):
            value = place + off * made.drive
            apart = made.apart(rounded.position(value)['q'], exact.position(value)['q'])
            assert abs(apart) < 1e-5
