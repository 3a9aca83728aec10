# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Masses, friction and efforts through ratios, against Lagrange's equation written by hand."""

from dataclasses import replace
from math import cos
from typing import Any

from linkage_ros.dynamics import (
    AppliedLoads,
    Friction,
    JointFriction,
    JointLoad,
    Loads,
    Mechanics,
    Reactions,
)
from linkage_ros.kinematics import Closure, Input, Linkage, Mass, Ratio, RevoluteJoint
from linkage_ros.stages.drives import Context, TorqueDrive
import pytest
from scipy.integrate import solve_ivp

from .loaded import BEGIN, shipped
from ..kinematics.test_ratios import rack_and_pinion

RADIUS, RATIO = 0.03, -2.5


def pinion_and_rack() -> Closure:
    """Return a pinion of 2e-4 kg·m² that moves a rack of 0.6 kg along x."""
    masses = {'pinion': Mass(0.3, (0.0, 0.0), 2e-4), 'rack': Mass(0.6, (0.1, 0.02), 1e-3)}
    return Closure(replace(rack_and_pinion(RADIUS), masses=masses))


def geared_pendulums() -> Closure:
    """Return two pendulums; the second turns −2.5 times as far as the first."""
    return Closure(
        Linkage(
            {
                'ground': {'O': (0.0, 0.0), 'P': (0.1, 0.0)},
                'first': {'O': (0.0, 0.0), 'A': (0.2, 0.0)},
                'second': {'P': (0.0, 0.0), 'B': (0.1, 0.0)},
            },
            (Input('drive_joint', 'ground', 'first'),),
            {},
            {'second_joint': RevoluteJoint('ground', 'second')},
            {},
            masses={'first': Mass(0.5, (0.2, 0.0), 1e-3), 'second': Mass(0.2, (0.1, 0.0), 5e-4)},
            ratios={'second_joint': Ratio('drive_joint', RATIO, 0.4)},
        )
    )


INERTIA = 0.5 * 0.2**2 + 1e-3 + RATIO**2 * (0.2 * 0.1**2 + 5e-4)


def turned(angle: float) -> float:
    """Return the moment of the weights of the two pendulums at the drive."""
    return 9.81 * (0.5 * 0.2 * cos(angle) + RATIO * 0.2 * 0.1 * cos(RATIO * angle + 0.4))


@pytest.mark.parametrize(('rate', 'change'), [(0.0, 1.0), (3.0, -2.0), (-7.0, 0.5)])
def test_rack_and_pinion_effort_equals_virtual_work(rate: float, change: float) -> None:
    """By virtual work: masses, weights, friction and a load on the rack, times the radius."""
    rubbing = Friction({'way': JointFriction(viscous=4.0), 'O': JointFriction(viscous=0.002)})
    loads = Loads(gravity=(-9.81, 0.0), drive_inertia=3e-5)
    mechanics = Mechanics(pinion_and_rack(), loads, rubbing)
    position = mechanics.closure.position(0.7)
    velocity = mechanics.closure.velocity(position, rate)
    acceleration = mechanics.closure.acceleration(position, velocity, change)
    right = (2e-4 + 3e-5 + 0.6 * RADIUS**2) * change
    right += 0.6 * 9.81 * RADIUS + (4.0 * RADIUS**2 + 0.002) * rate
    efforts = mechanics.drive_efforts(position, velocity, acceleration)
    assert efforts == pytest.approx((right,), rel=1e-12)


