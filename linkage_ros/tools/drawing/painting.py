# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The common parts of all pictures: colours, painting of shapes, placing of names, saving."""

from __future__ import annotations

from cmath import rect
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import BytesIO
from itertools import pairwise
from math import ceil, floor, inf, isnan, log10, pi
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple
from warnings import catch_warnings, filterwarnings

from linkage_ros.description import atomic_write, LENGTHS
from linkage_ros.errors import check_installed, LinkageError
from linkage_ros.kinematics import (
    bounding_corners,
    Circle,
    COLOURS,
    FACES,
    INK,
    Polygon,
    Segment,
    Shape,
    shape_outline,
)
from linkage_ros.names import picture_text

_DIRECTIONS = 16
_DISTANCES = 9
_ROUNDS = 3
_GAP = 4.0
"""Smallest distance between two names, in pixels."""

WANTED, TRACE, OTHER = COLOURS[0], COLOURS[2], COLOURS[4]
"""Colours in a design: wanted values, path of a point, other assembly."""

OTHER_TEXT = '#a86b00'
"""Colour of text about the other assembly, dark enough to read."""

NAME_INK = '#35608a'
GHOST = '#cfcfcf'
LAYERS: dict[str, int] = {'ghost': 1, 'path': 2, 'shape': 3, 'label': 6}

_STEPS = (1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 90.0, 180.0)

_FONT_SIZE = 7.0
"""Of names next to lines, in points."""
STROKES = {
    'rail': (INK, 1.3),
    'hatch': (INK, 0.7),
    'slot': ('#ffffff', 2.2),
    'axis': (NAME_INK, 0.7),
}
_DASH_DOT = (0, (9, 2, 1.5, 2))
_SETTINGS: Any = {
    'font.size': 8.0,
    'svg.hashsalt': 'linkage_ros',
    'axes.linewidth': 0.6,
    'text.parse_math': False,  # a name between dollar signs is not a formula
}


class DrawnName(NamedTuple):
    """A name to be written next to one of some places, the first the best."""

    text: str
    anchors: Sequence[complex]
    is_link: bool = False
    clear: float = 1.2  # Of the anchor, in half widths of a bar


class DrawnLinkage(NamedTuple):
    """A linkage as it is painted; all lengths in [m]."""

    size: float  # Half the width of a bar
    shapes: Sequence[Shape]  # The topmost last
    skeleton: Sequence[Segment]  # The links as lines
    ghosts: Sequence[Sequence[Segment]]  # Poses in the background
    paths: Mapping[str, Sequence[complex]]  # Of the traced points
    dots: Mapping[str, complex]  # The traced points
    names: Sequence[DrawnName]
    strengths: Sequence[float] = ()  # How strong shapes are painted; those behind are fainter
    camera: Any = None  # The `Camera` of a spatial linkage
    has_lengths: bool = True
    length: str = 'm'  # As `LinkageView.length`

    def corners(self, margin: float) -> tuple[complex, complex]:
        """Return lower left and upper right of all, with a margin in half widths of a bar."""
        places = [place for shape in self.shapes for place in shape_outline(shape)]
        places += [place for path in self.paths.values() for place in path]
        for lines in (self.skeleton, *self.ghosts):
            places += [end for line in lines for end in shape_outline(line)]
        low, high = bounding_corners(places)
        edge = margin * self.size * (1.0 + 1.0j)
        return low - edge, high + edge


class Label(NamedTuple):
    """A name to be placed; all sizes in one unit, such as pixels."""

    anchors: tuple[complex, ...]  # Places that it may be next to; the first is the best
    # Size of the text.
    width: float
    height: float
    clear: float  # Distance of its box from the anchor


class PlacedText(NamedTuple):
    """Place of a label's centre, and its anchor."""

    centre: complex
    anchor: complex


def place_labels(
    labels: Sequence[Label],
    obstacles: Sequence[complex],
    frame: tuple[complex, complex],
) -> list[PlacedText]:
    """
    Place labels one after the other, each where it hides least.

    The obstacles are points of lines and shapes; the frame is the lower left and the upper right
    corner of the drawing.
    """
    placed: list[PlacedText] = []
    for label in labels:
        placed.append(
            _best_place(label, obstacles, frame, list(zip(labels, placed, strict=False)))
        )
    # The first ones did not know the others.
    for _ in range(_ROUNDS):
        for index, label in enumerate(labels):
            pairs = enumerate(zip(labels, placed, strict=True))
            others = [pair for number, pair in pairs if number != index]
            placed[index] = _best_place(label, obstacles, frame, others)
    return placed


