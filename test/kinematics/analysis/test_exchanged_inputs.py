# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Any joint of a linkage with one input is the input: the crank, its rates, and all branches."""

from cmath import rect
from dataclasses import replace
from functools import cache
from itertools import pairwise
from math import asin, atan2, pi, remainder, sqrt, tan, tau
import os
import pickle
import random
import subprocess
import sys

from campaigns.inverse import (
    errors_of,
    is_wrong,
    moving_joints,
    passes_of,
    random_four_bars,
    random_slides,
)
from flint import arb
from linkage_ros import Closure, DefinitionError, Limits, load
from linkage_ros.kinematics import (
    CODES,
    CrankBranch,
    Input,
    InputRange,
    is_iterated,
    Linkage,
    RevoluteJoint,
    SlideJoint,
    Slider,
    Status,
)
from linkage_ros.kinematics.analysis.monotonic_pieces import monotonic_pieces
from linkage_ros.tools.models.source_code import LANGUAGES, Subject, write_source
from linkage_ros.tools.study import prove, SingularError
import numpy as np
import pytest

from ..linkages import four_bar_linkage
from ...support.sampling import sample_count
from ...support.scenes import ONE_INPUT

U = 2.0**-53
STATES = int(os.environ.get('LINKAGE_STATES') or sample_count(100, 30))
"""States on each branch; 10⁶ in all take LINKAGE_STATES=6000."""

FREE = Limits()

LINKAGES = [name for name in ONE_INPUT if name not in ('class_3', 'parallelogram')]


@cache
def gallery(name):
    return load(name)


def outputs(closure):
    """Return the dependent joints that move."""
    return [joint for joint in closure.joint_names if joint not in closure.input_names]


def numbers(count):
    """Return shares of a branch: at random, and at 1e-14 of both ends."""
    rng = random.Random(1)
    return [1e-14, 1.0 - 1e-14, *(rng.random() for _ in range(count))]


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', LINKAGES)
def test_inverse_crank_angle_stays_within_the_rounding_bound(name):
    """|θ − exact| ≤ 8·u·(|θ| + (|y| + 2π)/|f′| + 1)."""
    closure = gallery(name)
    for joint in outputs(closure):
        for branch in closure.branches(joint):
            error, off = errors_of(closure, joint, branch, STATES, random.Random(1))
            assert error <= 8.0, joint
            if not any(branch.steep):
                assert off <= 4e-15, joint


@pytest.mark.parametrize('name', ['four_bar', 'slider_crank', 'double_rocker', 'jansen_leg'])
def test_exact_crank_angle_lies_within_the_error_bound(name):
    """The joint, to fifty digits, passes the wanted value within the bound about the crank."""
    closure = gallery(name)
    for joint in outputs(closure)[-2:]:
        number = closure.joint_names.index(joint)
        for branch in closure.branches(joint):
            for share in numbers(3):
                y = branch.low + share * (branch.high - branch.low)
                crank, slope = branch.find_crank(y)
                size = tau if branch.turning else closure.scale
                bound = 8.0 * U * (abs(crank) + (abs(y) + size) / abs(slope) + 1.0)
                sides = []
                for place in (crank - bound, crank + bound):
                    if not branch.least < place < branch.most:
                        break  # The exact crank cannot be beyond the end.
                    try:
                        at = prove(closure, [place])
                    except (SingularError, ValueError):
                        break
                    off = float((at.joints[number] - arb(y)).mid())
                    sides.append(off - tau * round(off / tau) if branch.turning else off)
                assert len(sides) < 2 or sides[0] * sides[1] <= 0, (joint, share)


