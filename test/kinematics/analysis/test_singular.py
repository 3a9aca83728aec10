# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Singular states: at which inputs they are, and what dyads do there."""

from math import cos, inf, pi, remainder, tau
import random

from linkage_ros.kinematics import Closure, Input, Linkage, RevoluteJoint, Status
import numpy as np
import pytest

from ..defects import defect
from ..flat_linkages import FLAT
from ..linkages import four_bar_linkage
from ...support.scenes import closure_of

# Inputs at toggles and change points: a list with the kind of each.


COUNT = 50


def met(closure: Closure, status: Status) -> list[float]:
    """Return the singular inputs at which a status is met."""
    return [one.value for one in closure.singular_inputs if one.status is status]


def agree(found: list[float], expected: list[float]) -> bool:
    """Return whether two lists hold the same angles, but for whole turns and rounding."""
    return len(found) == len(expected) and all(
        any(abs(remainder(one - other, tau)) < 1e-12 for other in found) for one in expected
    )


@pytest.mark.sample(1)
@pytest.mark.parametrize('kind', FLAT)
def test_singular_inputs_list_change_points_and_coincident_pins(kind):
    for index in range(COUNT):
        flat = FLAT[kind](random.Random(f'singular/{kind}/{index}'))
        closure = Closure(flat.linkage)
        assert agree(met(closure, Status.CHANGE_POINT), [flat.sign * at for at in flat.at]), flat
        assert agree(met(closure, Status.INDETERMINATE), list(flat.meets)), flat


@pytest.mark.parametrize('kind', FLAT)
def test_change_point_rates_equal_numerical_derivatives(kind):
    for index in range(COUNT):
        flat = FLAT[kind](random.Random(f'singular/{kind}/{index}'))
        closure = Closure(flat.linkage)
        for at in flat.at:
            value = flat.sign * remainder(at, tau)
            position = closure.position(value)
            assert position.status is Status.CHANGE_POINT, flat
            velocity = closure.velocity(position, 1.0)
            change = closure.acceleration(position, velocity, 0.3)
            h = 1e-4
            places = [closure.position(value + k * h).joints for k in (-2, -1, 1, 2)]
            for j, joint in enumerate(position.joints):
                a, b, c, d = (values[j] for values in places)
                rate = (a - 8.0 * b + 8.0 * c - d) / (12.0 * h)
                pull = (-a + 16.0 * b - 30.0 * joint + 16.0 * c - d) / (12.0 * h * h)
                size = 1.0 + abs(rate) ** 5 + abs(pull) ** 2.5
                assert velocity.joints[j] == pytest.approx(rate, abs=1e-8 * size), flat
                assert change.joints[j] == pytest.approx(pull + 0.3 * rate, abs=1e-4 * size), flat