def _best_place(
    label: Label,
    obstacles: Sequence[complex],
    frame: tuple[complex, complex],
    others: Sequence[tuple[Label, PlacedText]],
) -> PlacedText:
    """Return the place at which a label hides least."""
    half_width, half_height = 0.5 * label.width, 0.5 * label.height
    best: tuple[float, PlacedText] | None = None
    for rank, anchor in enumerate(label.anchors):
        for ring in range(_DISTANCES):
            for i in range(_DIRECTIONS):
                way = rect(1.0, pi / 4.0 + i * 2.0 * pi / _DIRECTIONS)
                # The box touches a circle around the anchor.
                away = label.clear + 0.45 * ring * label.height
                centre = anchor + complex(
                    way.real * (away + half_width), way.imag * (away + half_height)
                )
                cost = 0.6 * ring + 0.3 * rank + 0.01 * i
                cost += 400.0 * sum(
                    _is_overlapping(
                        centre, half_width, half_height, neighbour.centre, 0.5 * box.width,
                        0.5 * box.height,
                    )
                    for box, neighbour in others
                )  # fmt: skip
                cost += 20.0 * _is_outside(centre, half_width, half_height, frame)
                if best is None or cost < best[0]:
                    cost += 40.0 * _count_struck(label, PlacedText(centre, anchor), others)
                if best is None or cost < best[0]:
                    cost += 2.5 * _count_inside(centre, half_width, half_height, obstacles)
                    if best is None or cost < best[0]:
                        best = cost, PlacedText(centre, anchor)
    assert best is not None, 'a label has an anchor'
    return best[1]


def _count_struck(
    label: Label, placed: PlacedText, others: Sequence[tuple[Label, PlacedText]]
) -> int:
    """Count the labels that a leader strikes: others by this one's, and this one by others'."""
    struck = 0
    for box, neighbour in others:
        for (leads, start), (neighbour_box, at) in (
            ((label, placed), (box, neighbour)),
            ((box, neighbour), (label, placed)),
        ):
            if has_leader(leads, start):
                line = _points_between(start.anchor, leader_end(leads, start))
                struck += bool(
                    _count_inside(
                        at.centre, 0.5 * neighbour_box.width, 0.5 * neighbour_box.height, line
                    )
                )
    return struck


def _count_inside(centre: complex, width: float, height: float, points: Sequence[complex]) -> int:
    return sum(
        abs(p.real - centre.real) < width and abs(p.imag - centre.imag) < height for p in points
    )


def _is_overlapping(
    centre: complex,
    width: float,
    height: float,
    other_centre: complex,
    its_width: float,
    its_height: float,
) -> bool:
    apart = other_centre - centre
    return abs(apart.real) < width + its_width and abs(apart.imag) < height + its_height


def _is_outside(
    centre: complex, width: float, height: float, frame: tuple[complex, complex]
) -> bool:
    low, high = frame
    return (
        centre.real - width < low.real
        or centre.real + width > high.real
        or centre.imag - height < low.imag
        or centre.imag + height > high.imag
    )


def picture_settings() -> Any:
    """Return the matplotlib context of a picture; a LinkageError without matplotlib."""
    check_installed('matplotlib', "pip install 'linkage_ros[report]', or apt its package")
    return _apply_settings()


@contextmanager
def _apply_settings() -> Iterator[None]:
    import matplotlib as mpl  # local import: an extra, and slow to load

    with mpl.rc_context(_SETTINGS), catch_warnings():
        # A letter that is not in the font is a box in the picture.
        filterwarnings('ignore', 'Glyph', UserWarning)
        yield


def save_picture(figure: Any, file: Path) -> None:
    """Save a picture; equal pictures give equal bytes. A LinkageError if it cannot be written."""
    kind = file.suffix[1:].lower() or 'png'
    metadata = {'png': {'Software': None}, 'svg': {'Date': None}}.get(kind)
    picture = BytesIO()
    try:
        figure.savefig(picture, format=kind, metadata=metadata)
    except ValueError as error:
        raise LinkageError(
            file, f'cannot be written ({error})', 'name another picture with -o'
        ) from None
    atomic_write(file, picture.getvalue())


def spread_places(places: Sequence[float], gap: float) -> list[float]:
    """Return places moved as little as possible until neighbours are a gap apart; same order."""
    order = sorted(range(len(places)), key=places.__getitem__)
    # Without the gaps the places may be equal but not fall: the mean of each run that falls.
    runs: list[list[float]] = []
    for rank, index in enumerate(order):
        runs.append([places[index] - rank * gap])
        while len(runs) > 1 and fmean(runs[-2]) > fmean(runs[-1]):
            last = runs.pop()
            runs[-1] += last
    moved = [fmean(run) for run in runs for _ in run]
    spread = [0.0] * len(places)
    for rank, index in enumerate(order):
        spread[index] = moved[rank] + rank * gap
    return spread


