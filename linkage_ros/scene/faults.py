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


"""The faults that a scene names, to be injected into its signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

from linkage_ros.errors import listed
from linkage_ros.faults.fault import Fault, FAULTS
from linkage_ros.scene.read import parts_of, read_parameters
from linkage_ros.scene.scene import Member
from linkage_ros.scene.section import Section

_WHEN = ('at', 'seconds')


def read_faults(content: Section, members: Sequence[Member]) -> dict[str, Fault]:
    """
    Return the faults that a scene names, by their names.

    Raises
    ------
    FileError
        Where one cannot be understood.

    """
    section = content.section('faults', required=False)
    parts: dict[str, tuple[str, ...]] = {}
    for member in members:
        for kind, names in parts_of(member.linkage).items():
            parts[kind] = (*parts.get(kind, ()), *(member.prefix + name for name in names))
    return {section.ros_name(name): _fault(section.section(name), parts) for name in section}


def _fault(content: Section, parts: Mapping[str, tuple[str, ...]]) -> Fault:
    kinds = [key for key in content if key in FAULTS]
    if len(kinds) != 1:
        for key in content:
            if key in (*_WHEN, *FAULTS):
                content.taken(key)
        content.finish((*_WHEN, *FAULTS))
        raise content.error('', f'{len(kinds)} kinds', f'name one of {listed(FAULTS)}')
    parameters: Any = read_parameters(
        content.section(kinds[0]), import_module(FAULTS[kinds[0]]).PARAMETERS, parts
    )
    at = content.numbers('at', most=1e9) if 'at' in content else []
    if any(time < 0.0 for time in at):
        raise content.error('at', f'{at} begins before the first tick', 'write seconds from it on')
    seconds = content.number('seconds', least=1e-6, most=1e9, unit='s') if at else 0.0
    content.finish(_WHEN)
    return Fault(kinds[0], parameters, tuple(at), seconds)