@pytest.mark.parametrize('name', ['four_bar', 'slider_crank', 'double_rocker', 'klann_leg'])
def test_inverse_crank_rates_give_the_requested_joint_rates(name):
    """The reference, driven by the crank's rates, moves the joint as was asked."""
    closure = gallery(name)
    for joint in [*outputs(closure)[:2], outputs(closure)[-1]]:
        number = closure.joint_names.index(joint)
        for branch in closure.branches(joint):
            inverse = closure.driven_by(joint, branch=branch.number)
            for share in (0.1, 0.37, 0.8):
                position = inverse.position(branch.low + share * (branch.high - branch.low))
                velocity = inverse.velocity(position, 0.7)
                acceleration = inverse.acceleration(position, velocity, -1.3)
                truth = prove(
                    closure,
                    [position.joints[0]],
                    [velocity.joints[0]],
                    [acceleration.joints[0]],
                )
                assert float(truth.rates[number]) == pytest.approx(0.7, rel=1e-11)
                assert float(truth.accelerations[number]) == pytest.approx(-1.3, rel=1e-10)
                for row, other in enumerate(inverse.joint_names[1:], 1):
                    at = closure.joint_names.index(other)
                    assert velocity.joints[row] == pytest.approx(float(truth.rates[at]), rel=1e-9)
                    off = position.joints[row] - float(truth.joints[at].mid())
                    off = remainder(off, tau) if closure.turning[at] else off
                    assert off == pytest.approx(0.0, abs=1e-12)


def closures_to_scan():
    yield from (gallery(name) for name in LINKAGES)
    yield from random_four_bars(STATES, random.Random(33))


def test_inverse_finds_all_crank_angles_of_a_value():
    rng = random.Random(5)
    cases = 0
    for closure in closures_to_scan():
        joint = rng.choice(outputs(closure))
        low, high = closure.input_ranges[0][:2]
        value = closure.position(rng.uniform(low, high))[joint]
        found = closure.cranks(joint, value)
        for _, crank in found:
            away = closure.position(crank)[joint] - value
            turning = closure.turning[closure.joint_names.index(joint)]
            position = closure.position(crank)
            slope = closure.velocity(position, 1.0)[joint] if position.status.has_rates else 1e8
            allowed = 1e-12 + 1e-14 * abs(slope)
            assert abs(remainder(away, tau) if turning else away) <= allowed
        cranks = sorted(remainder(crank, tau) for _, crank in found)
        assert all(after - before > 1e-9 for before, after in pairwise(cranks))
        assert len(found) >= passes_of(closure, joint, value), (closure, joint, value)
        cases += 1
    assert cases >= STATES


def test_inverse_finds_all_crank_angles_near_slide_poles():
    """A slide passes through infinity, and links that hang on it turn round there."""
    rng = random.Random(9)
    endless = 0
    for closure in random_slides(STATES, rng):
        low, high = closure.input_ranges[0][:2]
        position = closure.position(rng.uniform(low, high))
        moving = moving_joints(closure) if position.joints else []
        for joint in (*rng.sample(moving, min(1, len(moving))), *moving[-1:]):
            branches = closure.branches(joint)
            endless += any(any(branch.endless) for branch in branches)
            value = position[joint]
            found = closure.cranks(joint, value)
            assert len(found) >= passes_of(closure, joint, value), (closure.linkage, joint, value)
            for _, crank in found:
                assert not is_wrong(closure, joint, value, crank), (closure.linkage, joint, value)
    assert endless > STATES // 4


def tangent_mechanism(limits=FREE):
    """Return a linkage whose shoe slides at height 1, by a pin in the slot of the crank."""
    return Closure(
        Linkage(
            links={
                'ground': {'O': (0.0, 0.0), 'G': (0.0, 1.0)},
                'crank': {'O': (0.0, 0.0), 'X': (1.0, 0.0)},
                'shoe': {'P': (0.0, 0.0), 'Q': (0.2, 0.0)},
            },
            inputs=(Input('crank_joint', 'ground', 'crank', limits=limits),),
            assembly={},
            joints={'shoe_slide': SlideJoint('rail'), 'slot_slide': SlideJoint('slot')},
            sliders={
                'rail': Slider('P', 'ground', 'G', (1.0, 0.0), 'shoe'),
                'slot': Slider('P', 'crank', 'O', (1.0, 0.0)),
            },
        )
    )


