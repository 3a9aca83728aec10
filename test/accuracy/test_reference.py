# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The reference is true: by algebra, by another's balls, by its own differences, and proved."""

from math import pi
from pathlib import Path
from typing import Any

from campaigns.accuracy.adversarial import four_bar
from campaigns.accuracy.reference import Outcome
from campaigns.accuracy.reference import Reference as Elsewhere
from campaigns.accuracy.run import make
from flint import arb, ctx
from linkage_ros.accuracy.enclosure import prove
from linkage_ros.accuracy.poses import (
    five_dyads,
    near_change_point,
    near_toggle,
    Poses,
    shipped_linkage,
)
from linkage_ros.accuracy.reference import Reference, SingularError
from linkage_ros.accuracy.solving import confirmed, true_states
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Input, Linkage, RevoluteJoint, SlideJoint, Slider
from linkage_ros.kinematics.sweep_analysis import usual_inputs
from mpmath import mp, mpf
import pytest

from ..kinematics import reference as algebra
from ..kinematics.samples import four_bars

SHIPPED = sorted(
    path.stem
    for path in (Path(__file__).parents[2] / 'config/linkages').glob('*.yaml')
    if path.stem != 'gripper'  # neither of the two knows ratios
)

FAMILIES = ('RRR', 'RRP', 'RPR', 'PRP', 'RPP', 'RRR-RRR-RRR', 'any three')


def linkage_of(name: str) -> Linkage:
    return five_dyads() if name == 'five dyads' else shipped_linkage(name)


def apart(one: Any, other: Any, turning: bool) -> mpf:
    """Return how far two values are apart, to 90 digits; of angles, modulo 2π."""
    with mp.workdps(90):
        difference = mp.mpf(one) - mp.mpf(other)
        if turning:
            difference -= 2 * mp.pi * mp.nint(difference / (2 * mp.pi))
        return abs(difference)


def coefficient(truth: Any, joint: int, order: int, turning: bool) -> mpf:
    """Return a joint's derivative from its power series, whose lengths are scaled."""
    with mp.workdps(90):
        value = mpf(truth.joints[joint][order].mid().str(90, radius=False))
        value *= (1, 1, 2)[order]
        return value if turning else value * mpf(2) ** truth.motion.constants.exponent


@pytest.mark.parametrize('family', FAMILIES)
def test_random_linkages_of_every_dyad_are_as_the_campaign_has_them(family):
    compared = 0
    for index in range(3):
        mechanism, angles, accelerations = make(7, family, index)
        linkage = mechanism.linkage()
        closure, elsewhere, reference = Closure(linkage), Elsewhere(mechanism), Reference(linkage)
        for phi, alpha in [*zip(angles, accelerations, strict=True)][::5]:
            expected = elsewhere.solve(phi, alpha)
            if expected.outcome is not Outcome.CLOSED or not closure.position(phi).joints:
                continue
            found = reference.solve([phi], [1.0], [alpha])
            for joint, turning in enumerate(closure.turning):
                for order in range(3):
                    value = coefficient(expected, joint, order, turning)
                    off = apart(found.orders[order][joint], value, turning and not order)
                    assert off <= 1e-45 * max(1, abs(value)), (index, phi, joint, order)
                    compared += 1
    assert compared > 30


@pytest.mark.parametrize('family', ['any lengths', 'fold and stretch', 'crank along ground'])
def test_four_bars_are_as_by_algebra(family):
    compared = 0
    for a, b, c, d, phi, side in four_bars(family, 100):
        expected = algebra.four_bar(a, b, c, d, phi, side, digits=120)
        linkage = four_bar((a, b, c, d), side).linkage()
        if expected.gap > 0 or not Closure(linkage).position(phi).joints:
            continue
        try:
            found = Reference(linkage).solve([phi])
        except SingularError:
            # Within some 1e-12 of a toggle a double does not tell its two assemblies apart.
            assert max(expected.coupler.condition, expected.rocker.condition) > 1e6
            continue
        for k, link in enumerate((expected.coupler, expected.rocker)):
            assert apart(found.joints[k], link.value, turning=True) <= 1e-45
        for k, rate in enumerate((expected.coupler_rate, expected.rocker_rate)):
            assert apart(found.rates[k], rate.value, turning=False) <= 1e-45 * rate.condition
        compared += 1
    assert compared > 15


def test_the_worked_inverted_slider_crank_to_twenty_digits():
    # AB 15, A to D 25, D to C 10, crank at 60 degrees: r3 and θ3, as the sources' README has them.
    linkage = Linkage(
        links={
            'ground': {'A': (0.0, 0.0), 'C': (25.0, 10.0)},
            'crank': {'A': (0.0, 0.0), 'B': (15.0, 0.0)},
            'rod': {'B': (0.0, 0.0)},
        },
        inputs=(Input('crank_joint', 'ground', 'crank'),),
        assembly={'swivel': 'ahead'},
        joints={'rod_joint': RevoluteJoint('ground', 'rod'), 'slide': SlideJoint('swivel')},
        sliders={'swivel': Slider('C', 'rod', 'B', (1.0, 0.0))},
    )
    with mp.workdps(60):
        found = Reference(linkage).solve([mp.pi / 3])
        degrees = found.joints[0] * 180 / mp.pi
        assert abs(found.joints[1] - mpf('17.753658182601928364')) < 1e-18
        assert abs(degrees + mpf('9.6969819871210262071')) < 1e-18


