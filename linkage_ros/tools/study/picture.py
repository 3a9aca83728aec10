# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The picture of a budget: error against cost, one curve for each knob, as SVG.

Across is the core that the whole scene takes with a setting, so all curves meet on the line of the
scene as it is. Settings that another one of the same knob beats in both are pale and without a
line. A label takes a place where it covers no mark, no line and no other label; if there is none,
the setting has its name only as a title, which a browser shows next to the pointer.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from itertools import pairwise
from math import ceil, floor, log10
from typing import NamedTuple

from linkage_ros.kinematics import COLOURS, INK
from linkage_ros.tools.drawing import GHOST
from linkage_ros.tools.study.budget import Budget, Knob, Setting
from linkage_ros.tools.study.budget_text import error_knobs, error_text, rate_text, share_text

WIDTH = 480.0
_PLOT_HEIGHT = 330.0
_LEFT, _RIGHT, _BELOW = 64.0, 14.0, 46.0
_TEXT = 13.0
"""Height of text, in pixels of the picture: readable where it is shown 400 pixels wide."""

_LETTER = 0.6 * _TEXT
"""Width that a letter takes at most, on average."""

_MARK = 5.0
_LEAST = 1e-18
"""Smaller errors are drawn on the lower edge: no double can have them."""

_MOST = 1e3
"""Greater errors are drawn on the upper edge, as of a step that runs away, in [rad]."""

_FAINT = '#6b7782'
_HALO = 'stroke="#ffffff" stroke-width="3" paint-order="stroke"'
"""So that no line of the grid runs through letters."""

_DIRECTIONS = (
    *((side, up) for up in (0.0, -0.6, 0.6, -1.0, 1.0) for side in (1.0, -1.0)),
    *((side, up) for side in (0.0, 0.5, -0.5) for up in (-1.4, 1.4)),
)
"""Where a label may be, seen from its mark: to the right and up."""


class Box(NamedTuple):
    """A rectangle, in pixels."""

    left: float
    top: float
    right: float
    bottom: float

    def overlaps(self, other: Box) -> bool:
        """Return whether two rectangles have a common area."""
        return (
            self.left < other.right
            and other.left < self.right
            and self.top < other.bottom
            and other.top < self.bottom
        )


class Mark(NamedTuple):
    """A setting in the picture."""

    x: float
    y: float
    setting: Setting
    title: str
    is_own: bool
    is_pale: bool

    @property
    def box(self) -> Box:
        """Return the area of the mark."""
        size = _MARK + (2.5 if self.is_own else 0.5)
        return Box(self.x - size, self.y - size, self.x + size, self.y + size)


class PlacedLabel(NamedTuple):
    """A text in the picture, with the area that it takes."""

    text: str
    box: Box
    colour: str


def budget_svg(budget: Budget) -> str:
    """Return the picture of a budget as an SVG document; '' if it has no errors."""
    knobs = error_knobs(budget)
    return _Picture(budget, knobs).svg_document() if knobs else ''


class _Scale(NamedTuple):
    """A logarithmic axis: the powers of ten at its ends, and the pixels there."""

    low: float
    high: float
    begin: float
    end: float

    def to_pixel(self, value: float) -> float:
        part = (log10(value) - self.low) / (self.high - self.low)
        return self.begin + part * (self.end - self.begin)


