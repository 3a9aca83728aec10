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


"""
A designed four-bar painted by matplotlib: at its positions, and beside it its rocker's angle.

The first position is drawn as an engineer draws it, the others as lines behind it, all in the
assembly in which they are met. What was wanted is blue.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from linkage_ros.drawing.design import (
    arrow_ends,
    magnify,
    name_ends,
    paint_poses,
    paint_traces,
    paint_wanted,
    write_numbers,
)
from linkage_ros.drawing.design_curves import (
    misses_places,
    number_angles,
    paint_angles,
    paint_distances,
    paint_error,
)
from linkage_ros.drawing.design_poses import Branch, branches, Pose, poses
from linkage_ros.drawing.painting import (
    bar_size,
    corners,
    save,
    settings,
)
from linkage_ros.kinematics.linkage import GROUND
from linkage_ros.synthesis.design import COUPLER, CRANK, Design, FourBar, ROCKER
from numpy.typing import ArrayLike

_DRAWN, _DRAWN_OF_PATH = 6, 4
"""Positions in which the linkage is drawn, at most; a path is to be seen between them."""

_TINY = 1.0 / 25.0
"""A link shorter than this, of the picture, is drawn once more, larger."""

_MAGNIFIED = 4


def draw_design(
    design: Design,
    title: str,
    file: Path,
    *,
    error: tuple[ArrayLike, ArrayLike] | None = None,
) -> None:
    """
    Paint a design to a file.

    Parameters
    ----------
    design
        The four-bar and what was wanted of it.
    title
        What stands above.
    file
        PNG, SVG or PDF.
    error
        Of the rocker's angle over a range: crank angles, and the errors there, in [rad]; (n,)
        each.

    Raises
    ------
    LinkageError
        Where the design closes at none of its positions, matplotlib is not installed, or the file
        cannot be written.

    """
    context = settings()
    from matplotlib.figure import Figure  # local import: an extra, and slow to load

    shown, missing = poses(design)
    ways = branches(design, shown)
    drawn = _chosen(shown)
    low, high = _frame(design, drawn, ways)
    size = bar_size(abs(high - low), min(design.four_bar.lengths))
    width, height = (high - low).real, (high - low).imag
    wide = min(max(5.2 * width / height, 3.6), 6.2)
    tall = min(max(wide * height / width, 3.6), 5.4)
    link = _tiny(design.four_bar, abs(high - low))
    magnified = drawn[: _MAGNIFIED if link else 0]
    with context:
        below = (wide / max(3, len(magnified)) + 0.3) if link else 0.0
        figure = Figure(figsize=(wide + 4.6, tall + below + 0.8), dpi=110, layout='constrained')
        figure.suptitle(title, x=0.01, ha='left', fontsize=9.5)
        halves: Any = figure.add_gridspec(1, 2, width_ratios=(wide, 4.6))
        left, right = halves
        if link:
            rows = left.subgridspec(2, max(3, len(magnified)), height_ratios=(tall, below))
            axes = figure.add_subplot(rows[0, :])
            panels = [figure.add_subplot(rows[1, i]) for i in range(len(magnified))]
        else:
            axes, panels = figure.add_subplot(left), []
        axes.set_aspect('equal')
        axes.set_xlim(low.real, high.real)
        axes.set_ylim(low.imag, high.imag)
        axes.set_xlabel('x [m]')
        axes.set_ylabel('y [m]')
        axes.tick_params(labelsize=7, width=0.5)
        for side in ('top', 'right'):
            axes.spines[side].set_visible(False)
        paint_wanted(axes, design, shown, abs(high - low))
        paint_traces(axes, ways, drawn)
        paint_poses(axes, drawn, size)
        for panel, pose in zip(panels, magnified, strict=True):
            magnify(panel, pose, link)
        above = _paint_beside(figure, right, ways, shown, error)
        if missing:
            said = ', '.join(map(str, missing))
            axes.plot([], [], ' ', label=f'position {said}: the loop does not close')
        _legend(axes, columns=2)
        figure.draw_without_rendering()  # from here on a text has its size
        _fix_layout(figure)
        write_numbers(axes, design, drawn, ways, size)
        number_angles(above, ways, shown)
        for panel, pose in zip(panels, magnified, strict=True):
            name_ends(panel, pose, link)
        save(figure, file)


def _chosen(shown: Sequence[Pose]) -> list[Pose]:
    """Return the positions in which the linkage is drawn, the first on its own assembly first."""
    traced = all(pose.wanted.place is not None for pose in shown)
    count = min(len(shown), _DRAWN_OF_PATH if traced else _DRAWN)
    spread = [shown[round(i * (len(shown) - 1) / max(1, count - 1))] for i in range(count)]
    first = next((pose for pose in spread if pose.own), spread[0])
    return [first, *(pose for pose in spread if pose is not first)]


def _frame(
    design: Design, drawn: Sequence[Pose], ways: Sequence[Branch]
) -> tuple[complex, complex]:
    """Return the corners of the paper, in [m]."""
    places = [place for pose in drawn for place in pose.points.values()]
    places += [one.place for one in design.wanted if one.place is not None]
    places += [place for way in ways if way.own for place in way.trace]
    low, high = corners(places)
    places += arrow_ends(design, 1.15 * abs(high - low))
    low, high = corners(places)
    margin = 0.07 * abs(high - low)
    # Pivots stand on ground that is drawn, and rays of wanted angles go beyond their pins.
    return low - complex(margin, margin), high + complex(margin, margin)


def _tiny(four_bar: FourBar, picture: float) -> str:
    """Return the link that is too short to be seen; '' for none."""
    lengths = dict(zip((CRANK, COUPLER, ROCKER, GROUND), four_bar.lengths, strict=True))
    link = min(lengths, key=lengths.__getitem__)
    return link if lengths[link] < _TINY * picture else ''


def _paint_beside(
    figure: Any,
    right: Any,
    ways: Sequence[Branch],
    shown: Sequence[Pose],
    error: tuple[ArrayLike, ArrayLike] | None,
) -> Any:
    """Plot what there is to plot beside the linkage, and return the upper axes."""
    places = misses_places(shown)
    if error is None and not places:
        above = figure.add_subplot(right)
    else:
        above, under = map(figure.add_subplot, right.subgridspec(2, 1, height_ratios=(3, 2)))
        if error is not None:
            paint_error(under, error, shown)
        else:
            paint_distances(under, shown)
    paint_angles(above, ways, shown)
    _legend(above, columns=2)
    return above


def _fix_layout(figure: Any) -> None:
    """Keep the axes where they are, rounded: the solver's last digits are not the same twice."""
    figure.set_layout_engine('none')
    for axes in figure.axes:
        places = axes.get_position(original=True).bounds
        axes.set_position([round(place, 6) for place in places])


def _legend(axes: Any, columns: int) -> None:
    """Say what the lines are, above the axes, where no line is."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            loc='lower left', bbox_to_anchor=(0.0, 1.0), ncols=columns, frameon=False, fontsize=7,
            borderaxespad=0.2, columnspacing=1.2,
        )  # fmt: skip
