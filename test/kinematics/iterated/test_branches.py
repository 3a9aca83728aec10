# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Iterated links follow one branch over the unwrapped input, as a walk apart from it does."""

from cmath import rect
from dataclasses import replace
from functools import cache
from math import pi, remainder, tau
import random

from linkage_ros.kinematics import (
    AssemblyPose,
    Closure,
    Input,
    InputSweep,
    Linkage,
    other_assemblies,
    Status,
)
from mpmath import mp
import numpy as np
import pytest

from ..defects import defect
from ..platforms import (
    everything,
    Leg,
    linkage_of,
    Platform,
    platform,
    platform_of,
    residuals,
    Walked,
    walks,
)

KINDS = {
    'three arms': (True, 0),
    'a line': (True, 1),
    'two lines': (True, 2),
    'a slot of the crank': (True, 3),
    'a slide driven': (False, 0),
    'a slide driven, a line': (False, 1),
}
COUNT = 8
DEFECTS = {'class3_over_a_turn': 50.0, 'class3_beyond_range': 30.0, 'ref_11': 1.0}
NEAR = 1e-6
"""What a walk in steps of 1/250 is off by at most, but next to where it turns back."""


@cache
def family(kind: str) -> list[tuple[Platform, Linkage, Walked, Walked]]:
    """Return platforms of a kind, each with its walks to smaller and to larger inputs."""
    turning, lines = KINDS[kind]
    rng = random.Random(11)
    made = [platform(rng, turning=turning, lines=lines) for _ in range(COUNT)]
    walked = walks([*made, *made], [-1.0] * COUNT + [1.0] * COUNT)
    return [
        (one, linkage_of(one, rng), walked[i], walked[COUNT + i]) for i, one in enumerate(made)
    ]


def off_branch(closure: Closure, walked: Walked, joint: int = 0, count: int = 150) -> list[str]:
    """Return the inputs along a walk at which the closure has another angle, or none."""
    found = []
    last = len(walked.states) - 1
    for i in sorted({round(last * k / count) for k in range(count + 1)}):
        _, _, angle, x = walked.states[i].tolist()
        position = closure.position(x)
        # A step before x turns back the walk may be beyond the end already, by its own error.
        if not position.joints and i < last:
            found.append(f'{position.status.value} at {x}')
        elif position.joints and abs(remainder(position.joints[joint] - angle, tau)) > NEAR:
            found.append(f'elsewhere at {x}')
    return found


