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

"""What can be wrong with a linkage: how to change one, the key that is named, the remedy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from linkage_ros.kinematics.linkage import Input, Linkage, Pose, RevoluteJoint, SlideJoint, Slider

from .linkages import (
    class_3_linkage,
    four_bar_linkage,
    inverted_slider_crank_linkage,
    scotch_yoke_linkage,
)

# A linkage as fields that can be changed, and the changes.


Fields = dict[str, Any]


Change = Callable[[Fields], None]


def fields(linkage: Linkage) -> Fields:
    """Return the fields of a linkage, which may be changed."""
    return {
        'links': {name: dict(points) for name, points in linkage.links.items()},
        'inputs': linkage.inputs,
        'assembly': dict(linkage.assembly),
        'joints': dict(linkage.joints),
        'sliders': dict(linkage.sliders),
        'traced': linkage.traced,
        'pose': linkage.pose,
    }


def put(*path_and_value: Any) -> Change:
    """Return a change that sets a value, given its path."""
    *path, last, value = path_and_value

    def change(linkage: Fields) -> None:
        for key in path:
            linkage = linkage[key]
        linkage[last] = value

    return change


def drop(*path: str) -> Change:
    """Return a change that removes what stands at a path."""

    def change(linkage: Fields) -> None:
        for key in path[:-1]:
            linkage = linkage[key]
        del linkage[path[-1]]

    return change


def rename(old: str, new: str) -> Change:
    """Return a change that gives a link another name."""

    def change(linkage: Fields) -> None:
        linkage['links'] = {new if k == old else k: v for k, v in linkage['links'].items()}

    return change


# Possible faults of a linkage: how to make each, the key that the error names, the remedy.


FOUR_BAR = fields(four_bar_linkage((0.04, 0.12, 0.08, 0.1), 'left'))


SLIDER_CRANK = fields(inverted_slider_crank_linkage((0.15, 0.27, 0.0), 'ahead', along=0.3))


CLASS_3 = fields(class_3_linkage())


YOKE = fields(scotch_yoke_linkage(0.04))


def swivel(**changes: Any) -> Change:
    """Return a change of the slider-crank's slider."""
    parts = {'point': 'C', 'along': 'rod', 'through': 'T', 'direction': (1.0, 0.0)} | changes
    return put('sliders', 'swivel', Slider(**parts))


