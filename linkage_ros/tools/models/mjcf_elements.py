# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Elements of MJCF that planar and spatial linkages both have."""

from __future__ import annotations

from math import inf
from xml.etree import ElementTree as ET

from linkage_ros.kinematics import Limits
from linkage_ros.tools.models.xml import format_numbers

DENSITY = 7850.0
"""Density of links without a given mass: steel, in [kg/m³]."""

DIFFERENCE = 1e-4
"""Step of the finite differences, in [rad] or as a fraction of a length."""

LEAST_INERTIA = 1e-12
"""The engine needs an inertia; a body without extent gets this, in [kg·m²]."""

_FARTHEST = 1e9
"""Stands for the missing limit of a joint that has one limit only, in [rad] or [m]."""


def write_limits(joint: ET.Element, limits: Limits) -> None:
    """Write the limits of a joint that MJCF can express: it has none for rates."""
    if limits.is_bounded:
        joint.set(
            'range', format_numbers(max(limits.low, -_FARTHEST), min(limits.high, _FARTHEST))
        )
    if limits.effort < inf:
        joint.set('actuatorfrcrange', format_numbers(-limits.effort, limits.effort))
