# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The data of a report page; arrays are base64 of their bytes, least significant byte first.

The size is bounded, whatever the length of the run (see
`linkage_ros.tools.view.report.decimation`).

The shapes of a linkage are made once for a pose, in the frames of the links that carry them, and
then move with the links. So a rod in a tube keeps the length that it has in that pose.

Links are positioned by the recorded joints, for many instants at once. They form a tree of the
published joints, as in a robot model (`linkage_ros.tools.models.tree`), and each link is turned by
its own recorded value. The loops are not solved: where a sensor is wrong or late relative to
another, links that share a pin come apart there, and the page shows the distance. If the published
joints do not determine the position of a link, the loops are closed at the recorded inputs
instead. So are those of a spatial linkage, of which the page has places in space: see
`linkage_ros.tools.drawing.space_drawing`.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from linkage_ros.description import Units
from linkage_ros.errors import DefinitionError, LinkageError
from linkage_ros.kinematics import (
    frames_of_links,
    GROUND,
    PlanarClosure,
    prepare_view,
    separate_blocks,
    SpaceClosure,
    SpaceDrawing,
    usual_inputs,
)
from linkage_ros.tools.drawing import drawn_in_frames, space_page_data
from linkage_ros.tools.models import grow_tree, prefix_names, Tree
from linkage_ros.tools.view.report.decimation import EDGES, Histogram, Numbers, SHAPE_BYTES
from linkage_ros.tools.view.report.labels import (
    EVENT_TRACKS,
    QUANTITIES,
    shorten_text,
    size_in_json,
)
from linkage_ros.tools.view.report.run import (
    APART,
    Curves,
    EventTrack,
    Frames,
    LinkageRun,
    ReportedRun,
)
import numpy as np
from numpy.typing import ArrayLike

_FARTHEST = 1e30
"""In [m] or [rad]: larger values are implausible, and not written to the page."""

Places = Any
"""Array of complex numbers: positions in [m], or directions."""

_Found = dict[str, tuple[Places, Places]]
"""For each link the position of its frame, and its direction."""

Plot = dict[str, Any]

_NOT_PLOTTED_IF_ZERO = ('rate', 'effort', 'force')


class Poses(NamedTuple):
    """Poses of the links."""

    links: tuple[str, ...]  # The moving links, and the blocks of sliders, which are not links
    # Position, in [m], and angle, in (−π, π] rad, of each link's frame, of shape (instants, links,
    # 3); of a spatial linkage its places instead; NaN where it is unknown.
    frames: Numbers
    # Largest distance between links at a pin, or of a point from its line, in [m]; or NaN.
    apart: Numbers
    reason: str  # Why the loops were closed instead; '' if recorded joints determine every link


def link_poses(
    closure: PlanarClosure, prefix: str, values: Mapping[str, Numbers], inputs: Sequence[str]
) -> Poses:
    """
    Return the poses of the links.

    ``values`` are joint values, in [rad] or [m], by names in messages, which begin with the
    prefix; NaN where unknown. All have one length; the inputs are among them.
    """
    known = {
        name: np.where(np.abs(column) < _FARTHEST, column, np.nan)
        for name, column in values.items()
    }
    linkage = closure.linkage
    _, (names,) = prefix_names([(prefix, linkage)])
    try:
        placed, reason = _by_joints(grow_tree(linkage, names), prefix, known), ''
    except DefinitionError as error:
        placed, reason = _by_closing(closure, [known[name] for name in inputs]), error.reason
    for block in separate_blocks(linkage, closure.structure):
        place = _place_of(placed, block.link, linkage.links[block.link][block.point])
        placed.setdefault(block.name, (place, placed[block.along][1]))
    links = tuple(link for link in placed if link != GROUND)
    count = len(next(iter(values.values()), np.empty(0)))
    frames = np.full((count, len(links), 3), np.nan)
    for index, link in enumerate(links):
        place, way = placed[link]
        frames[:, index, 0] = place.real
        frames[:, index, 1] = place.imag
        frames[:, index, 2] = np.angle(way)
    # If one link of a linkage is unknown, none is drawn.
    frames[np.isnan(frames).any(axis=(1, 2))] = np.nan
    apart = _loop_gaps(closure, placed, count)
    apart[np.isnan(frames).any(axis=(1, 2))] = np.nan
    return Poses(links, frames, apart, reason)