def label_ends(axes: Any, lines: Sequence[Any]) -> None:
    """
    Write the names of lines at their right ends, next to the axes.

    The axes' limits are final. The heights of the axes are from the last drawing.
    """
    low, high = axes.get_ylim()
    height = axes.get_window_extent().height / axes.figure.dpi * 72.0  # in points, as the font
    gap = 1.25 * _FONT_SIZE / height
    lasts = [next((y for y in reversed(line.get_ydata()) if not isnan(y)), low) for line in lines]
    ends = [(last - low) / (high - low) for last in lasts]
    for line, place in zip(lines, spread_places(ends, gap), strict=True):
        axes.text(
            1.01, place, line.get_label(), transform=axes.transAxes, va='center', ha='left',
            fontsize=_FONT_SIZE, color=line.get_color(),
        )  # fmt: skip


def unit_of_length(size: float, length: str = 'm') -> tuple[str, float]:
    """
    Return the unit in which people read lengths, and how many make one m.

    It is the unit of their file, ``length``; if that is the metre, it is chosen for the size, in
    [m].
    """
    unit = 'mm' if length == 'm' and size < 1.0 else length
    return unit, 1.0 / float(LENGTHS[unit])


def show_lengths(axis: Any, name: str, size: float, length: str = 'm') -> None:
    """Let an axis in [m] show a length as `unit_of_length` has it; name it."""
    from matplotlib.ticker import AutoLocator  # local import: an extra, and slow to load

    class RoundInUnit(AutoLocator):
        """Ticks at round numbers of the unit."""

        def tick_values(self, vmin: float, vmax: float) -> Any:
            ticks: Any = super().tick_values(vmin * factor, vmax * factor)
            return ticks / factor

    unit, factor = unit_of_length(size, length)
    axis.set_major_locator(RoundInUnit())
    axis.set_major_formatter(lambda value, _: f'{value * factor:.6g}'.replace('-', '−'))
    axis.axes.set(**{f'{axis.axis_name}label': f'{name} [{unit}]'})


def degree_step(ends: tuple[float, float], most: int = 8) -> float:
    """Return the step of an axis between two angles, in [°], for at most ``most`` steps."""
    low, high = ends
    turns = 360.0 * ceil((high - low) / (360.0 * most))
    return next((step for step in _STEPS if (high - low) / step <= most), turns)


def set_plane(axes: Any, low: complex, high: complex, length: str = 'm') -> None:
    """
    Let axes show a part of the plane between two corners, in [m], true to scale.

    ``length`` is the unit of the file, as for `unit_of_length`.
    """
    axes.set_aspect('equal')
    axes.set_xlim(low.real, high.real)
    axes.set_ylim(low.imag, high.imag)
    size = max((high - low).real, (high - low).imag)
    show_lengths(axes.xaxis, 'x', size, length)
    show_lengths(axes.yaxis, 'y', size, length)
    axes.tick_params(labelsize=7, width=0.5)
    for side in ('top', 'right'):
        axes.spines[side].set_visible(False)


def plot_places(axes: Any, places: Sequence[complex], *mark: str, **style: Any) -> Any:
    """Plot places of the plane, as ``axes.plot`` plots points; return the artists."""
    return axes.plot([p.real for p in places], [p.imag for p in places], *mark, **style)


def paint_shapes(axes: Any, drawn: Sequence[Shape]) -> list[Any]:
    """Paint shapes, the last on top; return their artists, in the same order."""
    from matplotlib import patches  # local import: an extra, and slow to load

    painted: list[Any] = []
    for shape in drawn:
        if isinstance(shape, Polygon):
            corners = [(p.real, p.imag) for p in shape.corners]
            patch = patches.Polygon(
                corners,
                closed=True,
                facecolor=FACES[shape.role],
                edgecolor=INK,
                linewidth=0.9,
                joinstyle='round',
                zorder=LAYERS['shape'],
            )
            painted.append(axes.add_patch(patch))
        elif isinstance(shape, Circle):
            centre = (shape.centre.real, shape.centre.imag)
            circle = patches.Circle(
                centre,
                shape.radius,
                facecolor=FACES.get(shape.role, 'white'),
                edgecolor=INK,
                linewidth=0.9,
                zorder=LAYERS['shape'],
            )
            painted.append(axes.add_patch(circle))
        else:
            colour, width = STROKES[shape.role]
            painted += plot_places(
                axes,
                (shape.start, shape.end),
                color=colour,
                linewidth=width,
                linestyle=_DASH_DOT if shape.role == 'axis' else '-',
                solid_capstyle='round',
                zorder=LAYERS['shape'],
            )
    return painted


def make_faint(artist: Any, strength: float) -> None:
    """Mix the colours of a painted shape with white; of strength 1 nothing changes."""
    from matplotlib.colors import to_rgba  # local import: an extra, and slow to load

    for part in ('color',) if hasattr(artist, 'get_color') else ('facecolor', 'edgecolor'):
        *colour, opacity = to_rgba(getattr(artist, f'get_{part}')())
        mixed = [1.0 - strength * (1.0 - channel) for channel in colour]
        getattr(artist, f'set_{part}')((*mixed, opacity))


