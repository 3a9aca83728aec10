# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a node publishes about its run: the files of its scene, and begins and ends of faults."""

from __future__ import annotations

from collections.abc import Mapping
import json
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.description import Scene
from linkage_ros.messages import OwnJointStates, text_of

if TYPE_CHECKING:
    from linkage_ros.stages.faults import FaultChange

_LONGEST_ANNOUNCED = 16 * 2**20
"""Greatest size of a message with the files of a scene [bytes]; usually some kilobytes."""


class AnnouncedScene(NamedTuple):
    """The files of a running node's scene, as its message holds them."""

    path: str  # Name of the topic, for error messages
    attachments: dict[str, bytes]  # The files by name, as a bag of the run has them


def announced_text(files: Mapping[str, bytes]) -> str:
    """Return the files of a scene as the text that a node publishes."""
    return json.dumps({name: data.decode() for name, data in files.items()})


def read_announced(message: bytes, topic: str) -> AnnouncedScene:
    """Read a node's message with the files of its scene; raise `ValueError` for other content."""
    if len(message) > _LONGEST_ANNOUNCED:
        raise ValueError('too long')
    try:
        content = json.loads(text_of(message))
    except RecursionError:
        raise ValueError('too deep') from None
    if not isinstance(content, dict) or not all(isinstance(of, str) for of in content.values()):
        raise ValueError('not the files of a scene')
    return AnnouncedScene(
        topic, {name: text.encode('utf-8', 'replace') for name, text in content.items()}
    )


def own_joint_states(scene: Scene) -> OwnJointStates:
    """Return a predicate for the joint states of a scene among others on their topic."""
    return OwnJointStates(scene_linkage.joint_names for scene_linkage in scene.linkages)


def change_text(change: FaultChange, kind: str) -> str:
    """Return the begin or end of a fault as the text that is published and recorded."""
    return json.dumps({'fault': change.name, 'kind': kind, 'injected': change.on})


def read_change(message: bytes) -> tuple[str, bool]:
    """Return the fault that a message names and whether it begins, or raise `ValueError`."""
    try:
        content = json.loads(text_of(message))
    except RecursionError:
        raise ValueError('too deep') from None
    name, on = (
        (content.get('fault'), content.get('injected')) if isinstance(content, dict) else (0, 0)
    )
    if not isinstance(name, str) or not isinstance(on, bool):
        raise ValueError('not the begin or end of a fault')
    return name, on
