# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Loads on joints and points: motions in closed form, and by scipy's integrator with its own events.

Most are on a crank alone, whose inertia about its pivot is 0.23 kg·m², so that each load can be
seen by itself; then on linkages, where a load does the work f·dψ.
"""

from itertools import pairwise
from math import cos, exp, remainder, sin, sqrt, tau
from pathlib import Path

from linkage_ros.dynamics import (
    Friction,
    JointFriction,
    JointLoad,
    JointSpring,
    Loads,
    Mechanics,
    PointLoad,
    SoftStop,
)
from linkage_ros.errors import DefinitionError, FileError
import pytest
from scipy.integrate import solve_ivp

from .loaded import closed, everywhere, STATES, swing
from ..support.scenes import PENDULUM, pipeline_of

LINKAGES = Path(__file__).parents[2] / 'config' / 'linkages'
MS = 1_000_000
BEGIN = 1_700_000_000_000 * MS
INERTIA = 0.05 + 2.0 * 0.3**2
LIMITED = PENDULUM.replace('child: crank}\n', 'child: crank, limits: [-2, 1]}\n', 1)
METHODS = ('rk4', 'gauss_legendre')

# What a load does, as (load, start, rate) and the motion q(t).
WAVE = sqrt(4.0 / INERTIA)
DECAY = 0.5 * 0.3 / INERTIA
SLOWER = sqrt(4.0 / INERTIA - DECAY**2)
CLOSED_FORMS = {
    'a constant effort': ({'efforts': {'crank_joint': JointLoad(0.5)}}, 0.2, 1.0,
                          lambda t: 0.2 + t + 0.25 / INERTIA * t * t),
    'an effort that grows with the time': (
        {'efforts': {'drive_joint': JointLoad(over_time=((0.0, 0.0), (2.0, 1.0)))}}, 0.0, 0.0,
        lambda t: t**3 / 12.0 / INERTIA,
    ),
    'an effort from an instant between two steps on': (
        {'efforts': {'drive_joint': JointLoad(
            over_time=((0.1234567, 0.0), (0.12345670001, 1.0))
        )}}, 0.0, 0.0,
        lambda t: 0.5 / INERTIA * max(0.0, t - 0.123456700005) ** 2,
    ),
    'a motor curve, on its slope': (
        {'efforts': {'drive_joint': JointLoad(over_rate=((0.0, 2.0), (10.0, 0.0)))}}, 0.0, 0.0,
        lambda t: 10.0 * (t - 5.0 * INERTIA * (1.0 - exp(-t / (5.0 * INERTIA)))),
    ),
    'a spring': ({'joint_springs': {'crank_joint': JointSpring(4.0, 0.3)}}, 0.5, 0.0,
                 lambda t: 0.3 + 0.2 * cos(WAVE * t)),
    'a spring with a damper': (
        {'joint_springs': {'drive_joint': JointSpring(4.0, 0.3, 0.3)}}, 0.5, 0.0,
        lambda t: 0.3
        + 0.2 * exp(-DECAY * t) * (cos(SLOWER * t) + DECAY / SLOWER * sin(SLOWER * t)),
    ),
    'a force that turns with its link': (
        {'forces': {'crank.end': PointLoad((0.0, 2.0), 'link', 0.6)}}, 0.0, 0.0,
        lambda t: 0.5 * 0.3 / INERTIA * t * t,
    ),
    'a force along the link': ({'forces': {'crank.end': PointLoad((1.0, 0.0), 'link', 9.0)}}, 0.0,
                               0.5, lambda t: 0.5 * t),
}  # fmt: skip


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('name', CLOSED_FORMS)
def test_loaded_crank_follows_its_closed_form(name, method):
    applied, start, rate, expected = CLOSED_FORMS[name]
    after = swing(applied=applied, start=start, rate=rate, method=method)
    for seconds in (0.05, 0.1234567, 0.3331, 0.7):
        assert after(seconds)[0] == pytest.approx(expected(seconds), abs=2e-11)


def test_constant_ground_force_equals_a_weight():
    # The weight 2·9.81 N at 0.3 m has the moment of 11.772 N at 0.5 m.
    pulled = swing(applied={'forces': {'crank.end': PointLoad((0.0, -1.0), constant=11.772)}})
    hung = swing(gravity=(0.0, -9.81))
    for seconds in (0.1, 0.5, 1.3):
        assert pulled(seconds) == pytest.approx(hung(seconds), rel=1e-12)


def test_position_table_adds_the_energy_of_its_area():
    # Steps of 1 ms go across the rows at any place; the order of RK4 holds none the less.
    rows = ((-0.5, 1.0), (0.111, 3.0), (0.7777, -2.0), (1.5, 0.5))
    after = swing(applied={'efforts': {'crank_joint': JointLoad(over_position=rows)}}, rate=0.3)

    def area(end):
        places = [0.0, *(x for x, _ in rows if 0.0 < x < end), end]
        return sum(
            0.5 * (b - a) * (on_rows(rows, a) + on_rows(rows, b)) for a, b in pairwise(places)
        )

    for seconds in (0.1, 0.2, 0.3, 0.35):
        value, rate, _ = after(seconds)
        energy = 0.5 * INERTIA * (rate**2 - 0.3**2)
        assert energy == pytest.approx(area(value), abs=1e-11)


def on_rows(rows, x):
    for (a, f), (b, g) in pairwise(rows):
        if a <= x <= b:
            return f + (x - a) / (b - a) * (g - f)
    return rows[0][1] if x < rows[0][0] else rows[-1][1]


@pytest.mark.parametrize('damping', [0.0, 0.2, 3.0])
@pytest.mark.parametrize('method', METHODS)
def test_soft_stop_returns_the_crank_as_scipy_integrates(method, damping):
    # scipy integrates flight and contact, with an event at each end of the contact.
    stiffness = 60.0
    after = swing(
        LIMITED, start=0.0, rate=5.0, method=method,
        applied={'stops': {'drive_joint': SoftStop(stiffness, damping)}},
    )  # fmt: skip

    def pushed(_, state):
        return [state[1], -(stiffness * (state[0] - 1.0) + damping * state[1]) / INERTIA]

    def lets_go(_, state):
        return stiffness * (state[0] - 1.0) + damping * state[1]

    lets_go.terminal, lets_go.direction = True, -1
    contact = solve_ivp(
        pushed, (0.0, 1.0), [1.0, 5.0], 'DOP853', events=lets_go, rtol=1e-12, atol=1e-13,
        dense_output=True, first_step=1e-5,
    )  # fmt: skip
    begins = 0.2
    ends = begins + contact.t[-1]
    value, rate = contact.y[:, -1]
    assert rate < 0.0
    for seconds in (0.1, 0.23, ends - 0.01, ends + 0.05):
        if seconds < begins:
            expected = 5.0 * seconds, 5.0
        elif seconds < ends:
            expected = tuple(contact.sol(seconds - begins))
        else:
            expected = value + rate * (seconds - ends), rate
        assert after(seconds)[:2] == pytest.approx(expected, abs=5e-8)
    assert damping or rate == pytest.approx(-5.0, rel=1e-9)


def test_undamped_soft_stops_keep_the_energy():
    after = swing(
        LIMITED, rate=5.0, applied={'stops': {'drive_joint': SoftStop(200.0)}}, method='rk4'
    )
    rates = [abs(after(0.01 * n)[1]) for n in range(1, 500)]
    assert max(rates) == pytest.approx(5.0, rel=1e-8)
    assert min(rates) < 1.0  # it was in the stops, at both ends


def test_soft_stop_replaces_only_its_own_hard_stop():
    yields = {'stops': {'drive_joint': SoftStop(60.0)}}
    other = LIMITED.replace('child: crank}}', 'child: crank, limits: [-3, 1.1]}}')
    for linkage, applied, ends in (
        (LIMITED, None, pytest.approx(1.0, abs=1e-4)),
        (LIMITED, yields, pytest.approx(1.0 + 5.0 * sqrt(INERTIA / 60.0), rel=1e-3)),
        (other, yields, pytest.approx(1.1, abs=1e-4)),
    ):
        after = swing(linkage, rate=5.0, applied=applied)
        assert max(after(0.001 * n)[0] for n in range(500)) == ends


def test_friction_holds_until_the_effort_exceeds_it():
    # 0.4 N·m of friction; the effort is 1 N·m/s · t and beats it at 0.4 s, between two ticks.
    after = swing(
        friction=Friction({'O': JointFriction(coulomb=0.4)}),
        applied={'efforts': {'drive_joint': JointLoad(over_time=((0.0, 0.0), (5.0, 5.0)))}},
        step=0.03,
    )
    assert after(0.399)[:2] == (0.0, 0.0)
    for seconds in (0.5, 0.91):
        late = seconds - 0.4
        assert after(seconds)[0] == pytest.approx(late**3 / 6.0 / INERTIA, rel=1e-9)


# On linkages.


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', STATES)
def test_drive_effort_equals_the_virtual_work_of_loads(name):
    closure = closed(name)
    linkage, applied = closure.linkage, everywhere(closed(name))
    bare, loaded = Mechanics(closure), Mechanics(closure, Loads(applied=applied))
    names = [*(given.joint for given in linkage.inputs), *linkage.joints]
    driven = closure.input_names
    turning = {
        joint
        for joint, turns in zip(closure.joint_names, closure.turning, strict=True)
        if turns and joint not in driven
    }
    for q in STATES[name]:
        rates, time = [1.3, -0.8][: len(q)], 0.7
        position = closure.position(*q)
        velocity = closure.velocity(position, *rates)
        acceleration = closure.acceleration(position, velocity, *(0.5 for _ in q))
        given = position, velocity, acceleration
        more = [
            a - b
            for a, b in zip(
                loaded.drive_efforts(*given, (time,)), bare.drive_efforts(*given), strict=True
            )
        ]
        found = dict(zip(names, [*position.inputs, *position.joints], strict=True))
        speeds = dict(zip(names, [*rates, *velocity.joints], strict=True))

        for i in range(len(q)):
            h = 1e-6

            def moved(by, i=i, q=q):
                at = closure.position(*(x + by * (j == i) for j, x in enumerate(q)))
                places = {f'{link}.{p}': z for (link, p), z in closure.points(at).items()}
                return dict(zip(names, [*at.inputs, *at.joints], strict=True)), places

            (ahead, there), (behind, here) = moved(h), moved(-h)
            work = 0.0
            for joint, spring in applied.joint_springs.items():
                way = (ahead[joint] - behind[joint]) / (2 * h)
                load = applied.efforts[joint]
                force = load.constant + on_rows(load.over_time, time)
                force += on_rows(load.over_position, found[joint])
                stretch = found[joint] - spring.free
                if joint in turning:  # the nearest turn counts
                    stretch = remainder(stretch, tau)
                work += way * (force - spring.stiffness * stretch - spring.damping * speeds[joint])
            for point, load in applied.forces.items():
                way = (there[point] - here[point]) / (2 * h)
                along = complex(*load.direction) / abs(complex(*load.direction))
                if load.frame == 'link':
                    turn = closure.link_angles(position)[point.partition('.')[0]]
                    along *= complex(cos(turn), sin(turn))
                force = load.constant
                if load.over_rate:
                    force += on_rows(load.over_rate, rates[0])
                work += force * (way * along.conjugate()).real
            assert more[i] == pytest.approx(-work, rel=1e-6, abs=1e-6)


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', [name for name in STATES if name != 'five_bar'])
def test_compiled_load_terms_equal_the_interpreted_ones(name):
    closure = closed(name)
    mechanics = Mechanics(closure, Loads(applied=everywhere(closure)))
    for (q,) in STATES[name]:
        assert mechanics.motion_equation(q) == mechanics.motion_terms(closure.position(q))


def test_mechanics_without_loads_builds_no_load_terms():
    assert Mechanics(closed('four_bar')).applied is None


# What is refused: the load, and what the line says.
REFUSED = {
    'efforts: {elbow: {constant: 1}}': "elbow: there is no joint 'elbow'",
    'forces: {hand.end: {direction: [1, 0], constant: 1}}': "there is no point 'hand.end'",
    'forces: {ground.O: {direction: [1, 0], constant: 1}}': 'lies on the ground',
    'forces: {crank.end: {direction: [0, 0], constant: 1}}': '[0, 0] is not a direction',
    'forces: {crank.end: {direction: [1, 0]}}': 'is a load of 0',
    'efforts: {crank_joint: {over_time: [[0, 1]]}}': 'has one row',
    'efforts: {crank_joint: {over_time: [[1, 1], [0, 2]]}}': 'row 2 begins with 0 s, not after',
    'efforts: {crank_joint: {over_rate: [[0, 1], [1, .nan]]}}': 'efforts.crank_joint.over_rate',
    'efforts: {crank_joint: {constant: 1, over_angle: [[0, 1], [1, 1]]}}': 'unknown key',
    'stops: {drive_joint: {stiffness: 10}}': 'the joint has no limits',
    'joint_springs: {drive_joint: {stiffness: 1e9}}': 'too stiff for a step of 0.001 s',
    'joint_springs: {drive_joint: {stiffness: 1, damping: 5000}}': 'too stiff for a step',
    'joint_springs: {drive_joint: {damping: 1}}': "the key 'stiffness' is missing",
}  # fmt: skip


@pytest.mark.parametrize('load', REFUSED)
def test_invalid_load_is_refused_in_one_line(load):
    with pytest.raises((FileError, DefinitionError)) as refused:
        pipeline_of(f'rate: 100\ndrive: {{torque: {{}}}}\nloads: {{{load}}}\n', PENDULUM)
    assert REFUSED[load] in str(refused.value)
    assert '\n' not in str(refused.value)


@pytest.mark.parametrize('method', ['semi_implicit_euler', *METHODS])
@pytest.mark.parametrize('spring', [(1e6, 0.0), (1e4, 300.0), (1e3, 2e3)])
def test_recommended_step_keeps_a_stiff_spring_stable(method, spring):
    applied = {'joint_springs': {'crank_joint': JointSpring(spring[0], 0.0, spring[1])}}
    with pytest.raises(DefinitionError, match='too stiff') as refused:
        swing(applied=applied, start=0.1, method=method, step=0.05)
    step = float(
        str(refused.value).partition('step of ')[2].partition('write a step of ')[2].split()[0]
    )
    after = swing(applied=applied, start=0.1, method=method, step=step)
    assert all(abs(after(step * n)[0]) < 0.15 for n in range(0, 300, 7))


# Andrews' squeezing mechanism as shipped, under its constant torque. Reference: Test Set for IVP
# Solvers, Bari, "Andrews' squeezing mechanism", the angles after 0.03 s.
SQUEEZED = {
    'beta': 15.81077119629904, 'theta': -15.75637105984298, 'gamma': 0.04082224013073101,
    'phi': -0.5347301163226948, 'delta': 0.5244099658805304, 'omega': 0.5347301163226948,
    'epsilon': 1.048080741042263,
}  # fmt: skip

SQUEEZER = """
rate: 1000
drive: {torque: {start: -0.0617138900142764, method: METHOD, step: STEP}}
loads:
  springs: {spring: {from: ground.C, to: K3.D, stiffness: 4530, free_length: 0.07785}}
  efforts: {beta: {constant: 0.033}}
"""


@pytest.mark.parametrize(('method', 'step'), [('rk4', '1.0e-5'), ('gauss_legendre', '1.0e-4')])
def test_andrews_squeezer_equals_the_published_end_state(method, step):
    text = SQUEEZER.replace('METHOD', method).replace('STEP', step)
    linkage = (LINKAGES / 'andrews_squeezer.yaml').read_bytes()
    (line,) = pipeline_of(text, linkage).linkages
    for tick in range(31):
        seen = line.interpret(BEGIN + tick * MS)
    found = dict(zip(line.scene_linkage.joint_names, seen.reading.joints, strict=True))
    assert found == pytest.approx(SQUEEZED, abs=1e-8)
