# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Newton's method on dyads: its order, its answers, and that it stays in its assembly."""

from itertools import pairwise
from math import log10, pi, tau
import random

from hypothesis import given, settings, strategies as st
from linkage_ros.kinematics import Closure, Status
from linkage_ros.solvers import LoopFinder, NewtonClosure, NewtonDyad
import pytest

from .linkages import (
    apart,
    CRANK_ROCKER,
    crank_rocker,
    crank_rockers,
    GALLERY,
    Lengths,
    true_joints,
    worst_error,
)
from ..kinematics.linkages import four_bar_linkage
from ..support.scenes import shipped

STARTS = {'from knots': None, 'warm': True, 'cold': False}


@pytest.mark.parametrize('phi', [0.3, 2.0, 4.5])
def test_a_step_leaves_the_square_of_the_error(phi):
    closure = Closure(crank_rocker())
    finder = LoopFinder(closure.linkage, closure.structure, closure._known)
    (loops,) = finder.find_loops()
    one_step = NewtonDyad(loops, 10.0, 10.0)
    coupler, rocker = map(float, true_joints(CRANK_ROCKER, phi))
    sign = one_step.orientation([0.0, phi, coupler + phi, rocker])

    def left(off: float) -> float:
        x = [0.0, phi]
        assert one_step.close(x, [], coupler + phi + off, rocker - off, sign)
        return worst_error(CRANK_ROCKER, phi, (x[2] - phi, x[3]))

    errors = [left(10.0**-k) for k in range(2, 7)]
    orders = [log10(a / b) for a, b in pairwise(errors)]
    assert orders == pytest.approx([2.0] * 4, abs=0.1)


@settings(max_examples=60)
@given(crank_rockers(), st.floats(-20.0, 20.0), st.sampled_from([1e-3, 1e-6, 1e-9, 1e-13]))
def test_any_four_bar_is_as_near_as_its_tolerance(lengths, phi, tolerance):
    for warm in STARTS.values():
        newton = NewtonClosure(crank_rocker(lengths), tolerance, warm=warm)
        for value in (phi - 0.01, phi):
            found = newton.position(value)
            assert found.status is Status.CLOSED
            # Errors of both angles add up in a joint.
            assert worst_error(lengths, value, found.joints) <= 2.0 * tolerance


@pytest.mark.parametrize('file', GALLERY, ids=lambda file: file.stem)
@pytest.mark.parametrize('start', STARTS)
def test_the_gallery_moves_as_in_closed_form(file, start):
    linkage = shipped(file.stem)
    closure, newton = Closure(linkage), NewtonClosure(linkage, 1e-9, warm=STARTS[start])
    draw = random.Random(file.stem)
    n = len(linkage.inputs)
    for k in range(60):
        inputs = [0.01 * draw.random() + (0.03 if joint.slider else 0.1) * k * 0.3
                  for joint in linkage.inputs]  # fmt: skip
        found, solved = closure.position(*inputs), newton.position(*inputs)
        assert solved.status is found.status
        if found.status is not Status.CLOSED:
            assert solved == found
            continue
        assert apart(closure, solved.joints, found.joints) < 1e-11
        speeds, rates = closure.velocity(found, *[0.7] * n), newton.velocity(solved, *[0.7] * n)
        assert rates.joints == pytest.approx(speeds.joints, rel=1e-8, abs=1e-8)
        changes = newton.acceleration(solved, rates, *[0.3] * n)
        expected = closure.acceleration(found, speeds, *[0.3] * n)
        assert changes.joints == pytest.approx(expected.joints, rel=1e-7, abs=1e-7)
        assert newton.residual(solved) < 1e-11
        assert newton.singularity_margin(solved) == pytest.approx(
            closure.singularity_margin(found)
        )
        assert newton.points(solved).keys() == closure.points(found).keys()


# Change points, and linkages that come very close to one.
NEAR_CHANGE_POINTS: dict[str, Lengths] = {
    'parallelogram': (1.0, 2.0, 1.0, 2.0),
    'kite': (1.0, 1.0, 2.0, 2.0),
    'one change point': (1.0, 3.0, 2.5, 4.5),
    'nearly a parallelogram': (1.0, 2.000001, 1.0, 2.0),
    'nearly folding': (1.0, 2.0, 1.9999, 2.9),
}


@pytest.mark.parametrize('name', NEAR_CHANGE_POINTS)
@pytest.mark.parametrize('step', [0.001, 0.0123, 0.2])
@pytest.mark.parametrize('start', STARTS)
def test_no_jump_to_the_other_assembly(name, step, start):
    linkage = four_bar_linkage(NEAR_CHANGE_POINTS[name], 'left')
    closure, newton = Closure(linkage), NewtonClosure(linkage, 1e-6, warm=STARTS[start])
    for direction in (1.0, -1.0):
        for k in range(int(4.0 * pi / step) if step > 0.005 else 4000):
            phi = direction * (-2.0 + step * k)
            found, solved = closure.position(phi), newton.position(phi)
            assert solved.status is found.status
            if found.joints:
                assert apart(closure, solved.joints, found.joints) < 1e-5


def test_easy_states_are_newton_s_own():
    newton = NewtonClosure(crank_rocker(), 1e-9)
    for k in range(1000):
        newton.position(0.01 * k)
    assert newton.exact_states == 0


def test_at_a_toggle_the_closed_form_answers():
    linkage = four_bar_linkage((4.0, 5.0, 3.0, 6.5), 'left')
    closure, newton = Closure(linkage), NewtonClosure(linkage, 1e-9)
    ((low, high, *_),) = closure.input_ranges
    for value in (low, high, high - 1e-12, low - 1e-3, high + 1e-9):
        assert newton.position(value) == closure.position(value)
    assert newton.exact_states == 5


@pytest.mark.parametrize('name', ['four_bar', 'five_bar', 'jansen_leg', 'class_3'])
def test_a_state_depends_on_its_inputs_alone(name):
    linkage = shipped(name)
    draw = random.Random(1)
    states = [tuple(draw.uniform(0.0, tau) for _ in linkage.inputs) for _ in range(100)]
    newton = NewtonClosure(linkage, 1e-3)
    there = {inputs: newton.position(*inputs).joints for inputs in states}
    back = NewtonClosure(linkage, 1e-3)
    for inputs in reversed(states):
        assert back.position(*inputs).joints == there[inputs]


def test_a_warm_start_remembers_no_more_than_the_tolerance():
    one, other = (NewtonClosure(crank_rocker(), 1e-4, warm=True) for _ in range(2))
    one.position(0.9)
    other.position(1.1)
    found = [newton.position(1.0).joints for newton in (one, other)]
    assert found[0] != found[1]
    assert apart(one, *found) < 1e-4


def test_arrays_are_solved_state_by_state():
    newton = NewtonClosure(crank_rocker(), 1e-9)
    batch = newton.solve([0.5, 1.0], rates=2.0, accelerations=3.0)
    for k, phi in enumerate((0.5, 1.0)):
        position = newton.position(phi)
        velocity = newton.velocity(position, 2.0)
        assert tuple(batch.positions[:, k]) == position.joints
        assert tuple(batch.velocities[:, k]) == velocity.joints
        expected = newton.acceleration(position, velocity, 3.0).joints
        assert tuple(batch.accelerations[:, k]) == expected
