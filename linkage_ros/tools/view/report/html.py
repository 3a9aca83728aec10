# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The report of a run as an HTML page with tables; the scripts next to this file draw its plots.

The page has a size limit, whatever the bag holds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

from linkage_ros.cli import Table
from linkage_ros.description import Units
from linkage_ros.errors import LinkageError
from linkage_ros.tools.view.pages import facts_html, html_document, table_html
from linkage_ros.tools.view.report.data import (
    event_tracks,
    facts_of_thinning,
    page_data,
    time_plots,
    zero_plots,
)
from linkage_ros.tools.view.report.decimation import Histogram, PAGE_BYTES, TABLE_BYTES
from linkage_ros.tools.view.report.labels import (
    AGE_NOTE,
    CLOSED_NOTE,
    duration_text,
    EVENT_TRACKS,
    FORCE_NOTE,
    LATENESS_NOTE,
    POSE_NOTE,
    seconds_text,
    shorten_text,
    SPACE_NOTE,
)
from linkage_ros.tools.view.report.run import Curves, LinkageRun, ReportedRun
import numpy as np

_LONGEST = 200
"""Maximum number of characters of a cell."""

_BESIDE_CELL, _BESIDE_ROW, _BESIDE_TABLE = 25, 10, 250
"""Upper bound of the HTML around each cell, in [bytes]."""

_HERE = 'linkage_ros.tools.view.report'
_FILES = ('report.css', 'over_time.js', 'over_others.js', 'plots.js', 'report.js')

_LONGEST_FACT = 400
"""Maximum number of characters of a fact or a warning."""

_SPEEDS = ('0.01', '0.1', '0.25', '0.5', '1', '2', '5', '10', '60')

_ANGLE_CONTROLS = (
    '<div class="controls"><label>angles in <select id="unit"><option value="rad">radians</option>'
    '<option value="degrees">degrees</option></select></label> <label>that are <select id="range">'
    '<option value="continuous">continuous</option>'
    '<option value="wrapped">within ± half a turn</option></select></label></div>'
)


def tables_html(tables: Sequence[Table]) -> Iterator[str]:
    """Yield tables as HTML within the size limit; say how much is left out."""
    space = TABLE_BYTES
    for index, table in enumerate(table_shown.as_texts() for table_shown in tables):
        if not table.rows:
            continue
        space -= _BESIDE_TABLE + _row_size([shorten_text(table.title), *table.heads])
        if space < 0:
            yield f'<p class="note">No room for {len(tables) - index} more tables.</p>'
            return
        rows = []
        for row in table.rows:
            cells = [shorten_text(cell, _LONGEST) for cell in row]
            space -= _row_size(cells)
            if space < 0:
                break
            rows.append(cells)
        yield from _run_table_html(table._replace(title=shorten_text(table.title), rows=rows))
        if len(rows) < len(table.rows):
            yield f'<p class="note">No room for {len(table.rows) - len(rows)} more rows.</p>'


def _row_size(cells: Sequence[str]) -> int:
    written = (escape(cell).encode('utf-8', 'backslashreplace') for cell in cells)
    return _BESIDE_ROW + sum(_BESIDE_CELL + len(cell) for cell in written)


def _run_table_html(table: Table) -> Iterator[str]:
    if table.folded:
        yield f'<details><summary>{escape(table.title)}</summary>'
        yield from table_html(table._replace(title=''))
        yield '</details>'
    else:
        yield from table_html(table)


def run_tables(run: ReportedRun, units: Units) -> Iterator[Table]:
    """Yield the tables of a run; its curves are in the units of its file."""
    yield Table(
        'Curves',
        ('joint', 'quantity', '>least', '>greatest', 'unit', 'on'),
        [row for curves in run.curves for row in _curve_ranges(curves, units)],
    )
    yield Table(
        'Events',
        ('kind', '>count', '>first at [s]', 'what it is'),
        [
            (
                EVENT_TRACKS[key][0],
                f'{lane.count:,}',
                seconds_text(lane.in_order[0].begin),
                EVENT_TRACKS[key][1],
            )
            for key, lane in event_tracks(run).items()
        ],
    )
    yield Table(
        'Samples rejected',
        ('reason', '>count'),
        [(reason, f'{count:,}') for reason, count in run.rejected.items()],
    )
    yield Table(
        'Left out of the curves',
        ('of', 'reason', '>count'),
        [(of, reason, f'{count:,}') for (of, reason), count in run.left_out.items()],
    )
    yield Table(
        'What the diagnostics said last',
        ('of', 'key', 'value'),
        [(task, key, value) for (task, key), value in run.last_values.items()],
        folded=True,
    )


