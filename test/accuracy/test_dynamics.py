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


"""Free motions whose end is known: against elliptic functions, and against another integrator."""

from dataclasses import replace
from math import pi, sqrt

from linkage_ros.accuracy.dynamics import (
    free_motion,
    integrate,
    measure_dynamics,
    SECONDS,
    slope,
    STEPS,
)
from linkage_ros.accuracy.energy_integral import (
    ExactEnergy,
    NoReferenceError,
    State,
    swung,
    turned,
)
from linkage_ros.dynamics.loads import Loads
from linkage_ros.dynamics.mechanics import Mechanics
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Mass
from linkage_ros.resources import shipped
from linkage_ros.scene.load import load_scene
import mpmath
import pytest
from scipy.integrate import solve_ivp

from ..support.scenes import four_bar_text

TORQUE = 'scenes/torque_crank.yaml'
G = 9.81


def linkage_of(name):
    return load_scene(shipped(f'linkages/{name}.yaml')).members[0].linkage


@pytest.fixture(scope='module')
def pendulum():
    """Return a parallelogram, whose coupler does not turn: a pendulum with I·θ̈ = −W·cos θ."""
    linkage = linkage_of('parallelogram')
    radius = abs(complex(*linkage.links['crank']['A']) - complex(*linkage.links['crank']['O2']))
    arms = Mass(0.3, (0.0, 0.0), 0.004)
    linkage = replace(
        linkage,
        masses={'crank': arms, 'follower': arms, 'coupling_rod': Mass(0.7, (0.0, 0.0), 0.1)},
    )
    inertia, weight = 2 * 0.004 + 0.7 * radius**2, 0.7 * G * radius
    return linkage, Loads(gravity=(0.0, -G)), inertia, weight


def test_a_parallelogram_has_the_energy_of_a_pendulum(pendulum):
    linkage, loads, inertia, weight = pendulum
    energy = ExactEnergy(linkage, loads)
    (_, low), (_, high) = map(energy.inertia_and_potential, (-1.0, 0.5))
    assert float(energy.inertia_and_potential(0.3)[0]) == pytest.approx(inertia, rel=1e-15)
    rise = weight * (mpmath.sin(0.5) - mpmath.sin(-1.0))
    assert float(high - low) == pytest.approx(float(rise), rel=1e-15)


def test_a_swing_is_that_of_a_pendulum(pendulum):
    linkage, loads, inertia, weight = pendulum
    # From the bottom at −π/2 the angle is ψ: ψ̈ = −Ω²·sin ψ, let go at −1.
    found = swung(ExactEnergy(linkage, loads), -pi / 2 - 1.0, -pi / 2 + 0.9, SECONDS)
    with mpmath.workdps(40):
        omega = mpmath.sqrt(mpmath.mpf(weight) / inertia)
        # The start is a double, and so is its distance from the bottom.
        let_go = mpmath.mpf(-pi / 2 - 1.0) + mpmath.pi / 2
        k = mpmath.sin(let_go / 2)
        u, m = omega * SECONDS, k * k
        psi = 2 * mpmath.asin(k * mpmath.ellipfun('cd', u, m=m))
        slope = -(1 - m) * mpmath.ellipfun('sn', u, m=m) / mpmath.ellipfun('dn', u, m=m) ** 2
        rate = 2 * k * omega * slope / mpmath.cos(psi / 2)
        expected = float(psi - mpmath.pi / 2), float(rate)
    assert found.value == pytest.approx(expected[0], abs=1e-13)
    assert found.rate == pytest.approx(expected[1], abs=1e-12)


def test_a_swing_that_has_too_much_energy_is_refused(pendulum):
    linkage, loads, *_ = pendulum
    with pytest.raises(NoReferenceError):
        turned(ExactEnergy(linkage, loads), State(-pi / 2, 0.5), SECONDS)