@pytest.mark.parametrize('kind', FLAT)
def test_batch_equals_single_states_at_change_points(kind):
    for index in range(COUNT):
        flat = FLAT[kind](random.Random(f'singular/{kind}/{index}'))
        closure = Closure(flat.linkage)
        values = [flat.sign * remainder(at, tau) for at in flat.at]
        if not values:
            continue
        batch = closure.solve(values, rates=1.3, accelerations=0.4)
        assert batch.velocities is not None
        assert batch.accelerations is not None
        for k, value in enumerate(values):
            position = closure.position(value)
            velocity = closure.velocity(position, 1.3)
            change = closure.acceleration(position, velocity, 0.4)
            assert list(Status)[batch.status[k]] is position.status
            for row, joints in zip(batch[1:], (position, velocity, change), strict=True):
                assert row is not None
                assert row[:, k] == pytest.approx(joints.joints, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize('kind', FLAT)
def test_toggle_distance_equals_the_distance_to_the_change_point(kind):
    flat = FLAT[kind](random.Random(f'singular/{kind}/1'))
    closure = Closure(flat.linkage)
    for at in flat.at:
        for away in (1e-3, -1e-3, 1e-6):
            position = closure.position(flat.sign * at + away)
            assert closure.singularity_margin(position).toggle_distance == pytest.approx(abs(away))


def test_second_dyad_of_a_chain_adds_singular_inputs():
    # Two four-bars: the rocker of the first, a parallelogram, is the crank of the second, another
    # parallelogram, which folds flat whenever that rocker lies on the ground line.
    links = {
        'ground': {'O': (0.0, 0.0), 'D': (2.0, 0.0), 'E': (5.0, 0.0)},
        'crank': {'O': (0.0, 0.0), 'A': (1.0, 0.0)},
        'coupler': {'A': (0.0, 0.0), 'B': (2.0, 0.0)},
        'rocker': {'D': (0.0, 0.0), 'B': (1.0, 0.0), 'F': (1.5, 0.0)},
        'second_coupler': {'F': (0.0, 0.0), 'G': (3.0, 0.0)},
        'second_rocker': {'E': (0.0, 0.0), 'G': (1.5, 0.0)},
    }
    joints = {'last': RevoluteJoint('ground', 'second_rocker')}
    linkage = Linkage(
        links, (Input('crank_joint', 'ground', 'crank'),), {'B': 'left', 'G': 'left'}, joints, {}
    )
    closure = Closure(linkage)
    assert agree(met(closure, Status.CHANGE_POINT), [0.0, pi])
    # With a second dyad that only just reaches at 0: there it turns back, as at a toggle.
    links['second_rocker'] = {'E': (0.0, 0.0), 'G': (2.0, 0.0)}
    links['second_coupler'] = {'F': (0.0, 0.0), 'G': (3.5, 0.0)}
    closure = Closure(linkage)
    assert agree(met(closure, Status.TOGGLE), [0.0])


def test_limited_range_ends_are_listed_as_toggles():
    closure = Closure(four_bar_linkage((6.0, 4.0, 5.0, 4.5), 'left'))
    (interval,) = closure.input_ranges
    assert [one.value for one in closure.singular_inputs] == [interval.lowest, interval.highest]
    assert {one.status for one in closure.singular_inputs} == {Status.TOGGLE}


@pytest.mark.parametrize(
    ('name', 'status', 'places'),
    [
        ('change_point', Status.CHANGE_POINT, [pi]),
        ('inv_ahead', Status.CHANGE_POINT, [0.0]),
        ('isosceles', Status.CHANGE_POINT, [-0.5 * pi, 0.5 * pi]),
        ('par', Status.CHANGE_POINT, [0.0, pi]),
        ('inv1', Status.INDETERMINATE, [0.0]),
        ('straight_rev_ahead', Status.INDETERMINATE, [0.0]),
    ],
)
def test_formerly_failing_files_list_their_singular_inputs(name, status, places):
    closure = defect(name)
    assert agree(met(closure, status), places)
    assert closure.singularity_margin(closure.position(places[0] + 1e-3)).toggle_distance < inf


# Dyads on a rocker that lie flat, have parallel lines, or whose pins meet.
#
# The rocker is that of a parallelogram: it turns as the crank does, so that everything that
# follows is known without solving.


PARALLELOGRAM = """
links:
  ground:  {{O2: [0, 0], O4: [2, 0]{ground}}}
  crank:   {{O2: [0, 0], A: [1, 0]}}
  coupler: {{A: [0, 0], B: [2, 0]}}
  rocker:  {{O4: [0, 0], B: [1, 0], C: [0, 1]}}
  {link}
sliders:
  S: {slider}
input: {{joint: crank_joint, parent: ground, child: crank}}
assembly: {{B: left{side}}}
joints:
  s: {{slider: S}}
"""
"""The rocker's pin C lies a quarter of a turn ahead of its B."""


def closure(slider: str, link: str = '', ground: str = '', side: str = ', S: ahead') -> Closure:
    text = PARALLELOGRAM.format(slider=slider, link=link, ground=ground, side=side)
    return closure_of(text)


def statuses_at(solved: Closure, value: float) -> set[Status]:
    return {
        one.status
        for one in solved.singular_inputs
        if abs(remainder(one.value - value, 2 * pi)) < 1e-6
    }


def test_rod_with_rocker_length_passes_both_change_points():
    # C at the height cos φ over the line, the rod 1: it lies flat where the rocker is across, and
    # C and the rod's end are mirrored then: s = 2·cos(φ + π/2).
    solved = closure(
        '{point: E, along: ground, through: O4, direction: [1, 0]}',
        'rod: {C: [0, 0], E: [1, 0]}',
    )
    values = np.linspace(-3.0, 3.0, 41) + 0.001
    batch = solved.solve(values)
    sign = 0.0
    for k, value in enumerate(values):
        position = solved.position(value)
        assert position.status is Status.CLOSED
        wanted = 2.0 * cos(value + 0.5 * pi)
        # The named side says which of both motions it is: the one that starts ahead.
        sign = sign or position.joints[0] / wanted
        assert position.joints[0] == pytest.approx(sign * wanted, abs=1e-12)
        assert batch.positions[0, k] == pytest.approx(sign * wanted, abs=1e-12)
    assert sign == pytest.approx(1.0)
    assert statuses_at(solved, 0.0) == statuses_at(solved, pi) == {Status.CHANGE_POINT}


def test_coincident_rod_pins_in_a_chain_are_indeterminate():
    solved = closure(
        '{point: D, along: rod, through: C, direction: [1, 0]}',
        'rod: {C: [0, 0]}',
        ', D: [2.6, 0.8]',
    )
    # C stands at the angle φ + π/2, the swivel at the direction of (3, 4).
    meeting = np.arctan2(0.8, 0.6) - 0.5 * pi
    assert Status.INDETERMINATE in statuses_at(solved, meeting)
    near = solved.singularity_margin(solved.position(meeting + 0.01))
    assert near.toggle_distance == pytest.approx(0.01, abs=1e-6)


@pytest.mark.sample(5)
@pytest.mark.parametrize('turn', np.arange(0.1, 1.5, 0.1).tolist())
def test_parallel_slide_lines_in_a_chain_are_indeterminate(turn):
    solved = closure(
        '{point: E, block: one, along: ground, through: O2, direction: '
        f'[{np.cos(turn)}, {np.sin(turn)}]}}\n'
        '  T: {point: E, along: rocker, through: C, direction: [1, 0]}',
        'one: {E: [0, 0]}',
        side='',
    )
    for value in (turn, turn - pi):
        assert statuses_at(solved, value) == {Status.INDETERMINATE}