@pytest.mark.parametrize('slide', [-1e6, -40.0, -0.5, 0.0, 1e-9, 3.0, 1e3, 1.9e6])
def test_slide_has_a_branch_up_to_each_pole(slide):
    """The slide is cot(crank): its poles are 0 and pi, and each value has two cranks a turn."""
    closure = tangent_mechanism()
    expected = atan2(1.0, slide)
    cranks = [crank for _, crank in closure.cranks('shoe_slide', slide)]
    assert len(cranks) == 2
    for number, crank in enumerate(cranks, 1):
        assert remainder(crank - expected, pi) == pytest.approx(0.0, abs=1e-15)
        inverse = closure.driven_by('shoe_slide', branch=number)
        position = inverse.position(slide)
        assert position.status is Status.CLOSED
        assert position.joints[0] == pytest.approx(crank, abs=2e-15)
        velocity = inverse.velocity(position, 0.7)
        # A crank of 6 is rounded by 4e-16, and so is its distance from the pole.
        exact = {'rel': 1e-13 + 4e-15 * abs(slide)}
        assert velocity.joints[0] == pytest.approx(-0.7 / (1.0 + slide * slide), **exact)
        changed = inverse.acceleration(position, velocity, 0.0).joints[0]
        bend = 2.0 * slide * 0.49 / (1.0 + slide * slide) ** 2
        assert changed == pytest.approx(bend, **exact, abs=1e-15 / (1.0 + slide**4))


@pytest.mark.parametrize('slide', [3e6, -1e19, 1e150])
def test_slide_value_near_a_pole_drives_the_crank(slide):
    """The crank has too few digits for the slide; the slide has enough for the crank."""
    closure = tangent_mechanism()
    assert closure.cranks('shoe_slide', slide) == []
    for number in (1, 2):
        position = closure.driven_by('shoe_slide', branch=number).position(slide)
        assert position.status is Status.CLOSED
        assert remainder(position.joints[0] - atan2(1.0, slide), pi) == pytest.approx(
            0.0, abs=1e-15
        )


def test_slide_pole_does_not_end_the_crank_range():
    (whole,) = tangent_mechanism().input_ranges
    assert whole.is_whole
    (limited,) = tangent_mechanism(Limits(-1.0, 2.0)).input_ranges
    assert limited[:2] == (-1.0, 2.0)


@pytest.mark.parametrize(
    ('limits', 'ends'),
    [
        (Limits(-1.0, 2.0), [(-1.0, 0.0), (0.0, 2.0)]),
        (Limits(0.0, 2.0), [(0.0, 2.0)]),
        (Limits(0.3, pi), [(0.3, pi)]),
        (Limits(0.5, 7.0), [(0.5, pi), (pi, tau), (tau, 7.0)]),
    ],
)
def test_crank_limits_around_a_pole_split_the_branches(limits, ends):
    branches = tangent_mechanism(limits).branches('shoe_slide')
    found = [(branch.least, branch.most) for branch in branches]
    assert found == [pytest.approx(each, abs=1e-6) for each in ends]
    assert not any(any(branch.turns_back) for branch in branches)


@pytest.mark.parametrize('share', [*(k / 16 for k in range(1, 16)), 0.5 + 1 / 1440, 1 / 3])
def test_pole_at_a_sample_or_between_two_splits_the_branches(share):
    """Where limits lie about the pole at 0 as searches divide a range, one meets it exactly."""
    rng = random.Random(str(share))
    for _ in range(4):
        width = rng.randrange(2, 49) / 16
        limits = Limits(-share * width, width - share * width)
        closure = tangent_mechanism(limits)
        for joint in ('shoe_slide', 'slot_slide'):
            ends = [(one.least, one.most) for one in closure.branches(joint)]
            assert any(most == pytest.approx(0.0, abs=1e-5) for _, most in ends), (joint, limits)
            assert any(least == pytest.approx(0.0, abs=1e-5) for least, _ in ends), (joint, limits)
        for slide in (rng.uniform(-3.0, 3.0), *(1.0 / tan(limits.low * x) for x in (0.1, 0.9))):
            right = [atan2(1.0, slide), atan2(1.0, slide) - pi]
            right = [crank for crank in right if limits.low < crank < limits.high]
            cranks = [crank for _, crank in closure.cranks('shoe_slide', slide)]
            assert cranks == pytest.approx(right, abs=1e-14), (slide, limits)


