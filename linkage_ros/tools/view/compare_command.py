# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Compare two runs: the differences of their joints over the time, in numbers and as a picture.

The runs begin at their first joint states. The second is interpolated at the times of the first,
as long as both last, but not where states of it are missing. A difference is not a failure.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from itertools import chain, islice
from math import nan, pi, remainder, tau
from pathlib import Path
from threading import Event
from typing import Any, NamedTuple

from linkage_ros.bag import Bag
from linkage_ros.cli import (
    add_output,
    add_result,
    BagReading,
    deviations_account,
    joints_table,
    open_bag,
    PICTURES,
    Result,
    RESULTS,
    run_or_blank,
    show_result,
)
from linkage_ros.description import Units
from linkage_ros.errors import BagError, LinkageError, list_names
from linkage_ros.kinematics import Curve
from linkage_ros.messages import JOINT_STATE_TYPE, Key, MessageValues, POSITION
from linkage_ros.names import picture_text
from linkage_ros.replay import Deviation, recorded_scene, TickPlace, turning_joints
from linkage_ros.tools.drawing import (
    is_after_gap,
    label_joints,
    longest_step,
    picture_settings,
    plot_joints,
    save_picture,
    stacked_axes,
)
from linkage_ros.tools.view.report import DecimatedCurves
import numpy as np

EXAMPLE = 'linkage compare my_bag other_bag -o difference.png'

_INTERVALS = 1000
"""Least number of intervals of a picture; it shows the least and the greatest value of each."""

_ROWS = 1024


class TimedState(NamedTuple):
    """A joint state of a run."""

    time: int  # Since the first one, in [ns]
    values: Mapping[Key, float]


class BagDifferences:
    """The differences of two runs: by joint and quantity, and of positions over the time."""

    def __init__(self, turning: Mapping[str, bool], *, wrapped: bool) -> None:
        self.deviations: dict[Key, Deviation] = {}
        self.compared = 0
        """Joint states of the first run that the second has a value for."""
        self.end = 0
        """Time of the last of them, in [ns]."""
        self.positions: list[str] = []
        """The joints of `difference_curves`, once a state was compared."""
        self._turning, self._wrapped = turning, wrapped
        self._curves: DecimatedCurves | None = None
        self._rows: list[tuple[int, list[float]]] = []

    def add_states(
        self, time: int, first: Mapping[Key, float], second: Mapping[Key, float]
    ) -> None:
        """Add two states of one time, in [ns]."""
        self.compared += 1
        self.end = time
        for key, a in first.items():
            b = second.get(key)
            if b is None:
                continue
            if self._wrapped and self._is_angle(key):
                b = a + remainder(b - a, tau)
            deviation = self.deviations.setdefault(key, Deviation())
            deviation.compared += 1
            if a != b:
                deviation.add_difference(a, b, TickPlace(self.compared, time))
        if not self.positions:
            self.positions = [
                name for name, what in first if what == POSITION and (name, what) in second
            ]
            self._curves = DecimatedCurves(len(self.positions), _INTERVALS)
        row = []
        for name in self.positions:
            key = (name, POSITION)
            apart = second.get(key, nan) - first.get(key, nan)
            row.append(remainder(apart, tau) if self._wrapped and self._is_angle(key) else apart)
        self._rows.append((time, row))
        if len(self._rows) == _ROWS:
            self._flush_rows()

    def difference_curves(self) -> tuple[Any, Any, Any]:
        """Return times in [s], and the least and greatest difference in each interval."""
        self._flush_rows()
        assert self._curves is not None
        intervals = self._curves.build_intervals()
        lows, highs = (
            np.fmin(intervals.first, intervals.second),
            np.fmax(intervals.first, intervals.second),
        )
        return intervals.begins * 1e-9, lows, highs

    def interpolate(self, before: TimedState, after: TimedState, time: int) -> Mapping[Key, float]:
        """Return the values at a time between two states, in [ns]."""
        if after.time == time or after.time == before.time:
            return after.values
        share = (time - before.time) / (after.time - before.time)
        values = {}
        for key, value in before.values.items():
            step = after.values.get(key, nan) - value
            if self._wrapped and self._is_angle(key) and abs(step) > pi:
                step = remainder(step, tau)
            values[key] = value + share * step
        return values

    def _is_angle(self, key: Key) -> bool:
        return key[1] == POSITION and self._turning.get(key[0], True)

    def _flush_rows(self) -> None:
        if self._rows and self._curves is not None:
            times, rows = zip(*self._rows, strict=True)
            self._curves.add(np.array(times, np.int64), np.array(rows, float))
            self._rows.clear()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    for name, what in (('bag', 'the first bag'), ('other', 'the second bag')):
        parser.add_argument(
            name, type=Path, metavar=name.upper(), help=f'{what}: its folder or its .mcap file'
        )
    add_output(parser, (*PICTURES, *RESULTS), 'the result is printed, and no picture is written')
    add_result(parser, output=False)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Compare; return 1 if it was stopped, or a bag is damaged."""
    bags = [open_bag(path, stop) for path in (arguments.bag, arguments.other)]
    scenes = [_read_conventions(bag) for bag in bags]
    turning = {**scenes[0].turning, **scenes[1].turning}
    differences = BagDifferences(turning, wrapped=scenes[0].wrapped or scenes[1].wrapped)
    readings = [BagReading(bag, stop) for bag in bags]
    with readings[0].with_progress() as first, readings[1].with_progress() as second:
        _compare_states(differences, _read_states(bags[0], first), _read_states(bags[1], second))
    if not differences.deviations:
        raise LinkageError(
            arguments.other,
            f'has no joint in common with {arguments.bag}',
            'name two runs of one linkage',
        )
    account = {
        'bag': str(arguments.bag),
        'other': str(arguments.other),
        'compared': differences.compared,
        'seconds': differences.end * 1e-9,
        'damage': [reading.damage for reading in readings if reading.damage],
        'stopped': stop.is_set(),
        'joints': deviations_account(differences.deviations, turning),
    }
    picture = arguments.output is not None and arguments.output.suffix.lower() in PICTURES
    if picture:
        title = f'{arguments.other.name} against {arguments.bag.name}'
        length = scenes[0].units.length
        _draw_differences(differences, turning, title, arguments.output, length)
    head = (
        f'{account["other"]} against {account["bag"]}: {account["compared"]} joint states, '
        f'{account["seconds"]:.3f} s'
    )
    show_result(Result(account, [head, joints_table(account, 0, scenes[0].units)]), arguments)
    if picture and not arguments.json and not arguments.csv:
        print(arguments.output)
    return int(stop.is_set() or bool(account['damage']))


class _Conventions(NamedTuple):
    """What a run's scene says of its numbers."""

    turning: Mapping[str, bool]  # Of each joint, whether it turns
    wrapped: bool  # Whether angles are wrapped; without a scene they may be
    units: Units  # Of its tables


