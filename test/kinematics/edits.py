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

"""A linkage as fields that can be changed, and the changes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from linkage_ros.kinematics.linkage import Linkage

Fields = dict[str, Any]
Change = Callable[[Fields], None]


def fields(linkage: Linkage) -> Fields:
    """Return the fields of a linkage, which may be changed."""
    return {
        'links': {name: dict(points) for name, points in linkage.links.items()},
        'inputs': linkage.inputs,
        'assembly': dict(linkage.assembly),
        'joints': dict(linkage.joints),
        'sliders': dict(linkage.sliders),
        'traced': linkage.traced,
        'pose': linkage.pose,
    }


def put(*path_and_value: Any) -> Change:
    """Return a change that sets a value, given its path."""
    *path, last, value = path_and_value

    def change(linkage: Fields) -> None:
        for key in path:
            linkage = linkage[key]
        linkage[last] = value

    return change


def drop(*path: str) -> Change:
    """Return a change that removes what stands at a path."""

    def change(linkage: Fields) -> None:
        for key in path[:-1]:
            linkage = linkage[key]
        del linkage[path[-1]]

    return change


def rename(old: str, new: str) -> Change:
    """Return a change that gives a link another name."""

    def change(linkage: Fields) -> None:
        linkage['links'] = {new if k == old else k: v for k, v in linkage['links'].items()}

    return change
