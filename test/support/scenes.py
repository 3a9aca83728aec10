# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Linkages, scenes and pipelines from the text of their files, and the shipped linkages."""

from functools import cache
from pathlib import Path

from linkage_ros.description import parse_scene, parse_yaml, read_linkage, Scene
from linkage_ros.kinematics import Closure, Linkage
from linkage_ros.tick import Pipeline

ROOT = Path(__file__).parents[2]
LINKAGES = ROOT / 'config' / 'linkages'
GALLERY = sorted(file.stem for file in LINKAGES.glob('*.yaml'))
ONE_INPUT = [name for name in GALLERY if name != 'five_bar']
"""Names of all shipped linkages, and of those that a file alone drives."""
FOUR_BAR = 'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}'
"""Publishes coupler_joint and rocker_joint; its input is crank_joint."""
SLIDER_CRANK = 'inverted_slider_crank: {a: 0.15, swivel: [0.25, 0.1]}'
"""Publishes rod_joint, an angle, and rod_slide, a slide."""
PENDULUM = """
links:
  ground: {O: [0, 0], X: [1, 0]}
  crank: {O: [0, 0], end: [0.5, 0]}
input: {joint: drive_joint, parent: ground, child: crank}
joints: {crank_joint: {parent: ground, child: crank}}
masses: {crank: {mass: 2, center: [0.3, 0], inertia: 0.05}}
"""
LONG_COUPLER = """
links:
  ground:  {O2: [0, 0], O4: [120, 0]}
  crank:   {O2: [0, 0], A: [0.04, 0]}
  coupler: {A: [0, 0], B: [120.01, 0]}
  rocker:  {O4: [0, 0], B: [0.08, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: left}
joints: {rocker_joint: {parent: ground, child: rocker}}
"""
"""Metres that look like another unit: 120 m beside a crank of 0.04 m."""
FIVE_BAR = """
links:
  ground: {O1: [0, 0], O2: [0.1, 0]}
  left: {O1: [0, 0], A: [0.04, 0]}
  right: {O2: [0, 0], C: [0.05, 0]}
  upper: {A: [0, 0], B: [0.12, 0]}
  lower: {C: [0, 0], B: [0.11, 0]}
input:
  - {joint: left_crank, parent: ground, child: left}
  - {joint: right_crank, parent: ground, child: right}
assembly: {B: left}
joints:
  upper_joint: {parent: ground, child: upper}
  lower_joint: {parent: ground, child: lower}
"""
"""Two cranks on the ground, two links between them, all straight."""


def four_bar_text(a, b, c, d, masses=(), crank='', rocker=''):
    """Return a four-bar's file; masses: (mass, centre, inertia); limits go on behind a joint."""
    text = f"""\
links:
  ground: {{O2: [0, 0], O4: [{d}, 0]}}
  crank: {{O2: [0, 0], A: [{a}, 0]}}
  coupler: {{A: [0, 0], B: [{b}, 0]}}
  rocker: {{O4: [0, 0], B: [{c}, 0]}}
input: {{joint: crank_joint, parent: ground, child: crank{crank}}}
assembly: {{B: left}}
joints: {{rocker_joint: {{parent: ground, child: rocker{rocker}}}}}
"""
    rows = [
        f'  {link}: {{mass: {mass}, center: [{center}, 0], inertia: {inertia}}}\n'
        for link, (mass, center, inertia) in zip(
            ('crank', 'coupler', 'rocker'), masses, strict=False
        )
    ]
    return text + ''.join(['masses:\n', *rows] if rows else [])


def symmetric_five_bar(left, right='', rod=''):
    """Return the file of a five-bar of equal cranks and rods; limits go on behind a joint."""
    return f"""\
links:
  ground: {{A: [0, 0], E: [0.3, 0]}}
  left: {{A: [0, 0], B: [0.2, 0]}}
  left_rod: {{B: [0, 0], C: [0.25, 0]}}
  right_rod: {{C: [0, 0], D: [0.25, 0]}}
  right: {{E: [0, 0], D: [0.2, 0]}}
input:
- {{joint: left_joint, parent: ground, child: left{left}}}
- {{joint: right_joint, parent: ground, child: right{right}}}
assembly: {{C: right}}
joints: {{rod_joint: {{parent: left, child: left_rod{rod}}}}}
"""


def _bytes(text: str | bytes) -> bytes:
    return text.encode() if isinstance(text, str) else text


@cache
def linkage_of(text: str | bytes) -> Linkage:
    """Return the linkage of a file with this text."""
    return read_linkage(parse_yaml(_bytes(text), 'linkage.yaml'))


@cache
def closure_of(text: str | bytes) -> Closure:
    """Return the closure of a linkage file with this text, built once in a process."""
    return Closure(linkage_of(text))


def shipped(name: str) -> Linkage:
    """Return a linkage that comes with the package."""
    return linkage_of((LINKAGES / f'{name}.yaml').read_bytes())


def size_of(closure: Closure) -> float:
    """Return the length that errors are measured by: the longest distance on a link, in [m]."""
    return max(
        abs(complex(*p) - complex(*q))
        for points in closure.linkage.links.values()
        for p in points.values()
        for q in points.values()
    )


def scene_of(text: str | bytes, linkage: str | bytes = FOUR_BAR) -> Scene:
    """Return a scene of one linkage; the text is that of its file without the linkage's line."""
    files = {'scene.yaml': b'linkage: linkage.yaml\n' + _bytes(text)}
    return parse_scene('scene', 'here', {**files, 'linkage.yaml': _bytes(linkage)})


def pipeline_of(text: str | bytes, linkage: str | bytes = FOUR_BAR) -> Pipeline:
    """Return the pipeline of a scene of one linkage."""
    return Pipeline(scene_of(text, linkage))


def iterated_with_two_inputs() -> str:
    """Return a linkage file whose iterated links hang on two cranks that turn fully."""
    text = (LINKAGES / 'class_3.yaml').read_text('utf-8')
    for old, new in {
        'O2: [0.180, 0.020]': 'O4: [0.170, 0.020]',
        '  crank_arm:': '  second: {O4: [0, 0], O2: [0.010, 0]}\n  crank_arm:',
        'input: {joint: crank_joint, parent: ground, child: crank}': 'input:\n'
        '  - {joint: crank_joint, parent: ground, child: crank}\n'
        '  - {joint: second_joint, parent: ground, child: second}',
        'inputs: [0.0]': 'inputs: [0.0, 0.0]',
    }.items():  # fmt: skip
        assert old in text
        text = text.replace(old, new)
    return text
