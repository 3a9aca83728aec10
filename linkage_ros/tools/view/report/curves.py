# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The curves of a run: joint states, poses to animate, forces, input ages and tick lateness.

Lateness follows from the tick times alone. With the period T, the i-th of consecutive ticks, at
the time tᵢ, deviates from an even row by eᵢ = tᵢ − i·T. A tick is due on the row of the most
punctual ticks within a window before it (b) and after it (a); where these differ by whole rows,
on the later row::

    lateness = eᵢ − min(b, a)   where |a − b| < T/2, else eᵢ − max(b, a)

So consecutive late ticks are late until they have caught up. Lost ticks shift the row: ticks
before them keep the old row, ticks after them have the new one. At the beginning and the end of a
run there is only one side. A delay that all ticks of the window share cannot be seen. The minimum
within a window is found in two sweeps (M. van Herk, *A fast algorithm for local minimum and
maximum filters*, 1992).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from math import hypot

from linkage_ros.description import Scene
from linkage_ros.messages import MessageContent, MessageValues, read_wrench, Rejection, WRENCHES
from linkage_ros.replay import turning_joints
from linkage_ros.tools.view.report.decimation import (
    DecimatedCurves,
    Decimation,
    DURATION_BYTES,
    Flags,
    FORCE_BYTES,
    FRAME_BYTES,
    Histogram,
    interval_capacity,
    most_columns,
    MOST_FRAMES,
    Numbers,
    SAMPLE_BYTES,
    STATE_BYTES,
    Times,
)
from linkage_ros.tools.view.report.joint_states import MOST_JOINTS
from linkage_ros.tools.view.report.labels import shorten_text
from linkage_ros.tools.view.report.run import CurveColumn, Curves, Frames, Window
import numpy as np

LATER_PINS = 'pins that turn up later'

_WINDOW = 0.25
"""Window, in [s]: in a wider one the clocks drift, in a narrower one ticks still catch up."""

_FEWEST, _MOST_TICKS = 32, 4096

_NONE = 2**62
"""In [ns]: stands for the minimum of no values."""

MOST_LINKAGES = 16
"""Number of linkages of a run that move in the animation."""

UNITS = {'position': ('rad', 'm'), 'rate': ('rad/s', 'm/s'), 'effort': ('N·m', 'N')}
"""Unit of each quantity, for a revolute and for a prismatic joint."""

NO_ROOM = 'curves for which there is no room'

LATENESS, AGE = CurveColumn('tick', 'lateness', 'ms'), CurveColumn('input', 'age', 'ms')


class Lateness:
    """Computes the lateness of ticks as they come, at a rate in [Hz], more than 0."""

    def __init__(self, rate: float) -> None:
        self._period = 1e9 / rate
        self._window = min(max(round(_WINDOW * rate), _FEWEST), _MOST_TICKS)
        self._begin: int | None = None
        self._number = 0
        self._ended = False
        # The last window of the finished ticks, and all unfinished ones.
        self._times = np.empty(0, np.int64)
        self._off = np.empty(0, np.int64)
        self._done = 0

    def add(self, times: Times) -> tuple[Times, Times]:
        """Add tick times, in [ns]; return the times with known lateness so far, and that."""
        if not len(times):
            return self._lateness_found(0)
        if self._begin is None:
            self._begin = int(times[0])
        numbers = np.arange(self._number, self._number + len(times))
        self._number += len(times)
        # Integers: in long runs, or after a long pause, a double loses the nanoseconds.
        whole, part = divmod(self._period, 1.0)
        due = numbers * int(whole) + np.rint(numbers * part).astype(np.int64)
        self._times = np.concatenate([self._times, times])
        self._off = np.concatenate([self._off, times - self._begin - due])
        return self._lateness_found(max(0, len(self._off) - self._window - self._done))

    def finish_lateness(self) -> tuple[Times, Times]:
        """Return the rest; nothing may be added after it."""
        self._ended = True
        return self._lateness_found(len(self._off) - self._done)

    def _lateness_found(self, count: int) -> tuple[Times, Times]:
        first, end = self._done, self._done + count
        if not count:
            return np.empty(0, np.int64), np.empty(0, np.int64)
        due = self._due_times()
        late = self._off[first:end] - due[first:end]
        times = self._times[first:end]
        kept = max(0, end - self._window)
        self._times, self._off, self._done = self._times[kept:], self._off[kept:], end - kept
        return times, late

    def _due_times(self) -> Times:
        """Return the even row of each tick."""
        before, after = _least_around(self._off, self._window)
        few, n = self._window // 4, len(self._off)
        if self._number == n:
            before[:few] = -_NONE
        if self._ended:
            last = max(0, n - few)
            after[last:] = -_NONE
        due = np.maximum(before, after)
        near = np.abs(before - after) < 0.5 * self._period
        due[near] = np.minimum(before, after)[near]
        return np.where(due == -_NONE, self._off.min(), due)


