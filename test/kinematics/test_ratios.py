# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Joints that follow others by ratios, against loops that are closed without the package."""

from cmath import phase, rect
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from math import inf, pi, radians, remainder, sin, tau
from os import environ
from random import Random
from typing import Any

from linkage_ros import Closure, load
from linkage_ros.description import parse_yaml, read_closure
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import (
    AssemblyPose,
    check_turns,
    Input,
    InputSweep,
    Limits,
    Linkage,
    Ratio,
    RevoluteJoint,
    SlideJoint,
    Slider,
    transmission_angles,
)
from mpmath import mp, mpf
import numpy as np
import pytest

from ..support.four_bar import meeting_point

STATES = int(environ.get('LINKAGE_STATES', '0')) or 120
"""How many random linkages of each kind are compared."""


def geared_five_bar(
    lengths: tuple[float, ...], ratio: Ratio, side: str = 'left', **more: Any
) -> Linkage:
    """Return Norton's geared five-bar: ground, links 2 to 5; link 5 follows link 2."""
    ground, a, b, c, d = lengths
    return Linkage(
        {
            'ground': {'O2': (0.0, 0.0), 'O5': (ground, 0.0)},
            'link2': {'O2': (0.0, 0.0), 'A': (a, 0.0)},
            'link3': {'A': (0.0, 0.0), 'B': (b, 0.0)},
            'link4': {'C': (0.0, 0.0), 'B': (c, 0.0)},
            'link5': {'O5': (0.0, 0.0), 'C': (d, 0.0)},
        },
        (Input('theta2', 'ground', 'link2'),),
        {'B': side} if side else {},  # type: ignore[dict-item]
        {
            f'theta{number}': RevoluteJoint(
                'ground', f'link{number}', more.pop('limits', Limits())
            )
            for number in (5, 3, 4)
        },
        {},
        ratios={'theta5': ratio},
        **more,
    )


def rack_and_pinion(radius: float, **more: Any) -> Linkage:
    """Return a pinion that moves a rack along the x axis."""
    return Linkage(
        {
            'ground': {'O': (0.0, 0.0), 'R': (0.0, radius)},
            'pinion': {'O': (0.0, 0.0), 'E': (radius, 0.0)},
            'rack': {'P': (0.0, 0.0)},
        },
        (Input('pinion_joint', 'ground', 'pinion', **more),),
        {},
        {'rack_slide': SlideJoint('way')},
        {'way': Slider('P', 'ground', 'R', (1.0, 0.0), 'rack')},
        ratios={'rack_slide': Ratio('pinion_joint', radius, 0.001)},
    )


def two_four_bars(ratio: Ratio, **more: Any) -> Linkage:
    """Return a crank-rocker whose rocker drives the crank of a second one."""
    return Linkage(
        {
            'ground': {'O': (0.0, 0.0), 'D': (0.08, 0.0), 'P': (0.2, 0.0), 'Q': (0.3, 0.0)},
            'crank': {'O': (0.0, 0.0), 'A': (0.03, 0.0)},
            'coupler': {'A': (0.0, 0.0), 'B': (0.08, 0.0)},
            'rocker': {'D': (0.0, 0.0), 'B': (0.06, 0.0)},
            'gear': {'P': (0.0, 0.0), 'E': (0.03, 0.0)},
            'rod': {'E': (0.0, 0.0), 'F': (0.09, 0.0)},
            'out': {'Q': (0.0, 0.0), 'F': (0.07, 0.0)},
        },
        (Input('crank_joint', 'ground', 'crank'),),
        {'B': 'left', 'F': 'left'},
        {
            'rocker_joint': RevoluteJoint('ground', 'rocker'),
            'gear_joint': RevoluteJoint('ground', 'gear'),
            'out_joint': RevoluteJoint('ground', 'out'),
        },
        {},
        ratios={'gear_joint': ratio},
        **more,
    )


def turned(angle: Any) -> Any:
    """Return an angle within half a turn of 0."""
    return angle - 2 * mp.pi * mp.nint(angle / (2 * mp.pi))


def same_angles(one: Any, other: Any, error: float = 1e-12) -> bool:
    """Return whether angles are the same apart from whole turns."""
    return all(abs(turned(mpf(p) - q)) < error for p, q in zip(one, other, strict=True))


