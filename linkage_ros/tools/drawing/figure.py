# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A picture of a linkage by matplotlib: a pose, and next to it its joints over the input."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import ceil, degrees, sqrt
from pathlib import Path
from textwrap import fill, wrap
from typing import Any

from linkage_ros.description import Units
from linkage_ros.kinematics import (
    all_places,
    bounding_corners,
    COLOURS,
    Curve,
    draw_shapes,
    INK,
    LinkageView,
    pose_text,
    SAME_ANGLE,
    shape_outline,
    symbol_size,
)
from linkage_ros.names import picture_text
from linkage_ros.tools.drawing.drawn_linkage import draw_linkage
from linkage_ros.tools.drawing.painting import (
    degree_step,
    DrawnLinkage,
    GHOST,
    label_ends,
    LAYERS,
    make_faint,
    NAME_INK,
    NameLabels,
    paint_frame,
    paint_shapes,
    picture_settings,
    plot_places,
    save_picture,
    set_plane,
    show_lengths,
)

_DASHES: tuple[Any, ...] = ('-', (0, (5, 1.5)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)))
"""Whole, dashed, dotted, and both: four times as many curves as colours are told apart."""


def _pose_text(shown: LinkageView) -> str:
    """Return the pose: inputs, place on the axis, and which limit it exceeds."""
    text = f'{pose_text(shown.closure, shown.inputs)}{_turns_text(shown)}{_beyond_text(shown)}'
    return Units(shown.length, 'degrees').convert_quantities(text).replace(' deg', '°')


def _turns_text(shown: LinkageView) -> str:
    """Return where the mark is, if that is not the angle that was named."""
    if abs(shown.mark - shown.inputs[0]) < SAME_ANGLE:
        return ''
    return f' ({degrees(shown.mark):.4g}° on the axis)'


def _beyond_text(shown: LinkageView) -> str:
    beyond = shown.closure.limit_exceeded(shown.position)
    return f' (limited: {beyond})' if beyond else ''


def paint_picture(
    shown: LinkageView,
    title: str,
    file: Path,
    *,
    names: bool = False,
    camera: Sequence[float | None] = (None, None),
) -> None:
    """
    Paint a picture to a file; a spatial linkage from a camera, as `draw_linkage` does.

    A LinkageError is raised if matplotlib is not installed, or the file cannot be written.
    """
    context = picture_settings()
    from matplotlib.figure import Figure  # local import: an extra, and slow to load

    drawn = draw_linkage(shown, camera)
    low, high = drawn.corners(3.0)
    width, height = (high - low).real, (high - low).imag
    wide = min(max(4.9 * width / height, 3.0), 6.4)
    tall = min(max(wide * height / width, 3.2), 4.9)
    joints = shown.sweep.joints
    with context:
        figure = Figure(figsize=(wide + 5.4, tall + 0.5), dpi=110, layout='constrained')
        grid = figure.add_gridspec(1, 2, width_ratios=(wide, 4.7))
        left = figure.add_subplot(grid[0])
        panels = joint_axes(grid[1], joints)
        pose = _pose_text(shown)
        heading, width = picture_text(f'{title}, {pose}', 120), max(40, round(12.0 * wide))
        if len(heading) > width:
            # A character that breaks no line stands for the spaces that are not between inputs.
            whole = pose.replace(' ', '\u00a0').replace(',\u00a0', ', ')
            broken = wrap(whole, width, break_long_words=False, break_on_hyphens=False)
            lines_of_heading = (title, *(line.replace('\u00a0', ' ') for line in broken))
            heading = '\n'.join(picture_text(line, 120) for line in lines_of_heading)
        if drawn.camera:
            azimuth, elevation = map(degrees, drawn.camera)
            heading += f'\nfrom azimuth {azimuth:.4g}°, elevation {elevation:.4g}°'
        left.set_title(heading, loc='left', fontsize=9)
        paint_linkage(left, drawn, 3.0)
        turning_input = not shown.closure.linkage.inputs[0].slider
        lines = plot_joints(panels, joints, degrees_x=turning_input, length=shown.length)
        # A pose beyond the limits has no place on the axis.
        if shown.interval.lowest <= shown.mark <= shown.interval.highest:
            now = degrees(shown.mark) if turning_input else shown.mark
            for axes in panels.values():
                axes.axvline(now, color='0.55', linewidth=0.8, linestyle=':')
        label_across(list(panels.values())[-1], *moved_input(shown), shown.length)
        figure.draw_without_rendering()  # only now axes and texts have a size
        label_joints(panels, joints, lines)
        if names:
            figure.draw_without_rendering()
            _write_names(left, drawn)
        save_picture(figure, file)