class _Picture:
    """The parts of the picture with their places."""

    def __init__(self, budget: Budget, knobs: Sequence[Knob]) -> None:
        self.budget, self.knobs = budget, knobs
        self.names = list(_legend_places([knob.name for knob in knobs]))
        self.top = 12.0 + (1 + max(row for _, row in self.names)) * 1.5 * _TEXT
        self.bottom = self.top + _PLOT_HEIGHT
        self.height = self.bottom + _BELOW
        settings = [(knob, setting) for knob in knobs for setting in knob.settings]
        costs = [budget.core_of(knob, setting) for knob, setting in settings]
        errors = [_drawn_error(setting) for _, setting in settings]
        # Room next to the outermost marks, for their labels.
        low, high = log10(min(costs)), log10(max(costs))
        self.x = _Scale(low - 0.25, high + 0.45, _LEFT, WIDTH - _RIGHT)
        self.y = _Scale(
            floor(log10(min(errors))) - 0.5,
            ceil(log10(max(errors))) + 0.3,
            self.bottom,
            self.top,
        )
        self.curves = [self._place_marks(knob) for knob in knobs]
        self.own_x = self.x.to_pixel(budget.tick.core_share)

    def _place_marks(self, knob: Knob) -> list[Mark]:
        costs = [self.budget.core_of(knob, setting) for setting in knob.settings]
        errors = [setting.error.worst for setting in knob.settings]
        points = list(zip(costs, errors, strict=True))
        return [
            Mark(
                self.x.to_pixel(cost),
                self.y.to_pixel(_drawn_error(setting)),
                setting,
                f'{knob.name}, {setting.label}: {error_text(error)} rad; {share_text(cost)}',
                setting is knob.own_setting,
                any(c <= cost and e <= error and (c, e) != (cost, error) for c, e in points),
            )
            for setting, (cost, error) in zip(knob.settings, points, strict=True)
        ]

    def curve_marks(self) -> list[list[Mark]]:
        """Return for each knob the marks that its line connects."""
        return [
            sorted((mark for mark in marks if not mark.is_pale), key=lambda mark: mark.x)
            for marks in self.curves
        ]

    def place_labels(self) -> list[PlacedLabel]:
        """Return the labels that have a free place; the scene's settings come first."""
        taken = [mark.box for marks in self.curves for mark in marks]
        segments = [
            ((start.x, start.y), (end.x, end.y))
            for line in self.curve_marks()
            for start, end in pairwise(line)
        ]
        segments.append(((self.own_x, self.top), (self.own_x, self.bottom)))
        named = [
            (mark, COLOURS[index % len(COLOURS)])
            for index, marks in enumerate(self.curves)
            for mark in marks
        ]
        named.sort(key=lambda mark: (not mark[0].is_own, mark[0].is_pale))
        plot = Box(_LEFT + 3.0, self.top, WIDTH - _RIGHT - 3.0, self.bottom)
        labels = []
        for mark, colour in named:
            text = mark.setting.label
            box = next(
                (
                    box
                    for box in _places_beside(mark, text)
                    if _is_within(box, plot)
                    and not any(box.overlaps(label) for label in taken)
                    and not any(_is_crossed(box, *segment) for segment in segments)
                ),
                None,
            )
            if box is not None:
                taken.append(box)
                labels.append(
                    PlacedLabel(text, box, _FAINT if mark.is_pale and not mark.is_own else colour)
                )
        return labels

    def svg_document(self) -> str:
        """Return the SVG document."""
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {self.height:.0f}" '
            f'width="{WIDTH:g}" height="{self.height:.0f}" role="img" '
            f'font-family="DejaVu Sans, Verdana, sans-serif" font-size="{_TEXT:g}" fill="{INK}">'
        )
        title = f'{self.budget.scene}: error of the published joints against cost'
        return '\n'.join(
            [
                head,
                f'<title>{escape(title, quote=False)}</title>',
                f'<rect width="{WIDTH:g}" height="{self.height:.0f}" fill="#ffffff"/>',
                *self._draw_legend(),
                *self._draw_axes(),
                *self._draw_curves(),
                *(
                    _text_svg(
                        label.box.left,
                        label.box.bottom - 3.0,
                        label.text,
                        fill=label.colour,
                        more=f' class="label" {_HALO}',
                    )
                    for label in self.place_labels()
                ),
                '</svg>\n',
            ]
        )  # fmt: skip

    def _draw_legend(self) -> Iterator[str]:
        for index, (knob, (x, row)) in enumerate(zip(self.knobs, self.names, strict=True)):
            y = 16.0 + row * 1.5 * _TEXT
            colour = COLOURS[index % len(COLOURS)]
            yield _mark_svg(index, x + _MARK, y - 4.0, f'fill="{colour}"')
            yield _text_svg(x + 2.0 * _MARK + 5.0, y, knob.name, fill=colour)

    def _draw_axes(self) -> Iterator[str]:
        right = WIDTH - _RIGHT
        for power in _powers_of_ten(self.y.low, self.y.high, 6):
            y = self.y.to_pixel(10.0**power)
            yield _line_svg(_LEFT, y, right, y, GHOST)
            yield _text_svg(_LEFT - 6.0, y + 4.0, f'1e{power}' if power else '1', anchor='end')
        for value in _axis_values(self.x):
            x = self.x.to_pixel(value)
            yield _line_svg(x, self.top, x, self.bottom, GHOST)
            text = f'{100.0 * value:.6g}'
            if x + 0.5 * _LETTER * len(text) < WIDTH:
                yield _text_svg(x, self.bottom + 17.0, text, anchor='middle')
        yield _line_svg(
            self.own_x, self.top, self.own_x, self.bottom, INK, 'stroke-dasharray="4 3"'
        )
        yield (
            f'<rect x="{_LEFT:g}" y="{self.top:g}" width="{right - _LEFT:g}" '
            f'height="{_PLOT_HEIGHT:g}" fill="none" stroke="{_FAINT}"/>'
        )
        rate = rate_text(self.budget.rate)
        across = f'core that the scene takes [%]; dashed: as it is, at {rate}'
        yield _text_svg(0.5 * (_LEFT + right), self.bottom + 37.0, across, anchor='middle')
        middle = 0.5 * (self.top + self.bottom)
        yield (
            f'<text transform="translate(13 {middle:.1f}) rotate(-90)" text-anchor="middle">'
            'worst error [rad]</text>'
        )

    def _draw_curves(self) -> Iterator[str]:
        for index, (marks, line) in enumerate(zip(self.curves, self.curve_marks(), strict=True)):
            colour = COLOURS[index % len(COLOURS)]
            points = ' '.join(f'{mark.x:.1f},{mark.y:.1f}' for mark in line)
            yield f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>'
            for mark in marks:
                opacity = 0.3 if mark.is_pale else 1.0
                style = f'fill="{colour}" fill-opacity="{opacity:g}"'
                yield f'<g><title>{escape(mark.title, quote=False)}</title>'
                if mark.is_own:
                    yield (
                        f'<circle cx="{mark.x:.1f}" cy="{mark.y:.1f}" r="{_MARK + 3.5:g}" '
                        f'fill="#ffffff" stroke="{colour}" stroke-width="1.5"/>'
                    )
                yield f'{_mark_svg(index, mark.x, mark.y, style)}</g>'


