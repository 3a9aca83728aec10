# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Spatial links that close only together by one motor follow their branch to its ends.

The family: ankles whose second motor is geared to the first. Their rods are written here anew.
"""

from math import tau
import random

from linkage_ros.kinematics import Ratio, SpaceClosure, SpaceLinkage, SpatialJoint, Status
from mpmath import mp
import numpy as np
import pytest

SEEDS = range(5)
STEP = 1.0 / 100.0


class GearedAnkle:
    """A foot on a cross, held by two rods from bars that turn with one motor, about x."""

    def __init__(self, seed: int) -> None:
        rng = random.Random(seed)

        def about(*place: float) -> tuple[float, ...]:
            return tuple(value + rng.uniform(-0.01, 0.01) for value in place)

        self.points = {
            'b1': about(0.035, 0.0165, 0.146), 'b2': about(0.040, -0.0165, 0.211),
            'c1': about(0.022, 0.015, -0.010), 'c2': about(0.022, -0.015, -0.010),
        }  # fmt: skip
        self.motors = about(0.035, 0.0, 0.150), about(0.040, 0.0, 0.215)
        self.roll = about(0.0, 0.0, -0.018)
        self.ratio = rng.choice([-0.5, -1.0, 0.5, 1.5])

    def closure(self) -> SpaceClosure:
        turning = {
            'm1': ('ground', 'bar1', self.motors[0], (1.0, 0.0, 0.0)),
            'm2': ('ground', 'bar2', self.motors[1], (1.0, 0.0, 0.0)),
            'pitch': ('ground', 'cross', (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
            'roll': ('cross', 'foot', self.roll, (1.0, 0.0, 0.0)),
        }
        return SpaceClosure(
            SpaceLinkage(
                points=self.points,
                links={
                    'bar1': ('b1',), 'bar2': ('b2',), 'rod1': ('b1', 'c1'),
                    'rod2': ('b2', 'c2'), 'foot': ('c1', 'c2'),
                },
                hinges={
                    name: SpatialJoint(parent, child, axis=axis, at=at)
                    for name, (parent, child, at, axis) in turning.items()
                },
                slides={},
                struts={},
                ratios={'m2': Ratio('m1', self.ratio)},
                driven=('m1',),
                published=('pitch', 'roll'),
            )
        )  # fmt: skip

    def misses(self, pitch, roll, x, functions=np):
        """Return (|c − b|² − |c₀ − b₀|²)/2 of both rods."""
        sin, cos, found = functions.sin, functions.cos, []
        for number, (motor, turn) in enumerate(
            zip(self.motors, (1.0, self.ratio), strict=True), 1
        ):
            bar, foot = self.points[f'b{number}'], self.points[f'c{number}']
            s, c = sin(turn * x), cos(turn * x)
            _, y, z = (one - at for one, at in zip(bar, motor, strict=True))
            moved = bar[0], motor[1] + c * y - s * z, motor[2] + s * y + c * z
            s, c = sin(roll), cos(roll)
            a, y, z = (one - at for one, at in zip(foot, self.roll, strict=True))
            a, y, z = a + self.roll[0], self.roll[1] + c * y - s * z, self.roll[2] + s * y + c * z
            s, c = sin(pitch), cos(pitch)
            way = [p - q for p, q in zip(moved, (c * a + s * z, y, c * z - s * a), strict=True)]
            length = sum((p - q) ** 2 for p, q in zip(bar, foot, strict=True))
            found.append((sum(each * each for each in way) - length) / 2)
        return found

    def slopes(self, place):
        """Return the derivatives of what the rods miss by pitch, roll and x, by complex steps."""
        rows = np.eye(3) * 1e-30j + np.array(place, complex)
        return np.array([np.imag(self.misses(*row)) / 1e-30 for row in rows]).T

    def walk(self, sign):
        """Yield (pitch, roll, x) along the curve, until x turns back or has made a turn."""
        place = np.zeros(3)
        ahead = np.array([0.0, 0.0, sign])
        while abs(place[2]) < tau:
            yield place
            tangent = np.cross(*self.slopes(place))
            tangent *= np.sign(tangent @ ahead) / np.linalg.norm(tangent)
            if tangent[2] * sign < 0.0:
                return
            ahead, start = tangent, place + STEP * tangent
            place = start
            for _ in range(4):
                matrix = np.vstack([self.slopes(place), ahead])
                off = [*np.real(self.misses(*place)), ahead @ (place - start)]
                place = place - np.linalg.solve(matrix, off)

    def toggle(self, start):
        """Return x near a place where the rods close and pitch and roll do not follow it."""

        def system(pitch, roll, x):
            def rod(number, *at):
                return self.misses(*at, x, mp)[number]

            rows = [
                [
                    mp.diff(lambda *at, n=n: rod(n, *at), (pitch, roll), by)
                    for by in ((1, 0), (0, 1))
                ]
                for n in (0, 1)
            ]
            return [*self.misses(pitch, roll, x, mp), mp.det(mp.matrix(rows))]

        with mp.workdps(40):
            return mp.findroot(system, tuple(map(mp.mpf, start)), tol=1e-30)[2]


@pytest.mark.sample(2)
@pytest.mark.parametrize('seed', SEEDS)
def test_geared_ankle_stays_on_the_branch_of_its_pose(seed):
    ankle = GearedAnkle(seed)
    closure, walked = ankle.closure(), 0
    for sign in (-1.0, 1.0):
        # A step before x turns back the walk may be beyond the end already, by its own error.
        for pitch, roll, x in [*ankle.walk(sign)][:-1:7]:
            position = closure.position(x)
            assert position.status is Status.CLOSED
            assert position.joints == pytest.approx((pitch, roll), abs=1e-9)
            walked += 1
    assert walked > 20


@pytest.mark.sample(2)
@pytest.mark.parametrize('seed', SEEDS)
def test_geared_ankle_range_ends_at_exact_toggles(seed):
    ankle = GearedAnkle(seed)
    closure = ankle.closure()
    (interval,) = closure.closing_ranges
    if interval.is_whole:
        assert all(len([*ankle.walk(sign)]) > 100 for sign in (-1.0, 1.0))
        return
    width = interval.highest - interval.lowest
    for end, inward in ((interval.lowest, 1.0), (interval.highest, -1.0)):
        at = closure.position(end)
        assert at.status is Status.TOGGLE
        assert end == pytest.approx(float(ankle.toggle((*at.joints, end))), abs=1e-13)
        for part in (1e-2, 1e-4, 1e-8):
            inside = closure.position(end + inward * part * width)
            assert inside.status is Status.CLOSED
            misses = ankle.misses(*inside.joints, inside.inputs[0])
            assert np.abs(misses) == pytest.approx(0.0, abs=4e-17)
            assert closure.velocity(inside, 1.0).joints == pytest.approx(
                rates(ankle, inside), rel=1e-6
            )
        assert closure.position(end - inward * 1e-8 * width).status is Status.OPEN


def rates(ankle, position):
    """Return the rates of pitch and roll at a rate of 1."""
    slopes = ankle.slopes((*position.joints, position.inputs[0]))
    return -np.linalg.solve(slopes[:, :2], slopes[:, 2])


@pytest.mark.sample(2)
@pytest.mark.parametrize('seed', SEEDS)
def test_geared_ankle_states_do_not_depend_on_their_order(seed):
    ankle = GearedAnkle(seed)
    inputs = np.linspace(-7.0, 7.0, 57).tolist()
    one, other = ankle.closure(), ankle.closure()
    expected = {x: one.position(x) for x in inputs}
    random.Random(seed).shuffle(inputs)
    for x in inputs:
        found = other.position(x)
        assert (found.status, found.joints) == (expected[x].status, expected[x].joints)
    assert one.grids == []


def test_two_geared_ankles_follow_their_own_inputs():
    """Of several inputs, links that depend on one of them follow it alone."""
    ankle = GearedAnkle(0)
    twice = two_of(ankle.closure().linkage)
    closure = SpaceClosure(twice)
    assert closure.grids == []
    alone = ankle.closure()
    for one, other in ((0.3, -0.2), (-1.0, 1.1), (0.0, 0.7)):
        position = closure.position(one, other)
        assert position.status is Status.CLOSED
        assert position.joints[:2] == alone.position(one).joints
        assert position.joints[2:] == pytest.approx(alone.position(other).joints, abs=1e-13)


def two_of(linkage):
    """Return a linkage twice, side by side, each with its own input."""
    away = (0.0, 0.5, 0.0)

    def moved(place):
        return tuple(a + b for a, b in zip(place, away, strict=True))

    def named(name):
        return name if name == 'ground' else f'{name}_2'

    def both(parts, changed):
        return {**parts, **{named(name): changed(part) for name, part in parts.items()}}

    return SpaceLinkage(
        points=both(linkage.points, moved),
        links=both(linkage.links, lambda points: tuple(map(named, points))),
        hinges=both(
            linkage.hinges,
            lambda one: SpatialJoint(
                named(one.parent), named(one.child), axis=one.axis, at=moved(one.at)
            ),
        ),
        slides={},
        struts={},
        ratios=both(linkage.ratios, lambda one: Ratio(named(one.of), one.ratio)),
        driven=('m1', 'm1_2'),
        published=('pitch', 'roll', 'pitch_2', 'roll_2'),
    )
