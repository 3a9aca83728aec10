# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The longest step that a refusal recommends gives the accuracy that it names.

The reference is scipy's DOP853 at 1e-12, cut at its events: contacts, and rates of zero.
"""

from math import exp, inf, sin, sqrt, tau
import random

from linkage_ros.dynamics import (
    Contact,
    EXACT,
    LawTerm,
    Loads,
    Mechanics,
    METHODS,
    SingleDofMechanism,
    Terms,
)
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Closure
from linkage_ros.messages import EffortCommand
import pytest
from scipy.integrate import solve_ivp

from .loaded import BEGIN, FOLDER, shipped
from ..support.scenes import pipeline_of

SHARES = {'semi_implicit_euler': 1e-2, 'rk4': 1e-3, 'gauss_legendre': 1e-4}
"""What is promised of a step, by method."""
FOUR_BAR = (FOLDER / 'four_bar.yaml').read_text()


def integrated(slopes, begin, until, state, *events):
    """Return the solution up to the first event."""
    for event in events:
        event.terminal = True
    return solve_ivp(
        slopes, (begin, until), state, 'DOP853', events=events, rtol=1e-12, atol=1e-13
    )  # fmt: skip


def after_a_blow(damping):
    """Return the rate after a blow of rate 1 on x'' + 2·damping·x' + x = 0, which only pushes."""

    def leaves(_, y):
        return y[0] + 2.0 * damping * y[1]

    leaves.direction = -1
    done = integrated(lambda _, y: [y[1], -leaves(0, y)], 0.0, 1e3, [0.0, 1.0], leaves)
    return done.y_events[0][0][1]


@pytest.mark.parametrize('method', EXACT)
@pytest.mark.parametrize('damping', [0.0, 0.05, 0.3, 0.7, 1.0, 1.5, 5.0])
def test_longest_step_reproduces_the_rebound_rate(method, damping):
    fastest = damping + sqrt(damping**2 - 1.0) if damping > 1.0 else 1.0
    step, drawn = EXACT[method] / fastest, random.Random(f'{method} {damping}')
    stop = Contact(-inf, 0.0, 1.0, 2.0 * damping)
    mechanism = SingleDofMechanism(
        lambda value: Terms(1.0, 0.0, 0.0, 0.0, 0.0, (), (LawTerm(1.0, value, 1.0),)),
        METHODS[method].step,
        laws=(stop,),
    )
    expected = after_a_blow(damping)
    for _ in range(6):
        motion = mechanism.state_at(-drawn.random() * step, 1.0)
        for _ in range(100_000):
            motion = mechanism.advance(motion, step, 0.0)
            if motion.rate < 0.0 and stop.segment(motion.value, motion.rate, 0.0) == 0:
                break
        assert motion.rate == pytest.approx(expected, abs=SHARES[method])


def recommended(scene, linkage=FOUR_BAR):
    """Return the step that the refusal of a scene with ``STEP`` recommends."""
    with pytest.raises(FileError) as refused:
        pipeline_of(scene.replace('STEP', '0.05'), linkage)
    told = str(refused.value)
    assert '\n' not in told
    return float(told.partition('write a step of ')[2].split()[0])


STOPPED = FOUR_BAR.replace(
    'rocker_joint: {parent: ground, child: rocker}',
    'rocker_joint: {parent: ground, child: rocker, limits: [1.2, 1.8]}',
)
BLOW = """
rate: 1000
loads: {gravity: [0, -9.81], drive_inertia: 1.0e-3, stops: {rocker_joint: {stiffness: K}}}
drive: {torque: {start: 2.25, rate: 5.0, method: METHOD, step: STEP}}
effects: {velocity: {}}
"""


@pytest.mark.parametrize('method', ['rk4', 'gauss_legendre'])
@pytest.mark.parametrize('stiffness', ['5.0e+4', '1.0e+6'])
def test_recommended_step_reproduces_a_rocker_impact(method, stiffness):
    scene = BLOW.replace('K}', f'{stiffness}}}').replace('METHOD', method)
    step = recommended(scene, STOPPED)
    (linkage,) = pipeline_of(scene.replace('STEP', repr(step)), STOPPED).linkages
    found = [linkage.drive.state(BEGIN + 1_000_000 * ms) for ms in range(26)][-1]

    closure = Closure(shipped('four_bar'))
    mechanics = Mechanics(closure, Loads((0.0, -9.81), drive_inertia=1e-3))

    def depth(_, y):
        return closure.position(y[0]).joints[1] - 1.8

    def slopes(contact):
        def slope(_, y):
            position = closure.position(y[0])
            terms, lever = (
                mechanics.motion_terms(position),
                closure.velocity(position, 1.0).joints[1],
            )
            push = float(stiffness) * depth(0, y) * lever if contact else 0.0
            return [
                y[1],
                -(terms.potential_slope + terms.half_slope * y[1] ** 2 + push) / terms.inertia,
            ]

        return slope

    t, state, contact, blows = 0.0, [2.25, 5.0], False, 0
    while t < 0.025:
        depth.direction = -1 if contact else 1
        done = integrated(slopes(contact), t, 0.025, state, depth)
        t, state = done.t[-1], done.y[:, -1]
        blows += contact and t < 0.025
        contact = not contact
    assert blows == 1, 'there is a blow'
    assert state[1] < -4.0
    assert found.rates[0] == pytest.approx(state[1], rel=SHARES[method])