def _by_joints(tree: Tree, prefix: str, values: Mapping[str, Numbers]) -> _Found:
    count = len(next(iter(values.values()), np.empty(0)))
    frames: _Found = {prefix + GROUND: (np.zeros(count, complex), np.ones(count, complex))}
    for joint in tree.joints:
        place, way = frames[joint.parent]
        place = place + joint.place * way
        turned = np.exp(1j * joint.turn) * way
        moved = values.get(joint.mimics or joint.name)
        if joint.kind == 'fixed':
            frames[joint.child] = place, turned
            continue
        if moved is None:
            moved = np.full(count, np.nan)
        if joint.kind == 'revolute':
            frames[joint.child] = place, turned * np.exp(1j * joint.axis.real * moved)
        else:
            frames[joint.child] = place + joint.axis * moved * turned, turned
    placed = {}
    for link in tree.linkage.links:
        place, way = frames[prefix + link]
        placed[link] = place - tree.origins[link] * way, way
    return placed


def _by_closing(closure: PlanarClosure, inputs: Sequence[Numbers]) -> _Found:
    links = (
        *closure.linkage.links,
        *(block.name for block in separate_blocks(closure.linkage, closure.structure)),
    )
    count = len(inputs[0])
    placed = {link: (np.full(count, np.nan + 0j), np.full(count, np.nan + 0j)) for link in links}
    for i, inputs_now in enumerate(zip(*(values.tolist() for values in inputs), strict=True)):
        if not all(np.isfinite(inputs_now)):
            continue
        position = closure.position(*inputs_now)
        if not position.joints:
            continue
        for link, frame in frames_of_links(closure, position).items():
            place, way = placed[link]
            place[i], way[i] = frame.place, np.exp(1j * frame.angle)
    return placed


def _place_of(placed: _Found, link: str, point: tuple[float, float]) -> Places:
    place, way = placed[link]
    return place + complex(*point) * way


def _loop_gaps(closure: PlanarClosure, placed: _Found, count: int) -> Numbers:
    linkage = closure.linkage
    worst = np.zeros(count)
    carriers: dict[str, list[str]] = {}
    for link, named in linkage.links.items():
        for point in named:
            carriers.setdefault(point, []).append(link)
    for point, (first, *others) in carriers.items():
        place = _place_of(placed, first, linkage.links[first][point])
        for link in others:
            worst = np.maximum(
                worst, np.abs(_place_of(placed, link, linkage.links[link][point]) - place)
            )
    for slider in linkage.sliders.values():
        unit = complex(*slider.direction) / abs(complex(*slider.direction))
        through = _place_of(placed, slider.along, linkage.links[slider.along][slider.through])
        carrier = carriers[slider.point][0]
        between = _place_of(placed, carrier, linkage.links[carrier][slider.point]) - through
        across = between / (unit * placed[slider.along][1])
        worst = np.maximum(worst, np.abs(across.imag))
    return worst


def page_data(run: ReportedRun, wrapped: bool, units: Units) -> dict[str, Any]:
    """Return the data of a page, as JSON holds them; wrapped angles jump from π to −π."""
    since = max(0, run.window.since)
    until = max(since, min(run.end, run.window.until))
    frames = run.frames
    return {
        'since': since / 1e9,
        'until': until / 1e9,
        'units': {
            'wrapped': wrapped,
            'degrees': units.angle == 'degrees',
            'length': {'length': units.length, 'factor': units.to_si(1.0, 'm')},
        },
        'curves': [_curves_json(curves) for curves in run.curves],
        'plots': time_plots(run),
        'frames': _frames_json(frames) if frames is not None else None,
        'linkages': _linkages_json(run.linkages, frames) if frames is not None else [],
        'lanes': [
            {'key': key, 'title': EVENT_TRACKS[key][0], 'spans': _spans_json(lane)}
            for key, lane in event_tracks(run).items()
        ],
        'histograms': {
            key: _histogram_json(histogram)
            for key, histogram in (('lateness', run.lateness), ('age', run.age))
            if histogram is not None
        },
    }


