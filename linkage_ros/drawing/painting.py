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

"""The common parts of all pictures: colours, painting of shapes, placing of names, saving."""

from __future__ import annotations

from cmath import rect
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from io import BytesIO
from itertools import pairwise
from math import ceil, pi
from pathlib import Path
from typing import Any, NamedTuple

from linkage_ros.drawing.shapes import Circle, Polygon, Segment, Shape
from linkage_ros.errors import LinkageError
from linkage_ros.files.atomic_write import atomic_write

_DIRECTIONS = 16
_DISTANCES = 7


class Label(NamedTuple):
    """
    A name to be placed; all sizes in one unit, such as pixels.

    Attributes
    ----------
    anchors
        Places that it may be next to; the first is the best.
    width, height
        Size of the text.
    clear
        Distance of its box from the anchor.

    """

    anchors: tuple[complex, ...]
    width: float
    height: float
    clear: float


class Placed(NamedTuple):
    """Place of a label's centre, and its anchor."""

    centre: complex
    anchor: complex


def place_labels(
    labels: Sequence[Label],
    obstacles: Sequence[complex],
    frame: tuple[complex, complex],
) -> list[Placed]:
    """
    Place labels one after the other, each where it hides least.

    Parameters
    ----------
    labels
        The labels; the first ones are placed first.
    obstacles
        Points of lines and shapes that should not be hidden.
    frame
        The lower left and the upper right corner of the drawing.

    """
    boxes: list[tuple[complex, float, float]] = []
    placed = []
    for label in labels:
        best: tuple[float, Placed] | None = None
        half_width, half_height = 0.5 * label.width, 0.5 * label.height
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
                    cost += 2.5 * _inside(centre, half_width, half_height, obstacles)
                    cost += 12.0 * sum(
                        _overlap(centre, half_width, half_height, *box) for box in boxes
                    )
                    cost += 20.0 * _outside(centre, half_width, half_height, frame)
                    if best is None or cost < best[0]:
                        best = cost, Placed(centre, anchor)
        assert best is not None, 'a label has an anchor'
        placed.append(best[1])
        boxes.append((best[1].centre, half_width, half_height))
    return placed


def _inside(centre: complex, width: float, height: float, points: Sequence[complex]) -> int:
    return sum(
        abs(p.real - centre.real) < width and abs(p.imag - centre.imag) < height for p in points
    )


def _overlap(
    centre: complex,
    width: float,
    height: float,
    other: complex,
    its_width: float,
    its_height: float,
) -> bool:
    apart = other - centre
    return abs(apart.real) < width + its_width and abs(apart.imag) < height + its_height


def _outside(centre: complex, width: float, height: float, frame: tuple[complex, complex]) -> bool:
    low, high = frame
    return (
        centre.real - width < low.real
        or centre.real + width > high.real
        or centre.imag - height < low.imag
        or centre.imag + height > high.imag
    )


COLOURS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#000000')
"""Colours of Okabe and Ito, which colour-blind readers can distinguish."""

WANTED, TRACE, OTHER = COLOURS[0], COLOURS[2], COLOURS[4]
"""Colours in a design: wanted values, path of a point, other assembly."""

OTHER_TEXT = '#a86b00'
"""Colour of text about the other assembly, dark enough to read."""

INK = '#1f2d3a'
NAME_INK = '#35608a'
GHOST = '#cfcfcf'
LAYERS = {'ghost': 1, 'path': 2, 'shape': 3, 'label': 6}

FACES = {
    'link': '#c3d3e2',
    'plate': '#d3e0ecc0',
    'input': '#f0a07a',
    'block': '#fff6d6',
    'tube': '#e8edf2',
    'ground': '#ffffff',
}
_STEPS = (1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 90.0, 180.0)
STROKES = {'rail': (INK, 1.3), 'hatch': (INK, 0.7), 'slot': ('#ffffff', 2.2)}
_SETTINGS: Any = {'font.size': 8.0, 'svg.hashsalt': 'linkage_ros', 'axes.linewidth': 0.6}


def settings() -> Any:
    """
    Return the matplotlib context of a picture.

    Raises
    ------
    LinkageError
        If matplotlib is not installed.

    """
    if find_spec('matplotlib') is None:
        raise LinkageError(
            'matplotlib', 'is not installed', 'pip install linkage_ros[report], or apt its package'
        )
    import matplotlib as mpl  # local import: an extra, and slow to load

    return mpl.rc_context(_SETTINGS)


