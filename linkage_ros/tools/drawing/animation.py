# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A moving picture of a linkage: its links, and beside them its joints with a mark at the instant.

The shapes are made once, in one pose, and each moves with its link. A GIF and a video are painted
picture by picture. An SVG is the first picture, whose shapes a style sheet moves, so that it needs
no script; a reader who prefers reduced motion sees the first picture.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from math import cos, degrees, isnan, nan, pi
from pathlib import Path
from subprocess import CalledProcessError
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

from linkage_ros.description import atomic_write, check_output_name
from linkage_ros.errors import check_installed, LinkageError
from linkage_ros.kinematics import (
    bounding_corners,
    carried_shapes,
    COLOURS,
    Curve,
    frames_of_links,
    GROUND,
    InputSweep,
    LinkageView,
    Shape,
    shape_outline,
    symbol_size,
)
from linkage_ros.names import picture_text
from linkage_ros.tools.drawing.figure import (
    joint_axes,
    label_across,
    label_joints,
    moved_input,
    plot_joints,
)
from linkage_ros.tools.drawing.painting import (
    LAYERS,
    paint_shapes,
    picture_settings,
    plot_places,
    set_plane,
)
import numpy as np

ANIMATION_KINDS = ('.gif', '.mp4', '.svg')
"""The files that can be written."""

RATE = 20
"""Pictures a second."""

_LONGEST = 30.0
"""In [s]."""

_DPI = {'.gif': 80, '.mp4': 110, '.svg': 72}  # an SVG counts in points
_COMPACT = 0.64
"""Scale of a compact picture."""

_PALETTE = 64
"""Colours of a GIF; with more it looks the same."""

_SVG = '{http://www.w3.org/2000/svg}'
_STYLE = (
    '.moving {{ animation: {seconds:g}s linear infinite }}\n'
    '@media (prefers-reduced-motion: reduce) {{ .moving {{ animation: none }} }}\n'
)
_STEP = 2
"""One in this many pictures is a key of the SVG; it moves evenly between them."""

Advance = Callable[[int, int], Any]
"""Called with the number of pictures that are painted, and of all."""


class AnimatedMotion(NamedTuple):
    """A motion to be shown, at instants 1/`RATE` s apart."""

    title: str  # What moves
    view: LinkageView  # The linkage, in the pose in which its shapes are made
    links: Sequence[str]  # The links and the blocks of sliders that move
    # Position, in [m], and angle, in [rad], of their frames, of shape (instants, links, 3); NaN if
    # unknown: the linkage is hidden then.
    frames: Any
    # Abscissa of the mark at the instants: the first input, in [rad] or [m].
    x: Any
    # Its name, and the unit in which it is shown: ° or m.
    x_name: str
    x_unit: str
    joints: Sequence[Curve]  # The curves of the joints
    # The joints at the instants, of shape (instants, joints), in [rad] or [m]; NaN if unknown.
    values: Any


def count_of(seconds: float) -> int:
    """
    Return the number of pictures.

    A LinkageError is raised if it is less than two pictures, or too long.
    """
    if not 2.0 / RATE <= seconds <= _LONGEST:
        reason = f'{seconds:g} is not between {2.0 / RATE:g} and {_LONGEST:g} s'
        raise LinkageError('seconds', reason, 'name another time')
    return round(seconds * RATE)


def check_kind(file: Path) -> None:
    """
    Check that files of a name can be written here.

    A LinkageError is raised if it is no GIF, MP4 or SVG; matplotlib is missing, or ffmpeg for an
    MP4.
    """
    check_installed('matplotlib', "pip install 'linkage_ros[report]', or apt its package")
    check_output_name(file, ANIMATION_KINDS)
    if file.suffix.lower() == '.mp4':
        from matplotlib.animation import FFMpegWriter  # local import: an extra, and slow to load

        if not FFMpegWriter.isAvailable():
            raise LinkageError('ffmpeg', 'is not installed', 'apt install ffmpeg, or name a GIF')