def test_geared_pendulum_effort_equals_the_closed_form() -> None:
    """The inertia of the second counts by the square of the ratio."""
    mechanics = Mechanics(geared_pendulums(), Loads(gravity=(0.0, -9.81)))
    for k in range(12):
        angle, rate, change = 0.5 * k, 1.0 - k, 0.3 * k
        position = mechanics.closure.position(angle)
        velocity = mechanics.closure.velocity(position, rate)
        acceleration = mechanics.closure.acceleration(position, velocity, change)
        right = INERTIA * change + turned(angle)
        efforts = mechanics.drive_efforts(position, velocity, acceleration)
        assert efforts == pytest.approx((right,), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize('method', ['rk4', 'gauss_legendre'])
def test_geared_pendulums_under_torque_follow_scipy(method: str) -> None:
    """Under their weights and viscous friction, and an effort on the second one."""
    rubbing = Friction({'P': JointFriction(viscous=0.003)})
    applied = AppliedLoads(efforts={'second_joint': JointLoad(constant=0.05)})
    loads = Loads((0.0, -9.81), applied=applied)
    context = Context(geared_pendulums(), 1000.0, True, 'seed', loads, rubbing)
    drive = TorqueDrive(start=-1.0, method=method, step=1e-3).build(context)
    drive.state(BEGIN)

    def change(_: float, state: tuple[float, float]) -> tuple[float, float]:
        angle, rate = state
        pull = 0.05 * RATIO - turned(angle) - 0.003 * RATIO**2 * rate
        return rate, pull / INERTIA

    right = solve_ivp(change, (0.0, 2.0), (-1.0, 0.0), rtol=1e-10, atol=1e-12, t_eval=[1.0, 2.0])
    for seconds, value, rate in zip(right.t, *right.y, strict=True):
        state = drive.state(BEGIN + round(seconds * 1e9))
        assert state.angles[0] == pytest.approx(value, abs=1e-6)
        assert state.rates[0] == pytest.approx(rate, abs=1e-5)


def test_bearing_forces_of_gears_are_not_published() -> None:
    """No file says the radii of the wheels; what they need of the drive is certain."""
    mechanics = Mechanics(pinion_and_rack(), Loads(gravity=(-9.81, 0.0)))
    reactions = Reactions(mechanics)
    assert reactions.published_joints == ()
    assert reactions.uncertain.startswith('force in O, way; moment in way: teeth and belts press')
    motion = motion_of(mechanics.closure, 0.7, 3.0, -2.0)
    assert reactions.drive_efforts(*motion) == pytest.approx(mechanics.drive_efforts(*motion))
    assert reactions.solve(*motion) == ((0.0, 0.0, 0.0),) * 2


def motion_of(closure: Closure, angle: float, rate: float, change: float) -> tuple[Any, Any, Any]:
    position = closure.position(angle)
    velocity = closure.velocity(position, rate)
    return position, velocity, closure.acceleration(position, velocity, change)


def test_joint_forces_behind_a_gear_equal_the_plain_linkage() -> None:
    """A wheel that turns a crank by −1/2: all joints but the bearings of both bear the same."""
    linkage = shipped('four_bar')
    (given,) = linkage.inputs
    wheel = {'O': (-0.1, 0.0)}
    geared = replace(
        linkage,
        links={
            **linkage.links,
            'ground': {**linkage.links['ground'], **wheel},
            'wheel': {'O': (0.0, 0.0)},
        },
        inputs=(Input('wheel_joint', 'ground', 'wheel'),),
        joints={given.joint: given.as_joint(), **linkage.joints},
        masses={**linkage.masses, 'wheel': Mass(0.2, (0.0, 0.0), 1e-4)},
        ratios={given.joint: Ratio('wheel_joint', -0.5)},
    )
    loads = Loads(gravity=(0.3, -9.81))
    plain, behind = (Reactions(Mechanics(Closure(each), loads)) for each in (linkage, geared))
    found = behind.solve(*motion_of(Closure(geared), -2.0, -14.0, 60.0))
    right = plain.solve(*motion_of(Closure(linkage), 1.0, 7.0, -30.0))
    assert found is not None
    assert right is not None
    expected = dict(zip(plain.names, right, strict=True))
    published = {behind.names[number]: found[number] for number in behind.published_joints}
    assert {*published} == {*expected} - {'O2'}
    for name, reaction in published.items():
        assert reaction == pytest.approx(expected[name], rel=1e-11, abs=1e-13)