def event_tracks(run: ReportedRun) -> dict[str, EventTrack]:
    """Return the lanes that have events, in the order of the page."""
    shown = dict(run.event_tracks)
    silent = [linkage.silent for linkage in run.linkages]
    if silent:
        # Each linkage has its own silences; one lane shows all.
        merged = EventTrack(APART)
        spans = [
            (s.begin, s.end, linkage.name, s.count)
            for linkage in run.linkages
            for s in linkage.silent.spans
        ]
        for span in sorted(spans):
            merged.add(*span)
        merged.count = sum(lane.count for lane in silent)
        shown['silent'] = merged
    return {key: shown[key] for key in EVENT_TRACKS if key in shown and shown[key].count}


def time_plots(run: ReportedRun) -> list[Plot]:
    """Return the plots over time: for each its curves, by number and column, and its unit."""
    return [plot for plot in _all_plots(run) if not _is_zero(plot, run)]


def zero_plots(run: ReportedRun) -> list[str]:
    """Return the titles of the plots that are left out because all their values are zero."""
    return [plot['title'] for plot in _all_plots(run) if _is_zero(plot, run)]


def _all_plots(run: ReportedRun) -> list[Plot]:
    plots: dict[str, Plot] = {}
    # The crank comes first: everything else depends on it.
    driven = {name for linkage in run.linkages for name in linkage.inputs}
    order = sorted(
        (
            (index, place, column)
            for index, curves in enumerate(run.curves)
            for place, column in enumerate(curves.columns)
        ),
        key=lambda curve: (curve[2].name not in driven, curve[0]),
    )
    published = {
        (column.name, column.quantity) for curves in run.curves[:1] for column in curves.columns
    }
    for number, place, column in order:
        key, title = QUANTITIES[column.quantity, column.unit]
        plot = plots.setdefault(
            key, {'key': key, 'title': title, 'unit': column.unit, 'curves': []}
        )
        # If a joint is on two topics, the topic is shown as well.
        twice = number and (column.name, column.quantity) in published
        foreign = not run.linkages and len(run.curves) > 1
        topic = f' on {run.curves[number].title}' if twice or foreign else ''
        plot['curves'].append({'of': number, 'column': place, 'name': column.name + topic})
    return [plots[key] for key, _ in QUANTITIES.values() if key in plots]


def _is_zero(plot: Plot, run: ReportedRun) -> bool:
    """Return whether a plot has only zeros; angles and times are plotted even so."""
    for curve in plot['curves']:
        curves = run.curves[curve['of']]
        place = curve['column']
        if curves.columns[place].quantity not in _NOT_PLOTTED_IF_ZERO:
            return False
        for values in (curves.intervals.first[:, place], curves.intervals.second[:, place]):
            if not (np.isnan(values) | (values == 0.0)).all():
                return False
    return True


def _curves_json(curves: Curves) -> dict[str, Any]:
    intervals = curves.intervals
    single = intervals.rows == 1
    return {
        'title': curves.title,
        'rows': intervals.rows,
        'of': curves.rows,
        'begins': _pack_seconds(intervals.begins),
        'ends': None if single else _pack_seconds(intervals.ends),
        'first': [_pack_values(column, '<f8') for column in intervals.first.T],
        'second': None
        if single
        else [_pack_values(column, '<f8') for column in intervals.second.T],
    }


def _frames_json(frames: Frames) -> dict[str, Any]:
    return {
        'step': frames.step,
        'times': _pack_seconds(frames.times),
        'values': {name: _pack_values(values, '<f8') for name, values in frames.values.items()},
    }