@pytest.mark.parametrize(
    ('side', 'theta3', 'theta4'), [('right', 173.642, -177.715), ('left', -115.407, -124.050)]
)
def test_geared_five_bar_equals_the_textbook_example(
    side: str, theta3: float, theta4: float
) -> None:
    """Norton, Design of Machinery: L 6, 1, 7, 9, 4; ratio 2, phase angle 30°, crank 60°."""
    linkage = geared_five_bar((6.0, 1.0, 7.0, 9.0, 4.0), Ratio('theta2', 2.0, radians(30)), side)
    found = Closure(linkage).position(radians(60.0)).joints
    assert same_angles(found, [radians(k) for k in (150.0, theta3, theta4)], radians(5e-4))


def five_bar_angles(lengths: Any, ratio: Ratio, side: int, crank: Any) -> Any:
    """Return the angles of links 5, 3 and 4 by circles that meet; None where they miss."""
    ground, a, b, c, d = map(mpf, lengths)
    geared = mpf(ratio.ratio) * crank + mpf(ratio.offset)
    pin_a, pin_c = a * mp.expj(crank), ground + d * mp.expj(geared)
    pin_b = meeting_point(pin_c, pin_a, c, b, side)
    return None if pin_b is None else (geared, mp.arg(pin_b - pin_a), mp.arg(pin_b - pin_c))


def test_random_geared_five_bars_equal_the_reference() -> None:
    """Positions, rates and accelerations, of the steps and of the compiled steps."""
    random = Random(33)
    compared = 0
    with mp.workdps(40):
        for _ in range(STATES):
            lengths = tuple(random.uniform(0.3, 1.0) for _ in range(5))
            kind = random.choice([-1.0, 2.0, 0.5, -1.7, 1 / 3])
            given = Ratio('theta2', kind, random.uniform(-3, 3))
            side = random.choice(['left', 'right'])
            closure = Closure(geared_five_bar(lengths, given, side))
            theta, rate, change = (random.uniform(-9, 9) for _ in range(3))
            step = mpf('1e-9')
            before, right, after = (
                five_bar_angles(
                    lengths,
                    given,
                    1 if side == 'left' else -1,
                    mpf(theta) + mpf(rate) * t + mpf(change) * t * t / 2,
                )
                for t in (-step, mpf(0), step)
            )
            position = closure.position(theta)
            assert (right is not None) == position.status.has_pose
            if None in (before, right, after) or not position.status.has_rates:
                continue
            assert same_angles(position.joints, right, 1e-11)
            weak = abs(sin(right[1] - right[2]))
            if weak < 0.05:
                continue
            compared += 1
            fore = [turned(p - q) for p, q in zip(after, right, strict=True)]
            back = [turned(p - q) for p, q in zip(before, right, strict=True)]
            rates = [float((p - q) / (2 * step)) for p, q in zip(fore, back, strict=True)]
            changes = [float((p + q) / step**2) for p, q in zip(fore, back, strict=True)]
            velocity = closure.velocity(position, rate)
            acceleration = closure.acceleration(position, velocity, change)
            batch = closure.solve([theta], rates=rate, accelerations=change)
            assert same_angles(batch.positions[:, 0], right, 1e-11)
            for found in (velocity.joints, batch.velocities[:, 0]):
                assert [*found] == pytest.approx(rates, rel=1e-9, abs=1e-9 / weak)
            for found in (acceleration.joints, batch.accelerations[:, 0]):
                assert [*found] == pytest.approx(changes, rel=1e-8, abs=1e-8 / weak**3)
    assert compared > STATES // 8


def loop_errors(lengths: Any, given: Ratio, crank: float, x: Any) -> list[float]:
    """Return the errors of the loop and of the gears on links 5 and 3."""
    ground, a, b, c, d = lengths
    five, three, four = x
    loop = rect(a, crank) + rect(b, three) - ground - rect(d, five) - rect(c, four)
    return [loop.real, loop.imag, three - crank - given.ratio * five - given.offset]


