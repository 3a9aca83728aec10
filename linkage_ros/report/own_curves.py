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


"""The curves of a run of a scene, its instants for the moving picture, and its durations."""

from __future__ import annotations

from collections.abc import Sequence

from linkage_ros.kinematics.linkage import RevoluteJoint
from linkage_ros.report.arrays import Flags, Numbers, Times
from linkage_ros.report.extremes import capacity, Extremes, most_columns
from linkage_ros.report.histogram import Histogram
from linkage_ros.report.lateness import Lateness
from linkage_ros.report.room import DURATIONS, FRAMES, MOST_FRAMES, SAMPLES, STATES
from linkage_ros.report.run import Column, Curves, Frames, Window
from linkage_ros.report.thinned import Thinned
from linkage_ros.report.words import short
from linkage_ros.scene.scene import Scene
import numpy as np

MOST_LINKAGES = 16
"""Those that move in a picture."""

UNITS = {'position': ('rad', 'm'), 'rate': ('rad/s', 'm/s'), 'effort': ('N·m', 'N')}
"""Of each quantity where the joint turns, and where it slides."""

NO_ROOM = 'curves for which there is no room'

LATENESS, AGE = Column('tick', 'lateness', 'ms'), Column('input', 'age', 'ms')


class Kept:
    """
    Curves that share their times, as far as they are within a window.

    Parameters
    ----------
    title
        What they are of.
    columns
        What each tells.
    room
        How much of them may come onto a page, in [bytes].
    window
        Which part of the run is told.

    Attributes
    ----------
    left_out
        How many columns there is no room for, behind the others.

    """

    def __init__(self, title: str, columns: Sequence[Column], room: int, window: Window) -> None:
        most = most_columns(room)
        self._title, self._columns, self._window = short(title), tuple(columns[:most]), window
        self.left_out = max(0, len(columns) - most)
        n = len(self._columns)
        self._kept = Extremes(n, capacity(n, room))
        self._rows = 0

    def add(self, times: Times, values: Numbers) -> None:
        """Add rows, in the time of the run in [ns]."""
        since, until = self._window
        within = (times >= since) & (times <= until)
        self._rows += int(within.sum())
        self._kept.add(times[within], values[within, : len(self._columns)])

    def curves(self) -> Curves | None:
        """Return the curves that there are; nothing without rows."""
        found = self._kept.intervals()
        told = [not np.isnan(column).all() for column in found.first.T]
        if not any(told):
            return None
        columns = [column for column, there in zip(self._columns, told, strict=True) if there]
        found = found._replace(first=found.first[:, told], second=found.second[:, told])
        return Curves(self._title, columns, self._rows, found)


def joint_columns(names: Sequence[str], turning: Sequence[bool]) -> list[Column]:
    """Return the columns of joints: positions, rates, and efforts, in the order of a message."""
    return [
        Column(name, quantity, units[not turns])
        for quantity, units in UNITS.items()
        for name, turns in zip(names, turning, strict=True)
    ]


class OwnCurves:
    """
    Collects what is drawn of a run.

    Parameters
    ----------
    scene
        The scene.
    topics
        Names of the topics of the joint states and of the crank.
    bodies
        How many links there are to be moved in the picture.
    window
        Which part of the run is told.

    """

    def __init__(self, scene: Scene, topics: tuple[str, str], bodies: int, window: Window) -> None:
        turning = {
            member.prefix + name: isinstance(joint, RevoluteJoint)
            for member in scene.members
            for name, joint in member.linkage.joints.items()
        }
        inputs = {
            name: not given.slider
            for member in scene.members
            for name, given in zip(member.inputs, member.linkage.inputs, strict=True)
        }
        states, crank = topics
        columns = joint_columns(scene.joints, [turning[name] for name in scene.joints])
        self._window = window
        self._states = Kept(states, columns, STATES, window)
        self._samples = Kept(crank, joint_columns([*inputs], [*inputs.values()]), SAMPLES, window)
        self._lates = Kept('ticks', [LATENESS], DURATIONS, window)
        self._ages = Kept('ticks', [AGE], DURATIONS, window)
        self._lateness = Lateness(scene.rate) if scene.rate else None
        self.late, self.age = Histogram(), Histogram()
        moving = scene.members[:MOST_LINKAGES]
        names = (name for each in moving for name in (*each.inputs, *each.joints))
        self._places = {name: place for place, name in enumerate(dict.fromkeys(names))}
        # Beside the values the frames of the links come onto the page, three numbers each, and by
        # how much they are apart.
        size = 8 * (1 + len(self._places)) + 12 * bodies + 4 * len(moving)
        most = min(MOST_FRAMES, FRAMES // size)
        self._frames = Thinned(len(self._places), max(2, most - most % 2))
        # The joints of a scene stand in the order of its linkages.
        self._joints = [self._places[name] for each in moving for name in each.joints]

    def add_states(
        self, times: Times, numbers: Numbers, inputs: Sequence[tuple[Sequence[str], Numbers]]
    ) -> None:
        """
        Add joint states.

        Parameters
        ----------
        times
            In the time of the run, in [ns].
        numbers
            As `JointBlock.numbers` has them.
        inputs
            Where driven joints were, by the samples, with their names.

        """
        self._states.add(times, numbers.reshape(len(times), numbers.shape[1] * numbers.shape[2]))
        values = np.full((len(times), len(self._places)), np.nan)
        for names, angles in inputs:
            if names[0] in self._places:
                values[:, [self._places[name] for name in names]] = angles
        # What is published goes before what a sample said.
        positions = numbers[:, 0, : len(self._joints)]
        there = ~np.isnan(positions)
        under = values[:, self._joints]
        values[:, self._joints] = np.where(there, positions, under)
        within = self._within(times)
        self._frames.add(times[within], values[within])

    def add_samples(self, times: Times, numbers: Numbers) -> None:
        """Add samples of the crank, as joint states."""
        self._samples.add(times, numbers.reshape(len(times), numbers.shape[1] * numbers.shape[2]))

    def add_ticks(self, times: Times) -> None:
        """Add ticks, at which something was published or not, in the time of the run in [ns]."""
        if self._lateness is not None:
            self._add_late(*self._lateness.add(times))

    def add_ages(self, times: Times, ages: Times) -> None:
        """Add how old the input was at ticks, in [ns]."""
        self._ages.add(times, _milliseconds(ages))
        self.age.add(ages[self._within(times)])

    def end(self) -> tuple[list[Curves], Frames]:
        """Return all that was collected; nothing is to be added after it."""
        if self._lateness is not None:
            self._add_late(*self._lateness.end())
        kept = (self._states, self._samples, self._lates, self._ages)
        found = [curves for each in kept if (curves := each.curves()) is not None]
        values = dict(zip(self._places, self._frames.values.T, strict=True))
        return found, Frames(self._frames.step, self._frames.times, values)

    @property
    def left_out(self) -> dict[tuple[str, str], int]:
        """Return of how many curves there is no room for, by what they are of, and why."""
        return {
            (what, NO_ROOM): kept.left_out
            for what, kept in (('joint states', self._states), ('samples', self._samples))
            if kept.left_out
        }

    def _add_late(self, times: Times, late: Times) -> None:
        self._lates.add(times, _milliseconds(late))
        self.late.add(late[self._within(times)])

    def _within(self, times: Times) -> Flags:
        since, until = self._window
        return (times >= since) & (times <= until)


def _milliseconds(durations: Times) -> Numbers:
    """Return durations in [ns] as a column in [ms]."""
    return (durations * 1e-6).astype(np.float64)[:, None]
