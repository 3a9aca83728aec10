# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Links that are iterated, alone and in chains with dyads."""

from cmath import rect
from dataclasses import replace
import json
from math import tau
from pathlib import Path
import random
from typing import Any

from linkage_ros.kinematics import (
    AssemblyPose,
    assur_groups,
    Closure,
    Driven,
    GROUND,
    Input,
    InputSweep,
    Iterated,
    Linkage,
    Position,
    RevoluteJoint,
    sides_at,
    Status,
    Structure,
)
import numpy as np
import pytest

from ..linkages import class_3_linkage
from ..platforms import linkage_of, platform
from ...support.scenes import shipped

# Iteration agrees with the closed form, depends on no history, and reports when it fails.


FOLDER = Path(__file__).parents[3] / 'config' / 'linkages'
PLACES = json.loads((Path(__file__).parents[1] / 'gallery.json').read_text('utf-8'))

CLOSED_FORM = ['four_bar', 'slider_crank', 'inverted_slider_crank', 'scotch_yoke', 'jansen_leg',
               'whitworth_quick_return', 'elliptic_trammel', 'excavator_bucket']  # fmt: skip
"""Linkages of all kinds of dyads but PRP; the last ones by a slide that is driven."""


def iterated(linkage: Linkage) -> Structure:
    """Return a structure in which every link but the ground is iterated."""
    found = assur_groups(linkage)
    links = tuple(link for link in found.links if link != GROUND)
    crank = tuple(
        group
        for group in found.groups[:1]
        if isinstance(group, Driven) and group.joint.to == GROUND and group.joint.kind == 'R'
    )
    rest = tuple(link for link in links if all(link != group.joint.link for group in crank))
    return replace(found, groups=(*crank, Iterated(rest)))


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', CLOSED_FORM)
def test_iterated_solution_equals_the_closed_form(name, monkeypatch):
    linkage = shipped(name)
    exact = Closure(linkage)
    start = PLACES[f'{name}.yaml']['inputs'][1]
    rough = {
        point: (place.real + 0.003 * exact.scale, place.imag - 0.002 * exact.scale)
        for (_, point), place in exact.points(exact.position(start)).items()
    }
    posed = replace(linkage, assembly={}, pose=AssemblyPose((start,), rough))
    monkeypatch.setattr('linkage_ros.kinematics.plane.closure.assur_groups', iterated)
    found = Closure(posed)
    turns = not linkage.inputs[0].slider
    for i in range(-20, 21):
        value = start + i * (0.3 if turns else 0.0005 * exact.scale)
        one, other = exact.position(value), found.position(value)
        assert one.status is other.status is Status.CLOSED
        places, expected = found.points(other), exact.points(one)
        motions = []
        for closure, position in ((exact, one), (found, other)):
            velocity = closure.velocity(position, 1.3)
            acceleration = closure.acceleration(position, velocity, -0.7)
            motions.append((velocity.joints, acceleration.joints))
        for key, place in expected.items():
            assert abs(places[key] - place) < 1e-13 * exact.scale, (value, key)
        for mine, theirs in zip(*motions, strict=True):
            assert theirs == pytest.approx(mine, rel=1e-10, abs=1e-10)
        assert found.slide_values(other) == pytest.approx(
            exact.slide_values(one), rel=1e-12, abs=1e-13 * exact.scale
        )
    assert found.residual(other) < 1e-14 * exact.scale


def test_iterated_states_do_not_depend_on_numpy_rounding(monkeypatch):
    # Another LAPACK gives other last digits: here they are drawn.
    rng = np.random.default_rng(5)

    def noisy(function):
        def call(*arguments, **options):
            found = function(*arguments, **options)
            parts = found if isinstance(found, tuple) else (found,)
            changed = [x * (1.0 + rng.integers(-2, 3, size=x.shape) * 2.0**-53) for x in parts]
            return type(found)(*changed) if isinstance(found, tuple) else changed[0]

        return call

    def motions() -> list[str]:
        closures = Closure(shipped('class_3')), Closure(class_3_linkage())
        return [
            repr(closure.compile_linkage(2)(0.01 * i - 0.6, 1.3, -0.7).values)
            for closure in closures
            for i in range(200)
        ]

    expected = motions()
    for name in ('solve', 'inv', 'svd'):
        monkeypatch.setattr(np.linalg, name, noisy(getattr(np.linalg, name)))
    assert motions() == expected