def _least_around(values: Times, window: int) -> tuple[Times, Times]:
    """Return each value's minimum with ``window`` values before it, and after it."""
    size = window + 1
    n = len(values)
    padded = np.full(-(-n // size) * size + size, _NONE)
    padded[:n] = values
    blocks = padded.reshape(-1, size)
    onward = np.minimum.accumulate(blocks, axis=1).ravel()
    back = np.minimum.accumulate(blocks[:, ::-1], axis=1)[:, ::-1].ravel()
    end = window + n
    after = np.minimum(back[:n], onward[window:end])
    before = onward[:n].copy()
    before[window:] = np.minimum(before[window:], back[: max(0, n - window)])
    return before, after


class BoundedCurves:
    """
    Curves with common times within a window, in a space of some bytes on the page.

    The columns ``left_out`` are beyond it: the last ones.
    """

    def __init__(
        self, title: str, columns: Sequence[CurveColumn], space: int, window: Window
    ) -> None:
        most = most_columns(space)
        self._title, self._columns, self._window = (
            shorten_text(title),
            tuple(columns[:most]),
            window,
        )
        self.left_out = max(0, len(columns) - most)
        n = len(self._columns)
        self._kept = DecimatedCurves(n, interval_capacity(n, space))
        self._rows = 0

    def add(self, times: Times, values: Numbers) -> None:
        """Add rows at run times in [ns]."""
        since, until = self._window
        within = (times >= since) & (times <= until)
        self._rows += int(within.sum())
        self._kept.add(times[within], values[within, : len(self._columns)])

    def build_curves(self) -> Curves | None:
        """Return the curves; None without rows."""
        intervals = self._kept.build_intervals()
        filled = [not np.isnan(column).all() for column in intervals.first.T]
        if not any(filled):
            return None
        columns = [column for column, there in zip(self._columns, filled, strict=True) if there]
        intervals = intervals._replace(
            first=intervals.first[:, filled], second=intervals.second[:, filled]
        )
        return Curves(self._title, columns, self._rows, intervals)


def joint_columns(names: Sequence[str], turning: Mapping[str, bool]) -> list[CurveColumn]:
    """Return the columns of joints: positions, rates and efforts, in the order of a message."""
    return [
        CurveColumn(name, quantity, units[not turning[name]])
        for quantity, units in UNITS.items()
        for name in names
    ]


class SceneCurves:
    """Collects the curves of a run: joint states, crank, and moving links."""

    def __init__(self, scene: Scene, topics: tuple[str, str], bodies: int, window: Window) -> None:
        turning = turning_joints(scene)
        inputs = [
            name for scene_linkage in scene.linkages for name in scene_linkage.sampled_joints
        ]
        states, crank = topics
        self._window = window
        self._states = BoundedCurves(
            states, joint_columns(scene.joint_names, turning), STATE_BYTES, window
        )
        self._samples = BoundedCurves(crank, joint_columns(inputs, turning), SAMPLE_BYTES, window)
        self._lates = BoundedCurves('ticks', [LATENESS], DURATION_BYTES, window)
        self._ages = BoundedCurves('ticks', [AGE], DURATION_BYTES, window)
        self._lateness = Lateness(scene.rate) if scene.rate else None
        self.late, self.age = Histogram(), Histogram()
        moving = scene.linkages[:MOST_LINKAGES]
        names = (
            name for linkage in moving for name in (*linkage.input_names, *linkage.joint_names)
        )
        self._places = {name: place for place, name in enumerate(dict.fromkeys(names))}
        # After the joint values, the page holds three numbers for the frame of each link, or for
        # each place of a spatial linkage, and the distance by which loops are open.
        size = 8 * (1 + len(self._places)) + 12 * bodies + 4 * len(moving)
        most = min(MOST_FRAMES, FRAME_BYTES // size)
        self._frames = Decimation(len(self._places), max(2, most - most % 2))
        # The joints of a scene are in the order of its linkages.
        self._joints = [self._places[name] for linkage in moving for name in linkage.joint_names]

    def add_states(
        self, times: Times, numbers: Numbers, inputs: Sequence[tuple[Sequence[str], Numbers]]
    ) -> None:
        """Add joint states at run times in [ns], with driven joints from the samples."""
        self._states.add(times, numbers.reshape(len(times), numbers.shape[1] * numbers.shape[2]))
        values = np.full((len(times), len(self._places)), np.nan)
        for names, angles in inputs:
            if names[0] in self._places:
                values[:, [self._places[name] for name in names]] = angles
        # Published values have priority over samples.
        positions = numbers[:, 0, : len(self._joints)]
        there = ~np.isnan(positions)
        under = values[:, self._joints]
        values[:, self._joints] = np.where(there, positions, under)
        within = self._is_within(times)
        self._frames.add(times[within], values[within])

    def add_samples(self, times: Times, numbers: Numbers) -> None:
        """Add samples of the crank, as joint states."""
        self._samples.add(times, numbers.reshape(len(times), numbers.shape[1] * numbers.shape[2]))

    def add_ticks(self, times: Times) -> None:
        """Add the run times of ticks, in [ns], whether or not they published anything."""
        if self._lateness is not None:
            self._add_late(*self._lateness.add(times))

    def add_ages(self, times: Times, ages: Times) -> None:
        """Add the ages of the input at ticks, in [ns]."""
        self._ages.add(times, _millisecond_column(ages))
        self.age.add(ages[self._is_within(times)])

    def finish_curves(self) -> tuple[list[Curves], Frames]:
        """Return the curves and frames; nothing may be added after it."""
        if self._lateness is not None:
            self._add_late(*self._lateness.finish_lateness())
        kept = (self._states, self._samples, self._lates, self._ages)
        lanes = [curves for recorder in kept if (curves := recorder.build_curves()) is not None]
        values = dict(zip(self._places, self._frames.values.T, strict=True))
        return lanes, Frames(self._frames.step, self._frames.times, values)

    @property
    def left_out(self) -> dict[tuple[str, str], int]:
        """Return the number of curves beyond the size limit, by title and reason."""
        return {
            (what, NO_ROOM): kept.left_out
            for what, kept in (('joint states', self._states), ('samples', self._samples))
            if kept.left_out
        }

    def _add_late(self, times: Times, late: Times) -> None:
        self._lates.add(times, _millisecond_column(late))
        self.late.add(late[self._is_within(times)])

    def _is_within(self, times: Times) -> Flags:
        since, until = self._window
        return (times >= since) & (times <= until)


def _millisecond_column(durations: Times) -> Numbers:
    """Return durations in [ns] as a column in [ms]."""
    return (durations * 1e-6).astype(np.float64)[:, None]


_TORQUE = 3
"""Index of the first number of the torque in a wrench."""


class LinkWrenches:
    """
    Collects the wrenches on links, of a window, each from its topic.

    ``numbers`` has for each topic the indices of those numbers of a message that move the linkage.
    Messages that are ``left_out`` are counted by reason.
    """

    def __init__(self, numbers: Mapping[str, Sequence[int]], window: Window) -> None:
        topics, self._numbers = [*numbers], numbers
        self._kept = {}
        for topic in topics:
            name = shorten_text(topic.rpartition('/')[2])
            columns = [
                CurveColumn(name, 'load', 'N'),
                CurveColumn(name, 'moment of a load', 'N·m'),
            ]
            space = FORCE_BYTES // len(topics)
            self._kept[topic] = BoundedCurves(topic, columns, space, window)
        self.left_out: Counter[str] = Counter()

    def add(self, topic: str, times: Times, messages: Sequence[bytes]) -> None:
        """Add the messages of a topic at run times in [ns]."""
        numbers = np.full((len(messages), 2), np.nan)
        for row, message in enumerate(messages):
            wrench = read_wrench(message)
            if isinstance(wrench, Rejection):
                self.left_out[wrench.value] += 1
            else:
                counted = self._numbers[topic]
                force = [wrench[index] for index in counted if index < _TORQUE]
                moment = [wrench[index] for index in counted if index >= _TORQUE]
                # In the plane a moment has a sign.
                numbers[row] = hypot(*force), moment[0] if len(moment) == 1 else hypot(*moment)
        self._kept[topic].add(times, numbers)

    def build_curves(self) -> list[Curves]:
        """Return the curves of each topic with messages."""
        curves = (kept.build_curves() for kept in self._kept.values())
        return [curve for curve in curves if curve is not None]


class PinForces:
    """
    Collects the forces in pins and sliders, of a window, from the topics of `pin_forces`.

    Messages, or pins of messages, that are ``left_out`` are counted by reason.
    """

    def __init__(self, topics: str, window: Window) -> None:
        self._topics, self._window = topics, window
        self._reader = MessageValues(WRENCHES)
        self._places: dict[str, int] = {}
        self._kept: BoundedCurves | None = None
        self.left_out: Counter[str] = Counter()

    def add(self, times: Times, messages: Sequence[bytes]) -> None:
        """Add messages at run times in [ns]; several linkages at one time are a row."""
        good: list[tuple[int, MessageContent]] = []
        for time, message in zip(times.tolist(), messages, strict=True):
            values = self._reader.read(message)
            if isinstance(values, str):
                self.left_out[values] += 1
            elif values.numbers:
                good.append((time, values))
        if not good:
            return
        if self._kept is None:
            names = list(dict.fromkeys(name for _, values in good for name in values.names))
            self._places = {name: place for place, name in enumerate(names[:MOST_JOINTS])}
            columns = [
                CurveColumn(shorten_text(name), quantity, unit)
                for quantity, unit in (('force', 'N'), ('moment', 'N·m'))
                for name in self._places
            ]
            self._kept = BoundedCurves(self._topics, columns, FORCE_BYTES, self._window)
        rows = {time: row for row, time in enumerate(sorted({time for time, _ in good}))}
        numbers = np.full((len(rows), 2, len(self._places)), np.nan)
        for time, values in good:
            wrenches = np.reshape(values.numbers, (-1, 2, 3))
            for name, (force, (x, y, z)) in zip(values.names, wrenches, strict=True):
                if name in self._places:
                    # About z a moment has a sign.
                    moment = hypot(x, y, z) if x or y else z
                    numbers[rows[time], :, self._places[name]] = hypot(*force), moment
                else:
                    self.left_out[LATER_PINS] += 1
        self._kept.add(np.array([*rows]), numbers.reshape(len(rows), -1))

    def build_curves(self) -> Curves | None:
        """Return the curves, without moments that are zero, as in pins; None without messages."""
        curves = None if self._kept is None else self._kept.build_curves()
        if curves is None:
            return None
        first, second = curves.intervals.first, curves.intervals.second
        kept = [
            place
            for place, column in enumerate(curves.columns)
            if column.quantity == 'force'
            or np.nan_to_num([first[:, place], second[:, place]]).any()
        ]
        return curves._replace(
            columns=[curves.columns[place] for place in kept],
            intervals=curves.intervals._replace(first=first[:, kept], second=second[:, kept]),
        )
