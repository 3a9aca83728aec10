# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A picture of a designed four-bar: its positions, and beside it its rocker's angle.

The first position is drawn as an engineer draws it, the others as lines behind it, each in the
assembly that meets it. Wanted values are blue. A short link is drawn again, enlarged.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Sequence
from math import degrees, remainder, tau
from pathlib import Path
from typing import Any

from linkage_ros.drawing.design_curves import (
    Branch,
    branches,
    misses_places,
    number_angles,
    numbered,
    paint_angles,
    paint_distances,
    paint_error,
    Pose,
    poses,
)
from linkage_ros.drawing.painting import (
    LAYERS,
    Names,
    OTHER,
    OTHER_TEXT,
    paint,
    plot_places,
    save,
    set_plane,
    settings,
    TRACE,
    WANTED,
)
from linkage_ros.kinematics.curves import drawn_once
from linkage_ros.kinematics.linkage import GROUND
from linkage_ros.kinematics.shapes import bar_size, corners, INK, outline, shapes, skeleton
from linkage_ros.names import picture_text
from linkage_ros.synthesis.design import COUPLER, CRANK, Design, FourBar, ROCKER
from numpy.typing import ArrayLike

_BEHIND = '#a3a3a3'
_BEHIND_TEXT = '#5f5f5f'

_EVERY = 6
"""Every so many places of a path are obstacles for a number."""


def paint_wanted(axes: Any, design: Design, shown: Sequence[Pose], picture: float) -> None:
    """Paint rays to wanted rocker pins, crosses at wanted places, frames at wanted poses."""
    four_bar = design.four_bar
    pivot = four_bar.pivots[1]
    # Below all else, and wide: the line of an exact rocker runs in its middle.
    pale = {'color': WANTED, 'alpha': 0.3, 'linewidth': 3.5, 'zorder': 0.5}
    rays = 'wanted rocker angle φ' + _zero(four_bar.rocker, 'its pin at φ')
    places, frames = 'wanted place of P', 'wanted pose at P (long: x axis)'
    for one in design.wanted:
        if one.rocker is not None:
            end = pivot + _ray(four_bar, one.rocker, picture)
            plot_places(axes, (pivot, end), label=rays, **pale)
            rays = ''
        if one.place is not None and one.coupler is None:
            plot_places(
                axes, [one.place], linestyle='', marker='x', markersize=6.0, markeredgewidth=1.5,
                color=WANTED, zorder=LAYERS['label'], label=places,
            )  # fmt: skip
            places = ''
        if one.place is not None and one.coupler is not None:
            for end in _axes_of(one.place, one.coupler, picture):
                axes.annotate(
                    '', (end.real, end.imag), (one.place.real, one.place.imag),
                    arrowprops={
                        'arrowstyle': '-|>', 'color': WANTED, 'linewidth': 1.3,
                        'shrinkA': 0.0, 'shrinkB': 0.0, 'mutation_scale': 7.0,
                    },
                    zorder=LAYERS['label'],
                )  # fmt: skip
            axes.plot([], [], color=WANTED, linewidth=1.3, label=frames)
            frames = ''
    turned = _zero(four_bar.crank, 'crank pin at θ')
    if turned:
        axes.plot([], [], ' ', label=turned.lstrip(', '))


def arrow_ends(design: Design, picture: float) -> list[complex]:
    """Return the ends of the axes of wanted poses."""
    return [
        end
        for one in design.wanted
        if one.place is not None and one.coupler is not None
        for end in _axes_of(one.place, one.coupler, picture)
    ]


def paint_traces(axes: Any, ways: Sequence[Branch], drawn: Sequence[Pose]) -> None:
    """Paint the path of the traced point on every assembly that meets a position."""
    label = 'path of P'
    for way in ways:
        if way.trace and (way.own or not all(pose.own for pose in drawn)):
            path = drawn_once(way.trace)
            plot_places(
                axes, path, color=TRACE if way.own else OTHER, linewidth=1.2 if way.own else 0.8,
                linestyle=(0, (5, 2)), zorder=LAYERS['path'], label=label if way.own else '',
            )  # fmt: skip
            label = '' if way.own else label