def test_returning_slide_ends_its_branches_at_poles():
    """The slot's slide is 1/sin(crank): it comes back on the side on which it went."""
    closure = tangent_mechanism(Limits(0.5, 6.0))
    found = [(one.least, one.most, one.turns_back) for one in closure.branches('slot_slide')]
    places = [0.5, pi / 2.0, pi, 1.5 * pi, 6.0]
    assert [each[:2] for each in found] == [
        pytest.approx(each, abs=1e-6) for each in pairwise(places)
    ]
    cranks = sorted(crank for _, crank in closure.cranks('slot_slide', 1.25))
    assert cranks == pytest.approx([asin(0.8), pi - asin(0.8)], abs=1e-15)


def test_compiled_inverse_equals_the_closure_near_a_pole():
    inverse = tangent_mechanism().driven_by('shoe_slide', branch=1)
    subject = Subject(inverse, 'm', 'x.yaml', 0, inverse.joint_names)
    made: dict = {}
    exec(write_source(subject, LANGUAGES['.py'](subject)), made)
    rng = random.Random(4)
    for _ in range(STATES):
        slide = tan(rng.uniform(-1.57, 1.57))
        status, joints = made['position']([slide])[:2]
        assert (status, joints) == (0, inverse.position(slide).joints), slide


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', LINKAGES)
def test_compiled_inverse_equals_the_closure_at_cell_ends(name):
    """One of them is the middle of the branch. Beside a toggle numbers are bisected further."""
    closure = gallery(name)
    branch = closure.branches(outputs(closure)[0])[0]
    inverse = closure.driven_by(outputs(closure)[0], branch=branch.number)
    subject = Subject(inverse, 'm', 'x.yaml', 0, inverse.joint_names)
    made: dict = {}
    exec(write_source(subject, LANGUAGES['.py'](subject)), made)
    cells = branch._cells
    beside_toggles = {end for i in branch._steep_cells for end in (i, i + 1)}
    for k in {*range(1, cells)} - beside_toggles:
        value, _ = branch._output_at(k / cells)
        status, joints = made['position']([value])[:2]
        if status == 0:
            assert repr(joints) == repr(inverse.position(value).joints), (k, value)


def test_inverse_states_do_not_depend_on_their_order():
    values = np.linspace(0.97, 2.24, 500).tolist()
    once = [
        load('four_bar').driven_by('rocker_joint', branch=2).position(y).joints
        for y in values[::50]
    ]
    inverse = load('four_bar').driven_by('rocker_joint', branch=2)
    random.Random(2).shuffle(values)
    found = {y: inverse.position(y).joints for y in values}
    assert [found[y] for y in sorted(values)[::50]] == once


def test_driven_rocker_toggles_at_its_dead_centres():
    inverse = load('four_bar').driven_by('rocker_joint', branch=1)
    branch = load('four_bar').branches('rocker_joint')[0]
    # The dead centres of the crank-rocker: coupler and crank in line (cosine rule).
    a, b, c, d = _lengths(load('four_bar').linkage)
    for reach, end in ((b + a, branch.low), (b - a, branch.high)):
        at_ground = np.arccos((c * c + d * d - reach * reach) / (2 * c * d))
        assert end == pytest.approx(pi - at_ground, abs=1e-14)
        position = inverse.position(end)
        assert position.status is Status.TOGGLE
        with pytest.raises(ValueError, match='toggle has none'):
            inverse.velocity(position, 1.0)
    beyond = inverse.position(branch.high + 0.25)
    # The crank pin is as far from where the coupler ends as the crank is too long.
    opened = sqrt(c * c + d * d - 2 * c * d * np.cos(pi - branch.high - 0.25))
    assert (beyond.status, beyond.gap) == (Status.OPEN, pytest.approx(b - a - opened))
    assert inverse.position(float('nan')).status is Status.INDETERMINATE


def _lengths(linkage):
    def length(link):
        (x, y), (u, v) = list(linkage.links[link].values())[:2]
        return sqrt((x - u) ** 2 + (y - v) ** 2)

    return [length(link) for link in ('crank', 'coupler', 'rocker', 'ground')]


