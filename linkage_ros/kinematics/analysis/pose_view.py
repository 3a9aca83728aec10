# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A pose of a linkage and the motion about it, as pictures, pages and markers show them."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, remainder, tau
from typing import Any, NamedTuple

from linkage_ros.errors import LinkageError
from linkage_ros.kinematics.analysis.curves import RangeSweep, sweep_range
from linkage_ros.kinematics.analysis.shapes import bar_size, bounding_corners, draw_skeleton
from linkage_ros.kinematics.analysis.sweep_analysis import InputSweep
from linkage_ros.kinematics.plane.linkage import GROUND
from linkage_ros.kinematics.results import InputRange, Position

_GHOSTS = 5
SAME_ANGLE = 1e-9
"""Largest difference of angles that counts as rounding, in [rad]."""


class LinkageView(NamedTuple):
    """The content of a picture."""

    closure: Any  # The linkage: a `PlanarClosure`, or a `SpaceClosure`
    # The pose to draw.
    inputs: tuple[float, ...]
    position: Position
    ghosts: tuple[Position, ...]  # Poses in the background
    are_ghosts_given: bool  # Or else they cover the range
    interval: InputRange  # Range of the first input around the pose, with the others held
    mark: float  # The first input, less the whole turns by which it lies outside of that range
    sweep: RangeSweep  # The motion through that range
    length: str = 'm'  # Unit of lengths in texts; from metres a picture may go to millimetres


def prepare_view(
    closure: Any, inputs: tuple[float, ...], ghosts: Sequence[tuple[float, ...]] = ()
) -> LinkageView:
    """
    Prepare a picture of a pose, with others in the background.

    By default these cover the whole range. A LinkageError says that a pose does not close.
    """
    position = _close_loops(closure, inputs)
    input_sweep = InputSweep(closure, inputs)
    value = inputs[0]
    # A pose beyond the limits lies in no range; show the widest one.
    about = input_sweep.range_about(value) or input_sweep.widest_range
    about = about or InputRange(value, value, input_sweep.turning)
    interval = _find_range(input_sweep, about)
    shift = about.shift(value) if about.is_whole else interval.lowest - about.lowest
    if ghosts:
        behind = [_close_loops(closure, inputs) for inputs in ghosts]
    elif interval.is_whole:
        turn = interval.highest - interval.lowest
        behind = [
            input_sweep.position_at(value + turn * i / (_GHOSTS + 1))
            for i in range(1, _GHOSTS + 1)
        ]
    else:
        low, high = interval.lowest, interval.highest
        behind = [
            input_sweep.position_at(low + (high - low) * i / (_GHOSTS - 1)) for i in range(_GHOSTS)
        ]
    return LinkageView(
        closure,
        inputs,
        position,
        tuple(ghost for ghost in behind if ghost.joints),
        bool(ghosts),
        interval,
        value + shift,
        sweep_range(input_sweep, interval),
    )


def _find_range(input_sweep: InputSweep, about: InputRange) -> InputRange:
    """Return a range with the turns with which it is among the ranges."""
    if not about.turning or about in input_sweep.ranges:
        return about
    for interval in input_sweep.ranges:
        period = tau * interval.turns
        if period and abs(remainder(about.lowest - interval.lowest, period)) < SAME_ANGLE:
            return interval
    return about


def _close_loops(closure: Any, inputs: tuple[float, ...]) -> Position:
    position: Position = closure.position(*inputs)
    if not position.joints:
        ranges = InputSweep(closure, inputs).ranges
        near = ' or '.join(_ends_text(interval) for interval in ranges)
        held = ', the others held' if near and len(inputs) > 1 else ''
        raise LinkageError(
            pose_text(closure, inputs),
            f'{position.status.value}, the links miss each other by {position.gap:.3g} m',
            f'closes from {near}{held}' if near else 'name another pose',
        )
    return position


def _ends_text(interval: InputRange) -> str:
    low, high = interval.lowest, interval.highest
    if interval.turning:
        return f'{degrees(low):.6g} to {degrees(high):.6g}°'
    return f'{low:.6g} to {high:.6g} m'


def pose_text(closure: Any, inputs: tuple[float, ...]) -> str:
    """Return the inputs of a pose as text, each with its joint."""
    return ', '.join(
        f'{driven.joint} {value:.4g} m'
        if driven.slider
        else f'{driven.joint} {degrees(value):.4g}°'
        for driven, value in zip(closure.linkage.inputs, inputs, strict=True)
    )


def all_places(shown: LinkageView) -> list[complex]:
    """Return all places that any part passes, in [m]."""
    places = [place for path in shown.sweep.paths.values() for place in path]
    for position in (shown.position, *shown.ghosts):
        for line in draw_skeleton(shown.closure, position):
            places += (line.start, line.end)
    return places


def symbol_size(shown: LinkageView) -> float:
    """Return half the width of a bar, in [m], for the picture and its shortest link."""
    low, high = bounding_corners(all_places(shown))
    picture = abs(high - low)
    points = shown.closure.points(shown.position)
    bars = [
        abs(points[link, first] - points[link, second])
        for link, named in shown.closure.linkage.links.items()
        if link != GROUND
        for first in named
        for second in named
        if first < second and points[link, first] != points[link, second]
    ]
    shortest = min(bars, default=picture)
    return bar_size(picture, shortest)