def range_motion(shown: LinkageView, title: str, seconds: float) -> AnimatedMotion:
    """
    Return the motion through the range of the first input: a turn, or there and back.

    A LinkageError is raised if the time is too short or too long.
    """
    count = count_of(seconds)
    low, high = shown.interval.lowest, shown.interval.highest
    if shown.interval.is_whole:
        start = shown.inputs[0]
        x = [start + (high - low) * i / count for i in range(count)]
        x = [value + shown.interval.shift(value) for value in x]
    else:
        x = [low + (high - low) * 0.5 * (1.0 - cos(2.0 * pi * i / count)) for i in range(count)]
    way = InputSweep(shown.closure, shown.inputs)
    links = tuple(
        link for link in frames_of_links(shown.closure, shown.position) if link != GROUND
    )
    frames = np.full((count, len(links), 3), nan)
    for i, value in enumerate(x):
        position = way.position_at(min(max(value, low), high))
        if not position.joints:
            continue
        found = frames_of_links(shown.closure, position)
        for index, link in enumerate(links):
            place, angle = found[link]
            frames[i, index] = place.real, place.imag, angle
    joints = shown.sweep.joints
    return AnimatedMotion(
        title,
        shown,
        links,
        frames,
        np.array(x),
        *moved_input(shown),
        joints,
        np.column_stack([np.interp(x, joint.x, joint.y) for joint in joints]),
    )


def animate(
    motion: AnimatedMotion,
    file: Path,
    advance: Advance = lambda _done, _of: None,
    *,
    compact: bool = False,
) -> None:
    """
    Write a moving picture: GIF, MP4 or SVG.

    ``advance`` is called after each picture. A ``compact`` picture is read at a width of 400
    pixels: it is smaller, except its letters, and the plane has no axes. Errors are those of
    `check_kind`, or a LinkageError if the file cannot be written.
    """
    check_kind(file)
    kind = file.suffix.lower()
    write = {'.gif': _encode_gif, '.mp4': _encode_mp4, '.svg': _encode_svg}[kind]
    with picture_settings():
        scene = _MovingPicture(motion, _DPI[kind], compact=compact)
        atomic_write(file, write(scene, advance))


