# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Broken link: the loop with the link has no pose any more, so nothing is published.

A mechanism with a broken link has one degree of freedom more than inputs: the crank does not
determine its pose.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from linkage_ros.drives.drive import Context
from linkage_ros.faults.fault import Switch
from linkage_ros.files.parameters import name
from linkage_ros.kinematics.results import Position
from linkage_ros.kinematics.status import Status


@dataclass(frozen=True, slots=True)
class BrokenLinkParameters:
    """A link is broken: the linkage has no pose."""

    link: str = name('the broken link', 'link')


PARAMETERS = BrokenLinkParameters


def mechanism(
    parameters: BrokenLinkParameters, switch: Switch, context: Context
) -> Callable[[Position], Position] | None:
    """Build a function that removes the pose; None if the link is not in this linkage."""
    if parameters.link not in [context.prefix + link for link in context.closure.linkage.links]:
        return None

    def broken(position: Position) -> Position:
        if not switch.on:
            return position
        return replace(position, status=Status.INDETERMINATE, gap=0.0, joints=())

    return broken
