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

"""Linkages, scenes and pipelines from the text of their files, and the shipped linkages."""

from __future__ import annotations

from pathlib import Path

from linkage_ros.files.linkage_file import read_linkage
from linkage_ros.files.yaml_file import parse_yaml
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.scene.load import parse_scene
from linkage_ros.scene.scene import Scene

ROOT = Path(__file__).parents[2]
LINKAGES = ROOT / 'config' / 'linkages'
GALLERY = sorted(file.stem for file in LINKAGES.glob('*.yaml'))
ONE_INPUT = [name for name in GALLERY if name != 'five_bar']
"""Names of all shipped linkages, and of those that a file alone drives."""
FOUR_BAR = 'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}'
"""Publishes coupler_joint and rocker_joint; its input is crank_joint."""


def _bytes(text: str | bytes) -> bytes:
    return text.encode() if isinstance(text, str) else text


def linkage_of(text: str | bytes) -> Linkage:
    """Return the linkage of a file with this text."""
    return read_linkage(parse_yaml(_bytes(text), 'linkage.yaml'))


def closure_of(text: str | bytes) -> Closure:
    """Return the closure of a linkage file with this text."""
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