def _read_conventions(bag: Bag) -> _Conventions:
    try:
        scene = recorded_scene(bag)
    except LinkageError:
        return _Conventions({}, wrapped=True, units=Units())
    return _Conventions(turning_joints(scene), scene.wrapped, scene.units)


def _read_states(bag: Bag, messages: Iterator[Any]) -> Iterator[TimedState]:
    """Yield the joint states of a bag whose time goes on."""
    held = [topic.name for topic in bag.topics if topic.type == JOINT_STATE_TYPE]
    topic = run_or_blank(bag).joint_states_topic or '/joint_states'
    if topic not in held:
        raise BagError(
            bag.path,
            f'holds no {topic} of {JOINT_STATE_TYPE}',
            f'it holds {list_names(held) or "none"}',
        )
    read = MessageValues(JOINT_STATE_TYPE).read
    begin = last = None
    for name, _, publish_time, data in messages:
        if name != topic:
            continue
        values = read(data)
        if isinstance(values, str):
            continue
        time = values.stamp or publish_time
        begin = time if begin is None else begin
        if last is None or time > last:
            last = time
            yield TimedState(time - begin, dict(zip(values.keys, values.numbers, strict=True)))


def _compare_states(
    differences: BagDifferences, first: Iterator[TimedState], second: Iterator[TimedState]
) -> None:
    begin = [*islice(second, _ROWS)]
    longest = longest_step(np.array([state.time for state in begin], float), steady=False)
    second = chain(begin, second)
    before = after = next(second, None)
    for time, values in first:
        while after is not None and after.time < time:
            before, after = after, next(second, None)
        if before is None or after is None:
            return
        # Nothing is known within a gap of the second run.
        if after.time == time or after.time - before.time <= longest:
            differences.add_states(time, values, differences.interpolate(before, after, time))


def _draw_differences(
    differences: BagDifferences, turning: Mapping[str, bool], title: str, file: Path, length: str
) -> None:
    """Draw the least and the greatest difference of each joint over the time."""
    context = picture_settings()
    from matplotlib.figure import Figure  # local import: an extra, and slow to load
    from matplotlib.ticker import AutoLocator

    times, *ends = differences.difference_curves()
    # A curve begins anew where states are missing.
    gaps = np.flatnonzero(is_after_gap(times, steady=True))
    times, lows, highs = (np.insert(values, gaps, np.nan, axis=0) for values in (times, *ends))
    curves = [
        Curve(
            name,
            turning.get(name, True),
            tuple(times.tolist()),
            tuple((0.5 * (lows + highs))[:, column].tolist()),
        )
        for column, name in enumerate(differences.positions)
    ]
    panels = len({curve.turning for curve in curves})
    with context:
        figure = Figure(figsize=(8.0, 0.8 + 2.6 * panels), dpi=120, layout='constrained')
        (axes_of,) = stacked_axes(figure.add_gridspec, [curves])
        lines = plot_joints(axes_of, curves, degrees_x=False, length=length)
        for column, curve in enumerate(curves):
            low, high = (np.degrees(bound) if curve.turning else bound for bound in (lows, highs))
            axes_of[curve.turning].fill_between(
                times,
                low[:, column],
                high[:, column],
                color=lines[curve.name].get_color(),
                alpha=0.3,
                linewidth=0,
            )
        for are_angles, axes in axes_of.items():
            if are_angles:
                axes.yaxis.set_major_locator(AutoLocator())
            axes.set_ylabel(f'difference of {axes.get_ylabel()}')
        axes.set_xlabel('time since the first joint state [s]')
        figure.suptitle(picture_text(title, 160))
        figure.align_ylabels()
        figure.draw_without_rendering()  # only now axes and texts have a size
        label_joints(axes_of, curves, lines)
        save_picture(figure, file)