# Fault: the linkage, the change, the key named, and words of the remedy.
MALFORMED: dict[str, tuple[Fields, Change, str, str]] = {
    'no ground': (FOUR_BAR, rename('ground', 'frame'), 'links', "name the frame 'ground'"),
    'no input': (FOUR_BAR, put('inputs', ()), 'input', 'name a joint that is'),
    'an input between links without a pin': (
        FOUR_BAR,
        put('inputs', (Input('crank_joint', 'rocker', 'crank'),)),
        'links.crank',
        "name the pin about which 'crank_joint' turns on both",
    ),
    'an input of an unknown link': (
        FOUR_BAR,
        put('inputs', (Input('crank_joint', 'ground', 'krank'),)),
        'input.child',
        'name one of coupler, crank, ground, rocker',
    ),
    'an input of a link against itself': (
        FOUR_BAR,
        put('inputs', (Input('crank_joint', 'ground', 'ground'),)),
        'input.child',
        'name two links',
    ),
    'an input of an unknown slider': (
        FOUR_BAR,
        put('inputs', (Input('cylinder', slider='bore'),)),
        'input.slider',
        'this linkage has none',
    ),
    'an input twice': (
        FOUR_BAR,
        put('inputs', (Input('crank_joint', 'ground', 'crank'),) * 2),
        'input',
        'give each input its own name',
    ),
    'one input too many': (
        FOUR_BAR,
        put(
            'inputs',
            (Input('crank_joint', 'ground', 'crank'), Input('rocker_joint', 'ground', 'rocker')),
        ),
        'links.coupler',
        'take one of them away',
    ),
    'a loop of inputs': (
        FOUR_BAR,
        put(
            'inputs',
            (
                Input('one', 'ground', 'crank'),
                Input('two', 'crank', 'coupler'),
                Input('three', 'coupler', 'rocker'),
                Input('four', 'rocker', 'ground'),
            ),
        ),
        'input.four',
        'leave one of the inputs out',
    ),
    'a link of one point': (
        FOUR_BAR,
        drop('links', 'coupler', 'A'),
        'links.coupler',
        'two points',
    ),
    'a link of no length': (
        FOUR_BAR,
        put('links', 'coupler', 'B', (0.0, 0.0)),
        'links.coupler.B',
        'different places',
    ),
    'a ground pivot on the other': (
        FOUR_BAR,
        put('links', 'ground', 'D', (0.0, 0.0)),
        'links.ground.D',
        'different places',
    ),
    'two links with two points in common': (
        FOUR_BAR,
        put('links', 'rocker', 'A', (0.5, 0.5)),
        'links.rocker',
        'rename the points that are not pins',
    ),
    'a crank without a pin on the ground': (
        FOUR_BAR,
        put('links', 'crank', {'Q': (0.0, 0.0), 'A': (0.04, 0.0)}),
        'links.crank',
        'name the pin about which',
    ),
    'a coupler without a pin on the crank': (
        FOUR_BAR,
        put('links', 'crank', {'O': (0.0, 0.0), 'Q': (0.04, 0.0)}),
        'links.coupler',
        'join it to one more link',
    ),
    'a rocker without a pin on the ground': (
        FOUR_BAR,
        put('links', 'ground', {'O': (0.0, 0.0), 'Q': (0.1, 0.0)}),
        'links.rocker',
        'join it to one more link',
    ),
    'a coupler and a rocker that are not pinned': (
        FOUR_BAR,
        put('links', 'rocker', {'D': (0.0, 0.0), 'Q': (0.08, 0.0)}),
        'links.coupler',
        'join it to one more link',
    ),
    'a part that hangs in the air': (
        FOUR_BAR,
        put('links', 'fifth', {'S': (0.0, 0.0), 'T': (0.08, 0.0)}),
        'links.fifth',
        'name one of its points on another link too',
    ),
    'a link that swings from a pin': (
        FOUR_BAR,
        put('links', 'fifth', {'B': (0.0, 0.0), 'E': (1.0, 0.0)}),
        'links.fifth',
        'join it to one more link',
    ),
    'a link that holds crank and ground': (
        FOUR_BAR,
        put('links', 'fifth', {'A': (0.0, 0.0), 'D': (1.0, 0.0)}),
        'links.fifth',
        'take one of them away',
    ),
    'no assembly': (FOUR_BAR, drop('assembly', 'B'), 'assembly', 'write B: left or right'),
    'an assembly of a pin that closes nothing': (
        FOUR_BAR,
        put('assembly', 'A', 'left'),
        'assembly.A',
        "name 'B'",
    ),
    'an assembly on no side': (
        FOUR_BAR,
        put('assembly', 'B', 'ahead'),
        'assembly.B',
        'write left or right (the side of A→D)',
    ),
    'a rod assembled on no side': (
        SLIDER_CRANK,
        put('assembly', 'swivel', 'left'),
        'assembly.swivel',
        'write ahead or behind',
    ),
    'no assembly of a rod': (
        SLIDER_CRANK,
        drop('assembly', 'swivel'),
        'assembly',
        'write swivel: ahead or behind',
    ),
    'a slider along an unknown link': (
        SLIDER_CRANK,
        swivel(along='rail'),
        'sliders.swivel.along',
        'name one of crank, ground, rod',
    ),
    'a slider through an unknown point': (
        SLIDER_CRANK,
        swivel(through='U'),
        'sliders.swivel.through',
        'name one of A, T',
    ),
    'a slider of an unknown point': (
        SLIDER_CRANK,
        swivel(point='U'),
        'sliders.swivel.point',
        "a link other than 'rod'",
    ),
    'a slider of its own link': (
        SLIDER_CRANK,
        swivel(point='T'),
        'sliders.swivel.point',
        "a link other than 'rod'",
    ),
    'a block that does not carry the point': (
        SLIDER_CRANK,
        swivel(block='crank'),
        'sliders.swivel.block',
        'name one of ground',
    ),
    'a slider in no direction': (
        SLIDER_CRANK,
        swivel(direction=(0.0, 0.0)),
        'sliders.swivel.direction',
        'for example [1, 0]',
    ),
    'a swivel on the crank pivot': (
        SLIDER_CRANK,
        put('links', 'ground', 'C', (0.0, 0.0)),
        'links.ground.C',
        'different places',
    ),
    'a rod that slides in two swivels': (
        SLIDER_CRANK,
        put('sliders', 'second', Slider('O', 'rod', 'T', (1.0, 0.0))),
        'sliders.second',
        'take one of them away',
    ),
    'a joint of an unknown parent': (
        FOUR_BAR,
        put('joints', 'rocker_joint', RevoluteJoint('base', 'rocker')),
        'joints.rocker_joint.parent',
        'name one of coupler, crank, ground, rocker',
    ),
    'a joint of an unknown child': (
        FOUR_BAR,
        put('joints', 'rocker_joint', RevoluteJoint('ground', 'roker')),
        'joints.rocker_joint.child',
        'name one of coupler, crank, ground, rocker',
    ),
    'a joint of an unknown slider': (
        SLIDER_CRANK,
        put('joints', 'slide_joint', SlideJoint('swivle')),
        'joints.slide_joint.slider',
        'name one of swivel',
    ),
    'a slide of a linkage without sliders': (
        FOUR_BAR,
        put('joints', 'slide_joint', SlideJoint('swivel')),
        'joints.slide_joint.slider',
        'this linkage has none',
    ),
    'an unknown traced point': (FOUR_BAR, put('traced', ('P',)), 'traced', 'name one of A, B'),
    'a pose with a value too many': (
        FOUR_BAR,
        put('pose', Pose((1.0, 2.0), {})),
        'pose.inputs',
        'give one for each input',
    ),
    'a class III group without a pose': (CLASS_3, put('pose', None), 'pose', 'pose: {inputs'),
    'a pose that leaves a link out': (
        CLASS_3,
        put('pose', Pose((1.0,), {})),
        'pose.points',
        'give two of its points: P1, P2, P3',
    ),
    'rails that run alike': (
        YOKE,
        put('sliders', 'slot', Slider('A', 'yoke', 'U', (1.0, 0.0))),
        'sliders.slot.direction',
        'different directions',
    ),
}