@pytest.mark.parametrize(('name', 'start'), [('four_bar', State(0.5, 15.0)), ('drag_link', None)])
def test_turning_agrees_with_another_integrator(name, start):
    scene = load_scene(shipped(TORQUE))
    linkage = linkage_of(name)
    if not linkage.masses:
        bar = Mass(0.2, (0.01, 0.0), 1e-4)
        linkage = replace(linkage, masses={k: bar for k in linkage.links if k != 'ground'})
    start = start or State(1.0, 60.0)
    loads = replace(scene.members[0].loads, springs=())
    found = turned(ExactEnergy(linkage, loads), start, 1.0)
    mechanics = Mechanics(Closure(linkage), loads)
    position = mechanics.closure.position

    def motion(_, state):
        terms = mechanics.terms(position(state[0]))
        push = -terms.potential_slope - terms.half_slope * state[1] ** 2
        return [state[1], push / terms.inertia]

    solved = solve_ivp(motion, (0.0, 1.0), start, method='DOP853', rtol=1e-13, atol=1e-13)
    assert found.value == pytest.approx(solved.y[0, -1], abs=1e-9)
    assert found.rate == pytest.approx(solved.y[1, -1], abs=1e-8)


def test_errors_fall_by_the_order_of_the_method():
    motion = free_motion(load_scene(shipped(TORQUE)).members[0])
    for method, steps, order in (
        ('semi_implicit_euler', (2e-3, 1e-3), 1),
        ('rk4', (2e-3, 1e-3), 4),
        ('gauss_legendre', (1e-2, 5e-3), 6),
    ):
        results = [integrate(motion, method, step) for step in steps]
        errors = [(result.step, result.error) for result in results]
        drifts = [(result.step, result.drift) for result in results]
        # Of an oscillator RK4 loses |R(iz)| = 1 − z⁶/144 a step: over many turns, where that is
        # what counts, its error falls with the fifth power.
        most = order + (1.4 if method == 'rk4' else 0.4)
        assert order - 0.4 < slope(errors) < most, method
        assert order - 0.4 < slope(drifts) < most, method


def test_the_slope_is_of_the_shortest_steps_that_tell():
    assert slope([(1.0, 5.0), (0.1, 1e-3), (0.01, 1e-7), (0.001, 1e-14)]) == pytest.approx(4.0)
    assert slope([(1.0, 1e-13), (0.1, 1e-14)]) is None


def test_the_part_has_all_methods_and_what_the_scene_says():
    part = measure_dynamics(load_scene(shipped(TORQUE)), True, lambda *said: None)
    table, slopes = part.tables
    assert {row[0] for row in table.rows} == set(STEPS) == {row[0] for row in slopes.rows}
    assert ('rk4', 1.0) in [row[:2] for row in table.rows], 'as the scene has it'
    for diagram in part.diagrams:
        assert [curve.name for curve in diagram.curves] == list(STEPS)
    assert len(part.advice) == 4
    assert part.headline.startswith('rk4, 1 ms a step: ')
    assert len(part.sentences) == 3


def test_without_torque_there_is_no_such_part():
    scene = load_scene(shipped('scenes/demo.yaml'))
    assert measure_dynamics(scene, True, lambda *said: None) is None


def scene_text(linkage, start, loads):
    return (
        f'linkage: {linkage}\nrate: 100\ndrive: {{torque: {{start: {start}}}}}\nloads: {loads}\n'
    )


DOUBLE_ROCKER = four_bar_text(0.9, 0.6, 0.8, 1, [(1, 0.45, 0.07), (1, 0.3, 0.03), (1, 0.4, 0.05)])


@pytest.mark.parametrize(
    ('loads', 'words'),
    [
        ('{gravity: [9.81, 0]}', 'swings'),
        ('{drive_inertia: 0.1}', 'Not measured: under its weight and springs it falls'),
    ],
)
def test_an_input_that_cannot_turn_swings_or_is_said_to_fall(tmp_path, loads, words):
    (tmp_path / 'rocker.yaml').write_text(DOUBLE_ROCKER)
    (tmp_path / 'scene.yaml').write_text(scene_text('rocker.yaml', 0.8, loads))
    part = measure_dynamics(load_scene(tmp_path / 'scene.yaml'), True, lambda *said: None)
    assert any(words in text for text in (part.headline, *part.method))
    if part.tables:
        best = min(row[3] for row in part.tables[0].rows)
        assert best < 1e-6 * sqrt(SECONDS), 'the reference is where the methods go'
