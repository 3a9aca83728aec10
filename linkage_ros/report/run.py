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


"""What a page tells of a run, as it comes from reading the bag."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from linkage_ros.bag.contents import Contents
from linkage_ros.kinematics.closure import Closure
from linkage_ros.report.arrays import Numbers, Times
from linkage_ros.report.extremes import Intervals
from linkage_ros.report.histogram import Histogram
from linkage_ros.report.spans import Lane


class Window(NamedTuple):
    """Which part of a run is told, in the time of the run, in [ns]."""

    since: int = 0
    until: int = 2**63 - 1


class Column(NamedTuple):
    """
    What a curve tells.

    Attributes
    ----------
    name
        Of the joint, as messages have it.
    quantity
        position, rate, effort, lateness or age.
    unit
        Of its values.

    """

    name: str
    quantity: str
    unit: str


class Curves(NamedTuple):
    """
    Curves that share their times.

    Attributes
    ----------
    title
        What they are of: a topic.
    columns
        What each tells.
    rows
        How many rows there were.
    intervals
        The curves.

    """

    title: str
    columns: Sequence[Column]
    rows: int
    intervals: Intervals


class LinkageRun(NamedTuple):
    """
    A linkage of a scene, and what was recorded of it.

    Attributes
    ----------
    name
        Its name; '' where it is the only one.
    prefix
        What its joints have before their own names.
    closure
        As it is solved.
    inputs, joints
        Names of the driven joints, and of the published ones, in messages.
    input_units
        Of the driven joints.
    silent
        When nothing was published of it.

    """

    name: str
    prefix: str
    closure: Closure
    inputs: tuple[str, ...]
    joints: tuple[str, ...]
    input_units: tuple[str, ...]
    silent: Lane


class Frames(NamedTuple):
    """
    Instants of a run at which all joints are told, for the moving picture.

    Attributes
    ----------
    step
        Of how many joint states there is one.
    times
        In the time of the run, in [ns].
    values
        By the names in messages the values of joints, in [rad] or [m]; NaN where there is none.

    """

    step: int
    times: Times
    values: Mapping[str, Numbers]


@dataclass(frozen=True, slots=True)
class Run:
    """
    What a bag holds of a run.

    Attributes
    ----------
    begin
        The log time at which its time begins, in [ns]; nothing without messages.
    end
        The time of the run at its end, in [ns].
    window
        Which part of it is told.
    contents
        Counts of all messages, and what is damaged.
    curves
        Joints, cranks, lateness and age over time.
    frames
        For the moving picture; nothing where there is no scene.
    linkages
        Of the scene; none where there is none.
    lanes
        What happened, by kind.
    lateness, age
        How they are spread; nothing where they cannot be told.
    rejected
        How many samples were rejected, by reason.
    left_out
        How many messages, or joints of messages, could not be read, by topic and reason.
    said
        What the last diagnostics say, by task and key.

    """

    begin: int | None
    end: int
    window: Window
    contents: Contents
    curves: Sequence[Curves]
    frames: Frames | None = None
    linkages: Sequence[LinkageRun] = ()
    lanes: Mapping[str, Lane] = field(default_factory=dict)
    lateness: Histogram | None = None
    age: Histogram | None = None
    rejected: Mapping[str, int] = field(default_factory=dict)
    left_out: Mapping[tuple[str, str], int] = field(default_factory=dict)
    said: Mapping[tuple[str, str], str] = field(default_factory=dict)