class _MovingPicture:
    """The picture, and what moves in it."""

    def __init__(self, motion: AnimatedMotion, dpi: int, *, compact: bool) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg  # an extra, and slow to load
        from matplotlib.figure import Figure

        self.motion = motion
        shown = motion.view
        size = symbol_size(shown)
        drawn = carried_shapes(shown.closure, shown.position, size, shown.sweep.travels)
        low, high = _motion_bounds(motion, drawn)
        margin = complex(2.0, 2.0) * size
        across = high - low + 2.0 * margin
        wide = min(max(3.6 * across.real / across.imag, 2.6), 5.0)
        tall = min(max(wide * across.imag / across.real, 2.6), 3.8)
        scale = _COMPACT if compact else 1.0
        inches = scale * (wide + 3.8), scale * (tall + 0.5)
        self.figure = Figure(figsize=inches, dpi=dpi, layout='constrained')
        self.canvas: Any = FigureCanvasAgg(self.figure)
        grid = self.figure.add_gridspec(1, 2, width_ratios=(wide, 4.8 if compact else 3.4))
        self.plane = self.figure.add_subplot(grid[0])
        self.plane.set_title(picture_text(motion.title, 100), loc='left', fontsize=9)
        set_plane(self.plane, low - margin, high + margin, shown.length)
        if compact:
            self.plane.set_axis_off()
        colours = dict(zip(shown.sweep.paths, COLOURS, strict=False))
        if len(shown.inputs) == 1:
            for name, path in shown.sweep.paths.items():
                plot_places(
                    self.plane, path, color=colours[name], linewidth=1.1, linestyle=(0, (5, 2)),
                    zorder=LAYERS['path'],
                )  # fmt: skip
        self.parts: list[tuple[str, Any]] = []
        for (link, _), artist in zip(
            drawn, paint_shapes(self.plane, [shape for _, shape in drawn]), strict=True
        ):
            artist.set_clip_on(False)
            self.parts.append((link, artist))
        for (link, point), place in shown.closure.points(shown.position).items():
            if point in shown.sweep.paths and link in motion.links:
                (dot,) = plot_places(
                    self.plane, [place], 'o', color=colours[point], markersize=3.5,
                    zorder=LAYERS['label'],
                )  # fmt: skip
                self.parts.append((link, dot))
        self.panels = joint_axes(grid[1], motion.joints)
        lines = plot_joints(
            self.panels,
            motion.joints,
            degrees_x=motion.x_unit == '°',
            steps=round(8 * scale),
            length=shown.length,
        )
        last = list(self.panels.values())[-1]
        label_across(last, motion.x_name, motion.x_unit, shown.length)
        self.marks = [
            axes.axvline(self.mark_x(0), color='0.55', linewidth=0.8, linestyle=':')
            for axes in self.panels.values()
        ]
        self.dots = [
            self.panels[joint.turning].plot(
                [self.mark_x(0)], [self.joint_y(0, index)], 'o', markersize=4.0,
                color=lines[joint.name].get_color(), clip_on=False, zorder=LAYERS['label'],
            )[0]
            for index, joint in enumerate(motion.joints)
        ]  # fmt: skip
        self.figure.draw_without_rendering()  # only now the axes have a size
        label_joints(self.panels, motion.joints, lines)
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine('none')  # the same places in all pictures
        frames = frames_of_links(shown.closure, shown.position)
        self.origin = {link: frames[link] for link in motion.links}
        moving = [artist for _, artist in self.parts] + self.marks + self.dots
        self._front = [
            artist
            for axes in (self.plane, *self.panels.values())
            for artist in sorted(axes.get_children(), key=lambda artist: artist.zorder)
            if artist.zorder >= min(part.zorder for part in moving if part.axes is axes)
        ]
        self._behind: Any = None

    def mark_x(self, i: int) -> float:
        """Return the place of the mark at an instant, as its axis shows it."""
        value = float(self.motion.x[i])
        return degrees(value) if self.motion.x_unit == '°' else value

    def joint_y(self, i: int, number: int) -> float:
        """Return a joint at an instant, as its axis shows it."""
        value = float(self.motion.values[i, number])
        return degrees(value) if self.motion.joints[number].turning else value

    def move_to(self, i: int) -> None:
        """Move everything to an instant."""
        from matplotlib.transforms import Affine2D

        moves = {}
        for index, link in enumerate(self.motion.links):
            x, y, angle = self.motion.frames[i, index]
            if isnan(x):
                continue
            place, made = self.origin[link]
            moves[link] = Affine2D().translate(-place.real, -place.imag)
            moves[link].rotate(angle - made).translate(x, y)
        for link, artist in self.parts:
            if link == GROUND:
                continue
            artist.set_visible(link in moves)
            if link in moves:
                artist.set_transform(moves[link] + self.plane.transData)
        for mark in self.marks:
            mark.set_xdata([self.mark_x(i)] * 2)
        for index, dot in enumerate(self.dots):
            dot.set_data([self.mark_x(i)], [self.joint_y(i, index)])

    def render_pixels(self) -> Any:
        """
        Return the pixels of the picture, of shape (height, width, 3).

        What lies behind all that moves, most of all the letters of the axes, is painted once.
        """
        if self._behind is None:
            for artist in self._front:
                artist.set_animated(True)
            self.canvas.draw()
            self._behind = self.canvas.copy_from_bbox(self.figure.bbox)
        self.canvas.restore_region(self._behind)
        for artist in self._front:
            artist.axes.draw_artist(artist)
        return np.asarray(self.canvas.buffer_rgba())[:, :, :3].copy()

    def svg_places(self, axes: Any, x: Sequence[float], y: Sequence[float]) -> Any:
        """Return places of axes in the coordinates of the SVG, of shape (n, 2)."""
        across, up = axes.transData.transform(np.column_stack([x, y])).T
        return np.column_stack([across, self.figure.bbox.height - up])


