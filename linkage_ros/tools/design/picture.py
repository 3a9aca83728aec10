# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A picture of a designed four-bar: its positions, and next to it its rocker's angle.

The first position is drawn as an engineer draws it, the others as lines behind it, each in the
assembly that meets it. Wanted values are blue. A short link is drawn again, enlarged.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Sequence
from math import degrees, remainder, tau
from pathlib import Path
from typing import Any

from linkage_ros.kinematics import (
    bar_size,
    bounding_corners,
    draw_shapes,
    draw_skeleton,
    drawn_once,
    GROUND,
    INK,
    shape_outline,
)
from linkage_ros.names import picture_text
from linkage_ros.tools.design.design import COUPLER, CRANK, Design, FourBar, ROCKER
from linkage_ros.tools.design.picture_curves import (
    design_poses,
    DesignBranch,
    DesignPose,
    is_numbered,
    misses_places,
    number_angles,
    paint_angles,
    paint_distances,
    paint_error,
    swept_branches,
)
from linkage_ros.tools.drawing import (
    LAYERS,
    NameLabels,
    OTHER,
    OTHER_TEXT,
    paint_shapes,
    picture_settings,
    plot_places,
    save_picture,
    set_plane,
    TRACE,
    WANTED,
)
from numpy.typing import ArrayLike

_BEHIND = '#a3a3a3'
_BEHIND_TEXT = '#5f5f5f'

_EVERY = 6
"""One in this many places of a path is an obstacle for a number."""

_DRAWN, _DRAWN_OF_PATH = 6, 4
"""Most positions that are drawn; fewer for a path, which should be visible between them."""

_TINY = 1.0 / 25.0
"""A link shorter than this, relative to the picture, is drawn again, enlarged."""

_MAGNIFIED = 4


def paint_wanted(axes: Any, design: Design, shown: Sequence[DesignPose], picture: float) -> None:
    """Paint rays to wanted rocker pins, crosses at wanted places, frames at wanted poses."""
    four_bar = design.four_bar
    pivot = four_bar.pivots[1]
    # Below all else, and wide: the line of an exact rocker runs in its middle.
    pale = {'color': WANTED, 'alpha': 0.3, 'linewidth': 3.5, 'zorder': 0.5}
    rays = 'wanted rocker angle φ' + _zero_note(four_bar.rocker, 'its pin at φ')
    places, frames = 'wanted place of P', 'wanted pose at P (long: x axis)'
    for wanted in design.wanted:
        if wanted.rocker is not None:
            end = pivot + _wanted_ray(four_bar, wanted.rocker, picture)
            plot_places(axes, (pivot, end), label=rays, **pale)
            rays = ''
        if wanted.place is not None and wanted.coupler is None:
            plot_places(
                axes, [wanted.place], linestyle='', marker='x', markersize=6.0,
                markeredgewidth=1.5, color=WANTED, zorder=LAYERS['label'], label=places,
            )  # fmt: skip
            places = ''
        if wanted.place is not None and wanted.coupler is not None:
            for end in _axes_of(wanted.place, wanted.coupler, picture):
                axes.annotate(
                    '', (end.real, end.imag), (wanted.place.real, wanted.place.imag),
                    arrowprops={
                        'arrowstyle': '-|>', 'color': WANTED, 'linewidth': 1.3,
                        'shrinkA': 0.0, 'shrinkB': 0.0, 'mutation_scale': 7.0,
                    },
                    zorder=LAYERS['label'],
                )  # fmt: skip
            axes.plot([], [], color=WANTED, linewidth=1.3, label=frames)
            frames = ''
    turned = _zero_note(four_bar.crank, 'crank pin at θ')
    if turned:
        axes.plot([], [], ' ', label=turned.lstrip(', '))


def arrow_ends(design: Design, picture: float) -> list[complex]:
    """Return the ends of the axes of wanted poses."""
    return [
        end
        for wanted in design.wanted
        if wanted.place is not None and wanted.coupler is not None
        for end in _axes_of(wanted.place, wanted.coupler, picture)
    ]


def paint_traces(axes: Any, ways: Sequence[DesignBranch], drawn: Sequence[DesignPose]) -> None:
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


def paint_poses(axes: Any, drawn: Sequence[DesignPose], size: float) -> None:
    """Paint the first position as bodies and the others as lines."""
    first, *others = drawn
    labelled: set[str] = set()
    for pose in others:
        label = 'other positions' if pose.own else 'met on the other assembly'
        for line in draw_skeleton(pose.closure, pose.position):
            plot_places(
                axes, (line.start, line.end), color=_pose_colour(pose),
                linewidth=1.0 if pose.own else 1.3, marker='o', markersize=2.4,
                zorder=LAYERS['ghost'] + (0.0 if pose.own else 0.5),
                label='' if label in labelled else label,
            )  # fmt: skip
            labelled.add(label)
    paint_shapes(axes, draw_shapes(first.closure, first.position, size, {}))
    if (COUPLER, 'P') in first.points:
        place = first.points[COUPLER, 'P']
        plot_places(axes, [place], 'o', color=TRACE, markersize=4.0, zorder=7)


