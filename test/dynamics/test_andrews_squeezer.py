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


"""
Andrews' squeezing mechanism under its spring and its motor, as all multibody solvers are tried on.

E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, 2nd ed., VII.7; reference
solution: Test Set for IVP Solvers, Bari, "Andrews' squeezing mechanism": the seven angles after
0.03 s, quoted from memory. With 3,000 steps of RK4 it was met to 1.4e-9 rad, with 12,000 to
1.1e-9: what is left is not that of the steps.
"""

from __future__ import annotations

from dataclasses import replace
from math import remainder, tau

from linkage_ros.dynamics.loads import Loads, Spring
from linkage_ros.dynamics.mechanics import Mechanics
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Mass
import pytest

from .loaded import shipped

MASSES = {
    'K1': Mass(0.04325, (0.00092, 0.0), 2.194e-6),
    'K2': Mass(0.00365, (-0.0115, 0.0), 4.410e-7),
    'K3': Mass(0.02373, (0.01043, -0.01874), 5.255e-6),
    'K4': Mass(0.00706, (0.0, -(0.020 - 0.01421)), 5.667e-7),
    'K5': Mass(0.07050, (0.02308, 0.00916), 1.169e-5),
    'K6': Mass(0.00706, (0.020 - 0.01421, 0.0), 5.667e-7),
    'K7': Mass(0.05498, (0.00449, -0.01228), 1.912e-5),
}
SPRING = Spring('ground', 'C', 'K3', 'D', stiffness=4530.0, free_length=0.07785)
MOMENT, DURATION = 0.033, 0.03
START = -0.0617138900142764496358948458001
"""beta where Theta is 0; everything is at rest."""

EXPECTED = {
    'beta': 15.81077119629904,
    'theta': -15.75637105984298,
    'gamma': 0.04082224013073101,
    'phi': -0.5347301163226948,
    'delta': 0.5244099658805304,
    'omega': 0.5347301163226948,
    'epsilon': 1.048080741042263,
}


def test_two_and_a_half_turns_of_the_crank():
    closure = Closure(replace(shipped('andrews_squeezer'), masses=MASSES))
    mechanics = Mechanics(closure, Loads(springs=(SPRING,)))

    def slope(q, rate):
        terms = mechanics.terms(closure.position(q))
        push = MOMENT - terms.potential_slope - terms.half_slope * rate * rate
        return rate, push / terms.inertia

    q, rate, steps = START, 0.0, 3000
    h = DURATION / steps
    for _ in range(steps):  # the Runge-Kutta method of order 4
        v1, a1 = slope(q, rate)
        v2, a2 = slope(q + 0.5 * h * v1, rate + 0.5 * h * a1)
        v3, a3 = slope(q + 0.5 * h * v2, rate + 0.5 * h * a2)
        v4, a4 = slope(q + h * v3, rate + h * a3)
        q += h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4)
        rate += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)

    found = {'beta': q}
    found.update(zip(closure.linkage.joints, closure.position(q).joints, strict=True))
    for angle, expected in EXPECTED.items():
        assert remainder(found[angle] - expected, tau) == pytest.approx(0.0, abs=1e-8), angle
    assert q == pytest.approx(EXPECTED['beta'], abs=1e-8)
