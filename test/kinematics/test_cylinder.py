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
Cylinders: of two ranges that are mirror images a user is told that of positive length.

Each family draws a rod in a tube, each on a pin of its own, with other places of the pins on the
line; and linkages that look alike, whose negative slides are poses of their own.
"""

from __future__ import annotations

from math import cos, hypot, pi, remainder, sin, tau

from hypothesis import assume, given, settings
from hypothesis import strategies as st
from linkage_ros.errors import FileError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.survey import Way
from linkage_ros.scene.linkage_file import read_linkage
from linkage_ros.scene.linkage_text import scene_text_for
from linkage_ros.scene.yaml_file import parse_yaml
import pytest

from ..support.scenes import closure_of

TEXT = """
links:
  ground: {{I: [0, 0], K: {K}{more}}}
  tube: {{K: [0, 0], through: {through}}}
  rod: {{C: [0, 0], eye: {eye}}}
  rocker: {{I: [0, 0], C: [{c}, 0]}}
sliders: {{bore: {{point: eye, {block}along: tube, through: through, direction: {direction}}}}}
input: {{joint: cylinder, slider: bore{limits}}}
assembly: {{C: left}}
joints:
  tube_joint: {{parent: ground, child: tube}}
  rocker_joint: {{parent: ground, child: rocker}}
{pose}
"""


def cylinder(
    foot=(1.0, 0.3), c=0.4, start=0.0, end=0.1, facing=0.0, beside=0.0, angle=0.0, **said
):
    """
    Return a rocker on a cylinder.

    The line of the tube goes past its pin K at a distance ``beside``, in a direction ``facing``,
    and is measured from ``start`` along it. The rod's pin C lies ``end`` behind the point on the
    line; the rod is turned by ``angle``.
    """
    u = complex(cos(facing), sin(facing))
    through = u * complex(start, beside)
    eye = u * end * complex(cos(angle), -sin(angle))
    return Closure(
        read_linkage(
            parse_yaml(
                TEXT.format(
                    K=[*foot],
                    c=c,
                    through=[through.real, through.imag],
                    eye=[eye.real, eye.imag],
                    direction=[u.real, u.imag],
                    block=f'block: rod, angle: {angle!r}, ',
                    limits=said.get('limits', ''),
                    pose=said.get('pose', ''),
                    more=said.get('more', ''),
                ).encode(),
                'c.yaml',
            )
        )
    )


PLACES = st.floats(-0.5, 0.5).map(lambda x: round(x, 3))


@settings(max_examples=40, deadline=None)
@given(
    foot=st.tuples(st.floats(0.6, 2.0), st.floats(-1.0, 1.0)),
    c=st.floats(0.1, 0.5),
    start=PLACES,
    end=PLACES,
    facing=st.floats(-pi, pi),
    angle=st.sampled_from([0.0, 0.5 * pi, 1.0]),
)
def test_the_length_is_positive(foot, c, start, end, facing, angle):
    assume(hypot(*foot) > c + 0.05 and end)
    try:
        closure = cylinder(foot, c, start, end, facing, angle=angle)
    except FileError:
        assume(False)
    (one,) = closure.input_ranges
    (usual,) = Way(closure).ranges
    assert usual == one
    # The pins' distance goes from |foot| − c to |foot| + c; the slide is it less start and end.
    shift = end - start
    assert one.lowest - shift == pytest.approx(hypot(*foot) - c, abs=1e-6)
    assert one.highest - shift == pytest.approx(hypot(*foot) + c, abs=1e-6)
    # What is left out is the same pose of all but tube and rod, with these turned about.
    value = 0.7 * one.lowest + 0.3 * one.highest
    here, there = closure.position(value), closure.position(2.0 * shift - value)
    assert there.status.has_pose
    tube, rocker = (p - q for p, q in zip(here.joints, there.joints, strict=True))
    assert abs(remainder(rocker, tau)) < 1e-9
    assert abs(remainder(tube - pi, tau)) < 1e-9


@pytest.mark.parametrize('beside', [0.05, -0.1])
def test_beside_its_pin_a_negative_slide_is_a_pose_of_its_own(beside):
    low, high = cylinder(beside=beside).input_ranges
    assert low.highest < 0.0 < high.lowest


def test_one_that_starts_behind_its_pin_stays_there():
    said = cylinder(pose='pose: {inputs: [-1.0]}')
    (one,) = said.input_ranges
    assert one.highest < 0.0
    assert 'mean: -' in scene_text_for(said, 'c.yaml')


def test_limits_say_the_side_too():
    (one,) = cylinder(limits=', limits: [-1.2, -0.8]').input_ranges
    assert one[:2] == (-1.2, -0.8)
    (one,) = cylinder(limits=', limits: [-1.2, 0.9]').input_ranges
    assert 0.0 < one.lowest < one.highest == 0.9


SLOT = """
links:
  ground: {O: [0, 0]}
  crank: {O: [0, 0], A: [0.1, 0]}
  rod: {A: [0, 0], B: [0.3, 0]}
sliders: {guide: {point: B, along: ground, through: O, direction: [1, 0]}}
input: {joint: drive, slider: guide}
assembly: {A: left}
joints: {crank_joint: {parent: ground, child: crank}}
"""


def test_a_slide_on_the_ground_is_no_cylinder():
    """A slider-crank that is driven by its slider goes to either side of its crank's pivot."""
    closure = closure_of(SLOT)
    low, high = closure.input_ranges
    assert low.highest < 0.0 < high.lowest