def _linkages_json(linkages: Sequence[LinkageRun], frames: Frames) -> list[dict[str, Any]]:
    shown, space = [], SHAPE_BYTES
    for linkage in linkages:
        closure: Any = linkage.closure
        drawing: dict[str, Any] | None = None
        if isinstance(closure, PlanarClosure):
            poses = link_poses(closure, linkage.prefix, frames.values, linkage.inputs)
        else:
            poses, drawing = _spatial_poses(closure, [frames.values[n] for n in linkage.inputs])
        drawn, size, undrawn = _drawing_of(closure, drawing, space)
        space -= size
        shown.append({**_linkage_json(linkage, poses), 'drawn': drawn, 'undrawn': undrawn})
    return shown


def _drawing_of(
    closure: Any, drawn: dict[str, Any] | None, space: int
) -> tuple[dict[str, Any] | None, int, str]:
    """Return the drawing of a linkage and its size in [bytes], or why there is none."""
    try:
        drawn = drawn or drawn_in_frames(prepare_view(closure, usual_inputs(closure)))
        size = size_in_json(drawn)
    except LinkageError as error:
        return None, 0, shorten_text(str(error), 200)
    except (ValueError, OverflowError, ZeroDivisionError):
        return None, 0, 'too large or too small for a picture'
    return (drawn, size, '') if size <= space else (None, 0, 'no room on the page')


def _spatial_poses(closure: SpaceClosure, inputs: Sequence[Numbers]) -> tuple[Poses, Any]:
    """Return places of a spatial linkage instead of frames, and its drawing."""
    drawing, count = SpaceDrawing(closure), len(inputs[0])
    places = np.full((count, drawing.count, 3), np.nan)
    for i, inputs_now in enumerate(zip(*(values.tolist() for values in inputs), strict=True)):
        if all(abs(value) < _FARTHEST for value in inputs_now):
            position = closure.position(*inputs_now)
            if position.joints:
                places[i] = drawing.places(position)
    known = places[np.isfinite(places).all(axis=(1, 2))]
    if not len(known):
        known = drawing.places(closure.position(*usual_inputs(closure)))[None]
    return Poses((), places, np.full(count, np.nan), ''), space_page_data(drawing, known)


def _linkage_json(linkage: LinkageRun, poses: Poses) -> dict[str, Any]:
    return {
        'name': linkage.name,
        'inputs': linkage.inputs,
        'input_units': linkage.input_units,
        'joints': linkage.joints,
        'units': ['rad' if turning else 'm' for turning in linkage.closure.turning],
        'links': poses.links,
        'poses': _pack_values(poses.frames, '<f4'),
        'apart': _pack_values(poses.apart, '<f4'),
        'untold': shorten_text(poses.reason, 200),
        'silent': [[span.begin / 1e9, span.end / 1e9] for span in linkage.silent.in_order],
    }


def _spans_json(track: EventTrack) -> list[list[Any]]:
    return [[s.begin / 1e9, s.end / 1e9, s.count, s.text] for s in track.in_order]


def _histogram_json(histogram: Histogram) -> dict[str, Any]:
    """Return the bins that are not empty, and their edges in [s]."""
    counts = histogram.counts
    (places,) = np.nonzero(counts)
    first, end = int(places[0]), int(places[-1]) + 1
    last_edge = end + 1
    edges = [0.0, *(edge / 1e9 for edge in EDGES), max(histogram.greatest, EDGES[-1]) / 1e9]
    return {
        'counts': counts[first:end].tolist(),
        'edges': edges[first:last_edge],
        'percentiles': {f'p{p}': histogram.percentile(p) / 1e9 for p in (50, 90, 99)},
        'greatest': histogram.greatest / 1e9,
    }


def _pack_seconds(times: Any) -> str:
    return _pack_values(times / 1e9, '<f8')


def _pack_values(values: ArrayLike, kind: str) -> str:
    return b64encode(np.ascontiguousarray(values, kind).tobytes()).decode()


def facts_of_thinning(run: ReportedRun) -> Iterator[str]:
    """Yield the decimation of the curves, in words."""
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