def paint_linkage(axes: Any, drawn: DrawnLinkage, margin: float) -> None:
    """Paint a linkage to axes that show all of it, with a margin in half widths of a bar."""
    low, high = drawn.corners(margin)
    if drawn.camera:
        low -= complex(0.0, 0.16 * abs(high - low))  # for the frame
    set_plane(axes, low, high, drawn.length)
    paint_background(axes, drawn)
    artists = paint_shapes(axes, drawn.shapes)
    for artist, strength in zip(artists, drawn.strengths, strict=False):
        make_faint(artist, strength)
    if drawn.camera:
        axes.set_axis_off()
        paint_frame(axes, drawn, low, high)


def assemblies_picture(views: Mapping[str, LinkageView], file: Path) -> None:
    """
    Paint the same linkage in several assemblies, each under the text that a file needs for it.

    A LinkageError is raised if matplotlib is not installed, or the file cannot be written.
    """
    context = picture_settings()
    from matplotlib.figure import Figure  # local import: an extra, and slow to load

    size = min(map(symbol_size, views.values()))
    low, high = bounding_corners(place for shown in views.values() for place in all_places(shown))
    margin = complex(4.0, 4.0) * size
    ratio = (high - low + 2.0 * margin).imag / (high - low + 2.0 * margin).real
    rows = ceil(len(views) / ceil(sqrt(len(views) * ratio)))
    columns = ceil(len(views) / rows)
    wide = min(max(9.0 / columns, 2.6), 4.6)
    with context:
        figure = Figure(
            figsize=(columns * wide, rows * (wide * ratio + 0.45)), dpi=110, layout='constrained'
        )
        first = next(iter(views.values()))
        for number, (text, shown) in enumerate(views.items(), 1):
            axes = figure.add_subplot(rows, columns, number)
            title = fill(picture_text(text, 200), round(15.0 * wide), subsequent_indent='  ')
            if shown.inputs != first.inputs:
                title += f'\nat {picture_text(_pose_text(shown))}'
            axes.set_title(title, loc='left', fontsize=7.5, family='monospace')
            set_plane(axes, low - margin, high + margin)
            axes.set_axis_off()
            paint_background(axes, draw_linkage(shown))
            paint_shapes(
                axes, draw_shapes(shown.closure, shown.position, size, shown.sweep.travels)
            )
        save_picture(figure, file)


def paint_background(axes: Any, drawn: DrawnLinkage) -> None:
    """Paint poses in light grey, and the paths of the traced points dashed."""
    for index, ghost in enumerate(drawn.ghosts):
        for line in ghost:
            plot_places(
                axes,
                (line.start, line.end),
                color=GHOST,
                alpha=1.0 - 0.75 * index / len(drawn.ghosts),  # the later, the paler
                linewidth=1.0,
                marker='' if drawn.camera else 'o',
                markersize=2.0,
                zorder=LAYERS['ghost'],
            )
    for index, (name, path) in enumerate(drawn.paths.items()):
        colour = COLOURS[index % len(COLOURS)]
        plot_places(
            axes,
            path,
            color=colour,
            linewidth=1.1,
            linestyle=(0, (5, 2)),
            zorder=LAYERS['path'],
        )
        dot = [drawn.dots[name]]
        plot_places(axes, dot, 'o', color=colour, markersize=3.5, zorder=LAYERS['label'])


def joint_axes(place: Any, joints: Sequence[Curve]) -> dict[bool, Any]:
    """Return the axes for angles (key True) and for slides (False), above each other."""
    return stacked_axes(place.subgridspec, [joints])[0]


