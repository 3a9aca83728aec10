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


"""A diagram as SVG, drawn by matplotlib: for print, and for browsers without scripts."""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
from itertools import pairwise
from math import ceil, floor, log10, nan
from textwrap import wrap
from typing import Any

from linkage_ros.accuracy.page.diagrams import (
    DASHES,
    Placed,
    Places,
    places,
    Range,
    Style,
    Styles,
)
from linkage_ros.accuracy.results import Diagram
from linkage_ros.drawing.painting import INK, Label, place_labels, settings

_MOST = 8
_SLACK = 1e-9
"""Rounding error of an end of the axis, relative to a step."""

_SUPERSCRIPT = str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹')
_PLAIN = (-2, 4)
"""Lowest and highest power of ten that is written out."""


def ticks(shown: Range) -> list[tuple[float, str]]:
    """Return the ticks of an axis: where, and the text."""
    if not shown.axis.logarithmic:
        return list(_even(shown.low, shown.high))
    first, last = ceil(log10(shown.low) - _SLACK), floor(log10(shown.high) + _SLACK)
    if last - first >= 3:
        step = ceil((last - first) / _MOST)
        # Multiples of the step, so that 1 is among them where it is in the range.
        return [(10.0**n, _power(n)) for n in range(ceil(first / step) * step, last + 1, step)]
    digits = ((1, 2, 5), (1, 2, 3, 5, 7))[last - first < 1]
    values = [digit * 10.0**n for n in range(first - 1, last + 1) for digit in digits]
    within = [value for value in values if shown.low <= value <= shown.high]
    if len(within) >= 2:
        return [(value, _text(value)) for value in within]
    return list(_even(shown.low, shown.high))