def follow(lengths: Any, given: Ratio, start: list[float], low: float, high: float) -> list[float]:
    """Return the angles at the end of an interval of the crank, followed in small steps."""
    x = np.array(start)
    for value in np.linspace(low, high, 60)[1:]:
        for _ in range(8):
            error = np.array(loop_errors(lengths, given, value, x))
            slopes = np.array(
                [
                    (np.array(loop_errors(lengths, given, value, x + 1e-7 * one)) - error) / 1e-7
                    for one in np.eye(len(x))
                ]
            ).T
            x = x - np.linalg.solve(slopes, error)
    return x.tolist()


def posed_five_bar(
    lengths: Any, ratio: float, theta: float, geared: float
) -> tuple[Closure, Ratio, list[float]] | None:
    """Return a five-bar whose coupler turns against the crank as link 5 does, by a ratio."""
    ground, a, b, c, d = lengths
    pin_a, pin_c = rect(a, theta), ground + rect(d, geared)
    met = meeting_point(pin_c, pin_a, c, b, 1)
    if met is None:
        return None
    pin_b = complex(met)
    theta3, theta4 = phase(pin_b - pin_a), phase(pin_b - pin_c)
    given = Ratio('theta5', ratio, theta3 - theta - ratio * geared)
    places = {'B': (pin_b.real, pin_b.imag), 'C': (pin_c.real, pin_c.imag)}
    linkage = geared_five_bar(lengths, given, '', pose=AssemblyPose((theta,), places))
    joints = dict(linkage.joints) | {'alpha': RevoluteJoint('link2', 'link3')}
    closure = Closure(replace(linkage, joints=joints, ratios={'alpha': given}))
    return closure, given, [geared, theta3, theta4]


