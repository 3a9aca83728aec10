# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Linkages whose published joints take every way there is from one frame of a tree to the next."""

from linkage_ros.description import parse_yaml, read_linkage
from linkage_ros.kinematics import Closure

FOUR_BAR = """
links:
  ground: {O2: [0, 0], O4: [0.100, 0.01]}
  crank: {O2: [0.01, -0.02], A: [0.050, 0]}
  coupler: {A: [0.02, 0], B: [0.120, 0.03], P: [0.060, 0.030]}
  rocker: {O4: [0, 0], B: [0.080, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: left}
traced: [P]
"""
SLIDER_CRANK = """
links:
  ground: {O2: [0, 0], G: [0, 0.010]}
  crank: {O2: [0, 0], A: [0.040, 0]}
  rod: {A: [0, 0], B: [0.140, 0.01]}
  ram: {B: [0.02, 0.01], R: [0.05, 0]}
sliders:
  guide: {point: B, block: ram, angle: 0.7, along: ground, through: G, direction: [3, 0.5]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {guide: ahead}
"""
QUICK_RETURN = """
links:
  ground: {O2: [0, 0], O4: [0, -0.050]}
  crank: {O2: [0, 0], A: [0.075, 0]}
  arm: {O4: [0, 0], C: [-0.060, 0.01], S: [0, 0.02]}
sliders:
  slot: {point: A, along: arm, through: S, direction: [-2, 0.1]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {slot: behind}
"""
YOKE = """
links:
  ground: {O2: [0, 0], G: [0.01, 0.01]}
  crank: {O2: [0, 0], A: [0.05, 0.01]}
  yoke: {Y: [0.02, 0], Z: [0, 0.03]}
sliders:
  guide: {point: G, block: ground, angle: -0.4, along: yoke, through: Y, direction: [1, 0.5]}
  slot: {point: A, along: yoke, through: Z, direction: [0.2, 1]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {}
"""
CYLINDER = """
links:
  ground: {J: [0, 0], K: [1.2, 0.3]}
  tube: {K: [0.1, 0]}
  rod: {C: [0, 0.1]}
  arm: {J: [0, 0], C: [0.5, 0.1]}
sliders:
  bore: {point: C, block: rod, angle: -2.1, along: tube, through: K, direction: [1, 1]}
input: {joint: cylinder, slider: bore}
assembly: {C: right}
pose: {inputs: [0.9]}
"""


def joints(linkage, **published):
    """Return a linkage's file with joints, each from 'parent child' or the name of a slider."""
    for name, said in published.items():
        links = said.split()
        how = 'parent: {}, child: {}' if len(links) == 2 else 'slider: {}'
        linkage += '' if 'joints:' in linkage else 'joints:\n'
        linkage += f'  {name}: {{{how.format(*links)}}}\n'
    return linkage


