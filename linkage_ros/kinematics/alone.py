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

"""The pose of one step of a solution, from the steps that it starts from and no others."""

from __future__ import annotations

from collections.abc import Callable

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import GROUND
from linkage_ros.kinematics.step import PLACED, Pose, State
from linkage_ros.kinematics.structure import Driven, Dyad, links_of


def pose_alone(closure: Closure, number: int, *inputs: float) -> Callable[..., Pose]:
    """
    Return what gives the pose of a step, by the inputs, in [rad] and [m].

    Of a hundred loops that hang side by side on a crank it closes one.

    Parameters
    ----------
    closure
        The linkage.
    number
        Of the step.
    *inputs
        Where the linkage closes: where each step appends what it finds is looked up there.

    """
    needed = _needed(closure, closure.step_groups[number])
    walked = closure.known(*inputs)
    plan: list[tuple[Callable[[State], Pose], int, int]] = []
    for step, group in zip(closure.steps[: number + 1], closure.step_groups, strict=False):
        start = len(walked.coordinates), len(walked.pins)
        # A pin is placed for the first group that asks for it, and serves others.
        if step.close(walked) is PLACED or group in needed:
            plan.append((step.close, *start))

    def pose(*values: float) -> Pose:
        state = closure.known(*values)
        found: Pose = PLACED
        for close, coordinates, pins in plan:
            # What is left out has its places all the same, which nobody asks for.
            state.coordinates.extend([0.0] * (coordinates - len(state.coordinates)))
            state.pins.extend([0j] * (pins - len(state.pins)))
            found = close(state)
            if not found.status.has_pose:
                break
        return found

    return pose


def _needed(closure: Closure, number: int) -> set[int]:
    """Return the groups that one starts from, and it."""
    groups = closure.structure.groups
    owner = {link: i for i, group in enumerate(groups) for link in links_of(group)}
    needed: set[int] = set()
    asked = [number]
    while asked:
        i = asked.pop()
        if i not in needed:
            needed.add(i)
            group = groups[i]
            if isinstance(group, Driven):
                starts = [group.joint.to]
            elif isinstance(group, Dyad):
                starts = [joint.to for joint in group.outer]
            else:
                return set(range(number + 1))
            asked += [owner[link] for link in starts if link != GROUND]
    return needed