def _motion_bounds(
    motion: AnimatedMotion, drawn: Sequence[tuple[str, Shape]]
) -> tuple[complex, complex]:
    """Return the corners of everything that the motion reaches, in [m]."""
    made = frames_of_links(motion.view.closure, motion.view.position)
    places = [place for path in motion.view.sweep.paths.values() for place in path]
    for link, shape in drawn:
        edge = np.array(shape_outline(shape))
        if link == GROUND:
            places += edge.tolist()
            continue
        x, y, angle = motion.frames[:, list(motion.links).index(link)].T
        place, turned = made[link]
        moved = (edge - place)[:, None] * np.exp(1j * (angle - turned)) + (x + 1j * y)
        places += moved[np.isfinite(moved)].tolist()
    return bounding_corners(places)


def _encode_gif(scene: _MovingPicture, advance: Advance) -> bytes:
    from PIL import Image  # local import: comes with matplotlib

    # One palette for all: equal pixels of successive pictures are stored once. At first every
    # part is visible, so the palette has all colours; with this method white stays white.
    palette = Image.fromarray(scene.render_pixels()).quantize(_PALETTE, Image.Quantize.MAXCOVERAGE)
    count = len(scene.motion.x)

    def paletted_pictures() -> Iterator[Image.Image]:
        for i in range(count):
            scene.move_to(i)
            picture = Image.fromarray(scene.render_pixels())
            yield picture.quantize(palette=palette, dither=Image.Dither.NONE)
            advance(i + 1, count)

    first, *others = paletted_pictures()
    data = BytesIO()
    first.save(
        data, 'GIF', save_all=True, append_images=others, duration=1000 // RATE, loop=0,
        optimize=True, disposal=1,
    )  # fmt: skip
    return data.getvalue()


def _encode_mp4(scene: _MovingPicture, advance: Advance) -> bytes:
    from matplotlib.animation import FFMpegWriter

    count = len(scene.motion.x)
    writer = FFMpegWriter(fps=RATE, extra_args=['-pix_fmt', 'yuv420p'])
    with TemporaryDirectory() as folder:
        video = Path(folder) / 'video.mp4'
        try:
            with writer.saving(scene.figure, str(video), scene.figure.dpi):
                for i in range(count):
                    scene.move_to(i)
                    writer.grab_frame()
                    advance(i + 1, count)
        except (CalledProcessError, BrokenPipeError):
            raise LinkageError('ffmpeg', 'does not write an MP4', 'name a GIF') from None
        return video.read_bytes()