def test_random_gears_on_moving_links_equal_the_reference() -> None:
    """No dyad covers them; positions and rates."""
    random = Random(34)
    compared = 0
    for _ in range(max(8, STATES // 10)):
        lengths = tuple(random.uniform(0.5, 1.0) for _ in range(5))
        theta, geared = random.uniform(-1, 1), random.uniform(0.5, 2.5)
        closed = posed_five_bar(lengths, random.choice([-1.0, 2.0, -0.5, 1.25]), theta, geared)
        if closed is None:
            continue
        closure, given, angles = closed
        assert closure.close_unlimited(theta).joints[:3] == pytest.approx(angles, abs=1e-9)
        (interval,) = closure.closing_ranges
        end = theta + 0.7 * (min(interval.highest, theta + 1.5) - theta)
        position = closure.position(end)
        if not position.status.has_rates:
            continue
        assert same_angles(position.joints[:3], follow(lengths, given, angles, theta, end), 1e-9)
        step = 1e-5
        velocity = closure.velocity(position, 1.0)
        fore, back = (closure.position(end + h).joints for h in (step, -step))
        slopes = [(p - q) / (2 * step) for p, q in zip(fore, back, strict=True)]
        assert list(velocity.joints) == pytest.approx(slopes, rel=1e-4, abs=1e-4)
        compared += 1
    assert compared >= 4


CAME_BACK_EARLY = (
    ((1.0, 0.1016, 1.2520, 0.8161, 0.2353), -0.9565, 1.4133),
    ((1.0, 0.0565, 1.1673, 1.3647, 0.2607), -0.3988, 0.7907),
    ((1.0, 0.0610, 1.0597, 1.1755, 0.3902), 0.1634, 1.5542),
)
"""Five-bars that seemed to repeat after one turn, in the mesh of another tooth."""


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('ratio', 'case'), [*((1.25, n) for n in range(4)), (-2.0, 3), (0.5, 3), (17 / 43, 3)]
)
def test_gears_on_moving_links_keep_mesh_over_whole_turns(ratio: float, case: int) -> None:
    """Teeth keep their mesh turn after turn, against a loop that is followed in small steps."""
    random = Random(case)
    for index in range(200):
        if not index and case < len(CAME_BACK_EARLY):
            lengths, theta, geared = CAME_BACK_EARLY[case]
        else:
            bars = (random.uniform(0.4, 1.5) for _ in range(3))
            lengths = (1.0, random.uniform(0.05, 0.2), *bars)
            theta, geared = random.uniform(-1, 1), random.uniform(0.5, 2.5)
        closed = posed_five_bar(lengths, ratio, theta, geared)
        if closed and closed[0].closing_ranges and closed[0].closing_ranges[0].is_whole:
            break
    assert closed is not None
    closure, given, angles = closed
    for part in range(12):
        begin, end = (theta + (part + more) * tau / 4 for more in (0, 1))
        angles = follow(lengths, given, angles, begin, end)
        assert same_angles(closure.position(end).joints[:3], angles, 1e-9), part


def geared_rocker(rng: Random, ratio: float) -> tuple[Closure, float]:
    """
    Return a double rocker with an arm on its crank, geared to its own angle against the ground.

    So the arm is at (θ + offset)/(1 − ratio): a turn of the crank may lead to another angle.
    """
    ground, crank, coupler, rocker = 1.0, *sorted(rng.uniform(0.3, 0.9) for _ in range(3))
    while abs(ground - crank - coupler) < 0.05 or crank + ground < coupler + rocker:
        ground, coupler, rocker = ground + 0.1, coupler * 0.95, rocker * 0.95
    theta, arm = rng.uniform(-0.05, 0.05), rng.uniform(-3.0, 3.0)
    offset = (1.0 - ratio) * arm - theta
    place = rect(crank, theta)
    end = place + rect(0.4, arm)
    linkage = Linkage(
        {
            'ground': {'O': (0.0, 0.0), 'D': (ground, 0.0)},
            'crank': {'O': (0.0, 0.0), 'A': (crank, 0.0)},
            'coupler': {'A': (0.0, 0.0), 'B': (coupler, 0.0)},
            'rocker': {'D': (0.0, 0.0), 'B': (rocker, 0.0)},
            'arm': {'A': (0.0, 0.0), 'E': (0.4, 0.0)},
        },
        (Input('theta', 'ground', 'crank'),),
        {'B': 'left'},
        {
            'arm_joint': RevoluteJoint('ground', 'arm'),
            'gear_joint': RevoluteJoint('crank', 'arm'),
        },
        {},
        ratios={'gear_joint': Ratio('arm_joint', ratio, offset)},
        pose=AssemblyPose((theta,), {'E': (end.real, end.imag)}),
    )
    return Closure(linkage), offset


@pytest.mark.sample(2)
@pytest.mark.parametrize('ratio', [-0.5, 0.25, -1.0, 3.0, 0.5, 0.37])
def test_implicit_ratio_turns_its_link_by_whole_input_turns(ratio: float) -> None:
    random = Random(8)
    closed = 0
    for _ in range(8):
        closure, offset = geared_rocker(random, ratio)
        links = closure.linkage.links
        values = [random.uniform(-pi, pi) for _ in range(4)]
        for value in values:
            for turns in range(-6, 7):
                theta = value + tau * turns
                place = mpf(links['crank']['A'][0]) * mp.expj(theta)
                met = meeting_point(
                    place, mpf(links['ground']['D'][0]), links['coupler']['B'][0],
                    links['rocker']['B'][0], 1,
                )  # fmt: skip
                position = closure.position(theta)
                assert position.status.has_pose == (met is not None), (theta, turns)
                if position.joints:
                    exact = (mpf(theta) + offset) / (1.0 - mpf(ratio))
                    assert same_angles([position['arm_joint']], [exact], 1e-11), (theta, turns)
                    closed += 1
    assert closed >= 8


def geared_train(rng: Random) -> tuple[Linkage, Any]:
    """
    Return a train of one or two links that ratios turn, on a double rocker, and its exact angles.

    The first link hangs on the ground or the crank, the second on one before. Each ratio is of two
    joints between the links so far: the equations are linear, and their solution is the reference.
    """
    count = rng.choice([1, 2])
    links: dict[str, dict[str, tuple[float, float]]] = {
        'ground': {'O': (0.0, 0.0), 'D': (1.0, 0.0)},
        'crank': {'O': (0.0, 0.0), 'A': (0.5, 0.0)},
        'coupler': {'A': (0.0, 0.0), 'B': (0.7, 0.0)},
        'rocker': {'D': (0.0, 0.0), 'B': (0.6, 0.0)},
    }
    names, joints = ['ground', 'crank'], {}
    for number in range(count):
        name, on = f'arm{number}', rng.choice(names[-2:])
        pin = f'P{number}'
        links[on] = dict(links[on]) | {pin: (rng.uniform(0.1, 0.4), rng.uniform(0.1, 0.4))}
        links[name] = {pin: (0.0, 0.0), f'E{number}': (0.3, 0.0)}
        joints[f'hinge{number}'] = RevoluteJoint(on, name)
        names.append(name)
    arms = [name for name in names if name.startswith('arm')]
    joints |= {f'{name}_angle': RevoluteJoint('ground', name) for name in arms}
    theta, wanted = rng.uniform(-0.4, 0.4), [rng.uniform(-3.0, 3.0) for _ in arms]
    ratios, rows, rights = {}, [], []
    for number in range(count):
        joint = joints[f'hinge{number}']
        on = 'crank' if joint.parent == 'ground' else 'ground'
        joints[f'of{number}'] = RevoluteJoint(on, arms[count - 1 - number])
        ratio = rng.choice([-1.0, -0.5, 1 / 3, 2.0, 3.0, -1.5, 0.3712345])
        angles = dict(zip(names, [0.0, theta, *wanted], strict=True))
        ends = joint, joints[f'of{number}']
        values = [angles[one.child] - angles[one.parent] for one in ends]
        ratios[f'hinge{number}'] = Ratio(f'of{number}', ratio, values[0] - ratio * values[1])
        row = dict.fromkeys(names, mpf(0))
        for one, factor in zip(ends, (mpf(1), -mpf(ratio)), strict=True):
            row[one.child] += factor
            row[one.parent] -= factor
        rows.append(row)
        rights.append(mpf(ratios[f'hinge{number}'].offset))

    def exact(crank: float) -> Any:
        matrix = mp.matrix([[row[name] for name in arms] for row in rows])
        right = mp.matrix([c - row['crank'] * crank for row, c in zip(rows, rights, strict=True)])
        return [*mp.lu_solve(matrix, right)]

    inputs = (Input('theta', 'ground', 'crank'),)
    linkage = Linkage(links, inputs, {'B': 'left'}, joints, {}, ratios=ratios)
    return linkage, exact


def test_geared_trains_follow_the_crank_over_whole_turns() -> None:
    """They follow the crank turn after turn, also where another loop was open in between."""
    rng = Random(11)
    compared, opened = 0, 0
    while compared < 40:
        linkage, exact = geared_train(rng)
        try:
            closure = Closure(linkage)
        except DefinitionError:
            continue  # The ratios lock the links, or leave them free.
        compared += 1
        names = [name for name in linkage.joints if name.endswith('_angle')]
        for turns in (-70, -1, 0, 2, 200):
            theta = rng.uniform(-pi, pi) + tau * turns
            place = mpf('0.5') * mp.expj(theta)
            closes = meeting_point(place, mpf(1), mpf('0.7'), mpf('0.6'), 1) is not None
            position = closure.position(theta)
            assert position.status.has_pose == closes
            opened += not closes
            if closes:
                right, error = exact(theta), 1e-15 * (10.0 + 20.0 * abs(theta))
                size = max(map(abs, right)) / abs(theta) if theta else 1.0
                found = [position[name] for name in names]
                assert same_angles(found, right, float(error * (1.0 + size)))
                rates = closure.velocity(position, 1.0)
                slopes = [a - b for a, b in zip(exact(1.0), exact(0.0), strict=True)]
                for name, slope in zip(names, slopes, strict=True):
                    at = closure.joint_names.index(name)
                    assert rates.joints[at] == pytest.approx(float(slope), rel=1e-13)
    assert opened > 20


@pytest.mark.parametrize('ratio', [1.0, -1.5, 0.37, -2.0])
def test_ratio_follows_a_rocker_of_another_four_bar(ratio: float) -> None:
    """A rocker drives the crank of another four-bar."""
    closure = Closure(two_four_bars(Ratio('rocker_joint', ratio, 0.3)))
    for k in range(-20, 20):
        position = closure.position(0.31 * k)
        with mp.workdps(30):
            pin_a = mpf('0.03') * mp.expj(mpf(0.31 * k))
            pin_b = meeting_point(pin_a, mpf('0.08'), mpf('0.08'), mpf('0.06'), 1)
            rocker = mp.arg(pin_b - mpf('0.08'))
            gear = mpf(ratio) * rocker + mpf('0.3')
            pin_e = mpf('0.2') + mpf('0.03') * mp.expj(gear)
            pin_f = meeting_point(pin_e, mpf('0.3'), mpf('0.09'), mpf('0.07'), 1)
            right = rocker, gear, mp.arg(pin_f - mpf('0.3'))
            assert same_angles(position.joints, right)


def test_limited_rocker_drives_a_gear_without_jumps() -> None:
    """A rocker that swings through 180° drives a gear by 0.5 without a jump."""
    linkage = two_four_bars(Ratio('rocker_joint', 0.5))
    # Turn the ground by 90°, so that the rocker swings about 180°.
    points = dict(linkage.links['ground'])
    points['D'] = (0.0, 0.08)
    joints = dict(linkage.joints)
    joints['rocker_joint'] = RevoluteJoint('ground', 'rocker', Limits(pi - 1.5, pi + 1.5))
    closure = Closure(
        replace(linkage, links=dict(linkage.links) | {'ground': points}, joints=joints)
    )
    found = [closure.position(0.01 * k).joints for k in range(700)]
    assert min(one[0] for one in found) < pi - 0.1 or max(one[0] for one in found) > pi + 0.1
    assert max(abs(p[1] - q[1]) for p, q in pairwise(found)) < 0.02


@pytest.mark.parametrize('ratio', [0.5, -1.5])
def test_ratio_of_a_joint_with_unknown_turns_is_refused(ratio: float) -> None:
    """A rocker that swings through 180° without limits, and one that turns fully: refused."""
    swinging = two_four_bars(Ratio('rocker_joint', ratio))
    points = dict(swinging.links['ground']) | {'D': (0.0, 0.08)}
    swinging = replace(swinging, links=dict(swinging.links) | {'ground': points})
    turning = two_four_bars(Ratio('rocker_joint', ratio))
    links = dict(turning.links)
    links['ground'] = dict(links['ground']) | {'D': (0.01, 0.0)}  # a drag link
    links['coupler'] = {'A': (0.0, 0.0), 'B': (0.04, 0.0)}
    links['rocker'] = {'D': (0.0, 0.0), 'B': (0.035, 0.0)}
    turning = replace(turning, links=links)
    for linkage in (swinging, turning):
        with pytest.raises(DefinitionError, match='its turns are not known') as caught:
            check_turns(Closure(linkage))
        assert caught.value.where == 'ratios.gear_joint.of'
        whole = replace(linkage, ratios={'gear_joint': Ratio('rocker_joint', 2.0)})
        check_turns(Closure(whole))


def test_pinion_moves_its_rack_by_radius_times_angle() -> None:
    """A rack that a pinion moves: radius times angle, over turns, within its limits."""
    closure = Closure(rack_and_pinion(0.012))
    for angle in (-30.0, -1.0, 0.0, 0.5, 11.0):
        position = closure.position(angle)
        assert position['rack_slide'] == pytest.approx(0.012 * angle + 0.001, rel=1e-15)
        velocity = closure.velocity(position, 3.0)
        assert velocity.joints == pytest.approx((0.036,), rel=1e-15)
        assert closure.acceleration(position, velocity, -2.0).joints == pytest.approx((-0.024,))
    (interval,) = closure.input_ranges
    assert interval.turns == 0
    assert interval.limited == (False, False)
    limited = rack_and_pinion(0.012)
    limited = replace(limited, joints={'rack_slide': SlideJoint('way', Limits(0.0, 0.1))})
    (interval,) = Closure(limited).input_ranges
    assert interval[:2] == pytest.approx((-1 / 12, 99 / 12), rel=1e-12)
    assert interval.by == ('rack_slide', 'rack_slide')


@pytest.mark.parametrize('ratio', [Fraction(-1), Fraction(1, 2), Fraction(-2, 3), Fraction(5, 4)])
def test_geared_five_bar_ranges_equal_a_scan(ratio: Fraction) -> None:
    """Where a geared five-bar closes, over as many turns as it takes to repeat."""
    lengths, given = (6.0, 1.5, 5.0, 4.0, 2.5), Ratio('theta2', float(ratio), 0.4)
    closure = Closure(geared_five_bar(lengths, given))
    turns = ratio.denominator
    ranges = closure.input_ranges
    assert all(one.turns == turns for one in ranges)
    count = 500 * turns
    with mp.workdps(20):
        for k in range(count):
            value = turns * tau * (k + 0.37) / count
            right = five_bar_angles(lengths, given, 1, mpf(value)) is not None
            within = any(
                one.lowest <= value + shift * turns * tau <= one.highest
                for one in ranges
                for shift in (-2, -1, 0, 1)
            )
            assert right == (within or any(one.is_whole for one in ranges))
    for end in closure.singular_inputs:
        assert closure.singularity_margin(closure.position(end.value + 0.01))
    assert InputSweep(closure).ranges


def test_follower_limits_cut_the_input_range() -> None:
    """They cut the range of the input, by the ratio."""
    linkage = geared_five_bar((1.0, 0.1, 1.0, 1.0, 0.1), Ratio('theta2', -1.0))
    joints = dict(linkage.joints) | {'theta5': RevoluteJoint('ground', 'link5', Limits(-0.5, 0.2))}
    (interval,) = Closure(replace(linkage, joints=joints)).input_ranges
    assert interval[:2] == pytest.approx((-0.2, 0.5), rel=1e-14)


def test_gallery_gripper_fingers_are_mirror_images() -> None:
    """The right finger follows the motor of the left one: each is the other one's mirror."""
    closure = load('gripper')
    for k in range(8):
        position = closure.position(0.1 * k)
        assert position['right_knuckle_joint'] == -0.1 * k
        points = closure.points(position)
        left, right = (points[f'{side}_finger', f'{side}_pad'] for side in ('left', 'right'))
        assert abs(right + left.conjugate()) < 1e-16
        arm = complex(-0.0344, -0.0492) * rect(1.0, 0.1 * k)
        assert abs(left - (complex(-0.030, -0.055) + arm + complex(0.0219, -0.045))) < 1e-16


WRONG: list[tuple[str, str, dict[str, Ratio], str]] = [
    ('an input that follows', 'ratios.theta2', {'theta2': Ratio('theta5', 2.0)}, 'is an input'),
    ('no joint', 'ratios.theta6', {'theta6': Ratio('theta2', 2.0)}, 'no published joint'),
    ('no other joint', 'ratios.theta5.of', {'theta5': Ratio('theta6', 2.0)}, 'there is no joint'),
    ('itself', 'ratios.theta5.of', {'theta5': Ratio('theta5', 2.0)}, 'theta5 follows theta5'),
    ('zero', 'ratios.theta5.ratio', {'theta5': Ratio('theta2', 0.0)}, '0, offset 0'),
    ('infinite', 'ratios.theta5.ratio', {'theta5': Ratio('theta2', inf)}, 'inf'),
    ('no pin', 'ratios.theta3', {'theta3': Ratio('theta2', 1.0)}, 'no common pin'),
    ('too many', 'ratios.theta4', {'theta5': Ratio('theta2', 1.0), 'theta4': Ratio('theta2', 1.0)},
     'no common pin'),
    ('none', 'links.link3', {}, 'is free'),
]  # fmt: skip


@pytest.mark.parametrize(('_', 'key', 'ratios', 'reason'), WRONG, ids=[one[0] for one in WRONG])
def test_wrong_ratio_error_names_its_key(
    _: str, key: str, ratios: dict[str, Ratio], reason: str
) -> None:
    """One line names the key and says what to do."""
    linkage = geared_five_bar((6.0, 1.0, 7.0, 9.0, 4.0), Ratio('theta2', 2.0))
    with pytest.raises(DefinitionError, match=reason) as caught:
        Closure(replace(linkage, ratios=ratios))
    assert caught.value.where == key
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('ratio', [-0.6667, 1.0, 2.0])
def test_ratio_between_joints_of_the_same_links_is_refused(ratio: float) -> None:
    """A link that turns by a part of its own angle is locked, whatever it is called."""
    linkage = two_four_bars(Ratio('rocker_joint', 1.0))
    gear = linkage.joints['gear_joint']
    assert isinstance(gear, RevoluteJoint)
    twins = {'twin': gear, 'reversed': RevoluteJoint(gear.child, gear.parent)}
    for name in twins:
        for ratios in (
            {'gear_joint': Ratio(name, ratio)},
            {'gear_joint': Ratio('out_joint', 1.0), 'out_joint': Ratio(name, ratio)},
        ):
            with pytest.raises(DefinitionError, match=f"'{name}' moves the same links") as caught:
                Closure(replace(linkage, joints=linkage.joints | twins, ratios=ratios))
            assert caught.value.where == 'ratios.gear_joint.of'


def test_overconstraining_ratio_is_refused() -> None:
    """A rocker cannot follow its crank: the coupler holds it."""
    linkage = replace(two_four_bars(Ratio('rocker_joint', 1.0)), ratios={})
    for name, of in (('rocker_joint', 'crank_joint'), ('out_joint', 'rocker_joint')):
        ratios = {'gear_joint': Ratio('rocker_joint', 1.0), name: Ratio(of, 1.0)}
        with pytest.raises(DefinitionError):
            Closure(replace(linkage, ratios=ratios))


@pytest.mark.parametrize('ratio', [2.0, 0.5, -1.0, 1.5])
@pytest.mark.parametrize('name', ['theta3', 'theta4'])
def test_geared_five_bar_crank_angles_equal_a_scan(ratio: float, name: str) -> None:
    """Norton's five-bar from the other end; with a ratio of halves it repeats after two turns."""
    closure = Closure(geared_five_bar((6.0, 1.0, 7.0, 9.0, 4.0), Ratio('theta2', ratio, 0.5236)))
    (interval,) = closure.input_ranges
    ends = np.linspace(interval.lowest, interval.highest, 3000)
    batch = closure.solve(ends)
    scanned = batch.positions[closure.joint_names.index(name)]
    for wanted in np.linspace(-3.0, 3.0, 13):
        cranks = [crank for _, crank in closure.cranks(name, wanted)]
        for crank in cranks:
            assert remainder(closure.position(crank)[name] - wanted, tau) == pytest.approx(0.0)
        off = np.remainder(scanned - wanted + pi, tau) - pi
        crossed = (off[:-1] * off[1:] < 0.0) & (np.abs(off[:-1] - off[1:]) < 1.0)
        assert len(cranks) == np.count_nonzero(crossed)


BEHIND_A_RATIO = """
links:
  ground: {O2: [0, 0], O4: [0.1, 0], P: [0.3, 0], Q: [0.4, 0], S: [1, 0.03]}
  crank: {O2: [0, 0], A: [0.03, 0]}
  coupler: {A: [0, 0], B: [0.11, 0]}
  FIRST
  wheel: {P: [0, 0], C: [0.03, 0]}
  rod: {C: [0, 0], D: [0.1, 0]}
  lever: {Q: [0, 0], D: [0.07, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {SIDE, D: left}
joints:
  followed: FOLLOWED
  wheel_joint: {parent: ground, child: wheel}
  lever_joint: {parent: ground, child: lever}
ratios: {wheel_joint: {of: followed, ratio: RATIO}}
"""
FOLLOWED = {
    'a rocker': (
        'rocker: {O4: [0, 0], B: [0.08, 0]}', 'B: left', '{parent: ground, child: rocker}', '1.5',
    ),
    'a coupler': (
        'rocker: {O4: [0, 0], B: [0.08, 0]}', 'B: left', '{parent: ground, child: coupler}', '0.7',
    ),
    'a slide': ('', 'way: ahead', '{slider: way}', '12'),
}  # fmt: skip


@pytest.mark.parametrize('name', FOLLOWED)
def test_least_transmission_angle_behind_a_ratio_equals_a_scan(name):
    first, side, followed, ratio = FOLLOWED[name]
    text = BEHIND_A_RATIO.replace('FIRST', first).replace('SIDE', side)
    text = text.replace('FOLLOWED', followed).replace('RATIO', ratio)
    if not first:
        text += 'sliders: {way: {point: B, along: ground, through: S, direction: [1, 0]}}\n'
    closure = read_closure(parse_yaml(text.encode(), name), name)
    angles = []
    for crank in np.linspace(0.0, tau, 3600, endpoint=False):
        _, wheel, lever = closure.position(crank).joints
        pin, end = 0.3 + rect(0.03, wheel), 0.4 + rect(0.07, lever)
        angle = abs(phase((end - pin) / (end - 0.4)))
        angles.append(min(angle, pi - angle))
    found = transmission_angles(InputSweep(closure))
    lowest = found[max(found)].lowest.value
    assert lowest == pytest.approx(min(angles), abs=1e-4)
