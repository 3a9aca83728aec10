# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Coulomb friction has a kink where a joint's slip turns: the methods keep their order across it.

The reference is worked out by hand and without steps. A crank that turns one way has the energy::

    ½·I(q)·q̇² + V(q) = E₀ − Σ T·(way that the joint has slipped, to and fro)

and the time is the integral of dq/q̇, by Gauss's rule between the places at which slips turn. Pose
and rates are those of textbooks (R. L. Norton, Design of Machinery, ch. 4 and 6).
"""

from cmath import rect
from itertools import pairwise
from math import log2, pi, sin, sqrt

from linkage_ros.dynamics import (
    Friction,
    JointFriction,
    Loads,
    Mechanics,
    METHODS,
    SingleDofMechanism,
    Terms,
)
from linkage_ros.kinematics import Mass
import numpy as np
import pytest

from .loaded import closed, four_bar, scotch_yoke, STATES
from .test_integrators import ORDER, STEP
from ..support.four_bar import four_bar_angles, GALLERY

GRAVITY = 9.81
LENGTHS = GALLERY
MASSES = {
    'crank': Mass(0.3, (0.01, 0.004), 2e-4),
    'coupler': Mass(0.2, (0.05, 0.02), 3e-4),
    'rocker': Mass(0.25, (0.04, -0.01), 2.5e-4),
}
COULOMB = {'O2': 0.02, 'A': 0.03, 'B': 0.05, 'O4': 0.08}
BEGIN, SPEED, SECONDS = 0.3, 60.0, 0.12


class ByHand:
    """The four-bar by hand: what its crank has in kinetic energy, weight and friction."""

    def __init__(self, masses, coulomb):
        self.masses = [masses[link] for link in ('crank', 'coupler', 'rocker')]
        self.coulomb = coulomb

    def angles(self, q):
        return q, *four_bar_angles(q)

    def rates(self, q):
        """Return the rates of the links at a crank rate of 1."""
        a, b, c, _ = LENGTHS
        _, coupler, rocker = self.angles(q)
        between = sin(coupler - rocker)
        return 1.0, a * sin(rocker - q) / (b * between), -a * sin(q - coupler) / (c * between)

    def slips(self, q):
        crank, coupler, rocker = self.rates(q)
        return {'O2': crank, 'A': coupler - crank, 'B': rocker - coupler, 'O4': rocker}

    def inertia(self, q):
        starts = 0j, rect(LENGTHS[0], q), complex(LENGTHS[3])
        found, moved = 0.0, (0j, 1j * rect(LENGTHS[0], q), 0j)
        for mass, angle, rate, _, speed in zip(
            self.masses, self.angles(q), self.rates(q), starts, moved, strict=True
        ):
            of_center = speed + 1j * rate * complex(*mass.center) * rect(1.0, angle)
            found += mass.mass * abs(of_center) ** 2 + mass.inertia * rate**2
        return found

    def potential(self, q):
        starts = 0j, rect(LENGTHS[0], q), complex(LENGTHS[3])
        return sum(
            mass.mass * GRAVITY * (start + complex(*mass.center) * rect(1.0, angle)).imag
            for mass, angle, start in zip(self.masses, self.angles(q), starts, strict=True)
        )

    def kinks(self, end):
        """Return where slips turn on the way from the beginning, in order."""
        found = []
        places = np.linspace(BEGIN, end, 2000)
        for pin, coulomb in self.coulomb.items():
            if not coulomb:
                continue
            for low, high in pairwise(map(float, places)):
                if self.slips(low)[pin] * self.slips(high)[pin] < 0.0:
                    found.append(self._root(pin, low, high))
        return sorted(found)

    def _root(self, pin, low, high):
        sign = self.slips(low)[pin]
        for _ in range(60):
            middle = 0.5 * (low + high)
            if self.slips(middle)[pin] * sign > 0.0:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high)

    def way(self, pin, start, end):
        """Return how far a pin has slipped between two places without a turn between them."""

        def turned(q):
            crank, coupler, rocker = self.angles(q)
            return {'O2': crank, 'A': coupler - crank, 'B': rocker - coupler, 'O4': rocker}[pin]

        way = turned(end) - turned(start)
        return abs(way - 2 * pi * round(way / (2 * pi)))

    def time_to(self, end):
        """Return when a crank that begins at `BEGIN` with `SPEED` comes to a place, in [s]."""
        whole = 0.5 * self.inertia(BEGIN) * SPEED**2 + self.potential(BEGIN)
        nodes, weights = np.polynomial.legendre.leggauss(16)
        edges = np.unique([*np.linspace(BEGIN, end, 120), *self.kinks(end)])
        seconds, lost = 0.0, 0.0
        for low, high in pairwise(map(float, edges)):
            half = 0.5 * (high - low)
            for node, share in zip(nodes, weights, strict=True):
                at = low + half * (1.0 + float(node))
                rubbed = sum(t * self.way(pin, low, at) for pin, t in self.coulomb.items())
                left = whole - lost - rubbed - self.potential(at)
                seconds += half * share * sqrt(self.inertia(at) / (2.0 * left))
            lost += sum(t * self.way(pin, low, high) for pin, t in self.coulomb.items())
        return float(seconds)


def loaded(coulomb):
    friction = Friction({pin: JointFriction(coulomb=t) for pin, t in coulomb.items()})
    return Mechanics(four_bar(MASSES, *LENGTHS), Loads(gravity=(0.0, -GRAVITY)), friction)


def turned(mechanics, method, steps):
    """Return where a crank comes to in `SECONDS`, in a number of steps."""
    crank = SingleDofMechanism(mechanics.motion_equation, STEP[method])
    motion = crank.state_at(BEGIN, SPEED)
    for _ in range(steps):
        motion = crank.advance(motion, SECONDS / steps, 0.0)
    return motion


@pytest.mark.parametrize(
    ('method', 'steps'),
    [
        ('semi_implicit_euler', (500, 1000, 2000)),
        ('rk4', (200, 400, 800)),
        ('gauss_legendre', (60, 120, 240)),
    ],
)
def test_method_order_holds_across_friction_kinks(method, steps):
    # Stepped across the kinks, rk4 erred by 3e-8 s with 800 steps, and gauss_legendre, whose error
    # did not fall at all from 60 steps to 480, by up to 4e-8 s.
    mechanics, by_hand = loaded(COULOMB), ByHand(MASSES, COULOMB)
    motions = [turned(mechanics, method, n) for n in steps]
    assert len(by_hand.kinks(motions[-1].value)) == 3
    errors = [abs(by_hand.time_to(motion.value) - SECONDS) for motion in motions]
    orders = [log2(before / after) for before, after in pairwise(errors)]
    assert orders == pytest.approx([ORDER[method]] * 2, abs=0.5)
    # Across the kinks errors of orders 4 and 6 were as large at any of these steps.
    assert errors[-1] < {1: 1e-3, 4: 1e-9, 6: 2e-11}[ORDER[method]]


@pytest.mark.parametrize(
    'name', ['four_bar', 'slider_crank', 'scotch_yoke', 'watt_1', 'reversed_yoke']
)
def test_gallery_linkages_with_friction_keep_the_highest_order(name):
    # Against the same motion in steps an eighth as long.
    closure = closed(name)
    friction = Friction({j.name: JointFriction(0.01, 0.05) for j in closure.structure.joints})
    mechanics = Mechanics(closure, Loads((0.0, -GRAVITY), (), 0.5), friction)
    ends, start = [], STATES[name][0][0]
    for steps in (50, 100, 400):
        motions = []
        crank = SingleDofMechanism(mechanics.motion_equation, STEP['gauss_legendre'])
        motion = crank.state_at(start, 15.0)
        for _ in range(steps):
            motions.append(motion)
            motion = crank.advance(motion, 0.6 / steps, 0.0)
        ends.append(motion.value)
    assert log2(abs(ends[0] - ends[2]) / abs(ends[1] - ends[2])) > 5.0
    kinks = sum(
        before * after < 0.0
        for one, other in pairwise(motions)
        for before, after in zip(one.terms.slips, other.terms.slips, strict=True)
    )
    assert kinks >= 5


def test_step_without_a_kink_equals_a_plain_step():
    # The friction of this motion has the sign that it has at the start, as it had without kinks.
    mechanics = loaded(COULOMB)
    position, terms = mechanics.closure.position, mechanics.motion_terms
    for method in METHODS:
        crank = SingleDofMechanism(lambda angle: terms(position(angle)), STEP[method])
        motion = crank.state_at(2.0, 5.0)
        assert motion.terms.coulomb == pytest.approx(sum(map(abs, motion.terms.slips)))

        def plain(value, rate, _time=0.0):
            inertia, half_slope, slope, viscous, coulomb, *_ = terms(position(value))
            resisted = viscous * rate + coulomb + 0.0
            return (0.3 - slope - resisted - half_slope * rate * rate) / inertia

        expected = STEP[method](plain, 2.0, 5.0, plain(2.0, 5.0), 0.01)
        assert crank.advance(motion, 0.01, 0.3)[:2] == expected


@pytest.mark.parametrize('method', METHODS)
def test_mechanics_without_coulomb_friction_evaluates_no_slips(method):
    mechanics = loaded(dict.fromkeys(COULOMB, 0.0))
    position, terms = mechanics.closure.position, mechanics.motion_terms
    asked = []

    def counted(angle):
        asked.append(angle)
        return terms(position(angle))

    crank = SingleDofMechanism(counted, STEP[method])
    motion = crank.state_at(3.1, 50.0)
    assert motion.terms.slips == ()
    moved = crank.advance(motion, 1e-3, 0.0)
    assert moved.value > 3.15, 'beyond the place at which a slip turns'
    asked.clear()
    crank.advance(motion, 1e-3, 0.0)
    stages = {'semi_implicit_euler': 0, 'rk4': 3}
    if method in stages:
        assert len(asked) == stages[method] + 1


def spun(mechanics, method, rate, seconds, steps):
    crank = SingleDofMechanism(mechanics.motion_equation, STEP[method])
    motion = crank.state_at(0.1, rate)
    for _ in range(steps):
        motion = crank.advance(motion, seconds / steps, 0.0)
    return motion


@pytest.mark.parametrize('method', ['rk4', 'gauss_legendre'])
def test_step_with_many_kinks_completes(method):
    # A heavy crank whose yoke, of no mass, rubs along its guide: twelve turns in one step.
    yoke = scotch_yoke(Mass(1.0, (0.0, 0.0), 0.5), Mass(1e-9, (0.0, 0.0), 0.0))
    friction = Friction({'guide': JointFriction(coulomb=0.5), 'slot': JointFriction(coulomb=0.2)})
    mechanics = Mechanics(yoke, Loads(), friction)
    once = spun(mechanics, method, 75.0, 1.0, 1)
    finely = spun(mechanics, method, 75.0, 1.0, 1000)
    # A turn takes 4·0.05·(0.5 + 0.2) of its energy, 1406 J.
    turns = (finely.value - 0.1) / (2 * pi)
    left = 0.5 * 0.5 * 75.0**2 - turns * 4 * 0.05 * 0.7
    assert 0.25 * finely.rate**2 == pytest.approx(left, abs=0.05)
    assert once.rate == pytest.approx(finely.rate, rel=1e-3)


def test_parallelogram_slips_at_rounding_level_have_no_kinks():
    # The coupler of a parallelogram does not turn: in its pins it slips as crank and rocker do. A
    # pin between coupler and a second rocker as long has that slip too.
    masses = {link: Mass(0.2, (0.02, 0.01), 1e-4) for link in ('crank', 'coupler', 'rocker')}
    friction = Friction({pin: JointFriction(coulomb=0.01) for pin in ('O2', 'A', 'B', 'O4')})
    closure = four_bar(masses, 0.05, 0.1, 0.05, 0.1)
    mechanics = Mechanics(closure, Loads(), friction)
    motion = spun(mechanics, 'rk4', 20.0, 0.5, 50)
    inertia = 2 * (1e-4 + 0.2 * (0.02**2 + 0.01**2)) + 0.2 * 0.05**2
    # All four pins slip as the crank turns: a constant moment of 0.04.
    assert motion.rate == pytest.approx(max(20.0 - 0.04 / inertia * 0.5, 0.0), abs=1e-9)


def test_one_step_handles_kink_stop_and_reversal():
    # A mass on a line whose friction is |x − 1|: it turns at 1, is stopped at 2, comes back and
    # sticks.
    def terms(x):
        return Terms(1.0, 0.0, 0.0, 0.0, abs(x - 1.0), (x - 1.0,))

    mass = SingleDofMechanism(terms, STEP['gauss_legendre'], (-5.0, 2.0), 0.5)
    # To 1: ẍ = x − 1, energy ½v² − ½(x − 1)²; from 1 to 2: ẍ = −(x − 1), and back so too.
    at_one = sqrt(3.0**2 - 1.0)
    at_two = sqrt(at_one**2 - 1.0)
    back = 0.5 * at_two
    motion = mass.state_at(0.0, 3.0)
    fine = [motion]
    for _ in range(4000):
        fine.append(mass.advance(fine[-1], 1e-3, 0.0))
    passing = min(fine, key=lambda m: abs(m.value - 1.0) + (m.rate < 0.0))
    assert passing.rate == pytest.approx(at_one, abs=2e-3)
    bounced = next(m for m in fine if m.rate < 0.0)
    assert bounced.rate == pytest.approx(-back, abs=2e-3)
    # From 2 it comes back against x − 1, to 1 with what is left, and on below 1.
    at_one_again = sqrt(back**2 - 1.0)
    again = min((m for m in fine if m.rate < 0.0), key=lambda m: abs(m.value - 1.0))
    assert again.rate == pytest.approx(-at_one_again, abs=2e-3)
    # Below 1 friction is 1 − x, against the motion: a cosine, to rest at 1 − at_one_again.
    assert fine[-1].rate == 0.0
    assert fine[-1].value == pytest.approx(1.0 - at_one_again, abs=1e-9)
    coarse = mass.state_at(0.0, 3.0)
    for _ in range(8):
        coarse = mass.advance(coarse, 0.5, 0.0)
    assert coarse.value == pytest.approx(fine[-1].value, abs=1e-4)