def _drawn_error(setting: Setting) -> float:
    return min(max(setting.error.worst, _LEAST), _MOST)


def _legend_places(names: Sequence[str]) -> Iterator[tuple[float, int]]:
    """Yield the left edge and the row of each name above the plot."""
    x, row = 12.0, 0
    for name in names:
        width = 2.0 * _MARK + 20.0 + _LETTER * len(name)
        if x + width > WIDTH and x > 12.0:
            x, row = 12.0, row + 1
        yield x, row
        x += width


def _places_beside(mark: Mark, text: str) -> Iterator[Box]:
    """Yield places for a label, the nearest first; from next to its mark to above it."""
    width, height = _LETTER * len(text), _TEXT + 1.0
    for gap in (10.0,) if mark.is_pale and not mark.is_own else (10.0, 15.0, 22.0):
        for dx, dy in _DIRECTIONS:
            x = mark.x + dx * gap + (0.5 * dx - 0.5) * width
            y = mark.y + dy * gap - 0.5 * height
            yield Box(x, y, x + width, y + height)


def _is_within(box: Box, outer: Box) -> bool:
    return (
        outer.left <= box.left
        and box.right <= outer.right
        and outer.top <= box.top
        and box.bottom <= outer.bottom
    )


def _is_crossed(box: Box, begin: tuple[float, float], end: tuple[float, float]) -> bool:
    """Return whether a line passes through a rectangle (Liang and Barsky's clipping)."""
    (x, y), (dx, dy) = begin, (end[0] - begin[0], end[1] - begin[1])
    enters, leaves = 0.0, 1.0
    for step, distance in (
        (-dx, x - box.left), (dx, box.right - x), (-dy, y - box.top), (dy, box.bottom - y),
    ):  # fmt: skip
        if step == 0.0:
            if distance <= 0.0:
                return False
        elif step < 0.0:
            enters = max(enters, distance / step)
        else:
            leaves = min(leaves, distance / step)
    return enters < leaves


def _powers_of_ten(low: float, high: float, most: int) -> Iterator[int]:
    """Yield powers of ten within a range, evenly apart."""
    step = max(1, ceil((high - low) / most))
    yield from range(step * ceil(low / step), floor(high) + 1, step)


def _axis_values(scale: _Scale) -> list[float]:
    """Return round values on an axis: powers of ten, and between them 2 and 5 if there is room."""
    inner = (1.0, 2.0, 5.0) if scale.high - scale.low < 2.2 else (1.0,)
    values = [
        digit * 10.0**power
        for power in range(floor(scale.low), ceil(scale.high) + 1)
        for digit in inner
    ]
    return [value for value in values if scale.low <= log10(value) <= scale.high]


def _mark_svg(number: int, x: float, y: float, style: str) -> str:
    """Return a mark; each knob has its own shape, for readers who see no colours."""
    size = _MARK
    corners = (
        None,
        ((-1, -1), (1, -1), (1, 1), (-1, 1)),
        ((0, -1.2), (1.2, 1), (-1.2, 1)),
        ((0, -1.3), (1.3, 0), (0, 1.3), (-1.3, 0)),
        ((0, 1.2), (1.2, -1), (-1.2, -1)),
    )[number % 5]
    if corners is None:
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{size:g}" {style}/>'
    points = ' '.join(f'{x + 0.9 * size * a:.1f},{y + 0.9 * size * b:.1f}' for a, b in corners)
    return f'<polygon points="{points}" {style}/>'


def _line_svg(x: float, y: float, right: float, bottom: float, colour: str, more: str = '') -> str:
    return (
        f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{right:.1f}" y2="{bottom:.1f}" '
        f'stroke="{colour}" {more}/>'
    )


def _text_svg(
    x: float, y: float, text: str, *, anchor: str = 'start', fill: str = INK, more: str = ''
) -> str:
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{fill}"{more}>'
        f'{escape(text, quote=False)}</text>'
    )