def paint_frame(axes: Any, drawn: DrawnLinkage, low: complex, high: complex) -> None:
    """Paint directions x, y and z in the lower left corner of a picture, and a bar to scale."""
    directions = drawn.camera.axes  # the first two rows are what is right and up in the picture
    arm = 0.05 * abs(high - low)
    origin = low + arm * (1.5 + 2.0j)
    for name, right, up in zip('xyz', *directions[:2], strict=True):
        way = arm * complex(right, up)
        plot_places(axes, (origin, origin + way), color=INK, linewidth=1.0)
        letter = origin + 1.4 * way
        axes.text(
            letter.real, letter.imag, name, ha='center', va='center', fontsize=_FONT_SIZE,
            color=INK,
        )  # fmt: skip
    if not drawn.has_lengths:
        return
    unit, factor = unit_of_length(abs(high - low), drawn.length)
    longest = 0.4 * (high - low).real * factor
    power = 10.0 ** floor(log10(longest))
    shown = next(k * power for k in (5.0, 2.0, 1.0) if k * power <= longest)
    length = shown / factor
    start = low + arm * (0.4 + 0.1j)
    ends = (start + 0.15j * arm, start, start + length, start + length + 0.15j * arm)
    plot_places(axes, ends, color=INK, linewidth=1.0)
    axes.text(
        ends[-1].real + 0.2 * arm, start.imag, f'{shown:g} {unit}', va='bottom',
        fontsize=_FONT_SIZE, color=INK,
    )  # fmt: skip


class NameLabels:
    """
    Texts placed together, each where it hides little.

    The figure of the axes has its final layout: before it a text has no size.
    """

    def __init__(self, axes: Any) -> None:
        self._axes = axes
        self._texts: list[Any] = []
        self._labels: list[Label] = []

    def to_pixel(self, place: complex) -> complex:
        """Return the pixel of a place in [m]."""
        x, y = self._axes.transData.transform((place.real, place.imag))
        return complex(x, y)

    def add_name(self, name: str, anchors: Sequence[complex], clear: float, **style: Any) -> None:
        """Add a name next to one of some places, in [m], the first the best; clear in pixels."""
        from matplotlib.patheffects import withStroke  # local import: an extra, and slow to load

        written = self._axes.text(
            0.0, 0.0, picture_text(name, 40), ha='center', va='center', zorder=LAYERS['label'] + 1,
            path_effects=[withStroke(linewidth=2.0, foreground='white')], **style,
        )  # fmt: skip
        box = written.get_window_extent()
        self._texts.append(written)
        pixels = tuple(map(self.to_pixel, anchors))
        self._labels.append(Label(pixels, box.width + _GAP, box.height + _GAP, clear))

    def place_names(self, lines: Iterable[Sequence[complex]]) -> None:
        """Place the texts where they hide little of some lines, in [m]."""
        obstacles = []
        for line in lines:
            for start, end in pairwise(map(self.to_pixel, line)):
                obstacles += _points_between(start, end)
        box = self._axes.get_window_extent()
        frame = complex(box.x0, box.y0), complex(box.x1, box.y1)
        back = self._axes.transData.inverted()
        for written, label, placed in zip(
            self._texts, self._labels, place_labels(self._labels, obstacles, frame), strict=True
        ):
            centre, anchor = placed
            written.set_position(back.transform((centre.real, centre.imag)))
            if has_leader(label, placed):
                edge = leader_end(label, placed)
                start, end = (back.transform((p.real, p.imag)) for p in (anchor, edge))
                self._axes.plot(
                    [start[0], end[0]], [start[1], end[1]],
                    color=NAME_INK, linewidth=0.5, zorder=LAYERS['label'],
                )  # fmt: skip


def has_leader(label: Label, placed: PlacedText) -> bool:
    """Return whether a label is so far from its anchor that a line has to lead to it."""
    away = placed.centre - placed.anchor
    distance = max(abs(away.real) - 0.5 * label.width, abs(away.imag) - 0.5 * label.height)
    return distance > label.clear + 0.4 * label.height


def leader_end(label: Label, placed: PlacedText) -> complex:
    """Return where the line from the anchor to the label's centre meets the label's box."""
    away = placed.centre - placed.anchor
    inside = min(
        0.5 * size / abs(part) if part else inf
        for size, part in ((label.width, away.real), (label.height, away.imag))
    )
    return placed.centre - min(inside, 1.0) * away


def _points_between(start: complex, end: complex) -> list[complex]:
    count = max(1, ceil(abs(end - start) / 4.0))
    return [start + (end - start) * i / count for i in range(count)]