def stacked_axes(
    add_grid: Callable[..., Any], parts: Sequence[Sequence[Curve]]
) -> list[dict[bool, Any]]:
    """Return the axes of each part, as `joint_axes`, all above each other with one left edge."""
    kinds = [sorted({joint.turning for joint in part}, reverse=True) for part in parts]
    panels = iter(add_grid(sum(map(len, kinds)), 1).subplots(sharex=True, squeeze=False)[:, 0])
    return [{kind: next(panels) for kind in of_part} for of_part in kinds]


def curve_look(index: int) -> dict[str, Any]:
    """Return colour and dashes of a curve: after the last colour they begin anew, in dashes."""
    return {
        'color': COLOURS[index % len(COLOURS)],
        'linestyle': _DASHES[index // len(COLOURS) % len(_DASHES)],
    }


def plot_joints(
    panels: Mapping[bool, Any],
    joints: Sequence[Curve],
    *,
    degrees_x: bool,
    steps: int = 8,
    length: str = 'm',
) -> dict[str, Any]:
    """Plot joints; return their lines by name. `label_joints` labels their ends."""
    from matplotlib.ticker import MultipleLocator  # local import: an extra, and slow to load

    lines = {}
    for index, joint in enumerate(joints):
        (lines[joint.name],) = panels[joint.turning].plot(
            [degrees(x) for x in joint.x] if degrees_x else joint.x,
            [degrees(y) for y in joint.y] if joint.turning else joint.y,
            **curve_look(index),
            linewidth=1.3,
            label=picture_text(joint.name, 40),
        )
    for turning, axes in panels.items():
        if turning:
            axes.set_ylabel('joint angle [°]')
            axes.yaxis.set_major_locator(
                MultipleLocator(degree_step(axes.get_ylim(), steps // len(panels)))
            )
        else:
            show_lengths(axes.yaxis, 'slide', max(map(abs, axes.get_ylim())), length)
        axes.tick_params(labelsize=7, width=0.5)
        axes.margins(x=0.0)
        axes.grid(alpha=0.25, linewidth=0.5)
        for side in ('top', 'right'):
            axes.spines[side].set_visible(False)
    if degrees_x:
        axes = next(iter(panels.values()))
        axes.xaxis.set_major_locator(MultipleLocator(degree_step(axes.get_xlim(), steps)))
    return lines


def label_joints(panels: Mapping[bool, Any], joints: Sequence[Curve], lines: Any) -> None:
    """Write the names of joints at the ends of their lines; the figure has been drawn once."""
    for turning, axes in panels.items():
        label_ends(axes, [lines[joint.name] for joint in joints if joint.turning == turning])


def moved_input(shown: LinkageView) -> tuple[str, str]:
    """Return the name and the unit of the input that moves."""
    driven = shown.closure.linkage.inputs[0]
    held = ', the others held' if len(shown.inputs) > 1 else ''
    return f'{picture_text(driven.joint)}{held}', 'm' if driven.slider else '°'


def label_across(axes: Any, name: str, unit: str, length: str = 'm') -> None:
    """Label the axis of the abscissa; of a length, as `unit_of_length` has it."""
    if unit == 'm':
        show_lengths(axes.xaxis, name, max(map(abs, axes.get_xlim())), length)
    else:
        axes.set_xlabel(f'{name} [{unit}]')


def _write_names(axes: Any, drawn: DrawnLinkage) -> None:
    """Write the names where they hide little."""
    names = NameLabels(axes)
    radius = abs(names.to_pixel(complex(drawn.size, 0.0)) - names.to_pixel(0j))
    for text, anchors, is_link, clear in drawn.names:
        look: dict[str, Any] = {'fontsize': 7.5, 'fontweight': 'bold', 'color': INK}
        if is_link:
            look = {'fontsize': 6.5, 'fontstyle': 'italic', 'color': NAME_INK}
        names.add_name(text, anchors, clear * radius, **look)
    lines = [shape_outline(shape) for shape in drawn.shapes]
    lines += [shape_outline(line) for line in drawn.skeleton]
    names.place_names(lines)
