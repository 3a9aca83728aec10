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


"""A diagram as SVG, drawn by matplotlib: for print, and where no script runs."""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
from math import ceil, floor, log10, nan
from textwrap import wrap
from typing import Any
from warnings import catch_warnings, filterwarnings

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
from linkage_ros.drawing.painting import INK, settings

_MOST = 8
_SLACK = 1e-9
"""Of a step: what rounding may take from an end of the axis."""

_SUPERSCRIPT = str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹')
_PLAIN = (-2, 4)
"""Powers of ten that are written out."""


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


_WIDTH = 7.2
_LEAST_HEIGHT, _FRAME = 4.0, 0.9
"""Of the picture, and of what it has beside its legend, in inches."""

_TITLE_LETTERS, _NAME_LETTERS = 78, 26
_NAME_LINE = 0.165
"""Height of a line in the legend, in inches."""

_LINES: dict[str, Any] = dict(
    zip(DASHES, ('solid', (0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5))), strict=True)
)
_MOST_MARKS = 40
"""On a curve; of more, every so manieth has one."""


def diagram_svg(diagram: Diagram, styles: Styles) -> bytes:
    """
    Return the picture of a diagram.

    Raises
    ------
    LinkageError
        Where matplotlib is not installed.

    """
    context = settings()
    from matplotlib.figure import Figure  # local import: an extra, and slow to load

    placed = places(diagram)
    with context:
        names = ['\n'.join(wrap(curve.curve.name, _NAME_LETTERS)) for curve in placed.curves]
        lines = sum(name.count('\n') + 1 for name in names)
        figure = Figure(
            figsize=(_WIDTH, max(_LEAST_HEIGHT, _FRAME + lines * _NAME_LINE)), layout='constrained'
        )
        axes = figure.subplots()
        _set_axes(axes, placed)
        for number, curve in enumerate(placed.curves):
            style = styles[curve.curve.name]
            _draw(axes, curve.within, style, joined=curve.curve.joined,
                  gid=f'curve_{number + 1}', name=_plain(names[number]))  # fmt: skip
            _draw_on_edge(
                axes,
                curve.on_edge,
                styles[curve.curve.name].mark.matplotlib,
                styles[curve.curve.name].colour,
            )
        if placed.on_edge:
            # Only for the legend.
            _draw_on_edge(axes, [_NOWHERE], 'o', '0.4', f'hollow: {placed.on_edge}')
        if placed.curves:
            figure.legend(
                loc='outside right upper', frameon=False, fontsize=8.0, handlelength=2.4,
                labelspacing=0.35, borderaxespad=0.2,
            )  # fmt: skip
        title = '\n'.join(wrap(diagram.title, _TITLE_LETTERS))
        figure.suptitle(_plain(title), x=0.01, ha='left', fontsize=10.0, color=INK)
        stored = BytesIO()
        about = {'Date': None, 'Creator': 'linkage_ros', 'Title': diagram.title}
        with catch_warnings():
            # A letter that matplotlib's font has not is a box here; the page and its CSV have it.
            filterwarnings('ignore', 'Glyph', UserWarning)
            figure.savefig(stored, format='svg', metadata=about)
    return stored.getvalue()


def _set_axes(axes: Any, placed: Places) -> None:
    for which, shown in (('x', placed.x), ('y', placed.y)):
        # The scale first: it brings locators of its own.
        getattr(axes, f'set_{which}scale')('log' if shown.axis.logarithmic else 'linear')
        _set_axis(getattr(axes, f'{which}axis'), shown)
        getattr(axes, f'set_{which}label')(_plain(shown.axis.title), color=INK, fontsize=9.0)
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


def _draw(
    axes: Any, points: list[Placed | None], style: Style, *, joined: bool, gid: str, name: str
) -> None:
    where: list[Any] = [point or _NOWHERE for point in points] or [_NOWHERE]
    xs, ys = [point.x for point in where], [point.y for point in where]
    axes.errorbar(
        xs, ys,
        xerr=[[point.x_arms[side] for point in where] for side in (0, 1)],
        yerr=[[point.y_arms[side] for point in where] for side in (0, 1)],
        fmt='none', ecolor=style.colour, elinewidth=0.8, clip_on=False,
    )  # fmt: skip
    (line,) = axes.plot(
        xs, ys,
        color=style.colour,
        marker=style.mark.matplotlib,
        markersize=7.0 if style.mark.matplotlib == '*' else 4.8,
        markeredgewidth=0.0,
        markevery=max(1, len(where) // _MOST_MARKS),
        linestyle=_LINES[style.dash] if joined and len(where) > 1 else 'none',
        linewidth=1.3,
        label=name,
        clip_on=False,
    )  # fmt: skip
    line.set_gid(gid)


def _draw_on_edge(
    axes: Any, points: list[Placed], mark: str, colour: str, name: str = '_nolegend_'
) -> None:
    axes.plot(
        [point.x for point in points], [point.y for point in points],
        linestyle='none', marker=mark, markersize=6.0, markerfacecolor='white',
        markeredgecolor=colour, markeredgewidth=1.1, clip_on=False, zorder=4, label=name,
    )  # fmt: skip


_NOWHERE = Placed(nan, nan, (0.0, 0.0), (0.0, 0.0), on_edge=False, text=())


def _plain(text: str) -> str:
    """Return a text in which no dollar begins a formula."""
    return text.replace('$', r'\$')
