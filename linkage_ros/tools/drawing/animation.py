# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A moving picture of a linkage: its links, and next to them its joints with a mark at the instant.

The shapes are made once, in one pose, and each moves with its link. A GIF and a video are painted
picture by picture. An SVG is the first picture, whose shapes a style sheet moves, so that it needs
no script; a reader who prefers reduced motion sees the first picture. A spatial linkage is
projected anew for each picture, so it has no SVG.
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
    Position,
    Shape,
    shape_outline,
    SpaceClosure,
    SpaceDrawing,
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
    make_faint,
    paint_frame,
    paint_shapes,
    picture_settings,
    plot_places,
    set_plane,
)
from linkage_ros.tools.drawing.space_drawing import draw_spatial, projected_shapes
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

_LOOKED_AT = 6
"""Pictures from which the colours are taken, where these change."""

_BEFORE_END = 1e-7
"""So far from the ends of a range a linkage in space is shown, relative to its length."""

_CURVE: Any = {'linewidth': 1.1, 'linestyle': (0, (5, 2)), 'zorder': LAYERS['path']}
_DOT: Any = {'markersize': 3.5, 'zorder': LAYERS['label']}

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
    links: Sequence[str]  # The links and the blocks of sliders that move; () in space
    # Position, in [m], and angle, in [rad], of their frames, of shape (instants, links, 3); NaN if
    # unknown: the linkage is hidden then. In space the places of the drawing, in [m].
    frames: Any
    # Abscissa of the mark at the instants: the first input, in [rad] or [m].
    x: Any
    # Its name, and the unit in which it is shown: ° or m.
    x_name: str
    x_unit: str
    joints: Sequence[Curve]  # The curves of the joints
    # The joints at the instants, of shape (instants, joints), in [rad] or [m]; NaN if unknown.
    values: Any
    camera: Sequence[float | None] = (None, None)  # In space, as `choose_camera` takes it


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

    A LinkageError is raised if it is none of GIF, MP4, SVG; if matplotlib is missing, or ffmpeg
    for an MP4.
    """
    check_installed('matplotlib', "pip install 'linkage_ros[report]', or apt its package")
    check_output_name(file, ANIMATION_KINDS)
    if file.suffix.lower() == '.mp4':
        from matplotlib.animation import FFMpegWriter  # local import: an extra, and slow to load

        if not FFMpegWriter.isAvailable():
            raise LinkageError('ffmpeg', 'is not installed', 'apt install ffmpeg, or name a GIF')


def range_motion(
    shown: LinkageView,
    title: str,
    seconds: float,
    camera: Sequence[float | None] = (None, None),
) -> AnimatedMotion:
    """
    Return the motion through the range of the first input: a turn, or there and back.

    A spatial linkage is seen from a camera, whose angles `choose_camera` takes. A LinkageError is
    raised if the time is too short or too long.
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
    links, frames_at = _frames_of(shown)
    frames = np.full((count, *frames_at(shown.position).shape), nan)
    # In space the end of a range is known to its rounding: it may be open.
    slack = 0.0 if links or shown.interval.is_whole else _BEFORE_END * (high - low)
    for i, value in enumerate(x):
        position = way.position_at(min(max(value, low + slack), high - slack))
        if position.joints:
            frames[i] = frames_at(position)
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
        camera,
    )