ODD = {
    'coupler from the ground': joints(FOUR_BAR, coupler_joint='ground coupler',
                                      rocker_joint='ground rocker'),
    'all turned round': joints(FOUR_BAR, coupler_joint='coupler crank',
                               rocker_joint='rocker ground'),
    'coupler from the rocker': joints(FOUR_BAR, coupler_joint='rocker coupler',
                                      rocker_joint='ground rocker'),
    'rocker from the crank, which no pin joins': joints(FOUR_BAR, rocker_joint='crank rocker',
                                                        coupler_joint='coupler rocker'),
    'one more than needed, and the crank once more': joints(FOUR_BAR, B_joint='coupler rocker',
                                                            crank_again='ground crank',
                                                            coupler_joint='crank coupler',
                                                            crossing='rocker crank',
                                                            rocker_joint='ground rocker'),
    'names that XML and YAML have to quote': FOUR_BAR.replace('coupler', '"a <b> & \\"c\\" --"')
    .replace('rocker', "'öß -- -'")
    .replace('B:', '"B -- <"  :')
    + """
joints:
  '"j" & <k>': {parent: ground, child: "a <b> & \\"c\\" --"}
  "l'm": {parent: ground, child: 'öß -- -'}
""",
    'names as frames and joints without a body would have': joints(
        FOUR_BAR.replace('coupler', 'rocker_1'),
        crank_joint_in_rocker='ground rocker_1',
        B_on_rocker='rocker_1 rocker',
    ),
    'a ram whose slide is told': joints(SLIDER_CRANK, rod_joint='crank rod', ram_slide='guide'),
    'a ram whose slide is not told': joints(SLIDER_CRANK, rod_joint='ground rod'),
    'a ram whose slide is told and the rod from it': joints(SLIDER_CRANK, ram_slide='guide',
                                                            rod_joint='rod ram'),
    'a pin in a slot, told': joints(QUICK_RETURN, arm_joint='ground arm', slot_slide='slot'),
    'a pin in a slot, not told': joints(QUICK_RETURN, arm_joint='crank arm'),
    'a rod that only slides hold': """
links:
  ground: {O: [0, 0], Q: [0.1, 0]}
  bar: {X: [0, 0], Y: [0.120, 0], P: [0.200, 0]}
sliders:
  driven_slot: {point: X, along: ground, through: O, direction: [1, 0.1]}
  cross_slot: {point: Y, along: ground, through: Q, direction: [0, 1]}
input: {joint: trammel_slide, slider: driven_slot}
assembly: {cross_slot: ahead}
joints:
  slide_again: {slider: driven_slot}
  bar_joint: {parent: bar, child: ground}
""",
    'a yoke that slides over a point of the ground': joints(YOKE, guide_slide='guide'),
    'a yoke, and its slot': joints(YOKE, slot_slide='slot'),
    'a cylinder': joints(CYLINDER, arm_joint='ground arm', rod_joint='arm rod'),
    'a cylinder that is seen from the arm': joints(CYLINDER, arm_joint='rod arm',
                                                   tube_joint='tube ground'),
    'three links at a pin': """
links:
  ground: {O: [0, 0], Q: [0.1, 0], R: [0.05, 0.12]}
  crank: {O: [0, 0], A: [0.03, 0]}
  one: {A: [0, 0], B: [0.1, 0]}
  two: {Q: [0, 0], B: [0.09, 0]}
  three: {B: [0, 0], C: [0.07, 0]}
  four: {R: [0, 0], C: [0.07, 0.01]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: left, C: left}
joints:
  one_joint: {parent: ground, child: one}
  two_joint: {parent: one, child: two}
  three_joint: {parent: two, child: three}
  four_joint: {parent: three, child: four}
""",
}  # fmt: skip

# Linkages whose published joints do not determine all links, and the joints that would.
UNTOLD = {
    'the coupler': (
        FOUR_BAR + 'joints: {rocker_joint: {parent: ground, child: rocker}}',
        "link 'coupler' stands; add to joints: coupler_joint: {parent: crank, child: coupler}",
    ),
    'both, by one joint between them': (
        FOUR_BAR + 'joints: {coupler_joint: {parent: coupler, child: rocker}}',
        "link 'coupler' stands; add to joints: coupler_joint_2: {parent: crank, child: coupler}",
    ),
    'a link and a slide': (
        YOKE.replace('Z: [0, 0.03]', 'Z: [0, 0.03], V: [0.1, 0]')
        + 'joints: {other: {parent: ground, child: crank}}',
        "link 'yoke' stands; add to joints: guide_slide: {slider: guide}",
    ),
    'two links': (
        CYLINDER + 'joints: {bore_again: {slider: bore}}',
        (
            "links 'tube' and 'arm' stand; add to joints: "
            'tube_joint: {parent: ground, child: tube}, arm_joint: {parent: ground, child: arm}'
        ),
    ),
}


def content(name):
    """Return a linkage of the table, as it is read from a file."""
    return parse_yaml(ODD[name].encode(), f'{name}.yaml')


def closure_of(name):
    """Return a linkage of the table, ready to be solved."""
    return Closure(read_linkage(content(name)))