@pytest.mark.parametrize('number', [1, 2, 3, 4])
def test_driven_rocker_moves_the_crank_through_its_toggle(number):
    """There the crank stands; behind it the crank turns back, in its other assembly."""
    closure = load('double_rocker')
    branch = closure.branches('right_rocker_joint')[number - 1]
    inverse = closure.driven_by('right_rocker_joint', branch=number)
    end = (branch.low, branch.high)[branch.steep.index(True)]
    step = 1e-4 if 0.5 * (branch.low + branch.high) > end else -1e-4
    position = inverse.position(end)
    velocity = inverse.velocity(position, 0.5)
    acceleration = inverse.acceleration(position, velocity, 0.2)
    assert position.status is Status.CLOSED
    assert velocity.joints[0] == pytest.approx(0.0, abs=1e-7)
    for beside in (step, -step):
        found = inverse.position(end + beside)
        bend = acceleration.joints[0] / 0.25
        assert found.joints[0] == pytest.approx(
            position.joints[0] + 0.5 * beside**2 * bend, abs=1e-10
        )
        moving = inverse.velocity(found, 0.5)
        assert velocity.joints == pytest.approx(moving.joints, abs=2e-3)
        nearly = inverse.acceleration(found, moving, 0.2)
        assert acceleration.joints == pytest.approx(nearly.joints, abs=5e-3)
    assert len(closure.cranks('right_rocker_joint', end - step)) < len(
        closure.cranks('right_rocker_joint', end + step)
    )


