# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The plots next to a design: a link's angle over the crank's, and below it the errors."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, pi, tau
from typing import Any, NamedTuple

from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import INK, InputRange, InputSweep, PlanarClosure, Position
from linkage_ros.tools.design.design import Assembly, COUPLER, Design, DesignRequest
from linkage_ros.tools.design.proof import (
    AchievedPosition,
    closed_position,
    closure_of,
    prove,
    SIDES,
)
from linkage_ros.tools.drawing import degree_step, NameLabels, OTHER, OTHER_TEXT, WANTED
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_SAMPLES = 481
_TURNS = (False, False)

_UNITS = (('m', 1.0), ('mm', 1e3), ('µm', 1e6), ('nm', 1e9))
_ROUNDING = 1e-9
"""Smaller errors, relative to the linkage's size, count as none."""

_EVERY = 6
"""One in this many points of a curve is an obstacle for a number."""

_NUMBERED = 12
"""With more positions only every second is numbered, or every third, and so on."""


class DesignPose(NamedTuple):
    """A design at one of its positions, in the assembly that meets it."""

    number: int  # Number of the position, from 1
    wanted: DesignRequest
    met: AchievedPosition
    own: bool  # Whether it is on the design's own assembly
    closure: PlanarClosure  # The linkage in the assembly that meets the position
    position: Position

    @property
    def points(self) -> dict[tuple[str, str], complex]:
        """Return every point of every link, in [m]."""
        return self.closure.points(self.position)


class DesignBranch(NamedTuple):
    """One assembly, while the crank goes through a range."""

    own: bool  # Whether it is the design's own assembly
    limited: bool  # Whether the range ends at toggles
    # Angles of the links, in [rad], without jumps; (n,).
    crank: Array
    rocker: Array
    coupler: Array
    trace: tuple[complex, ...]  # Places of the traced point, in [m]; (n,). Empty if there is none.


def design_poses(design: Design) -> tuple[list[DesignPose], list[int]]:
    """
    Return a design at its positions, and the numbers of positions where it does not close.

    A LinkageError says that it closes at none.
    """
    closures = {side: closure_of(design, side) for side in SIDES}
    closed, open_ = [], []
    for number, (wanted, met) in enumerate(zip(design.wanted, prove(design), strict=True), 1):
        closure = closures[met.side]
        position = closed_position(closure, wanted.crank)
        if position.joints:
            own = met.side == design.four_bar.side
            closed.append(DesignPose(number, wanted, met, own, closure, position))
        else:
            open_.append(number)
    if not closed:
        raise LinkageError(
            'the design', 'closes at none of its positions', 'there is nothing to draw'
        )
    return closed, open_


def swept_branches(design: Design, shown: Sequence[DesignPose]) -> list[DesignBranch]:
    """Return the assemblies of the positions, over the ranges of the crank around these."""
    cranks = [pose.wanted.crank for pose in shown]
    swept: list[DesignBranch] = []
    for side in SIDES:
        if any(pose.met.side == side for pose in shown):
            sweep = InputSweep(closure_of(design, side))
            own = design.four_bar.side
            swept += [
                _sweep_branch(sweep, interval, side, own)
                for interval in _crank_ranges(sweep, cranks)
            ]
    return swept


def _crank_ranges(sweep: InputSweep, cranks: Sequence[float]) -> list[InputRange]:
    """Return the ranges of the positions; for a crank that turns fully, one turn around them."""
    ranges: list[InputRange] = []
    for crank in cranks:
        interval = sweep.range_about(crank)
        if interval is None:
            continue
        if interval.is_whole:
            low, high = min(cranks), max(cranks)
            half = max(pi, 0.5 * (high - low))
            return [InputRange(0.5 * (low + high) - half, 0.5 * (low + high) + half, True, _TURNS)]
        if not any(interval.lowest <= known.highest <= interval.highest for known in ranges):
            ranges.append(interval)
    return ranges


