# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Robots by the text of their URDF."""

from __future__ import annotations

from typing import Any

from linkage_ros.description import read_any_closure, Section


def robot_of(urdf: bytes | str, **told: Any) -> Any:
    """Return the closure of a robot, with what a scene would tell: input, at, close."""
    content = Section('r.urdf', '', {'urdf': 'r.urdf', **told})
    content.named_data = urdf.encode() if isinstance(urdf, str) else urdf
    return read_any_closure(content)