def test_whole_rocker_turns_give_whole_crank_turns():
    inverse = load('drag_link').driven_by('rocker_joint')
    first = inverse.position(1.0).joints[0]
    for turns in (-3, 2, 1000):
        crank = inverse.position(1.0 + tau * turns).joints[0]
        assert crank - tau * turns == pytest.approx(first, abs=1e-12)
    backwards = load('four_bar').driven_by('coupler_joint')
    assert backwards.position(0.1 + tau).joints[0] < backwards.position(0.1).joints[0]


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', LINKAGES)
def test_inverse_crank_angle_follows_its_branch_continuously(name):
    """
    The crank runs on from end to end of the branch; its errors are as those of `cranks`.

    Links that are iterated have twice as many roundings.
    """
    closure = gallery(name)
    rng = random.Random(name)
    for joint in outputs(closure)[:2] + outputs(closure)[-1:]:
        row = closure.joint_names.index(joint)
        (branch, *_) = closure.branches(joint)
        inverse = closure.driven_by(joint, branch=branch.number)
        limit = 16.0 if is_iterated(inverse) else 8.0
        for share in [1e-3, 1.0 - 1e-3, *(rng.random() for _ in range(STATES // 3))]:
            y, known = branch.state_at(share)
            crank = inverse.position(y)[closure.input_names[0]]
            assert crank == pytest.approx(known, abs=1e-9)
            forward = closure.position(crank)
            slope = abs(closure.velocity(forward, 1.0).joints[row])
            off = forward.joints[row] - y
            off = remainder(off, tau) if branch.turning else off
            size = tau if branch.turning else closure.scale
            allowed = slope * (abs(crank) + 1.0) + abs(y) + size
            assert abs(off) <= limit * U * allowed, (joint, share)


def test_driven_rod_moves_parallelogram_through_its_change_points():
    """The rod keeps its direction: crank and follower turn against it, and together."""
    inverse = load('parallelogram').driven_by('rod_joint')
    for rod in (0.0, -pi, *(0.37 * k for k in range(-20, 21))):
        position = inverse.position(rod)
        velocity = inverse.velocity(position, 0.7)
        acceleration = inverse.acceleration(position, velocity, -0.2)
        assert position['crank_joint'] == pytest.approx(-rod, abs=1e-14)
        assert remainder(position['follower_joint'] + rod, tau) == pytest.approx(0.0, abs=1e-14)
        assert velocity.joints == pytest.approx((-0.7, -0.7), abs=1e-14)
        assert acceleration.joints == pytest.approx((0.2, 0.2), abs=1e-14)


@pytest.mark.parametrize('turned', [('coupler', 'crank'), ('crank', 'coupler')])
def test_coupler_angle_on_the_crank_drives_four_bars(turned):
    """By the loop itself: a·e^{iθ} + b·e^{i(θ ± x)} = d + c·e^{iψ}, with its derivatives."""
    child, parent = turned
    way = 1.0 if child == 'coupler' else -1.0
    rng, cases = random.Random(child), 0
    for _ in range(STATES):
        a, b, c, d = (rng.uniform(0.3, 1.0) for _ in range(4))
        links = {
            'ground': {'O2': (0.0, 0.0), 'O4': (d, 0.0)},
            'crank': {'O2': (0.0, 0.0), 'A': (a, 0.0)},
            'coupler': {'A': (0.0, 0.0), 'B': (b, 0.0)},
            'rocker': {'O4': (0.0, 0.0), 'B': (c, 0.0)},
        }
        closure = Closure(
            Linkage(
                links=links,
                inputs=(Input('x', parent, child),),
                assembly={'B': rng.choice(['left', 'right'])},
                joints={
                    'crank': RevoluteJoint('ground', 'crank'),
                    'rocker': RevoluteJoint('ground', 'rocker'),
                },
                sliders={},
            )
        )
        x = rng.uniform(-pi, pi)
        position = closure.position(x)
        diagonal = abs(a + b * rect(1.0, x))
        assert position.status is (Status.CLOSED if abs(c - d) < diagonal < c + d else Status.OPEN)
        if not position.joints:
            continue
        velocity = closure.velocity(position, 0.7)
        acceleration = closure.acceleration(position, velocity, -0.3)
        arms = [
            (a, position['crank'], velocity['crank'], acceleration['crank']),
            (
                b,
                position['crank'] + way * x,
                velocity['crank'] + way * 0.7,
                acceleration['crank'] - way * 0.3,
            ),
            (-c, position['rocker'], velocity['rocker'], acceleration['rocker']),
        ]
        scale = 1.0 + sum(rate * rate + abs(change) for _, _, rate, change in arms)
        unit = [(size * rect(1.0, angle), rate, change) for size, angle, rate, change in arms]
        assert abs(sum(arm for arm, _, _ in unit) - d) < 1e-15 * scale
        assert abs(sum(arm * rate for arm, rate, _ in unit)) < 1e-14 * scale
        bend = sum(arm * (1j * change - rate * rate) for arm, rate, change in unit)
        assert abs(bend) < 1e-13 * scale
        # B lies on the side of O2→O4 that the assembly names.
        side = closure.points(position)['rocker', 'B'].imag
        assert (side > 0.0) == (closure.linkage.assembly['B'] == 'left')
        cases += 1
    assert cases > STATES // 3


def test_driven_ratio_follower_moves_the_joint_it_followed():
    closure = load('gripper')
    inverse = closure.driven_by('right_knuckle_joint')
    position = closure.position(0.4)
    found = inverse.position(position['right_knuckle_joint'])
    for joint in inverse.joint_names:
        wanted = 0.4 if joint == 'left_knuckle_joint' else position[joint]
        assert found[joint] == pytest.approx(wanted, abs=1e-15)


def test_oscillating_driven_joint_is_taken_modulo_a_turn():
    inverse = load('four_bar').driven_by('rocker_joint', branch=1)
    assert inverse.position(1.2 + 3 * tau).joints[0] == pytest.approx(
        inverse.position(1.2).joints[0], abs=1e-13
    )


def test_crank_limits_cut_the_inverse_branches():
    linkage = load('four_bar').linkage
    crank = replace(linkage.inputs[0], limits=Limits(0.5, 3.0))
    closure = Closure(replace(linkage, inputs=(crank,)))
    inverse = closure.driven_by('rocker_joint')  # Only one is left.
    assert closure.branches('rocker_joint')[0].by == ('crank_joint', 'crank_joint')
    assert inverse.position(closure.position(3.0)['rocker_joint']).status is Status.CLOSED
    ends = [closure.position(x)['rocker_joint'] for x in (0.5, 3.0)]
    assert inverse.input_ranges[0][:2] == pytest.approx(tuple(ends), abs=1e-14)
    assert inverse.position(ends[1] + 0.1).status is Status.LIMITED
    assert closure.cranks('rocker_joint', ends[1] + 0.1) == []


def test_class_3_linkage_is_inverted_along_its_branch():
    closure = load('class_3')
    inverse = closure.driven_by('platform_joint', branch=1)
    branch = closure.branches('platform_joint')[0]
    y = 0.5 * (branch.low + branch.high)
    position = inverse.position(y)
    again = closure.position(position.joints[0])
    assert again['platform_joint'] == pytest.approx(y, abs=4e-14)
    velocity = inverse.velocity(position, 1.0)
    acceleration = inverse.acceleration(position, velocity, 0.0)
    step = 1e-4
    one, other = (inverse.position(y + k * step).joints[0] for k in (1, -1))
    assert velocity.joints[0] == pytest.approx((one - other) / (2 * step), rel=1e-6)
    bend = (one + other - 2 * position.joints[0]) / step**2
    assert acceleration.joints[0] == pytest.approx(bend, rel=1e-4)


@pytest.mark.parametrize('lengths', [(3.0, 2.0, 4.0, 1.0), (1.0, 2.0, 3.0, 4.0)])
def test_branches_cover_both_turns_of_change_point_four_bars(lengths):
    """One change point only: a turn of the crank ends in the other assembly."""
    closure = Closure(four_bar_linkage(lengths, 'left'))
    for joint in closure.joint_names:
        branches = closure.branches(joint)
        assert sum(one.most - one.least for one in branches) == pytest.approx(2.0 * tau)
        for crank in (0.3, 2.0, 5.0, 0.3 + tau, 2.0 + tau, 5.0 + tau):
            found = [x for _, x in closure.cranks(joint, closure.position(crank)[joint])]
            assert min(abs(remainder(x - crank, 2.0 * tau)) for x in found) < 1e-9


def test_traced_point_coordinate_drives_jansens_leg():
    closure = load('jansen_leg')
    for branch, crank in closure.cranks('foot.y', -0.08):
        assert closure.position(crank).points['foot'].imag == pytest.approx(-0.08, abs=1e-15)
        inverse = closure.driven_by('foot.y', branch=branch)
        position = inverse.position(-0.08)
        velocity = inverse.velocity(position, 0.1)
        acceleration = inverse.acceleration(position, velocity, 0.2)
        motion = next(
            found
            for (_, point), found in inverse.point_motion(position, velocity, acceleration).items()
            if point == 'foot'
        )
        assert motion.place.imag == pytest.approx(-0.08, abs=1e-15)
        assert motion.velocity.imag == pytest.approx(0.1, rel=1e-12)
        assert motion.acceleration.imag == pytest.approx(0.2, rel=1e-11)


def test_inverse_batch_equals_single_states():
    inverse = load('four_bar').driven_by('rocker_joint', branch=1)
    values = np.linspace(0.5, 2.5, 40)
    batch = inverse.solve(values, rates=2.0, accelerations=0.5)
    for k, y in enumerate(values.tolist()):
        position = inverse.position(y)
        assert batch.status[k] == CODES[position.status]
        if position.status.has_rates:
            velocity = inverse.velocity(position, 2.0)
            acceleration = inverse.acceleration(position, velocity, 0.5)
            found = (position.joints, velocity.joints, acceleration.joints)
            for group, joints in zip(batch[1:], found, strict=True):
                assert group[:, k] == pytest.approx(joints, rel=1e-12)


def test_pickled_inverse_keeps_its_branch():
    inverse = load('four_bar').driven_by('rocker_joint', branch=2)
    position = inverse.position(1.5)
    again = pickle.loads(pickle.dumps((inverse, position)))
    assert again[0].position(1.5).joints == position.joints
    assert again[1].inputs == (1.5,)


@pytest.mark.parametrize(
    ('name', 'joints', 'line'),
    [
        ('four_bar', 'rockr_joint', "did you mean 'rocker_joint'?"),
        ('four_bar', 'crank_joint', 'crank_joint: is an input'),
        ('four_bar', 'rocker_joint', '2 branches; name a branch, or a crank near it'),
        ('four_bar', 'rocker_joint 3', 'branch 3: rocker_joint has no branch of this number'),
        ('peaucellier', 'P.x', 'P.x: does not move with the input'),
        ('five_bar', 'left_elbow', 'left_elbow: 1 for 2 inputs; name 2 different joints'),
        ('five_bar', 'left_elbow left_elbow', 'name 2 different joints'),
        ('five_bar', 'left_elbow right_elbo', "did you mean 'right_elbow'?"),
        ('five_bar', 'left_elbow right_elbow left_crank_joint', '3 for 2 inputs'),
    ],
)
def test_driven_by_refuses_unknown_joints_in_one_line(name, joints, line):
    joints, number, _ = joints.partition(' 3')
    with pytest.raises(DefinitionError) as error:
        load(name).driven_by(*joints.split(), branch=int(number) if number else None)
    assert line in str(error.value)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize(
    ('name', 'joints'),
    [
        ('five_bar', ('left_elbow', 'right_elbow')),
        ('five_bar', ('left_crank_joint', 'left_elbow')),
        ('five_bar', ('right_elbow', 'right_crank_joint')),
    ],
)
def test_exchanged_inputs_of_two_motors_keep_the_assembly(name, joints):
    closure = load(name)
    other = closure.driven_by(*joints)
    assert other.input_names == joints
    assert {*other.joint_names} == {*closure.input_names, *closure.joint_names} - {*joints}
    for inputs in ((pi / 3, pi / 3), (1.1, 1.0), (1.2, 1.3)):
        position = closure.position(*inputs)
        velocity = closure.velocity(position, 0.3, -0.2)
        known = dict(zip(closure.joint_names, position.joints, strict=True))
        known |= dict(zip(closure.input_names, inputs, strict=True))
        rates = dict(zip(closure.joint_names, velocity.joints, strict=True))
        rates |= dict(zip(closure.input_names, (0.3, -0.2), strict=True))
        found = other.position(*(known[joint] for joint in joints))
        moving = other.velocity(found, *(rates[joint] for joint in joints))
        for joint in other.joint_names:
            assert remainder(found[joint] - known[joint], tau) == pytest.approx(0.0, abs=1e-9)
            assert moving[joint] == pytest.approx(rates[joint], abs=1e-8)


def test_forward_solution_does_not_import_the_inverse_modules():
    code = (
        'import sys, linkage_ros as lr; lr.load("four_bar").position(0.7); '
        'print(sorted(name for name in sys.modules if "exchange" in name or "crank_br" in name))'
    )
    told = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == '[]'


class Cubic:
    """An output x³ + bend·x² over the crank, with slopes that are noisy as rounded ones."""

    turning, crank_turns, size = False, True, 1.0

    def __init__(self, bend=0.0):
        self.bend = bend
        self.rng = random.Random(3)

    def __call__(self, crank):
        noise = self.rng.uniform(-1e-16, 1e-16)
        return crank**3 + self.bend * crank**2, 3.0 * crank**2 + 2.0 * self.bend * crank + noise

    def fast(self, crank, _rate):
        return tuple((value,) for value in self(crank))


def test_branch_continues_across_a_flat_inflection():
    output = Cubic()
    ((piece, turns_on),) = monotonic_pieces(output, InputRange(-1.1, 0.9))
    assert not turns_on
    branch = CrankBranch(output, piece, 1)
    for y in (-1.0, -1e-3, -1e-9, 1e-6, 0.5):
        assert branch.find_crank(y)[0] == pytest.approx(np.cbrt(y), rel=1e-12)
    assert abs(branch.find_crank(0.0)[1]) < branch.flat


@pytest.mark.parametrize('bend', [1e-2, 1e-3, -1e-3])
def test_slightly_reversing_joint_has_three_branches(bend):
    pieces = list(monotonic_pieces(Cubic(bend), InputRange(-1.1, 0.9)))
    ends = [piece[0][0] for piece, _ in pieces[1:]]
    assert ends == pytest.approx(sorted((0.0, -2.0 * bend / 3.0)), abs=1e-12)