def _sweep_branch(
    sweep: InputSweep, interval: InputRange, side: Assembly, own: Assembly
) -> DesignBranch:
    low, high = interval.lowest, interval.highest
    part = np.linspace(0.0, 1.0, _SAMPLES)
    limited = interval.limited != _TURNS
    if limited:
        # Near a toggle the rocker follows the root of the crank: denser samples for a round curve.
        part = 0.5 - 0.5 * np.cos(pi * part)
    crank, joints, trace = [], [], []
    closure: Any = sweep.closure
    for value in (low + (high - low) * part).tolist():
        position = sweep.position_at(min(max(value, low), high))
        if position.joints:
            crank.append(value)
            joints.append(position.joints)
            if closure.linkage.traced:
                trace.append(closure.points(position)[COUPLER, 'P'])
    relative, rocker = np.unwrap(np.array(joints), axis=0).T
    at = np.array(crank)
    return DesignBranch(side == own, limited, at, rocker, relative + at, tuple(trace))


def is_numbered(number: int, count: int) -> bool:
    """Return whether a position is labelled with its number."""
    return (number - 1) % (1 + (count - 1) // _NUMBERED) == 0


def paint_angles(axes: Any, branches: Sequence[DesignBranch], poses: Sequence[DesignPose]) -> None:
    """Plot the angle of the rocker, or of the coupler if that was wanted, over the crank's."""
    from matplotlib.ticker import MultipleLocator  # local import: an extra, and slow to load

    coupler = _of_coupler(poses)
    link = 'coupler' if coupler else 'rocker'
    both = len({branch.own for branch in branches}) > 1
    labelled: set[str] = set()

    def label_once(text: str) -> str:
        label = '' if text in labelled else text
        labelled.add(text)
        return label

    for branch in sorted(branches, key=lambda branch: not branch.own):
        angles, marks = _place_marks(branch, poses)
        side = ', other assembly' if not branch.own else ', own assembly' if both else ''
        axes.plot(
            np.degrees(branch.crank),
            np.degrees(angles),
            color=INK if branch.own else OTHER,
            linewidth=1.5 if branch.own else 0.9,
            zorder=2.5 if branch.own else 2.0,
            label=label_once(f'{link}{side}'),
        )
        if branch.limited:
            for end in (branch.crank[0], branch.crank[-1]):
                axes.axvline(
                    degrees(end), color='0.45', linewidth=0.8, linestyle=(0, (1, 2)),
                    label=label_once('end of the range'), zorder=0,
                )  # fmt: skip
        for pose, mark in marks:
            wanted = _wanted_angle(pose, coupler)
            axes.plot(
                [mark.real], [mark.imag],
                marker='o', linestyle='', markersize=5.5, markeredgewidth=1.4,
                markerfacecolor='white' if wanted is None else WANTED,
                markeredgecolor=(INK if wanted is None else WANTED) if branch.own else OTHER,
                zorder=5, label=label_once('position' if wanted is None else 'wanted'),
            )  # fmt: skip
    _label_degrees(axes, f'{link} angle [°]')
    axes.yaxis.set_major_locator(MultipleLocator(degree_step(axes.get_ylim())))


def number_angles(
    axes: Any, branches: Sequence[DesignBranch], poses: Sequence[DesignPose]
) -> None:
    """Write the numbers of the positions into that plot, after its layout."""
    names = NameLabels(axes)
    lines = []
    for branch in branches:
        angles, marks = _place_marks(branch, poses)
        lines.append([complex(*at) for at in np.degrees((branch.crank, angles)).T[::_EVERY]])
        for pose, mark in marks:
            if is_numbered(pose.number, len(poses)):
                ink = INK if branch.own else OTHER_TEXT
                style = {'fontsize': 7.5, 'fontweight': 'bold', 'color': ink}
                names.add_name(str(pose.number), (mark,), 6.0, **style)
    names.place_names(lines)


def paint_error(
    axes: Any, error: tuple[ArrayLike, ArrayLike], poses: Sequence[DesignPose]
) -> None:
    """Plot the error of the rocker's angle over the crank's, and mark the positions on it."""
    crank, missed = (np.asarray(values, np.float64) for values in error)
    order = np.argsort(crank, kind='stable')
    crank, missed = np.degrees(crank[order]), np.degrees(missed[order])
    axes.axhline(0.0, color='0.45', linewidth=0.7)
    if len(crank) > len(poses):
        axes.plot(crank, missed, color=INK, linewidth=1.3)
    else:
        axes.vlines(crank, 0.0, missed, color=INK, linewidth=1.3)
    for pose in poses:
        at = degrees(pose.wanted.crank)
        if crank[0] - 1e-6 <= at <= crank[-1] + 1e-6:
            axes.plot(
                [at], [np.interp(at, crank, missed)], 'o', color=WANTED, markersize=4.5, zorder=5
            )
    _label_degrees(axes, 'error of the rocker [°]')
    axes.margins(x=0.03)


def paint_distances(axes: Any, poses: Sequence[DesignPose]) -> None:
    """Plot the distance of the traced point from each of its places."""
    from matplotlib.ticker import MaxNLocator  # local import: an extra, and slow to load

    missed = np.array([pose.met.distance for pose in poses])
    unit, factor = next(
        ((unit, factor) for unit, factor in _UNITS if missed.max(initial=0.0) * factor >= 1.0),
        _UNITS[-1],
    )
    numbers = [pose.number for pose in poses]
    axes.vlines(numbers, 0.0, missed * factor, color=INK, linewidth=1.3)
    axes.plot(numbers, missed * factor, 'o', color=WANTED, markersize=4.5)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel(f'distance [{unit}]')
    axes.set_xlabel('point')
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    _style_axes(axes)


def misses_places(poses: Sequence[DesignPose]) -> bool:
    """Return whether wanted places are missed by more than rounding."""
    size = sum(abs(place) for place in poses[0].points.values())
    return any(pose.met.distance > _ROUNDING * size for pose in poses)


def _wanted_angle(pose: DesignPose, coupler: bool) -> float | None:
    return pose.wanted.coupler if coupler else pose.wanted.rocker


def _crank_on_branch(branch: DesignBranch, crank: float) -> float | None:
    """Return a crank angle with the turns that bring it into a branch's range, or None."""
    low, high = float(branch.crank[0]), float(branch.crank[-1])
    x = crank - tau * round((crank - 0.5 * (low + high)) / tau)
    return x if low - _ROUNDING <= x <= high + _ROUNDING else None


def _of_coupler(poses: Sequence[DesignPose]) -> bool:
    return any(pose.wanted.coupler is not None for pose in poses)


def _place_marks(
    branch: DesignBranch, poses: Sequence[DesignPose]
) -> tuple[Array, list[tuple[DesignPose, complex]]]:
    """
    Return a branch's angles in the wanted turn, and the marks of its positions.

    Angles of the link in [rad]; marks as crank angle + i·(the link's angle), in degrees.
    """
    coupler = _of_coupler(poses)
    angles = branch.coupler if coupler else branch.rocker
    placed = []
    for pose in poses:
        x = _crank_on_branch(branch, pose.wanted.crank)
        if pose.own == branch.own and x is not None:
            y = float(np.interp(x, branch.crank, angles))
            placed.append((pose, x, y, _wanted_angle(pose, coupler)))
    behind = [((wanted or 0.0) - y) / tau for _, _, y, wanted in placed]
    shift = tau * round(float(np.median(behind))) if behind else 0.0
    marks = []
    for pose, x, y, wanted in placed:
        there = y + shift
        at = there if wanted is None else wanted + tau * round((there - wanted) / tau)
        marks.append((pose, complex(degrees(x), degrees(at))))
    return angles + shift, marks


def _label_degrees(axes: Any, label: str) -> None:
    from matplotlib.ticker import MultipleLocator  # local import: an extra, and slow to load

    axes.set_xlabel('crank angle [°]')
    axes.set_ylabel(label)
    axes.xaxis.set_major_locator(MultipleLocator(degree_step(axes.get_xlim())))
    _style_axes(axes)


def _style_axes(axes: Any) -> None:
    axes.tick_params(labelsize=7, width=0.5)
    for side in ('top', 'right'):
        axes.spines[side].set_visible(False)
    axes.grid(alpha=0.25, linewidth=0.5)
