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


"""
A run as the data of its page: numbers as base64 of their bytes, least significant first.

Everything has a bound, whatever the length of the run: see `linkage_ros.report.room`.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator, Sequence
from typing import Any

from linkage_ros.drawing.figure import view
from linkage_ros.drawing.link_frames import drawn_in_frames
from linkage_ros.drawing.painting import COLOURS, FACES, INK
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.survey import usual_inputs
from linkage_ros.report.histogram import EDGES, Histogram
from linkage_ros.report.poses import poses
from linkage_ros.report.room import DRAWN
from linkage_ros.report.run import Curves, Frames, LinkageRun, Run
from linkage_ros.report.spans import APART, Lane
from linkage_ros.report.words import LANES, QUANTITIES, short, size_in_json
import numpy as np
from numpy.typing import ArrayLike

Plot = dict[str, Any]


def page_data(run: Run, wrapped: bool) -> dict[str, Any]:
    """
    Return the data of a page, as JSON has it.

    Parameters
    ----------
    run
        What the bag holds.
    wrapped
        Whether published angles jump from π to −π.

    """
    since = max(0, run.window.since)
    until = max(since, min(run.end, run.window.until))
    frames = run.frames
    return {
        'since': since / 1e9,
        'until': until / 1e9,
        'wrapped': wrapped,
        'colours': COLOURS,
        'faces': {**FACES, 'edge': INK},
        'curves': [_curves(curves) for curves in run.curves],
        'plots': plots(run),
        'frames': _frames(frames) if frames is not None else None,
        'linkages': _linkages(run.linkages, frames) if frames is not None else [],
        'lanes': [
            {'key': key, 'title': LANES[key][0], 'spans': _spans(lane)}
            for key, lane in lanes(run).items()
        ],
        'histograms': {
            key: _histogram(found)
            for key, found in (('lateness', run.lateness), ('age', run.age))
            if found is not None
        },
    }


def lanes(run: Run) -> dict[str, Lane]:
    """Return the lanes on which something is, in the order of the page."""
    found = dict(run.lanes)
    silent = [each.silent for each in run.linkages]
    if silent:
        # Of several linkages each has its own; one of one name is told of all.
        merged = Lane(APART)
        spans = [
            (s.begin, s.end, each.name, s.count)
            for each in run.linkages
            for s in each.silent.spans
        ]
        for span in sorted(spans):
            merged.add(*span)
        merged.count = sum(lane.count for lane in silent)
        found['silent'] = merged
    return {key: found[key] for key in LANES if key in found and found[key].count}


def plots(run: Run) -> list[Plot]:
    """Return the plots over time: of each the curves, by number and column, and the unit."""
    found: dict[str, Plot] = {}
    # The crank first: all else goes by it.
    driven = {name for linkage in run.linkages for name in linkage.inputs}
    order = sorted(
        (
            (number, place, column)
            for number, curves in enumerate(run.curves)
            for place, column in enumerate(curves.columns)
        ),
        key=lambda each: (each[2].name not in driven, each[0]),
    )
    published = {
        (column.name, column.quantity) for curves in run.curves[:1] for column in curves.columns
    }
    for number, place, column in order:
        key, title = QUANTITIES[column.quantity, column.unit]
        plot = found.setdefault(
            key, {'key': key, 'title': title, 'unit': column.unit, 'curves': []}
        )
        # What is on two topics is told apart by the topic.
        twice = number and (column.name, column.quantity) in published
        foreign = not run.linkages and len(run.curves) > 1
        topic = f' on {run.curves[number].title}' if twice or foreign else ''
        plot['curves'].append({'of': number, 'column': place, 'name': column.name + topic})
    return [found[key] for key, _ in QUANTITIES.values() if key in found]


def _curves(curves: Curves) -> dict[str, Any]:
    found = curves.intervals
    single = found.rows == 1
    return {
        'title': curves.title,
        'rows': found.rows,
        'of': curves.rows,
        'begins': _seconds(found.begins),
        'ends': None if single else _seconds(found.ends),
        'first': [_packed(column, '<f8') for column in found.first.T],
        'second': None if single else [_packed(column, '<f8') for column in found.second.T],
    }


def _frames(frames: Frames) -> dict[str, Any]:
    return {
        'step': frames.step,
        'times': _seconds(frames.times),
        'values': {name: _packed(values, '<f8') for name, values in frames.values.items()},
    }


def _linkages(linkages: Sequence[LinkageRun], frames: Frames) -> list[dict[str, Any]]:
    found, room = [], DRAWN
    for linkage in linkages:
        drawn, size, undrawn = _drawn(linkage.closure, room)
        room -= size
        found.append({**_linkage(linkage, frames), 'drawn': drawn, 'undrawn': undrawn})
    return found


def _drawn(closure: Closure, room: int) -> tuple[dict[str, Any] | None, int, str]:
    """Return how a linkage is drawn and what that takes, in [bytes], or why it is not."""
    try:
        drawn = drawn_in_frames(view(closure, usual_inputs(closure)))
        size = size_in_json(drawn)
    except LinkageError as error:
        return None, 0, short(str(error), 200)
    except (ValueError, OverflowError, ZeroDivisionError):
        return None, 0, 'too large or too small for a picture'
    return (drawn, size, '') if size <= room else (None, 0, 'no room on the page')


def _linkage(linkage: LinkageRun, frames: Frames) -> dict[str, Any]:
    found = poses(linkage.closure, linkage.prefix, frames.values, linkage.inputs)
    return {
        'name': linkage.name,
        'inputs': linkage.inputs,
        'input_units': linkage.input_units,
        'joints': linkage.joints,
        'units': ['rad' if turning else 'm' for turning in linkage.closure.turning],
        'links': found.links,
        'poses': _packed(found.frames, '<f4'),
        'apart': _packed(found.apart, '<f4'),
        'untold': short(found.untold, 200),
        'silent': [[span.begin / 1e9, span.end / 1e9] for span in linkage.silent.in_order],
    }


def _spans(lane: Lane) -> list[list[Any]]:
    return [[s.begin / 1e9, s.end / 1e9, s.count, s.text] for s in lane.in_order]


def _histogram(found: Histogram) -> dict[str, Any]:
    """Return the bins on which something is, and their edges in [s]."""
    counts = found.counts
    (places,) = np.nonzero(counts)
    first, end = int(places[0]), int(places[-1]) + 1
    last_edge = end + 1
    edges = [0.0, *(edge / 1e9 for edge in EDGES), max(found.greatest, EDGES[-1]) / 1e9]
    return {
        'counts': counts[first:end].tolist(),
        'edges': edges[first:last_edge],
        'percentiles': {f'p{p}': found.percentile(p) / 1e9 for p in (50, 90, 99)},
        'greatest': found.greatest / 1e9,
    }


def _seconds(times: Any) -> str:
    return _packed(times / 1e9, '<f8')


def _packed(values: ArrayLike, kind: str) -> str:
    return b64encode(np.ascontiguousarray(values, kind).tobytes()).decode()


def facts_of_thinning(run: Run) -> Iterator[str]:
    """Yield in words how much of a run is on its page."""
    whole = [curves for curves in run.curves if curves.intervals.rows == 1]
    for curves in run.curves:
        what = {'lateness': 'the lateness of ', 'age': 'the age of the input at '}.get(
            curves.columns[0].quantity, 'messages of '
        )
        rows, count = curves.intervals.rows, len(curves.intervals.begins)
        if rows > 1:
            yield (
                f'{what}{curves.title}: {curves.rows:,}, in {count:,} intervals of {rows:,}, each '
                'with its least and its greatest value'
            )
    if whole:
        titles = dict.fromkeys(curves.title for curves in whole)
        yield f'every one of {", ".join(titles)}'
    if run.frames is not None and run.frames.step > 1:
        yield f'of the moving picture one joint state of every {run.frames.step:,}'