def _curve_ranges(curves: Curves, units: Units) -> Iterator[tuple[str, ...]]:
    intervals = curves.intervals
    for index, (name, quantity, unit) in enumerate(curves.columns):
        least = np.nanmin(np.fmin(intervals.first[:, index], intervals.second[:, index]))
        greatest = np.nanmax(np.fmax(intervals.first[:, index], intervals.second[:, index]))
        ends = [f'{units.to_file_unit(float(end), unit):.9g}' for end in (least, greatest)]
        yield name, quantity, *ends, units.file_unit(unit), curves.title


class ReportHeader(NamedTuple):
    """
    The facts of a bag that a page shows with its run: at its head, as warnings, and as tables.

    If ``wrapped``, published angles jump from π to −π.
    """

    title: str
    facts: Sequence[tuple[str, str]]
    warnings: Sequence[str]
    tables: Sequence[Table]
    wrapped: bool = False
    units: Units = Units()


def run_html(run: ReportedRun, header: ReportHeader) -> str:
    """
    Return the page of a run.

    A LinkageError is raised if plotly is not installed, or the page would be larger than
    `PAGE_BYTES`.
    """
    data = page_data(run, header.wrapped, header.units)
    title = shorten_text(header.title)
    page = html_document(title, _page_body(run, header, data), data, _HERE, _FILES)
    # The limits of the parts add up to less, but names in a scene have no limit.
    if len(page.encode('utf-8', 'backslashreplace')) > PAGE_BYTES:
        bound = f'{PAGE_BYTES // 1_000_000} MB'
        raise LinkageError(title, f'its page would be larger than {bound}', 'shorten its names')
    return page


def _page_body(run: ReportedRun, header: ReportHeader, data: dict[str, object]) -> Iterator[str]:
    yield f'<header><h1>{escape(shorten_text(header.title))}</h1>'
    yield from facts_html(
        [(name, shorten_text(value, _LONGEST_FACT)) for name, value in header.facts]
    )
    if header.warnings:
        yield '<ul class="warnings" role="alert">'
        yield from (
            f'<li>{escape(shorten_text(warning, _LONGEST_FACT))}</li>'
            for warning in header.warnings
        )
        yield '</ul>'
    yield '<noscript><p class="warnings">Pictures and plots need JavaScript.</p></noscript>'
    yield '</header>'
    moving = run.frames is not None and len(run.frames.times) > 0 and bool(run.linkages)
    yield f'<main{" class=moving" if moving else ""}>'
    if moving:
        yield from _player_html(run.linkages, data)
    yield '<div class="plots">'
    yield from _events_html(run)
    yield from _plots_html(run, header.units)
    yield from _histograms_html(run)
    yield '</div>'
    yield '<section class="tables"><h2>In numbers</h2>'
    yield from tables_html([*header.tables, *run_tables(run, header.units)])
    yield '</section></main>'


def _player_html(linkages: Sequence[LinkageRun], data: dict[str, object]) -> Iterator[str]:
    drawn = data['linkages']
    assert isinstance(drawn, list)
    yield '<section class="player" aria-label="The linkage, moving"><div class="pictures">'
    for index, linkage in enumerate(linkages):
        name = escape(linkage.name or 'linkage')
        yield f'<figure data-linkage="{index}">'
        if linkage.name:
            yield f'<figcaption>{name}</figcaption>'
        spatial = 'camera' in (drawn[index]['drawn'] or {})
        turned = ' tabindex="0" class="orbit"' if spatial else ''
        yield f'<canvas{turned} role="img" aria-label="{name} in its recorded pose"></canvas>'
        if drawn[index]['undrawn']:
            yield f'<p class="note">Not drawn: {escape(drawn[index]["undrawn"])}</p>'
        yield '</figure>'
    yield '</div>'
    yield '<div class="controls">'
    yield '<button type="button" id="play" aria-label="Play">▶</button>'
    yield '<button type="button" id="back" aria-label="One picture back">‹</button>'
    yield '<button type="button" id="onward" aria-label="One picture on">›</button>'
    yield '<input type="range" id="scrub" min="0" max="1000000" step="1" value="0" '
    yield 'aria-label="Time in the run">'
    yield '<label>speed <select id="speed">'
    for speed in _SPEEDS:
        yield f'<option value="{speed}"{" selected" if speed == "1" else ""}>{speed}×</option>'
    yield '</select></label>'
    yield '<label><input type="checkbox" id="traces" checked> traced curves</label>'
    yield '</div><dl class="readout" id="readout" aria-live="off"></dl>'
    why = next((linkage['untold'] for linkage in drawn if linkage['untold']), '')
    kinds = {'camera' in linkage['drawn'] for linkage in drawn if linkage['drawn']}
    if False in kinds:
        yield f'<p class="note">{escape(CLOSED_NOTE.format(why=why) if why else POSE_NOTE)}</p>'
    if True in kinds:
        yield f'<p class="note">{escape(SPACE_NOTE)}</p>'
    yield '</section>'