def paint_poses(axes: Any, drawn: Sequence[Pose], size: float) -> None:
    """Paint the first position as bodies and the others as lines."""
    first, *others = drawn
    labelled: set[str] = set()
    for pose in others:
        label = 'other positions' if pose.own else 'met on the other assembly'
        for line in skeleton(pose.closure, pose.position):
            plot_places(
                axes, (line.start, line.end), color=_ink(pose),
                linewidth=1.0 if pose.own else 1.3, marker='o', markersize=2.4,
                zorder=LAYERS['ghost'] + (0.0 if pose.own else 0.5),
                label='' if label in labelled else label,
            )  # fmt: skip
            labelled.add(label)
    paint(axes, shapes(first.closure, first.position, size, {}))
    if (COUPLER, 'P') in first.points:
        place = first.points[COUPLER, 'P']
        plot_places(axes, [place], 'o', color=TRACE, markersize=4.0, zorder=7)


def magnify(panel: Any, pose: Pose, link: str) -> None:
    """Paint a position again, enlarged around a link that is too short to see."""
    middle, length = 0.5 * sum(_ends(pose, link).values()), _length(pose, link)
    panel.set_aspect('equal')
    panel.set_xlim(middle.real - 1.3 * length, middle.real + 1.3 * length)
    panel.set_ylim(middle.imag - 1.3 * length, middle.imag + 1.3 * length)
    paint(panel, shapes(pose.closure, pose.position, 0.13 * length, {}))
    panel.set_xticks([])
    panel.set_yticks([])
    ink = INK if pose.own else OTHER
    for spine in panel.spines.values():
        spine.set_edgecolor(ink)
        spine.set_linewidth(0.8 if pose.own else 1.6)
    times = f'{link} at {pose.number}'
    panel.set_title(
        times if pose.own else f'{times}, other assembly',
        fontsize=7.5, color=INK if pose.own else OTHER_TEXT,
    )  # fmt: skip


def name_ends(panel: Any, pose: Pose, link: str) -> None:
    """Name the pins of an enlarged link."""
    names = Names(panel)
    for name, place in _ends(pose, link).items():
        radius = 0.13 * abs(names.pixel(1.0 + 0j) - names.pixel(0j)) * _length(pose, link)
        names.want(name, (place,), 1.2 * radius, fontsize=7.5, color=INK)
    lines = skeleton(pose.closure, pose.position)
    names.place([(line.start, line.end) for line in lines])


def write_numbers(
    axes: Any, design: Design, drawn: Sequence[Pose], ways: Sequence[Branch], size: float
) -> None:
    """Write the numbers of positions and wanted values, and the names of the pivots."""
    names = Names(axes)
    one_size = abs(names.pixel(complex(size, 0.0)) - names.pixel(0j))
    count = len(design.wanted)
    for name, pivot in zip(('O2', 'O4'), design.four_bar.pivots, strict=True):
        names.want(name, (pivot,), 1.3 * one_size, fontsize=7.5, color=INK)
    for pose in drawn:
        a, b = pose.points[CRANK, 'A'], pose.points[ROCKER, 'B']
        together = abs(names.pixel(a) - names.pixel(b)) < 16.0
        style = {
            'fontsize': 8.0,
            'fontweight': 'bold',
            'color': (INK if pose is drawn[0] else _BEHIND_TEXT) if pose.own else OTHER_TEXT,
        }
        clear = 1.3 * one_size if pose is drawn[0] else 4.0
        for pin in (0.5 * (a + b),) if together else (a, b):
            names.want(str(pose.number), (pin,), clear, **style)
    picture = abs(complex(*(axes.viewLim.max - axes.viewLim.min)))
    blue = {'fontsize': 7.0, 'color': WANTED}
    for number, one in enumerate(design.wanted, 1):
        if not numbered(number, count):
            continue
        if one.rocker is not None:
            end = design.four_bar.pivots[1] + _ray(design.four_bar, one.rocker, picture)
            names.want(f'{degrees(one.rocker):.4g}°'.replace('-', '−'), (end,), 2.0, **blue)
        if one.place is not None:
            names.want(str(number), (one.place,), 5.0, **blue)
    lines = [outline(shape) for shape in shapes(drawn[0].closure, drawn[0].position, size, {})]
    lines += [way.trace[::_EVERY] for way in ways if way.trace]
    for pose in drawn:
        lines += [(line.start, line.end) for line in skeleton(pose.closure, pose.position)]
    names.place(lines)


def _ink(pose: Pose) -> str:
    return _BEHIND if pose.own else OTHER


def _axes_of(place: complex, angle: float, picture: float) -> tuple[complex, complex]:
    """Return the ends of the x and the y axis of a pose."""
    return place + rect(0.09 * picture, angle), place + rect(0.055 * picture, angle + 0.25 * tau)


def _ray(four_bar: FourBar, angle: float, picture: float) -> complex:
    """Return the vector from O4 through the wanted pin of the rocker, and a little beyond."""
    reach = abs(four_bar.rocker)
    return rect(reach + 0.045 * picture, angle + phase(four_bar.rocker))


