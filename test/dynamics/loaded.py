# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Linkages of the gallery with masses and loads, and states of them."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
import random

from linkage_ros.description import parse_yaml, read_linkage, read_yaml
from linkage_ros.dynamics import AppliedLoads, JointLoad, JointSpring, Loads, PointLoad, Spring
from linkage_ros.kinematics import Closure, GROUND, Input, Linkage, Mass, SlideJoint, Slider
from linkage_ros.stages.drives import Context, TorqueDrive

from ..support.scenes import closure_of, PENDULUM

FOLDER = Path(__file__).parents[2] / 'config' / 'linkages'

# The purpose of each, and values of its inputs, away from toggles.
STATES: dict[str, tuple[tuple[float, ...], ...]] = {
    'four_bar': ((0.3,), (1.9,), (-2.0,)),
    'slider_crank': ((0.4,), (2.5,), (-1.3,)),  # a pin in a slot: a block without mass
    'excavator_bucket': ((0.85,), (1.0,), (1.2,)),  # a slide drives, and a pin of three links
    'scotch_yoke': ((0.3,), (2.0,), (-1.0,)),  # a block that is a link, a slot that moves
    'inverted_slider_crank': ((0.3,), (1.7,), (-1.0,)),  # a rail that turns
    'elliptic_trammel': ((0.05,), (-0.03,)),  # a slide drives a pin in a slot
    'whitworth_quick_return': ((0.5,), (2.0,), (-2.5,)),
    'class_3': ((0.2,), (1.5,), (-2.0,)),  # iterated
    'watt_1': ((0.3,), (2.0,), (-1.7,)),
    'stephenson_3': ((0.3,), (2.0,), (-1.7,)),
    'five_bar': ((1.2, 1.9), (1.9, 1.3)),  # two inputs
    'reversed_yoke': ((0.3,), (2.0,), (-1.0,)),  # the ground is the block, the yoke has the line
    'reversed_ram': ((0.02,), (0.04,)),  # so too, and the slide drives
}

WRITTEN_HERE = {
    'reversed_yoke': b"""
links:
  ground: {O: [0, 0], G: [-0.1, 0.02]}
  crank: {O: [0, 0], A: [0.05, 0]}
  yoke: {Y: [0, 0], S: [0.01, 0.1]}
sliders:
  guide: {point: G, block: ground, angle: 0.3, along: yoke, through: Y, direction: [3, 1]}
  slot: {point: A, along: yoke, through: S, direction: [0, 1]}
input: {joint: turn, parent: crank, child: ground}
assembly: {}
joints:
  stroke: {slider: guide}
  slot_stroke: {slider: slot}
""",
    'reversed_ram': b"""
links:
  ground: {O: [0, 0], G: [0.2, 0.01]}
  ram: {R: [0, 0], C: [-0.06, 0.02]}
  rod: {C: [0, 0], D: [0.1, 0]}
  lever: {O: [0, 0], D: [0.08, 0]}
sliders:
  guide: {point: G, block: ground, angle: -0.2, along: ram, through: R, direction: [1, 0.1]}
input: {joint: ram_slide, slider: guide}
assembly: {D: left}
joints:
  rod_joint: {parent: ram, child: rod}
  lever_joint: {parent: ground, child: lever}
""",
}


def shipped(name: str) -> Linkage:
    """Return a linkage of the gallery, or one of those written out here."""
    if name in WRITTEN_HERE:
        return read_linkage(parse_yaml(WRITTEN_HERE[name], name))
    return read_linkage(read_yaml(FOLDER / f'{name}.yaml')[0])


def weighed(name: str) -> Linkage:
    """Return a linkage of the gallery with masses as odd as they come, other than the file's."""
    linkage, rng = shipped(name), random.Random(name)
    masses = {
        link: Mass(
            rng.uniform(0.1, 2.0),
            (rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1)),
            rng.uniform(1e-4, 1e-2),
        )
        for link in linkage.links
        if link != GROUND
    }
    return replace(linkage, masses=masses)


