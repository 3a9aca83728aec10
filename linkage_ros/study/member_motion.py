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


"""What one linkage of a scene does: its inputs over the time, its commands, its samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import NamedTuple

from linkage_ros.drives.drive import Context
from linkage_ros.kinematics.closure import Closure
from linkage_ros.scene.scene import SceneLinkage

Crank = tuple[tuple[float, ...], tuple[float, ...]]
"""Values and rates of the inputs."""

Path = Callable[[int], Crank | None]
"""Values and rates of the inputs at a time since the first tick, in [ns]."""


class Command(NamedTuple):
    """A command of a torque drive, in the unit that it takes."""

    time: int  # Arrival after the first tick, in [ns]
    effort: float


class MemberMotion(NamedTuple):
    """What one linkage of a scene does."""

    member: SceneLinkage
    closure: Closure  # The closed form of its linkage, with the deviations of its parts
    context: Context
    path: Path | None  # Its inputs at any time; None for a torque drive
    commands: Sequence[Command] = ()
    # When the samples of a topic drive are taken and when they come, after the first tick, in
    # [ns]; () if they come at the rate of `sample_rate`, at once.
    samples: Sequence[tuple[int, int]] = ()
    sample_rate: float = 0.0  # Samples of a topic drive per second; 0 for other drives
    length: float = inf  # How long it is known, in [s]
    note: str = ''  # What is assumed of it, in a sentence; '' for nothing
