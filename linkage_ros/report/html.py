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


"""The page of a run: what it shows, in HTML; `linkage_ros/report/*.js` moves and draws it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

from linkage_ros.errors import LinkageError
from linkage_ros.page.document import document
from linkage_ros.page.parts import facts_html
from linkage_ros.report.data import facts_of_thinning, lanes, page_data, plots
from linkage_ros.report.histogram import Histogram
from linkage_ros.report.room import BOUND
from linkage_ros.report.run import LinkageRun, Run
from linkage_ros.report.tables import run_tables, TableOf, tables_html
from linkage_ros.report.words import (
    AGE_NOTE,
    CLOSED_NOTE,
    duration_text,
    LANES,
    LATENESS_NOTE,
    POSE_NOTE,
    short,
)

_HERE = 'linkage_ros.report'
_STYLES = [(_HERE, 'report.css')]
_SCRIPTS = [
    (_HERE, f'{name}.js')
    for name in ('curves', 'looks', 'picture', 'over_time', 'over_others', 'plots', 'report')
]

_LONGEST = 400
"""Letters of a fact, or of a warning."""

_SPEEDS = ('0.01', '0.1', '0.25', '0.5', '1', '2', '5', '10', '60')


class Told(NamedTuple):
    """
    What a page tells of a bag beside its run.

    Attributes
    ----------
    title
        Of the page.
    facts
        What stands at its head.
    warnings
        What is missing or damaged, a line each.
    tables
        What stands at its end.
    wrapped
        Whether published angles jump from π to −π.

    """

    title: str
    facts: Sequence[tuple[str, str]]
    warnings: Sequence[str]
    tables: Sequence[TableOf]
    wrapped: bool = False


def run_html(run: Run, told: Told) -> str:
    """
    Return the page of a run.

    Raises
    ------
    LinkageError
        Where plotly is not installed, or the page would be larger than `BOUND`.

    """
    data = page_data(run, told.wrapped)
    title = short(told.title)
    page = document(title, _body(run, told, data), data, _STYLES, _SCRIPTS)
    # The rooms of its parts come to less, but for names in a scene, which have no bound.
    if len(page.encode('utf-8', 'backslashreplace')) > BOUND:
        bound = f'{BOUND // 1_000_000} MB'
        raise LinkageError(title, f'its page would be larger than {bound}', 'shorten its names')
    return page


def _body(run: Run, told: Told, data: dict[str, object]) -> Iterator[str]:
    yield f'<header><h1>{escape(short(told.title))}</h1>'
    yield from facts_html([(name, short(value, _LONGEST)) for name, value in told.facts])
    if told.warnings:
        yield '<ul class="warnings" role="alert">'
        yield from (f'<li>{escape(short(warning, _LONGEST))}</li>' for warning in told.warnings)
        yield '</ul>'
    yield '<noscript><p class="warnings">Pictures and plots need JavaScript.</p></noscript>'
    yield '</header>'
    moving = run.frames is not None and len(run.frames.times) > 0 and bool(run.linkages)
    yield f'<main{" class=moving" if moving else ""}>'
    if moving:
        yield from _player(run.linkages, data)
    yield '<div class="plots">'
    yield from _events(run)
    yield from _plots(run)
    yield from _histograms(run)
    yield '</div>'
    yield '<section class="tables"><h2>In numbers</h2>'
    yield from tables_html([*told.tables, *run_tables(run)])
    yield '</section></main>'


def _player(linkages: Sequence[LinkageRun], data: dict[str, object]) -> Iterator[str]:
    drawn = data['linkages']
    assert isinstance(drawn, list)
    yield '<section class="player" aria-label="The linkage, moving"><div class="pictures">'
    for number, linkage in enumerate(linkages):
        name = escape(linkage.name or 'linkage')
        yield f'<figure data-linkage="{number}">'
        if linkage.name:
            yield f'<figcaption>{name}</figcaption>'
        yield f'<canvas role="img" aria-label="{name} in its recorded pose"></canvas>'
        if drawn[number]['undrawn']:
            yield f'<p class="note">Not drawn: {escape(drawn[number]["undrawn"])}</p>'
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
    why = next((each['untold'] for each in drawn if each['untold']), '')
    yield f'<p class="note">{escape(CLOSED_NOTE.format(why=why) if why else POSE_NOTE)}</p>'
    yield '</section>'


def _events(run: Run) -> Iterator[str]:
    yield '<section id="events"><h2>What happened</h2>'
    there = lanes(run)
    if there:
        yield _plot('events', 'Events')
    # What is only told there may also be seen for itself.
    missing = [
        title
        for key, (title, _) in LANES.items()
        if key in run.lanes and key not in there and not key.startswith('told_')
    ]
    if missing:
        yield f'<p class="note">None of these: {escape("; ".join(missing))}.</p>'
    yield '</section>'


def _plots(run: Run) -> Iterator[str]:
    found = plots(run)
    if not found:
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
        f'The page is no larger than {BOUND // 1_000_000} MB, however long the run.</p>'
    )
    notes = {'lateness': LATENESS_NOTE, 'age': AGE_NOTE}
    for plot in found:
        yield _plot(plot['key'], f'{plot["title"]} [{plot["unit"]}]', notes.get(plot['key'], ''))
    yield '</section>'
    crossed = [each for each in run.linkages if run.frames is not None and len(run.frames.times)]
    if crossed:
        yield '<section><h2>Over the crank</h2>'
        yield '<p class="note">The instants of the moving picture that are within the zoom.</p>'
        for number, linkage in enumerate(run.linkages):
            over = f'Joints over {linkage.inputs[0]}'
            yield _plot(f'crossed_{number}', over)
        yield '</section>'


def _histograms(run: Run) -> Iterator[str]:
    spread = (
        ('lateness', 'How late ticks were, all', run.lateness),
        ('age', 'How old the input was, all', run.age),
    )
    if not any(found for _, _, found in spread):
        return
    yield '<section><h2>How durations are spread</h2>'
    for key, title, found in spread:
        if found is not None:
            yield _plot(f'spread_{key}', title, _spread(found))
    yield '</section>'


def _spread(found: Histogram) -> str:
    parts = [f'p{p} ≤ {duration_text(found.percentile(p) / 1e9)}' for p in (50, 90, 99)]
    return f'{found.count:,} ticks: {", ".join(parts)}, max {duration_text(found.greatest / 1e9)}.'


def _plot(key: str, title: str, note: str = '') -> str:
    told = f'<p class="note">{escape(note)}</p>' if note else ''
    return (
        f'<figure data-plot="{escape(key)}"><figcaption>{escape(title)}</figcaption>'
        f'<div class="plot" role="img" aria-label="{escape(title)}"></div>{told}</figure>'
    )