CURVED = """
rate: 1000
loads: {gravity: [0, -9.81], drive_inertia: 1.0e-3}
drive: {torque: {start: 1.0, method: METHOD, step: STEP}}
effects: {velocity: {}, friction: {joints: {O2: {coulomb: 0.02, breakaway: 0.05, stribeck: RATE}}}}
"""


def pushed(number):
    """Return the command of 10 ms with this number, in [N·m]."""
    return 0.15 * sin(tau * 2.0 * 0.01 * number)


def rubbed_by_scipy(rate, count):
    """Return the crank's angle after some commands, with events where it comes to rest."""
    closure = Closure(shipped('four_bar'))
    mechanics = Mechanics(closure, Loads((0.0, -9.81), drive_inertia=1e-3))
    state, sense = [1.0, 0.0], 0.0
    for index in range(count):
        t, end, push = 0.01 * index, 0.01 * (index + 1), pushed(index)
        while t < end:
            if not sense:
                left = push - mechanics.motion_terms(closure.position(state[0])).potential_slope
                if abs(left) <= 0.05:
                    break
                sense = 1.0 if left > 0.0 else -1.0

            def slope(_, y, push=push, sense=sense):
                terms = mechanics.motion_terms(closure.position(y[0]))
                rubs = sense * (0.02 + 0.03 * exp(-((y[1] / rate) ** 2)))
                left = push - rubs - terms.potential_slope - terms.half_slope * y[1] ** 2
                return [y[1], left / terms.inertia]

            rests = lambda _, y, sense=sense: sense * y[1]  # noqa: E731
            rests.direction = -1
            done = integrated(slope, t, end, state, rests)
            t, state = done.t[-1], [*done.y[:, -1]]
            if t < end:
                state[1], sense = 0.0, 0.0
    return state[0]


@pytest.mark.parametrize('method', ['rk4', 'gauss_legendre'])
@pytest.mark.parametrize('rate', [0.1, 0.01])
def test_recommended_step_reproduces_stribeck_friction(method, rate):
    scene = CURVED.replace('METHOD', method).replace('RATE', repr(rate))
    step = recommended(scene)
    (linkage,) = pipeline_of(scene.replace('STEP', repr(step)), FOUR_BAR).linkages
    linkage.drive.state(BEGIN)
    for index in range(20):
        now = BEGIN + 10_000_000 * index
        assert linkage.drive.offer(EffortCommand(0, (pushed(index),)), now) is None
    found = linkage.drive.state(BEGIN + 200_000_000).angles[0]
    expected = rubbed_by_scipy(rate, 20)
    assert abs(expected - 1.0) > 0.5, 'it moves'
    assert found == pytest.approx(expected, abs=0.1 * SHARES[method])


def test_too_narrow_stribeck_rate_is_refused_with_a_remedy():
    scene = CURVED.replace('METHOD', 'rk4').replace('RATE', '1.0e-5').replace('STEP', '1.0e-5')
    with pytest.raises(FileError, match=r'O2\.stribeck: .*; write 0: breakaway') as refused:
        pipeline_of(scene, FOUR_BAR)
    assert '\n' not in str(refused.value)


# A motion that is given may go beyond a stop that yields; a hard limit refuses it.
GIVEN = {
    'constant_rate': 'constant_rate: {rate: 3.0, start: 2.0}',
    'sine': 'sine: {mean: 2.0, amplitude: 0.8, frequency: 0.5}',
    'chirp': 'chirp: {mean: 2, amplitude: 1, start_frequency: 0.5, end_frequency: 1, seconds: 2}',
    'profile': 'profile: {table: [[0, 2.0], [1, 3.0]]}',
}


@pytest.mark.parametrize('name', GIVEN)
def test_given_motion_into_a_soft_stop_adds_its_effort(name):
    scene = f"""
rate: 1000
drive: {{{GIVEN[name]}}}
effects: {{velocity: {{}}, effort: {{}}}}
loads: {{LOADS}}
"""
    with pytest.raises(FileError, match='limit'):
        pipeline_of(scene.replace('LOADS', ''), STOPPED)
    stops = 'stops: {rocker_joint: {stiffness: 50, damping: 0.05}}'
    into = pipeline_of(scene.replace('LOADS', stops), STOPPED)
    free = pipeline_of(scene.replace('LOADS', ''), FOUR_BAR)
    closure, touched = Closure(shipped('four_bar')), 0
    for index in range(0, 1000, 20):
        now = BEGIN + 1_000_000 * index
        one, other = (pipeline.tick(now).states[0] for pipeline in (into, free))
        assert one.reading.joints == other.reading.joints
        assert one.reading.rates == other.reading.rates
        rocker, rate = one.reading.joints[2], one.reading.rates[2]
        push = 0.0
        if not 1.2 <= rocker <= 1.8:
            out, end = (1.0, 1.8) if rocker > 1.8 else (-1.0, 1.2)
            push = out * max(0.0, out * (50.0 * (rocker - end) + 0.05 * rate))
        lever = closure.velocity(closure.position(one.crank.angles[0]), 1.0).joints[1]
        touched += push != 0.0
        more = one.reading.efforts[0] - other.reading.efforts[0]
        assert more == pytest.approx(push * lever, abs=1e-9)
    assert touched > 5
