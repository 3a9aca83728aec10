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
"""What is iterated is what the closed form would say, depends on no history, and ends honestly."""

from __future__ import annotations

from dataclasses import replace
import json
from math import tau
from pathlib import Path
import random

from linkage_ros.kinematics import closure as closure_module
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.groups import find_groups
from linkage_ros.kinematics.linkage import GROUND, Linkage, Pose
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.structure import Driven, Iterated, Structure
from linkage_ros.scene.linkage_file import read_linkage
from linkage_ros.scene.yaml_file import read_yaml
import pytest

from .linkages import class_3_linkage

FOLDER = Path(__file__).parents[2] / 'config' / 'linkages'
PLACES = json.loads((Path(__file__).parent / 'gallery.json').read_text('utf-8'))

CLOSED_FORM = ['four_bar', 'slider_crank', 'inverted_slider_crank', 'scotch_yoke', 'jansen_leg',
               'whitworth_quick_return', 'elliptic_trammel', 'excavator_bucket']  # fmt: skip
"""Linkages of all kinds of dyads but PRP; the last ones by a slide that is driven."""


def linkage_of(name: str) -> Linkage:
    return read_linkage(read_yaml(FOLDER / f'{name}.yaml')[0])


def iterated(linkage: Linkage) -> Structure:
    """Return a structure in which every link but the ground is iterated."""
    found = find_groups(linkage)
    links = tuple(link for link in found.links if link != GROUND)
    crank = tuple(
        group
        for group in found.groups[:1]
        if isinstance(group, Driven) and group.joint.to == GROUND and group.joint.kind == 'R'
    )
    rest = tuple(link for link in links if all(link != group.joint.link for group in crank))
    return replace(found, groups=(*crank, Iterated(rest)))


@pytest.mark.parametrize('name', CLOSED_FORM)
def test_it_finds_what_the_closed_form_finds(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    linkage = linkage_of(name)
    exact = Closure(linkage)
    start = PLACES[f'{name}.yaml']['inputs'][1]
    rough = {
        point: (place.real + 0.003 * exact.scale, place.imag - 0.002 * exact.scale)
        for (_, point), place in exact.points(exact.position(start)).items()
    }
    posed = replace(linkage, assembly={}, pose=Pose((start,), rough))
    monkeypatch.setattr(closure_module, 'find_groups', iterated)
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


def test_a_state_depends_on_its_input_alone() -> None:
    fresh, used = Closure(class_3_linkage()), Closure(class_3_linkage())
    (interval,) = used.input_ranges
    inputs = [
        interval.lowest + (interval.highest - interval.lowest) * (i + 0.5) / 50 for i in range(50)
    ]
    forward = [used.position(value).joints for value in inputs]
    random.Random(3).shuffle(inputs)
    shuffled = {value: fresh.position(value).joints for value in inputs}
    assert forward == [shuffled[value] for value in sorted(inputs)]


def test_beyond_its_limits_it_is_open_with_a_gap_and_says_no_pose() -> None:
    closure = Closure(class_3_linkage())
    (interval,) = closure.input_ranges
    for value in (interval.lowest - 0.05, interval.highest + 0.05, interval.highest + 1.0):
        position = closure.position(value)
        assert (position.status, position.joints) == (Status.OPEN, ())
        assert position.gap > 0.0
    for value in (interval.lowest + 1e-6, interval.highest - 1e-6):
        assert closure.position(value).status is Status.CLOSED


def test_near_a_limit_its_conditioning_falls_to_nothing() -> None:
    closure = Closure(class_3_linkage())
    (interval,) = closure.input_ranges
    found = [
        closure.nearness(closure.position(interval.highest - distance)).conditioning
        for distance in (0.3, 1e-2, 1e-4, 1e-6)
    ]
    assert found == sorted(found, reverse=True)
    assert found[-1] < 1e-2 * found[0]


def test_whole_turns_of_its_input_change_nothing() -> None:
    closure = Closure(class_3_linkage())
    start = closure.points(closure.position(1.0))
    for turns in (1, -3, 1000):
        moved = closure.points(closure.position(1.0 + turns * tau))
        for key, place in start.items():
            assert abs(moved[key] - place) < 1e-15 * (20.0 + 20.0 * abs(turns)), key


def test_a_pose_that_leads_nowhere_is_an_open_loop() -> None:
    # The pose's input is beyond the limit: there is nothing to continue from.
    sound = class_3_linkage()
    assert sound.pose is not None
    closure = Closure(replace(sound, pose=Pose((3.0,), sound.pose.points)))
    assert closure.position(3.0).status is Status.OPEN
    assert closure.position(1.0).status is Status.OPEN