def test_class_3_conditioning_vanishes_at_the_range_end():
    closure = Closure(class_3_linkage())
    (interval,) = closure.input_ranges
    found = [
        closure.singularity_margin(closure.position(interval.highest - distance)).conditioning
        for distance in (0.3, 1e-2, 1e-4, 1e-6)
    ]
    assert found == sorted(found, reverse=True)
    assert found[-1] < 1e-2 * found[0]


@pytest.mark.parametrize('first', [True, False])
def test_class_3_links_ignore_a_second_input(first):
    """A second crank on the ground changes nothing of them, to the last bit."""
    alone = shipped('class_3')
    spare = Input('spare_joint', GROUND, 'spare')
    own = alone.inputs
    both = Closure(
        replace(
            alone,
            links={**alone.links, 'spare': {'O2': (0.0, 0.0), 'end': (0.05, 0.0)}},
            inputs=(spare, *own) if first else (*own, spare),
            pose=replace(alone.pose, inputs=(0.0, *alone.pose.inputs)),
        )
    )
    closure = Closure(alone)
    (step,) = (step for step in both.steps if step.iterates)
    assert step.branch() is not None
    assert both.grids == []
    for crank in np.linspace(-7.0, 7.0, 29).tolist():
        inputs = (0.3, crank) if first else (crank, 0.3)
        one, other = closure.position(crank), both.position(*inputs)
        assert (one.status, one.joints) == (other.status, other.joints)


def test_pose_beyond_the_limit_gives_an_open_loop():
    # The pose's input is beyond the limit: there is nothing to continue from.
    sound = class_3_linkage()
    assert sound.pose is not None
    closure = Closure(replace(sound, pose=AssemblyPose((3.0,), sound.pose.points)))
    assert closure.position(3.0).status is Status.OPEN
    assert closure.position(1.0).status is Status.OPEN


# Iterated links behind dyads, and dyads behind iterated links: ranges, turns, ends, tables.


FOUR_BARS = {
    'crank-rocker': (1.0, 2.5, 2.0, 2.2),
    'double rocker': (2.0, 1.5, 1.8, 2.4),
    'change point': (1.0, 4.0, 3.0, 2.0),
}


def chain(rng: random.Random, lengths: tuple[float, float, float, float], tail: bool) -> Linkage:
    """Return a four-bar whose rocker drives a platform, which may drive a dyad."""
    a, b, c, d = lengths
    made = platform(rng)
    linkage = linkage_of(made, rng)
    pivot = made.legs[0].anchor
    links = {name: dict(points) for name, points in linkage.links.items()}
    links['ground']['G'] = ((pivot - d).real, (pivot - d).imag)
    links['crank'] = {'G': (0.0, 0.0), 'A': (a, 0.0)}
    links['coupler'] = {'A': (0.0, 0.0), 'B': (b, 0.0)}
    links['driver'] = {'O': (0.0, 0.0), 'B': (c, 0.0)}
    driven = Linkage(
        links={name: links[name] for name in ('ground', 'crank', 'coupler', 'driver')},
        inputs=(Input('crank', 'ground', 'crank'),),
        assembly={'B': 'left'},
        joints={'driver': RevoluteJoint('ground', 'driver')},
        sliders={},
    )
    four_bar = Closure(driven)
    interval = four_bar.input_ranges[0]
    x = interval.lowest + (interval.highest - interval.lowest) * rng.uniform(0.2, 0.8)
    rocker = four_bar.position(x).joints[0]
    tip = made.legs[0].reach * rect(1.0, made.pose[2] - rocker)
    links['driver']['A0'] = (tip.real, tip.imag)
    # With a pose the side is the one there, and a change point may lie between.
    assembly: dict[str, Any] = sides_at(four_bar, four_bar.position(x))
    joints = dict(linkage.joints)
    assert linkage.pose is not None
    if tail:
        p, angle, _ = made.pose
        arm, ground, end = (complex(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0)) for _ in '123')
        begin = p + rect(1.0, angle) * arm
        end += begin
        links['platform']['Q'] = (arm.real, arm.imag)
        links['ground']['H'] = (ground.real, ground.imag)
        links['tail'] = {'Q': (0.0, 0.0), 'E': (abs(end - begin), 0.0)}
        links['fin'] = {'H': (0.0, 0.0), 'E': (abs(end - ground), 0.0)}
        left = ((ground - begin).conjugate() * (end - begin)).imag > 0.0
        assembly['E'] = 'left' if left else 'right'
        joints['fin'] = RevoluteJoint('ground', 'fin')
    return replace(
        driven,
        links=links,
        assembly=assembly,
        joints=joints,
        pose=AssemblyPose((x,), linkage.pose.points),
    )


