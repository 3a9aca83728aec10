# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Limits of joints in URDF, which requires them also where a linkage gives none."""

from __future__ import annotations

from math import isfinite
from xml.etree import ElementTree as ET

from linkage_ros.kinematics import Limits, Ratio
from linkage_ros.tools.models.xml import format_number

EFFORT, VELOCITY = 1000.0, 100.0
"""Limits that URDF requires but are unknown, in [N·m] or [N], and [rad/s] or [m/s]: wide."""

FARTHEST = 1e9
"""Stands for the missing limit of an angle that is limited on one side only, in [rad]."""


def write_limits(
    joint: ET.Element, limits: Limits, lowest: float, highest: float, mimic: Ratio | None
) -> dict[str, str]:
    """Write limits, with others where there are none, and a mimic; return what is made up."""
    known = {
        'lower': (limits.low, lowest),
        'upper': (limits.high, highest),
        'effort': (limits.effort, EFFORT),
        'velocity': (limits.velocity, VELOCITY),
    }
    if joint.get('type') == 'continuous':
        del known['lower'], known['upper']
    written = {
        key: format_number(given if isfinite(given) else ours)
        for key, (given, ours) in known.items()
    }
    ET.SubElement(joint, 'limit', written)
    if mimic:
        multiplier, offset = format_number(mimic.ratio), format_number(mimic.offset)
        ET.SubElement(joint, 'mimic', joint=mimic.of, multiplier=multiplier, offset=offset)
    return {key: written[key] for key, (given, _) in known.items() if not isfinite(given)}