def _zero(pin: complex, text: str) -> str:
    """Return the legend text for a link whose pin is not on the x axis of its frame."""
    angle = degrees(phase(pin))
    if abs(remainder(angle, 360.0)) < 1e-9:
        return ''
    return f', {text} {"+" if angle > 0.0 else "−"} {abs(angle):.4g}°'


def _ends(pose: Pose, link: str) -> dict[str, complex]:
    ends = {name: place for (carrier, name), place in pose.points.items() if carrier == link}
    return {name: place for name, place in ends.items() if name != 'P'}


def _length(pose: Pose, link: str) -> float:
    one, other = _ends(pose, link).values()
    return abs(other - one)


_DRAWN, _DRAWN_OF_PATH = 6, 4
"""Most positions that are drawn; fewer for a path, which should be visible between them."""

_TINY = 1.0 / 25.0
"""A link shorter than this, relative to the picture, is drawn again, enlarged."""

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
        The four-bar and its wanted positions.
    title
        Title of the picture.
    file
        PNG, SVG or PDF.
    error
        Error of the rocker's angle over a range: crank angles, and the errors there, in [rad];
        (n,) each.

    Raises
    ------
    LinkageError
        If the design closes at none of its positions, matplotlib is not installed, or the file
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
        figure.suptitle(picture_text(title, 140), x=0.01, ha='left', fontsize=9.5)
        halves: Any = figure.add_gridspec(1, 2, width_ratios=(wide, 4.6))
        left, right = halves
        if link:
            rows = left.subgridspec(2, max(3, len(magnified)), height_ratios=(tall, below))
            axes = figure.add_subplot(rows[0, :])
            panels = [figure.add_subplot(rows[1, i]) for i in range(len(magnified))]
        else:
            axes, panels = figure.add_subplot(left), []
        set_plane(axes, low, high)
        paint_wanted(axes, design, shown, abs(high - low))
        paint_traces(axes, ways, drawn)
        paint_poses(axes, drawn, size)
        for panel, pose in zip(panels, magnified, strict=True):
            magnify(panel, pose, link)
        above = _paint_beside(figure, right, ways, shown, error)
        if missing:
            numbers = ', '.join(map(str, missing))
            axes.plot([], [], ' ', label=f'position {numbers}: the loop does not close')
        _legend(axes, columns=2)
        figure.draw_without_rendering()  # only now a text has a size
        _fix_layout(figure)
        write_numbers(axes, design, drawn, ways, size)
        number_angles(above, ways, shown)
        for panel, pose in zip(panels, magnified, strict=True):
            name_ends(panel, pose, link)
        save(figure, file)


def _chosen(shown: Sequence[Pose]) -> list[Pose]:
    """Return the positions to draw; the first of them on the design's own assembly comes first."""
    traced = all(pose.wanted.place is not None for pose in shown)
    count = min(len(shown), _DRAWN_OF_PATH if traced else _DRAWN)
    spread = [shown[round(i * (len(shown) - 1) / max(1, count - 1))] for i in range(count)]
    first = next((pose for pose in spread if pose.own), spread[0])
    return [first, *(pose for pose in spread if pose is not first)]


def _frame(
    design: Design, drawn: Sequence[Pose], ways: Sequence[Branch]
) -> tuple[complex, complex]:
    """Return the corners of the drawing, in [m]."""
    places = [place for pose in drawn for place in pose.points.values()]
    places += [one.place for one in design.wanted if one.place is not None]
    places += [place for way in ways if way.own for place in way.trace]
    low, high = corners(places)
    places += arrow_ends(design, 1.15 * abs(high - low))
    low, high = corners(places)
    margin = 0.07 * abs(high - low)
    # The ground of the pivots and the rays of wanted angles extend beyond the pins.
    return low - complex(margin, margin), high + complex(margin, margin)


def _tiny(four_bar: FourBar, picture: float) -> str:
    """Return the link that is too short to see, or ''."""
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
    """Paint the plots beside the linkage, and return the upper axes."""
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
    """Fix the axes at rounded places: the last digits of the layout solver are not repeatable."""
    figure.set_layout_engine('none')
    for axes in figure.axes:
        places = axes.get_position(original=True).bounds
        axes.set_position([round(place, 6) for place in places])


def _legend(axes: Any, columns: int) -> None:
    """Write the legend above the axes, where no line is."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            loc='lower left', bbox_to_anchor=(0.0, 1.0), ncols=columns, frameon=False, fontsize=7,
            borderaxespad=0.2, columnspacing=1.2,
        )  # fmt: skip