def _frames_of(shown: LinkageView) -> tuple[tuple[str, ...], Callable[[Position], Any]]:
    """Return the links that move, and their frames at a position; in space places instead."""
    if isinstance(shown.closure, SpaceClosure):
        return (), SpaceDrawing(shown.closure).places
    moving = [link for link in frames_of_links(shown.closure, shown.position) if link != GROUND]

    def frames_at(position: Position) -> Any:
        frame_of = frames_of_links(shown.closure, position)
        frames = [frame_of[link] for link in moving]
        return np.array([(place.real, place.imag, angle) for place, angle in frames])

    return tuple(moving), frames_at


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
    if kind == '.svg' and isinstance(motion.view.closure, SpaceClosure):
        raise LinkageError(
            str(file),
            'a style sheet moves shapes, and does not project them from a camera',
            f'write {file.with_suffix(".gif").name}',
        )
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
        in_space = isinstance(shown.closure, SpaceClosure)
        self.linkage: Any = _SpatialShapes(motion) if in_space else _PlanarShapes(motion)
        low, high = self.linkage.low, self.linkage.high
        across = high - low
        wide = min(max(3.6 * across.real / across.imag, 2.6), 5.0)
        tall = min(max(wide * across.imag / across.real, 2.6), 3.8)
        scale = _COMPACT if compact else 1.0
        inches = scale * (wide + 3.8), scale * (tall + 0.5)
        self.figure = Figure(figsize=inches, dpi=dpi, layout='constrained')
        self.canvas: Any = FigureCanvasAgg(self.figure)
        grid = self.figure.add_gridspec(1, 2, width_ratios=(wide, 4.8 if compact else 3.4))
        self.plane = self.figure.add_subplot(grid[0])
        self.plane.set_title(picture_text(motion.title, 100), loc='left', fontsize=9)
        set_plane(self.plane, low, high, shown.length)
        if compact or in_space:
            self.plane.set_axis_off()
        self.linkage.paint(self.plane)
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
        self._behind: Any = None

    def _artists_in_front(self) -> list[Any]:
        """Return what is painted anew in each picture: all from the lowest part that moves on."""
        moving = [*self.linkage.artists, *self.marks, *self.dots]
        return [
            artist
            for axes in (self.plane, *self.panels.values())
            for artist in sorted(axes.get_children(), key=lambda artist: artist.zorder)
            if artist.zorder >= min(part.zorder for part in moving if part.axes is axes)
        ]

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
        self.linkage.move_to(i)
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
            for artist in self._artists_in_front():
                artist.set_animated(True)
            self.canvas.draw()
            self._behind = self.canvas.copy_from_bbox(self.figure.bbox)
        self.canvas.restore_region(self._behind)
        for artist in self._artists_in_front():
            artist.axes.draw_artist(artist)
        return np.asarray(self.canvas.buffer_rgba())[:, :, :3].copy()

    def svg_places(self, axes: Any, x: Sequence[float], y: Sequence[float]) -> Any:
        """Return places of axes in the coordinates of the SVG, of shape (n, 2)."""
        across, up = axes.transData.transform(np.column_stack([x, y])).T
        return np.column_stack([across, self.figure.bbox.height - up])


class _PlanarShapes:
    """A planar linkage: shapes in one pose, each moved with its link."""

    changes_colours = False

    def __init__(self, motion: AnimatedMotion) -> None:
        self._motion, shown = motion, motion.view
        size = symbol_size(shown)
        self._drawn = carried_shapes(shown.closure, shown.position, size, shown.sweep.travels)
        low, high = _motion_bounds(motion, self._drawn)
        margin = complex(2.0, 2.0) * size
        self.low, self.high = low - margin, high + margin
        frames = frames_of_links(shown.closure, shown.position)
        self.origin = {link: frames[link] for link in motion.links}
        self.parts: list[tuple[str, Any]] = []

    @property
    def artists(self) -> list[Any]:
        """Return the artists of all parts."""
        return [artist for _, artist in self.parts]

    def paint(self, plane: Any) -> None:
        """Paint the parts and the curves of traced points."""
        motion, shown = self._motion, self._motion.view
        self._plane = plane
        colours = dict(zip(shown.sweep.paths, COLOURS, strict=False))
        if len(shown.inputs) == 1:
            for name, path in shown.sweep.paths.items():
                plot_places(plane, path, color=colours[name], **_CURVE)
        shapes = [shape for _, shape in self._drawn]
        for (link, _), artist in zip(self._drawn, paint_shapes(plane, shapes), strict=True):
            artist.set_clip_on(False)
            self.parts.append((link, artist))
        for (link, point), place in shown.closure.points(shown.position).items():
            if point in shown.sweep.paths and link in motion.links:
                (dot,) = plot_places(plane, [place], 'o', color=colours[point], **_DOT)
                self.parts.append((link, dot))

    def move_to(self, i: int) -> None:
        """Move all parts to an instant."""
        from matplotlib.transforms import Affine2D

        moves = {}
        for index, link in enumerate(self._motion.links):
            x, y, angle = self._motion.frames[i, index]
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
                artist.set_transform(moves[link] + self._plane.transData)