def save(figure: Any, file: Path) -> None:
    """
    Save a picture; equal pictures give equal bytes.

    Raises
    ------
    LinkageError
        If the file cannot be written.

    """
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


def corners(places: Iterable[complex]) -> tuple[complex, complex]:
    """Return the lower left and the upper right corner of the bounding box of places."""
    xs, ys = zip(*((p.real, p.imag) for p in places), strict=True)
    return complex(min(xs), min(ys)), complex(max(xs), max(ys))


def outline(shape: Shape) -> tuple[complex, ...]:
    """Return the corners of a shape's edge."""
    if isinstance(shape, Segment):
        return shape.start, shape.end
    if isinstance(shape, Polygon):
        return (*shape.corners, shape.corners[0])
    return tuple(shape.centre + shape.radius * way for way in (1, 1j, -1, -1j, 1))


def bar_size(picture: float, shortest: float) -> float:
    """Return half the width of a bar, in [m], for a picture and its shortest link."""
    return min(0.013 * picture, max(0.26 * shortest, 0.006 * picture))


def degree_step(low: float, high: float) -> float:
    """Return the step of an axis in degrees."""
    return next((step for step in _STEPS if (high - low) / step <= 8.0), _STEPS[-1])


def paint(axes: Any, drawn: Sequence[Shape]) -> None:
    """Paint shapes, the last on top."""
    from matplotlib import patches  # local import: an extra, and slow to load

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
            axes.add_patch(patch)
        elif isinstance(shape, Circle):
            centre = (shape.centre.real, shape.centre.imag)
            axes.add_patch(
                patches.Circle(
                    centre,
                    shape.radius,
                    facecolor='white',
                    edgecolor=INK,
                    linewidth=0.9,
                    zorder=LAYERS['shape'],
                )
            )
        else:
            colour, width = STROKES[shape.role]
            axes.plot(
                [shape.start.real, shape.end.real],
                [shape.start.imag, shape.end.imag],
                color=colour,
                linewidth=width,
                solid_capstyle='round',
                zorder=LAYERS['shape'],
            )


class Names:
    """
    Texts placed together, each where it hides little.

    Parameters
    ----------
    axes
        Axes of a figure with a final layout: before it a text has no size.

    """

    def __init__(self, axes: Any) -> None:
        self._axes = axes
        self._texts: list[Any] = []
        self._labels: list[Label] = []

    def pixel(self, place: complex) -> complex:
        """Return the pixel of a place in [m]."""
        x, y = self._axes.transData.transform((place.real, place.imag))
        return complex(x, y)

    def want(self, text: str, anchors: Sequence[complex], clear: float, **style: Any) -> None:
        """Add a text next to one of some places, in [m], the first the best; clear in pixels."""
        from matplotlib.patheffects import withStroke  # local import: an extra, and slow to load

        written = self._axes.text(
            0.0, 0.0, text, ha='center', va='center', zorder=LAYERS['label'] + 1,
            path_effects=[withStroke(linewidth=2.0, foreground='white')], **style,
        )  # fmt: skip
        box = written.get_window_extent()
        self._texts.append(written)
        pixels = tuple(map(self.pixel, anchors))
        self._labels.append(Label(pixels, box.width + 2.0, box.height, clear))

    def place(self, lines: Iterable[Sequence[complex]]) -> None:
        """Place the texts where they hide little of some lines, in [m]."""
        obstacles = []
        for line in lines:
            for start, end in pairwise(map(self.pixel, line)):
                obstacles += _between(start, end)
        box = self._axes.get_window_extent()
        frame = complex(box.x0, box.y0), complex(box.x1, box.y1)
        back = self._axes.transData.inverted()
        for written, label, placed in zip(
            self._texts, self._labels, place_labels(self._labels, obstacles, frame), strict=True
        ):
            centre, anchor = placed
            written.set_position(back.transform((centre.real, centre.imag)))
            away = centre - anchor
            beside = max(abs(away.real) - 0.5 * label.width, abs(away.imag) - 0.5 * label.height)
            if beside > label.clear + 0.4 * label.height:
                start, end = (back.transform((p.real, p.imag)) for p in (anchor, centre))
                self._axes.plot(
                    [start[0], end[0]], [start[1], end[1]],
                    color=NAME_INK, linewidth=0.5, zorder=LAYERS['label'],
                )  # fmt: skip


def _between(start: complex, end: complex) -> list[complex]:
    count = max(1, ceil(abs(end - start) / 4.0))
    return [start + (end - start) * i / count for i in range(count)]
