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


"""The section ``loads`` of a scene: what acts on the links, read into `Loads`."""

from __future__ import annotations

from linkage_ros.dynamics.loads import Loads, Spring
from linkage_ros.scene.section import Section

_STRONGEST = 1e9


def read_loads(content: Section) -> Loads:
    """
    Read gravity, springs and the inertia of the drive.

    Raises
    ------
    FileError
        With line and key of what is wrong.

    """
    springs = content.section('springs', required=False)
    loads = Loads(
        gravity=content.point('gravity', most=1e3) if 'gravity' in content else (0.0, 0.0),
        springs=tuple(_spring(name, springs.section(name)) for name in springs),
        drive_inertia=content.number(
            'drive_inertia', 0.0, least=0.0, most=_STRONGEST, unit='kg·m², or kg of a slide'
        ),
    )
    content.finish(('gravity',))
    return loads


def _spring(name: str, content: Section) -> Spring:
    spring = Spring(
        *_end(content, 'from'),
        *_end(content, 'to'),
        content.number('stiffness', least=0.0, most=1e12, unit='N/m'),
        content.number('free_length', 0.0, least=0.0, most=_STRONGEST, unit='m'),
        content.number('damping', 0.0, least=0.0, most=1e12, unit='N·s/m'),
        name,
    )
    content.finish()
    return spring


def _end(content: Section, key: str) -> tuple[str, str]:
    """Return link and point of one end of a spring."""
    link, dot, point = content.text(key).rpartition('.')
    if not dot or not link or not point:
        raise content.error(key, f'{content.text(key)!r} is no point', 'write LINK.POINT')
    return link, point