def four_bar(masses: dict[str, Mass], *lengths: float, side: str = 'left') -> Closure:
    """Return a four-bar with links along their x axes: crank, coupler, rocker, ground."""
    a, b, c, d = lengths
    text = f'four_bar: {{a: {a}, b: {b}, c: {c}, d: {d}, assembly: {side}}}'
    linkage = read_linkage(parse_yaml(text.encode(), 'linkage.yaml'))
    return Closure(replace(linkage, masses=masses))


def scotch_yoke(crank: Mass, yoke: Mass) -> Closure:
    """Return a yoke at x = 0.05·cos θ on a guide along x, with a pin of the ground to hold it."""
    return Closure(
        Linkage(
            {
                'ground': {'O': (0.0, 0.0), 'W': (-0.2, 0.0)},
                'crank': {'O': (0.0, 0.0), 'A': (0.05, 0.0)},
                'yoke': {'Y': (0.0, 0.0)},
            },
            (Input('turn', 'ground', 'crank'),),
            {},
            {'stroke': SlideJoint('guide')},
            {
                'guide': Slider('Y', 'ground', 'O', (1.0, 0.0), 'yoke'),
                'slot': Slider('A', 'yoke', 'Y', (0.0, 1.0)),
            },
            masses={'crank': crank, 'yoke': yoke},
        )
    )


def loads_of(linkage: Linkage, damping: float = 0.0) -> Loads:
    """Return tilted gravity, a motor's inertia, a spring to the ground and one between links."""
    moving = [link for link in linkage.links if link != GROUND]
    ends = [(link, list(linkage.links[link])[-1]) for link in (GROUND, moving[-1], moving[0])]
    springs = tuple(
        Spring(*one, *other, 300.0, 0.05, damping)
        for one, other in pairwise(ends)
        if one[1] != other[1]
    )
    return Loads((1.5, -9.81), springs, 0.02)


def closed(name: str) -> Closure:
    """Return the closure of `weighed`."""
    return Closure(weighed(name))


def slope(function, x: float, step: float = 1e-3) -> float:
    """Return the derivative of a function by six points: the error falls as the sixth power."""
    weights = ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0))
    return sum(w * (function(x + k * step) - function(x - k * step)) for k, w in weights) / step


BEGIN = 1_700_000_000_000_000_000


def everywhere(closure: Closure) -> AppliedLoads:
    """Return loads on every joint and on a point of each link."""
    linkage = closure.linkage
    names = [*(given.joint for given in linkage.inputs), *linkage.joints]
    one = len(linkage.inputs) == 1
    return AppliedLoads(
        {name: JointSpring(1.5 + n, 0.1 * n, 0.02) for n, name in enumerate(names)},
        {},
        {
            name: JointLoad(0.3 - n, ((0.0, n), (2.0, 1.0)), ((-9.0, 1.0), (9.0, 2.0 + n)), ())
            for n, name in enumerate(names)
        },
        {
            f'{link}.{next(iter(points))}': PointLoad(
                (1.0, 0.5 * n), ('ground', 'link')[n % 2], 2.5 - n,
                over_rate=((-5.0, 1.0), (5.0, n)) if one else (),
            )
            for n, (link, points) in enumerate(linkage.links.items())
            if link != GROUND
        },
    )  # fmt: skip


def swing(linkage=PENDULUM, friction=None, gravity=(0.0, 0.0), applied=None, **parameters):
    """Return a function that gives value, rate and acceleration of a crank after some seconds."""
    loads = Loads(gravity, applied=AppliedLoads(**(applied or {})))
    context = Context(closure_of(linkage), 1000.0, True, 'seed', loads, friction)
    drive = TorqueDrive(**parameters).build(context)
    drive.state(BEGIN)

    def after(seconds):
        state = drive.state(BEGIN + round(seconds * 1e9))
        return state.angles[0], state.rates[0], state.accelerations[0]

    return after