class _SpatialShapes:
    """A spatial linkage: its parts, projected anew at each instant, those far away fainter."""

    changes_colours = True

    def __init__(self, motion: AnimatedMotion) -> None:
        self._motion, self._drawing = motion, SpaceDrawing(motion.view.closure)
        known = motion.frames[np.isfinite(motion.frames).all(axis=(1, 2))]
        shown = self._drawing.places(motion.view.position)
        self._drawn = draw_spatial(motion.view, motion.camera)
        seen, _ = self._drawn.camera.project(np.concatenate([shown, *known]))
        margin = 3.0 * (1 + 1j) * self._drawing.size
        low, high = bounding_corners(seen.tolist())
        self.low, self.high = low - margin, high + margin
        self.artists: list[Any] = []

    def paint(self, plane: Any) -> None:
        """Paint the parts in the pose, the directions of the axes, and the curves."""
        self._plane, drawn = plane, self._drawn
        # Next to the linkage, where nothing comes by.
        self.low -= 0.1 * (self.high - self.low)
        plane.set_xlim(self.low.real, self.high.real)
        plane.set_ylim(self.low.imag, self.high.imag)
        paint_frame(plane, drawn, self.low, self.high)
        self._colours = dict(zip(drawn.paths, COLOURS, strict=False))
        if len(self._motion.view.inputs) == 1:
            for name, path in drawn.paths.items():
                plot_places(plane, path, color=self._colours[name], **_CURVE)
        self._show(self._drawing.places(self._motion.view.position))

    def move_to(self, i: int) -> None:
        """Project all parts at an instant; where nothing is known, there are none."""
        self._show(self._motion.frames[i])

    def _show(self, places: Any) -> None:
        for artist in self.artists:
            artist.remove()
        hidden = not np.isfinite(places).all()
        if hidden:
            places = self._drawing.places(self._motion.view.position)
        camera = self._drawn.camera
        shapes = projected_shapes(self._drawing, places, camera)
        self.artists = paint_shapes(self._plane, [shape for shape, _ in shapes])
        for artist, (_, strength) in zip(self.artists, shapes, strict=True):
            make_faint(artist, strength)
        seen, _ = camera.project(places)
        for name, colour in self._colours.items():
            at = complex(seen[self._drawing.points[name]])
            self.artists += plot_places(self._plane, [at], 'o', color=colour, **_DOT)
        for artist in self.artists:
            artist.set_visible(not hidden)


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
    count, seen = len(scene.motion.x), [scene.render_pixels()]
    for i in range(0, count if scene.linkage.changes_colours else 0, max(1, count // _LOOKED_AT)):
        scene.move_to(i)
        seen.append(scene.render_pixels())
    palette = Image.fromarray(np.concatenate(seen)).quantize(_PALETTE, Image.Quantize.MAXCOVERAGE)

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
    moving = [(link, artist) for link, artist in scene.linkage.parts if link != GROUND]
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
        turns[known] = -np.degrees(np.unwrap(angle[known] - scene.linkage.origin[link].angle))
        places = scene.svg_places(scene.plane, x, y)
        rule, firsts[link] = _keyframe_rules(f'link{index}', times, places, turns)
        rules.append(rule)
    for index, (link, _) in enumerate(moving):
        group = groups[f'part{index}']
        origin = scene.linkage.origin[link].place
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