def paint_magnified(panel: Any, pose: DesignPose, link: str) -> None:
    """Paint a position again, enlarged around a link that is too short to see."""
    middle, length = 0.5 * sum(_link_ends(pose, link).values()), _link_length(pose, link)
    panel.set_aspect('equal')
    panel.set_xlim(middle.real - 1.3 * length, middle.real + 1.3 * length)
    panel.set_ylim(middle.imag - 1.3 * length, middle.imag + 1.3 * length)
    paint_shapes(panel, draw_shapes(pose.closure, pose.position, 0.13 * length, {}))
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


def name_ends(panel: Any, pose: DesignPose, link: str) -> None:
    """Name the pins of an enlarged link."""
    names = NameLabels(panel)
    for name, place in _link_ends(pose, link).items():
        radius = (
            0.13 * abs(names.to_pixel(1.0 + 0j) - names.to_pixel(0j)) * _link_length(pose, link)
        )
        names.add_name(name, (place,), 1.2 * radius, fontsize=7.5, color=INK)
    lines = draw_skeleton(pose.closure, pose.position)
    names.place_names([(line.start, line.end) for line in lines])


def write_numbers(
    axes: Any,
    design: Design,
    drawn: Sequence[DesignPose],
    ways: Sequence[DesignBranch],
    size: float,
) -> None:
    """Write the numbers of positions and wanted values, and the names of the pivots."""
    names = NameLabels(axes)
    one_size = abs(names.to_pixel(complex(size, 0.0)) - names.to_pixel(0j))
    count = len(design.wanted)
    for name, pivot in zip(('O2', 'O4'), design.four_bar.pivots, strict=True):
        names.add_name(name, (pivot,), 1.3 * one_size, fontsize=7.5, color=INK)
    for pose in drawn:
        a, b = pose.points[CRANK, 'A'], pose.points[ROCKER, 'B']
        together = abs(names.to_pixel(a) - names.to_pixel(b)) < 16.0
        style = {
            'fontsize': 8.0,
            'fontweight': 'bold',
            'color': (INK if pose is drawn[0] else _BEHIND_TEXT) if pose.own else OTHER_TEXT,
        }
        clear = 1.3 * one_size if pose is drawn[0] else 4.0
        for pin in (0.5 * (a + b),) if together else (a, b):
            names.add_name(str(pose.number), (pin,), clear, **style)
    picture = abs(complex(*(axes.viewLim.max - axes.viewLim.min)))
    blue = {'fontsize': 7.0, 'color': WANTED}
    for number, wanted in enumerate(design.wanted, 1):
        if not is_numbered(number, count):
            continue
        if wanted.rocker is not None:
            end = design.four_bar.pivots[1] + _wanted_ray(design.four_bar, wanted.rocker, picture)
            names.add_name(f'{degrees(wanted.rocker):.4g}°'.replace('-', '−'), (end,), 2.0, **blue)
        if wanted.place is not None:
            names.add_name(str(number), (wanted.place,), 5.0, **blue)
    lines = [
        shape_outline(shape)
        for shape in draw_shapes(drawn[0].closure, drawn[0].position, size, {})
    ]
    lines += [way.trace[::_EVERY] for way in ways if way.trace]
    for pose in drawn:
        lines += [(line.start, line.end) for line in draw_skeleton(pose.closure, pose.position)]
    names.place_names(lines)


def _pose_colour(pose: DesignPose) -> str:
    return _BEHIND if pose.own else OTHER


def _axes_of(place: complex, angle: float, picture: float) -> tuple[complex, complex]:
    """Return the ends of the x and the y axis of a pose."""
    return place + rect(0.09 * picture, angle), place + rect(0.055 * picture, angle + 0.25 * tau)


def _wanted_ray(four_bar: FourBar, angle: float, picture: float) -> complex:
    """Return the vector from O4 through the wanted pin of the rocker, and a little beyond."""
    reach = abs(four_bar.rocker)
    return rect(reach + 0.045 * picture, angle + phase(four_bar.rocker))


def _zero_note(pin: complex, text: str) -> str:
    """Return the legend text for a link whose pin is not on the x axis of its frame."""
    angle = degrees(phase(pin))
    if abs(remainder(angle, 360.0)) < 1e-9:
        return ''
    return f', {text} {"+" if angle > 0.0 else "−"} {abs(angle):.4g}°'