def _events_html(run: ReportedRun) -> Iterator[str]:
    yield '<section id="events"><h2>What happened</h2>'
    there = event_tracks(run)
    if there:
        yield _plot_html('events', 'Events')
    # An event from the diagnostics alone may also be visible in the messages.
    missing = [
        title
        for key, (title, _) in EVENT_TRACKS.items()
        if key in run.event_tracks and key not in there and not key.startswith('told_')
    ]
    if missing:
        yield f'<p class="note">None of these: {escape("; ".join(missing))}.</p>'
    yield '</section>'


def _plots_html(run: ReportedRun, units: Units) -> Iterator[str]:
    plots = time_plots(run)
    if not run.curves:
        yield '<section><h2>Over time</h2><p>No joint states are in this bag.</p></section>'
        return
    yield '<section><h2>Over time</h2>'
    moving = run.frames is not None and len(run.frames.times) > 0
    click = 'A click shows the linkage at that time. ' if moving else ''
    yield (
        f'<p class="note">{click}A zoom in one plot is one in all, a double click shows all '
        f'again. On this page: {escape("; ".join(facts_of_thinning(run)))}. A zoom shows what is '
        'here; of a longer run <code>linkage report --since S --until S</code> shows a part in '
        'full. '
        f'The page is no larger than {PAGE_BYTES // 1_000_000} MB, however long the run.</p>'
    )
    keys = '<kbd>+</kbd> <kbd>-</kbd> <kbd>0</kbd> zoom, <kbd>L</kbd> light or dark'
    if any(plot['unit'] == 'rad' for plot in plots):
        keys = f'<kbd>D</kbd> degrees, <kbd>W</kbd> within a turn, {keys}'
        yield _ANGLE_CONTROLS
    if moving:
        steps = '<kbd>←</kbd> <kbd>→</kbd> one picture, <kbd>Home</kbd> <kbd>End</kbd>'
        keys = f'<kbd>Space</kbd> plays, {steps}, {keys}'
    yield f'<p class="note no-print">Keys: {keys}.</p>'
    zero = zero_plots(run)
    if zero:
        yield f'<p class="note">Zero throughout, so not plotted: {escape("; ".join(zero))}.</p>'
    notes = {
        'lateness': LATENESS_NOTE,
        'age': AGE_NOTE,
        'pin_forces': FORCE_NOTE,
        'loads': FORCE_NOTE,
    }
    for plot in plots:
        title = f'{plot["title"]} [{units.file_unit(plot["unit"])}]'
        yield _plot_html(plot['key'], title, notes.get(plot['key'], ''))
    yield '</section>'
    crossed = [
        linkage for linkage in run.linkages if run.frames is not None and len(run.frames.times)
    ]
    if crossed:
        yield '<section><h2>Over the crank</h2>'
        yield '<p class="note">The instants of the moving picture that are within the zoom.</p>'
        for index, linkage in enumerate(run.linkages):
            over = f'Joints over {linkage.inputs[0]}'
            yield _plot_html(f'crossed_{index}', over)
        yield '</section>'


def _histograms_html(run: ReportedRun) -> Iterator[str]:
    spread = (
        ('lateness', 'How late ticks were, all', run.lateness),
        ('age', 'How old the input was, all', run.age),
    )
    if not any(histogram for _, _, histogram in spread):
        return
    yield '<section><h2>How durations are spread</h2>'
    for key, title, histogram in spread:
        if histogram is not None:
            yield _plot_html(f'spread_{key}', title, _spread_note(histogram))
    yield '</section>'


def _spread_note(counts: Histogram) -> str:
    parts = [f'p{p} ≤ {duration_text(counts.percentile(p) / 1e9)}' for p in (50, 90, 99)]
    return (
        f'{counts.count:,} ticks: {", ".join(parts)}, max {duration_text(counts.greatest / 1e9)}.'
    )


def _plot_html(key: str, title: str, note: str = '') -> str:
    below = f'<p class="note">{escape(note)}</p>' if note else ''
    return (
        f'<figure data-plot="{escape(key)}"><figcaption>{escape(title)}</figcaption>'
        f'<div class="plot" role="img" aria-label="{escape(title)}"></div>{below}</figure>'
    )