@pytest.mark.sample(2)
@pytest.mark.parametrize('kind', KINDS)
def test_reference_walk_keeps_the_constraints(kind):
    for made, _, *both in family(kind):
        for walked in both:
            for p_x, p_y, angle, x in walked.states[:: max(1, len(walked.states) // 20)].tolist():
                assert max(map(abs, residuals(made, complex(p_x, p_y), angle, x))) < 1e-9 * (
                    1.0 + abs(complex(p_x, p_y))
                )


@pytest.mark.sample(2)
@pytest.mark.parametrize('kind', KINDS)
def test_a_platform_stays_on_the_branch_of_its_pose(kind):
    wrong = {}
    for index, (_, linkage, *both) in enumerate(family(kind)):
        closure = Closure(linkage)
        found = [text for walked in both for text in off_branch(closure, walked)]
        if found:
            wrong[index] = found[:3]
    assert not wrong


@pytest.mark.sample(2)
@pytest.mark.parametrize('kind', KINDS)
def test_platform_ranges_end_where_the_reference_walk_turns_back(kind):
    for index, (made, linkage, down, up) in enumerate(family(kind)):
        closure = Closure(linkage)
        (interval,) = closure.input_ranges
        if interval.is_whole:
            assert (down.end, up.end) == (None, None), index
            continue
        x = made.pose[2]
        assert interval.lowest < x < interval.highest
        for end, walked, sign in ((interval.lowest, down, -1.0), (interval.highest, up, 1.0)):
            if walked.end is not None:
                assert end == pytest.approx(walked.end, abs=1e-6), index
            else:
                # The walk went so far and did not turn back.
                assert sign * (end - walked.states[-1][3]) > 0.0, index
            if any(interval.limited) and walked.end is not None:
                # Range and solver are one: closed up to the end, at a toggle there, open behind.
                assert closure.position(end).status is Status.TOGGLE
                assert closure.position(end - sign * 1e-9).status is Status.CLOSED
                behind = closure.position(end + sign * 1e-9)
                assert behind.status is Status.OPEN
                assert behind.gap > 0.0


def test_platform_range_ends_are_exact_toggles():
    """With 40 digits: constraints and the determinant of their slopes by place and angle are 0."""
    checked = 0
    for made, linkage, down, up in family('three arms'):
        (interval,) = Closure(linkage).input_ranges
        for end, walked in ((interval.lowest, down), (interval.highest, up)):
            if interval.is_whole or walked.end is None:
                continue
            toggle, condition = exact_toggle(made, walked.states[-1].tolist())
            assert abs(end - toggle) < 64.0 * 2.0**-53 * condition, end
            checked += 1
    assert checked > 8


def exact_toggle(made: Platform, start: list[float]) -> tuple[mp.mpf, float]:
    """Return x where a platform on arms toggles, and how lengths come into it."""
    with mp.workdps(40):

        def errors(px: mp.mpf, py: mp.mpf, angle: mp.mpf, x: mp.mpf) -> list[mp.mpf]:
            found, rows = [], []
            p, turn, crank = mp.mpc(px, py), mp.exp(1j * angle), mp.exp(1j * x)
            for leg in made.legs:
                arm = turn * mp.mpc(leg.point)
                between = p + arm - mp.mpc(leg.anchor) - mp.mpc(leg.reach) * crank
                found.append(abs(between) ** 2 - mp.mpf(leg.length) ** 2)
                by_angle = mp.re(mp.conj(between) * mp.mpc(0, 1) * arm)
                rows.append([mp.re(between), mp.im(between), by_angle])
            return [*found, mp.det(mp.matrix(rows))]

        root = mp.findroot(errors, start, tol=1e-30, maxsteps=60)
        # By a leg's length: what it moves x by, from the left null vector of the slopes.
        rows = []
        p, turn, crank = mp.mpc(root[0], root[1]), mp.exp(1j * root[2]), mp.exp(1j * root[3])
        by_x = []
        for leg in made.legs:
            arm = turn * mp.mpc(leg.point)
            reach = mp.mpc(leg.reach) * crank
            between = p + arm - mp.mpc(leg.anchor) - reach
            rows.append([float(mp.re(between)), float(mp.im(between)),
                         float(mp.re(mp.conj(between) * mp.mpc(0, 1) * arm))])  # fmt: skip
            by_x.append(float(-mp.re(mp.conj(between) * mp.mpc(0, 1) * reach)))
        left = np.linalg.svd(np.array(rows).T)[2][-1]
        sizes = [
            leg.length * (leg.length + abs(leg.point) + abs(leg.anchor) + abs(leg.reach))
            for leg in made.legs
        ]
        condition = float(np.abs(left) @ np.array(sizes) / abs(left @ np.array(by_x)))
        return root[3], abs(float(root[3])) + condition


def test_platform_states_do_not_depend_on_their_order():
    for _, linkage, down, up in family('three arms')[:6]:
        inputs = [float(x) for w in (down, up) for x in w.states[:: len(w.states) // 8, 3]]
        forward, mixed = Closure(linkage), Closure(linkage)
        expected = {x: forward.position(x).joints for x in inputs}
        random.Random(2).shuffle(inputs)
        assert {x: mixed.position(x).joints for x in inputs} == expected


def test_platform_branch_repeats_after_its_crank_turns():
    seen = set()
    for made, linkage, down, up in family('three arms'):
        closure = Closure(linkage)
        (interval,) = closure.input_ranges
        if not interval.is_whole:
            continue
        for walked in (down, up):
            for _, _, angle, x in walked.states[:: len(walked.states) // 30].tolist():
                # Not taken modulo a turn: the walk's angle grows on, and so does ours.
                assert closure.position(x).joints[0] == pytest.approx(angle, abs=NEAR)
        x, period = made.pose[2], interval.turns * tau
        base = closure.points(closure.position(x))
        for times in (1, -2, 50):
            moved = closure.points(closure.position(x + times * period))
            assert all(abs(moved[key] - place) < 1e-12 for key, place in base.items())
        seen.add(interval.turns)
    assert seen


def test_oscillating_input_is_taken_modulo_a_turn():
    checked = 0
    for _, linkage, _, _ in family('three arms'):
        closure = Closure(linkage)
        (interval,) = closure.input_ranges
        if interval.is_whole or interval.highest - interval.lowest >= tau:
            continue
        for x in np.linspace(interval.lowest, interval.highest, 7)[1:-1].tolist():
            expected = closure.points(closure.position(x))
            for turns in (1, -1, 3):
                found = closure.points(closure.position(x + turns * tau))
                assert all(abs(found[key] - place) < 1e-12 for key, place in expected.items())
        checked += 1
    assert checked > 2


@pytest.mark.parametrize('name', DEFECTS)
def test_formerly_failing_platforms_stay_on_their_branch(name):
    closure = defect(name)
    made = platform_of(closure.linkage, DEFECTS[name])
    # Of the linkage whose range is a five-hundredth, the walk's steps are too long for its turns.
    down, up = walks([made, made], [-1.0, 1.0])
    (interval,) = closure.input_ranges
    assert not interval.is_whole
    if name != 'ref_11':
        assert not off_branch(closure, down, 1)
        assert not off_branch(closure, up, 1)
        assert (down.end, up.end) == pytest.approx(interval[:2], abs=1e-6)
    for end, walked in ((interval.lowest, down), (interval.highest, up)):
        toggle, condition = exact_toggle(made, walked.states[-1].tolist())
        assert abs(end - toggle) < 64.0 * 2.0**-53 * condition
    assert InputSweep(closure).ranges == (interval,)


def test_crank_angle_has_one_pose_per_turn():
    closure = defect('class3_over_a_turn')
    (interval,) = closure.input_ranges
    assert interval.highest - interval.lowest > tau
    before, after = (closure.position(x).joints for x in (-1.0193, -1.0191))
    assert max(abs(p - q) for p, q in zip(before, after, strict=True)) < 1e-3
    here, there = closure.position(5.27), closure.position(5.27 - tau)
    assert here.status is there.status is Status.CLOSED
    assert abs(here.joints[1] - there.joints[1]) > 1.0
    assert closure.singularity_margin(there).toggle_distance == pytest.approx(
        5.27 - tau - interval.lowest, abs=1e-12
    )


def test_platform_is_open_beyond_a_range_over_one_turn():
    closure = defect('class3_beyond_range')
    (interval,) = closure.input_ranges
    assert interval.highest - interval.lowest > tau > interval.highest + pi
    # The same direction as 0.47007, within the range; but the crank cannot get there that way.
    position = closure.position(6.75324)
    assert position.status is Status.OPEN
    assert position.gap > 0.0
    assert InputSweep(closure).range_about(6.75324) is None


def two_inputs(rng: random.Random) -> tuple[Linkage, Platform]:
    """Return a platform with two inputs, and the same with x times the line's direction more."""
    made = platform(rng)
    way = rect(1.0, rng.uniform(-pi, pi))
    elbow = rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0)
    first = made.legs[0]
    _, _, x = made.pose
    begin = x, rng.uniform(-3.0, 3.0)
    tip = first.anchor + first.reach * rect(1.0, x)
    upper = complex(*elbow)
    lower = tip - first.anchor - upper
    legs = (
        Leg(first.anchor, upper, first.length, 0j, first.point, lower, way.real,
            way.real + way.imag),
        *made.legs[1:],
    )  # fmt: skip
    linkage = linkage_of(made, rng)
    own = upper * rect(1.0, -begin[0])
    end = lower * rect(1.0, -begin[0] - begin[1])
    assert linkage.pose is not None
    linkage = replace(
        linkage,
        links={
            **linkage.links,
            'driver': {'O': (0.0, 0.0), 'E': (own.real, own.imag)},
            'second': {'E': (0.0, 0.0), 'A0': (end.real, end.imag)},
        },
        inputs=(Input('one', 'ground', 'driver'), Input('two', 'driver', 'second')),
        pose=AssemblyPose(begin, linkage.pose.points),
    )
    line = Platform(legs, (made.pose[0], made.pose[1], 0.0), True)
    return replace(linkage, traced=()), line


def test_two_input_platform_follows_a_straight_input_line():
    rng = random.Random(4)
    cases = [two_inputs(rng) for _ in range(12)]
    walked = walks([line for _, line in cases], [1.0] * 12, turns=0.6)
    opened = 0
    for (linkage, line), one in zip(cases, walked, strict=True):
        closure = Closure(linkage)
        assert linkage.pose is not None
        leg = line.legs[0]
        way = leg.rate, leg.more_rate - leg.rate

        def inputs(
            x: float,
            begin: tuple[float, ...] = linkage.pose.inputs,
            way: tuple[float, float] = way,
        ) -> tuple[float, float]:
            return begin[0] + x * way[0], begin[1] + x * way[1]

        for _, _, angle, x in one.states[:: max(1, len(one.states) // 12)].tolist():
            position = closure.position(*inputs(x))
            assert position.status is Status.CLOSED
            assert abs(remainder(position.joints[0] - angle, tau)) < NEAR
        if one.end is not None:
            opened += 1
            assert closure.position(*inputs(one.end + 1e-3)).status is Status.OPEN
    assert opened > 2


def test_other_assemblies_equal_those_of_a_scan():
    rng = random.Random(8)
    counts = []
    for _ in range(12):
        made = platform(rng)
        closure = Closure(linkage_of(made, rng))
        scanned = everything(made, made.pose[2])
        own = complex(*closure.linkage.pose.points['P0']) if closure.linkage.pose else 0j
        expected = [p + rect(1.0, angle) * made.legs[0].point for p, angle in scanned]
        expected = [place for place in expected if abs(place - own) > 1e-6]
        assert len(expected) == len(scanned) - 1
        found = [one.points['P0'] for one in other_assemblies(closure, 1)]
        assert len(found) == len(expected)
        assert all(min(abs(place - one) for one in expected) < 1e-9 for place in found)
        counts.append(len(found))
    assert max(counts) >= 3


def test_listed_assembly_can_be_chosen_as_the_pose():
    closure = defect('class3_beyond_range')
    others = other_assemblies(closure, 1)
    assert len(others) == 3
    inputs = closure.linkage.pose.inputs if closure.linkage.pose else ()
    for one in others:
        rough = {name: (round(z.real, 3), round(z.imag, 3)) for name, z in one.points.items()}
        named = Closure(replace(closure.linkage, pose=AssemblyPose(inputs, rough)))
        places = {name: z for (_, name), z in named.points(named.position(*inputs)).items()}
        assert all(abs(places[name] - place) < 1e-9 for name, place in one.points.items())


def test_listed_assembly_is_reached_after_a_crank_turn():
    closure = defect('class3_over_a_turn')
    assert closure.linkage.pose is not None
    x = -1.1
    places = {name: z for (_, name), z in closure.points(closure.position(x)).items()}
    points = {name: (places[name].real, places[name].imag) for name in ('P3', 'P5', 'P7')}
    moved = Closure(replace(closure.linkage, pose=AssemblyPose((x,), points)))
    later = moved.position(x + tau)
    assert later.status is Status.CLOSED
    expected = {name: z for (_, name), z in moved.points(later).items()}
    (reached,) = [one for one in other_assemblies(moved, 1) if one.turns == 1]
    assert all(abs(expected[name] - place) < 1e-9 for name, place in reached.points.items())