def _link_ends(pose: DesignPose, link: str) -> dict[str, complex]:
    ends = {name: place for (carrier, name), place in pose.points.items() if carrier == link}
    return {name: place for name, place in ends.items() if name != 'P'}


def _link_length(pose: DesignPose, link: str) -> float:
    start, end = _link_ends(pose, link).values()
    return abs(end - start)


def draw_design(
    design: Design,
    title: str,
    file: Path,
    *,
    error: tuple[ArrayLike, ArrayLike] | None = None,
) -> None:
    """
    Paint a design to a PNG, SVG or PDF file.

    ``error`` is the error of the rocker's angle over a range: crank angles and the errors there,
    in [rad], (n,) each. A LinkageError is raised if the design closes at none of its positions,
    matplotlib is not installed, or the file cannot be written.
    """
    context = picture_settings()
    from matplotlib.figure import Figure  # local import: an extra, and slow to load

    shown, missing = design_poses(design)
    ways = swept_branches(design, shown)
    drawn = _poses_to_draw(shown)
    low, high = _drawing_corners(design, drawn, ways)
    size = bar_size(abs(high - low), min(design.four_bar.lengths))
    width, height = (high - low).real, (high - low).imag
    wide = min(max(5.2 * width / height, 3.6), 6.2)
    tall = min(max(wide * height / width, 3.6), 5.4)
    link = _tiny_link(design.four_bar, abs(high - low))
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
            paint_magnified(panel, pose, link)
        above = _paint_beside(figure, right, ways, shown, error)
        if missing:
            numbers = ', '.join(map(str, missing))
            axes.plot([], [], ' ', label=f'position {numbers}: the loop does not close')
        _write_legend(axes, columns=2)
        figure.draw_without_rendering()  # only now a text has a size
        _fix_layout(figure)
        write_numbers(axes, design, drawn, ways, size)
        number_angles(above, ways, shown)
        for panel, pose in zip(panels, magnified, strict=True):
            name_ends(panel, pose, link)
        save_picture(figure, file)


def _poses_to_draw(shown: Sequence[DesignPose]) -> list[DesignPose]:
    """Return the positions to draw; the first of them on the design's own assembly comes first."""
    traced = all(pose.wanted.place is not None for pose in shown)
    count = min(len(shown), _DRAWN_OF_PATH if traced else _DRAWN)
    spread = [shown[round(i * (len(shown) - 1) / max(1, count - 1))] for i in range(count)]
    first = next((pose for pose in spread if pose.own), spread[0])
    return [first, *(pose for pose in spread if pose is not first)]


def _drawing_corners(
    design: Design, drawn: Sequence[DesignPose], ways: Sequence[DesignBranch]
) -> tuple[complex, complex]:
    """Return the corners of the drawing, in [m]."""
    places = [place for pose in drawn for place in pose.points.values()]
    places += [wanted.place for wanted in design.wanted if wanted.place is not None]
    places += [place for way in ways if way.own for place in way.trace]
    low, high = bounding_corners(places)
    places += arrow_ends(design, 1.15 * abs(high - low))
    low, high = bounding_corners(places)
    margin = 0.07 * abs(high - low)
    # The ground of the pivots and the rays of wanted angles extend beyond the pins.
    return low - complex(margin, margin), high + complex(margin, margin)


def _tiny_link(four_bar: FourBar, picture: float) -> str:
    """Return the link that is too short to see, or ''."""
    lengths = dict(zip((CRANK, COUPLER, ROCKER, GROUND), four_bar.lengths, strict=True))
    link = min(lengths, key=lengths.__getitem__)
    return link if lengths[link] < _TINY * picture else ''


def _paint_beside(
    figure: Any,
    right: Any,
    ways: Sequence[DesignBranch],
    shown: Sequence[DesignPose],
    error: tuple[ArrayLike, ArrayLike] | None,
) -> Any:
    """Paint the plots next to the linkage, and return the upper axes."""
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
    _write_legend(above, columns=2)
    return above


def _fix_layout(figure: Any) -> None:
    """Fix the axes at rounded places: the last digits of the layout solver are not repeatable."""
    figure.set_layout_engine('none')
    for axes in figure.axes:
        places = axes.get_position(original=True).bounds
        axes.set_position([round(place, 6) for place in places])


def _write_legend(axes: Any, columns: int) -> None:
    """Write the legend above the axes, where no line is."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            loc='lower left', bbox_to_anchor=(0.0, 1.0), ncols=columns, frameon=False, fontsize=7,
            borderaxespad=0.2, columnspacing=1.2,
        )  # fmt: skip