def _encode_svg(scene: _MovingPicture, advance: Advance) -> bytes:
    motion = scene.motion
    moving = [(link, artist) for link, artist in scene.parts if link != GROUND]
    marks = (*scene.marks, *scene.dots)
    for index, (_, artist) in enumerate(moving):
        artist.set_gid(f'part{index}')
    for index, artist in enumerate(marks):
        artist.set_gid(f'mark{index}')
    buffer = BytesIO()
    scene.figure.savefig(buffer, format='svg', metadata={'Date': None})
    ET.register_namespace('', _SVG[1:-1])
    ET.register_namespace('xlink', 'http://www.w3.org/1999/xlink')
    tree = ET.fromstring(buffer.getvalue())
    groups = {group.get('id'): group for group in tree.iter(f'{_SVG}g')}
    count = len(motion.x)
    keys = list(range(0, count, _STEP))
    times = [100.0 * key / count for key in keys]
    keys, times = [*keys, 0], [*times, 100.0]
    rules = [_STYLE.format(seconds=count / RATE)]
    firsts = {}
    for index, link in enumerate(motion.links):
        x, y, angle = motion.frames[keys, index].T
        turns = np.full(len(keys), nan)
        known = np.isfinite(angle)
        turns[known] = -np.degrees(np.unwrap(angle[known] - scene.origin[link].angle))
        places = scene.svg_places(scene.plane, x, y)
        rule, firsts[link] = _keyframe_rules(f'link{index}', times, places, turns)
        rules.append(rule)
    for index, (link, _) in enumerate(moving):
        group = groups[f'part{index}']
        origin = scene.origin[link].place
        ((x, y),) = scene.svg_places(scene.plane, [origin.real], [origin.imag])
        inner = ET.Element(f'{_SVG}g')
        inner.set('transform', f'translate({-x:.2f} {-y:.2f})')
        inner.extend(list(group))
        group[:] = [inner]
        group.set('class', f'moving link{motion.links.index(link)}')
        group.set('transform', firsts[link])
        advance(index + 1, len(moving))
    across = [scene.mark_x(key) for key in keys]
    # The mark does not run back when the next turn begins.
    jumps = np.abs(np.diff(across, append=across[-1])) > 0.5 * np.ptp(across)
    panels = [*scene.panels.values(), *(scene.panels[joint.turning] for joint in motion.joints)]
    for index, (panel, mark) in enumerate(zip(panels, marks, strict=True)):
        joint = index - len(scene.marks)
        up = [scene.joint_y(key, joint) if joint >= 0 else 0.0 for key in keys]
        places = scene.svg_places(panel, across, up)
        x, y = mark.get_data()
        places -= scene.svg_places(panel, [x[0]], [y[0] if joint >= 0 else 0.0])
        rule, first = _keyframe_rules(f'at{index}', times, places, np.zeros(len(keys)), jumps)
        rules.append(rule)
        groups[f'mark{index}'].set('class', f'moving at{index}')
        groups[f'mark{index}'].set('transform', first)
    style = ET.SubElement(tree, f'{_SVG}style')
    style.text = ''.join(rules)
    return bytes(ET.tostring(tree, encoding='utf-8', xml_declaration=True))


def _keyframe_rules(
    name: str, times: Sequence[float], places: Any, turns: Any, jumps: Any = False
) -> tuple[str, str]:
    """
    Return the rules that move the groups of a class, and the transform at their first known place.

    Keys have times in [%], places in [px], (keys, 2), and angles in [°], (keys,); a place of NaN
    hides the group. ``jumps`` marks the keys after which it does not move evenly to the next one.
    """
    known = np.isfinite(places).all(axis=1)
    if not known.any():
        return f'.{name} {{ visibility: hidden }}\n', 'translate(0 0)'
    # A hidden group waits at its last known place.
    numbers = np.maximum.accumulate(np.where(known, np.arange(len(known)), known.argmax()))
    jumps = jumps | ~known | ~np.append(known[1:], True)
    keys = []
    for time, here, number, jump in zip(times, known, numbers, jumps, strict=True):
        (x, y), turn = places[number], turns[number]
        turned = f' rotate({turn:.2f}deg)' if turns.any() else ''
        hidden = '' if known.all() else f';visibility:{"visible" if here else "hidden"}'
        step = ';animation-timing-function:step-end' if jump else ''
        keys.append(
            f'{time:.4g}%{{transform:translate({x:.2f}px,{y:.2f}px){turned}{hidden}{step}}}'
        )
    x, y = places[numbers[0]]
    return (
        f'.{name} {{ animation-name: {name} }}\n@keyframes {name} {{{"".join(keys)}}}\n',
        f'translate({x:.2f} {y:.2f}) rotate({turns[numbers[0]]:.2f})',
    )