@pytest.mark.parametrize('distance', [1e-3, -1e-3, 1e-6, 1e-9, -1e-9, 1e-12])
def test_a_parallelogram_next_to_its_change_point_turns_as_its_crank(distance):
    found = Reference(shipped_linkage('parallelogram')).solve([distance], [1.0], [0.5])
    for order, value in enumerate((distance, 1.0, 0.5)):
        rod, follower = found.orders[order]
        assert apart(rod, -value, turning=False) < 1e-50
        assert apart(follower, value, turning=False) < 1e-50


@pytest.mark.parametrize(
    'name', ['class_3', 'five_bar', 'excavator_bucket', 'whitworth_quick_return']
)
def test_derivatives_are_those_of_its_positions(name):
    linkage = shipped_linkage(name)
    reference, inputs = Reference(linkage), usual_inputs(Closure(linkage))
    rates = [0.7 - 1.1 * k for k in range(len(inputs))]
    accelerations = [0.3 + k for k in range(len(inputs))]
    found = reference.solve(inputs, rates, accelerations)
    with mp.workdps(90):
        h = mpf(10) ** -15

        def at(time: Any) -> tuple[Any, ...]:
            moved = [
                x + v * time + a * time**2 / 2
                for x, v, a in zip(inputs, rates, accelerations, strict=True)
            ]
            return tuple(mp.mpf(x) for x in reference.solve(moved).joints)

        before, now, after = at(-h), at(mpf(0)), at(h)
        for k in range(len(now)):
            rate, acceleration = mp.mpf(found.rates[k]), mp.mpf(found.accelerations[k])
            # An angle may be told a turn away from its neighbour.
            ahead, behind = (
                end - now[k] - 2 * mp.pi * mp.nint((end - now[k]) / (2 * mp.pi))
                for end in (after[k], before[k])
            )
            assert abs((ahead - behind) / (2 * h) - rate) < 1e-25
            assert abs((ahead + behind) / h**2 - acceleration) < 1e-25


def held_by(proof: Any, truth: Any, turning: tuple[bool, ...]) -> bool:
    """Return whether balls of 1e-40 hold the reference, which is told to 80 digits and more."""
    ctx.prec = 512
    for balls, values in zip(proof, truth.orders, strict=True):
        for ball, value, turns in zip(balls, values, turning, strict=True):
            with mp.workdps(90):
                number = arb(mp.nstr(mp.mpf(value), 85))
            if turns and balls is proof.joints:
                number -= 2 * arb.pi() * round(float((number - ball).mid()) / (2 * pi))
            size = max(1.0, abs(float(value)))
            if (
                not (number + arb(0, 1e-70 * size)).overlaps(ball)
                or float(ball.rad()) > 1e-40 * size
            ):
                return False
    return True


@pytest.mark.parametrize('name', [*SHIPPED, 'five dyads'])
def test_balls_prove_it_for_every_shipped_linkage(name):
    linkage = linkage_of(name)
    closure = Closure(linkage)
    inputs = usual_inputs(closure)
    driven = inputs, [1.0] * len(inputs), [0.5] * len(inputs)
    assert held_by(prove(linkage, *driven), Reference(linkage).solve(*driven), closure.turning)


@pytest.mark.parametrize(
    ('name', 'find'),
    [('double_rocker', near_toggle), ('excavator_bucket', near_toggle),
     ('parallelogram', near_change_point)],
)  # fmt: skip
def test_balls_prove_it_next_to_trouble(name, find):
    linkage = shipped_linkage(name)
    closure, reference = Closure(linkage), Reference(linkage)
    for inputs in find(closure)[0][::7]:
        driven = inputs, [1.0], [0.5]
        assert held_by(prove(linkage, *driven), reference.solve(*driven), closure.turning), inputs


def test_a_ball_does_not_hold_what_is_off_by_1e_30():
    linkage = shipped_linkage('four_bar')
    driven = [1.0], [1.0], [0.5]
    truth = Reference(linkage).solve(*driven)
    with mp.workdps(90):
        moved = truth._replace(rates=tuple(mp.mpf(rate) + mpf(10) ** -30 for rate in truth.rates))
    proof = prove(linkage, *driven)
    assert held_by(proof, truth, (True, True))
    assert not held_by(proof, moved, (True, True))


def test_a_change_point_itself_has_no_reference():
    linkage = shipped_linkage('parallelogram')
    with pytest.raises(SingularError, match='singular'):
        Reference(linkage).solve([0.0])
    with pytest.raises(SingularError, match='nothing is proved'):
        prove(linkage, [0.0])


def test_what_does_not_close_has_none():
    linkage = shipped_linkage('double_rocker')
    for solve in (Reference(linkage).solve, lambda inputs: prove(linkage, inputs)):
        with pytest.raises(ValueError, match='open'):
            solve([3.0])


def test_a_run_confirms_some_of_its_states_and_notices_one_that_differs():
    linkage = shipped_linkage('jansen_leg')
    poses = Poses('easy', '', 'jansen_leg', linkage, tuple((0.1 * k,) for k in range(9)))
    truths = true_states(poses)
    assert confirmed(poses, truths) == 3
    with mp.workdps(90):
        joints = tuple(mp.mpf(joint) for joint in truths[0].joints)
        truths[0] = truths[0]._replace(joints=(joints[0] + mpf(10) ** -30, *joints[1:]))
    with pytest.raises(ArithmeticError, match='references differ'):
        confirmed(poses, truths)
