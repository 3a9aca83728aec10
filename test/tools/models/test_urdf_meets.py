# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Where URDF puts the links, from the node's own messages: every pin that was cut meets.

The forward kinematics are yourdfpy's, which knows the URDF and nothing else. So are frames of
links compared with the closure: turned by the link's angle, with their origin on a point of it.
"""

from cmath import rect
from math import cos, sin

from linkage_ros.tools.models import add_frames, grow_tree, ModelPart, prefix_names, urdf_model
import numpy as np
import pytest

from .odd import closure_of, ODD
from .walked import moving, moving_text, said, several_inputs, Walked
from ...support.scenes import LINKAGES, ONE_INPUT, size_of

pytest.importorskip('yourdfpy')


def check(data, closure, messages, within=1e-12):
    """Check links and cut pins of a model at each message; return how many there were."""
    model, size = Walked(data), size_of(closure)
    _, (names,) = prefix_names([('', closure.linkage)])
    cuts = add_frames(grow_tree(closure.linkage, names), names)
    count = 0
    for names, positions in messages:
        model.pose(names, positions)
        values = dict(zip(names, positions, strict=True))
        position = closure.position(*(values[each.joint] for each in closure.linkage.inputs))
        points, angles = closure.points(position), closure.link_angles(position)
        for link in closure.linkage.links:
            off = min(
                abs(model.place(link) - points[link, point])
                for point in closure.linkage.links[link]
            )
            if link != 'ground':
                assert off <= within * size, (link, off)
            assert abs(model.facing(link) - rect(1.0, angles[link])) <= within, link
        for cut in cuts:
            first, *others = cut.frames
            for other in others:
                apart = model.place(other) - model.place(first)
                if cut.kind == 'line':
                    apart = (apart / model.facing(first)).imag
                assert abs(apart) <= within * size, cut
        count += 1
    return count, cuts


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', ONE_INPUT)
def test_urdf_cut_pins_of_gallery_linkages_meet(name):
    file = LINKAGES / f'{name}.yaml'
    pipeline = moving(file)
    (closure,) = pipeline.closures
    count, cuts = check(urdf_model(name, [ModelPart(closure)]), closure, said(pipeline))
    assert count > 100
    assert cuts, 'nothing closes'


def test_urdf_cut_pins_of_a_five_bar_meet():
    file = LINKAGES / 'five_bar.yaml'
    turns = np.linspace(0.0, 6.28, 60)
    values = [(1.6 + 0.3 * cos(t), 1.5 + 0.3 * sin(1.7 * t)) for t in turns]
    names = ['left_crank_joint', 'right_crank_joint']
    closure = moving(file).closures[0]
    messages = several_inputs(file.read_bytes(), names, values)
    count, _ = check(urdf_model('five_bar', [ModelPart(closure)]), closure, messages)
    assert count == 60


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', ODD)
def test_urdf_cut_pins_of_odd_frames_meet(name):
    closure = closure_of(name)
    pipeline = moving_text(ODD[name])
    count, _ = check(urdf_model(name, [ModelPart(closure)]), closure, said(pipeline))
    assert count > 100