def _even(low: float, high: float) -> Iterator[tuple[float, str]]:
    """Yield ticks at equal distances, each one of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / _MOST
    scale = 10.0 ** floor(log10(rough))
    step = next(factor * scale for factor in (1, 2, 5, 10) if factor * scale >= rough)
    decimals = max(0, -floor(log10(step)))
    for number in range(ceil(low / step - _SLACK), floor(high / step + _SLACK) + 1):
        value = number * step
        plain = decimals <= 6 and abs(value) < 1e6
        yield value, f'{value + 0.0:.{decimals}f}' if plain else f'{value:.4g}'


def _power(exponent: int) -> str:
    low, high = _PLAIN
    if low <= exponent <= high:
        return f'{10.0**exponent:g}'
    return f'10{str(exponent).translate(_SUPERSCRIPT)}'


def _text(value: float) -> str:
    exponent = floor(log10(value) + _SLACK)
    low, high = _PLAIN
    if low <= exponent <= high:
        return f'{value:g}'
    digit = round(value / 10.0**exponent)
    return _power(exponent) if digit == 1 else f'{digit}·{_power(exponent)}'


_WIDTH, _HEIGHT = 6.0, 4.2
"""Size of the picture, in inches."""

_TITLE_LETTERS, _NAME_LETTERS = 66, 26
_FONT, _LETTER, _LINE = 8.0, 0.55, 1.2
"""Size of a name, in points; width and height of a letter, as a part of it."""

_PARTS = 6
"""Parts of a line between whose ends no name should stand."""

_PALE = 0.3
"""Opacity of a point that is worse than another on both axes."""

_LINES: dict[str, Any] = dict(
    zip(DASHES, ('solid', (0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5))), strict=True)
)
_MOST_MARKS = 40
"""Maximum number of markers on a curve."""


def diagram_svg(diagram: Diagram, styles: Styles) -> bytes:
    """Return the picture of a diagram; a LinkageError if matplotlib is not installed."""
    context = settings()
    from matplotlib.figure import Figure  # local import: an extra, and slow to load

    placed = places(diagram)
    with context:
        figure = Figure(figsize=(_WIDTH, _HEIGHT), layout='constrained')
        axes = figure.subplots()
        _set_axes(axes, placed)
        for number, curve in enumerate(placed.curves):
            style = styles[curve.curve.name]
            _draw(axes, curve.within, style, joined=curve.curve.joined,
                  gid=f'curve_{number + 1}')  # fmt: skip
            _draw_on_edge(
                axes,
                curve.on_edge,
                styles[curve.curve.name].mark.matplotlib,
                styles[curve.curve.name].colour,
            )
        if placed.on_edge:
            axes.text(1.0, 1.0, f'hollow, on the edge: {placed.on_edge}', ha='right', va='bottom',
                      transform=axes.transAxes, color=INK)  # fmt: skip
        axes.step(
            [point.x for point in placed.front], [point.y for point in placed.front],
            where='post', color=INK, linewidth=0.9, zorder=1.5, clip_on=False,
        )  # fmt: skip
        title = '\n'.join(wrap(diagram.title, _TITLE_LETTERS))
        figure.suptitle(title, x=0.01, ha='left', fontsize=10.0, color=INK)
        figure.draw_without_rendering()
        # Names are placed in this layout; they must not change it.
        figure.set_layout_engine('none')
        _write_names(axes, placed, styles)
        stored = BytesIO()
        about = {'Date': None, 'Creator': 'linkage_ros', 'Title': diagram.title}
        figure.savefig(stored, format='svg', metadata=about)
    return stored.getvalue()


def _set_axes(axes: Any, placed: Places) -> None:
    for which, shown in (('x', placed.x), ('y', placed.y)):
        # The scale first: it brings locators of its own.
        getattr(axes, f'set_{which}scale')('log' if shown.axis.logarithmic else 'linear')
        _set_axis(getattr(axes, f'{which}axis'), shown)
        getattr(axes, f'set_{which}label')(shown.axis.title, color=INK, fontsize=9.0)
        getattr(axes, f'set_{which}lim')(shown.low, shown.high)
    axes.set_axisbelow(True)
    axes.grid(alpha=0.3, linewidth=0.5)
    axes.tick_params(labelsize=8.0, width=0.5)
    for side in ('top', 'right'):
        axes.spines[side].set_visible(False)
    if placed.empty:
        axes.text(0.5, 0.5, 'nothing was measured', transform=axes.transAxes, ha='center',
                  color=INK)  # fmt: skip


def _set_axis(axis: Any, shown: Range) -> None:
    from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator  # local import: slow

    found = ticks(shown)
    axis.set_major_locator(FixedLocator([value for value, _ in found]))
    axis.set_major_formatter(FixedFormatter([text for _, text in found]))
    axis.set_minor_locator(NullLocator())


def _draw(axes: Any, points: list[Placed | None], style: Style, *, joined: bool, gid: str) -> None:
    where: list[Any] = [point or _NOWHERE for point in points] or [_NOWHERE]
    xs, ys = [point.x for point in where], [point.y for point in where]
    pale = any(point.pale for point in where)
    axes.errorbar(
        xs, ys,
        xerr=[[point.x_arms[side] for point in where] for side in (0, 1)],
        yerr=[[point.y_arms[side] for point in where] for side in (0, 1)],
        fmt='none', ecolor=style.colour, elinewidth=0.8, clip_on=False,
        alpha=_PALE if pale else 1.0,
    )  # fmt: skip
    look: dict[str, Any] = {
        'color': style.colour,
        'marker': style.mark.matplotlib,
        'markersize': 7.0 if style.mark.matplotlib == '*' else 4.8,
        'markeredgewidth': 0.0,
        'clip_on': False,
    }
    (line,) = axes.plot(
        xs, ys,
        markevery=max(1, len(where) // _MOST_MARKS),
        linestyle=_LINES[style.dash] if joined and len(where) > 1 else 'none',
        linewidth=1.3,
        alpha=_PALE if pale else 1.0,
        **look,
    )  # fmt: skip
    line.set_gid(gid)
    best = [point for point in points if point and pale and not point.pale]
    axes.plot([point.x for point in best], [point.y for point in best], linestyle='none', **look)


def _draw_on_edge(axes: Any, points: list[Placed], mark: str, colour: str) -> None:
    for point in points:
        axes.plot(
            point.x, point.y,
            linestyle='none', marker=mark, markersize=6.0, markerfacecolor='white',
            markeredgecolor=colour, markeredgewidth=1.1, clip_on=False, zorder=4,
            alpha=_PALE if point.pale else 1.0,
        )  # fmt: skip


def _write_names(axes: Any, placed: Places, styles: Styles) -> None:
    """Write each name beside its point, where it hides least."""
    curves = [curve for curve in placed.curves if curve.named]
    curves.sort(key=lambda curve: bool(curve.named and curve.named.pale))
    names = ['\n'.join(wrap(curve.curve.name, _NAME_LETTERS)) for curve in curves]
    unit = axes.figure.dpi / 72.0 * _FONT

    def place(point: Placed) -> complex:
        return complex(*axes.transData.transform((point.x, point.y)))

    labels = [
        Label(
            (place(curve.named),),
            _LETTER * unit * max(map(len, name.split('\n'))),
            _LINE * unit * (name.count('\n') + 1),
            0.6 * unit,
        )
        for curve, name in zip(curves, names, strict=True)
        if curve.named
    ]
    obstacles = [place(point) for curve in placed.curves for point in curve.points if point]
    lines = [
        pair
        for curve in placed.curves
        if curve.curve.joined
        for pair in pairwise(place(point) for point in curve.points if point)
    ]
    for one, other in pairwise(map(place, placed.front)):
        corner = complex(other.real, one.imag)
        lines += [(one, corner), (corner, other)]
    for one, other in lines:
        obstacles += [one + part / _PARTS * (other - one) for part in range(1, _PARTS)]
    frame = axes.get_window_extent()
    found = place_labels(labels, obstacles, (complex(*frame.p0), complex(*frame.p1)))
    for curve, name, label, (centre, anchor) in zip(curves, names, labels, found, strict=True):
        pale = curve.named is not None and curve.named.pale
        colour = styles[curve.curve.name].colour
        to_data = axes.transData.inverted().transform
        axes.annotate(
            name,
            to_data((anchor.real, anchor.imag)),
            to_data((centre.real, centre.imag)),
            ha='center', va='center', fontsize=_FONT, color=colour, annotation_clip=False,
            alpha=0.7 if pale else 1.0, fontweight='normal' if pale else 'bold',
            arrowprops={'arrowstyle': '-', 'color': colour, 'linewidth': 0.5, 'alpha': 0.5}
            if abs(centre - anchor) > 0.5 * label.width + 2.0 * unit else None,
        )  # fmt: skip


_NOWHERE = Placed(nan, nan, (0.0, 0.0), (0.0, 0.0), on_edge=False, pale=False, text=())