def misfit(closure: Closure, position: Position) -> float:
    """Return how far links are from their shapes, and points of one name from each other."""
    points = closure.points(position)
    worst = 0.0
    for link, given in closure.linkage.links.items():
        names = list(given)
        for one in names:
            for other in names:
                meant = abs(complex(*given[one]) - complex(*given[other]))
                worst = max(worst, abs(abs(points[link, one] - points[link, other]) - meant))
    for (_, one), place in points.items():
        worst = max(worst, *(abs(place - z) for (_, name), z in points.items() if name == one))
    return worst


@pytest.mark.sample(1)
@pytest.mark.parametrize('tail', [False, True], ids=['', 'a dyad behind'])
@pytest.mark.parametrize('name', FOUR_BARS)
def test_chain_moves_through_its_ranges_without_jumps(name, tail):
    rng = random.Random(3)
    for _ in range(6):
        closure = Closure(chain(rng, FOUR_BARS[name], tail))
        assert closure.linkage.pose is not None
        (start,) = closure.linkage.pose.inputs
        assert any(
            one.lowest <= start <= one.highest or one.is_whole for one in closure.input_ranges
        )
        for interval in closure.input_ranges:
            middle = 0.5 * (interval.lowest + interval.highest)
            half = 0.5 * (interval.highest - interval.lowest)
            places = None
            # As the root of the input at the ends, so that neighbours are near each other there.
            for part in np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, 1501)).tolist():
                x = min(max(middle + half * part, interval.lowest), interval.highest)
                position = closure.position(x)
                assert position.status.has_pose, (x, interval)
                now = closure.points(position)
                if places is not None:
                    assert max(abs(now[key] - place) for key, place in places.items()) < 0.25
                places = now
            for end, sign in ((interval.lowest, -1.0), (interval.highest, 1.0)):
                position = closure.position(end)
                assert misfit(closure, position) < 1e-12
                if not interval.is_whole:
                    assert position.status is Status.TOGGLE
                    assert not closure.position(end + sign * 1e-9).status.has_pose


def test_platform_on_change_point_linkage_repeats_after_two_turns():
    found = 0
    for seed in (4, 8, 9, 11, 12):
        closure = Closure(chain(random.Random(seed), FOUR_BARS['change point'], tail=False))
        (interval,) = closure.input_ranges
        assert interval.is_whole
        assert interval.turns == 2
        assert InputSweep(closure).ranges[0].highest == pytest.approx(2.0 * tau)
        # Apart: the four-bar itself is on its other side after a turn, and back after two.
        once, twice = (closure.points(closure.position(1.0 + n * tau)) for n in (1, 2))
        start = closure.points(closure.position(1.0))
        moved = max(abs(once[key] - place) for key, place in start.items())
        assert moved > 0.01
        assert all(abs(twice[key] - place) < 1e-12 for key, place in start.items())
        found += 1
    assert found == 5
