# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Compare the ranges and singular values of a single input with a fine sampling of it."""

from __future__ import annotations

from math import inf, remainder, tau
from typing import NamedTuple

from campaigns.accuracy.dyads import RPR
from campaigns.tally import Judgement
from campaigns.topologies.constraints import Array, Real
from campaigns.topologies.geometry import Geometry, Margin, Passing
from campaigns.topologies.topology import Topology, Walks
from linkage_ros.kinematics import Closure, GROUND, SingularInput, Status
import numpy as np

SAMPLES = 2400
"""Number of samples over a turn, or over the reach of a slide; the pose is one of them."""

_FLAT = 1e-13
"""Margin of a dyad at a change point, which is 0 but for rounding, relative to its lengths."""

_NEARLY_FLAT = 0.03
_SAME = 1e-6
"""Tolerance of input values, in [rad] or relative to the reach of a slide."""


class Travel(NamedTuple):
    """The values of an input at which the loops close."""

    parts: list[tuple[float, float]]  # Intervals of the input, in [rad] or [m]
    ends: list[float]  # Ends of these intervals that are limits of the linkage
    changes: list[float]  # Values within them at which the links of a dyad are in line
    parallels: list[float]  # Values at which the two lines of a dyad are parallel


def judge_ranges(
    topology: Topology, closure: Closure, findings: Judgement, walks: Walks | None
) -> None:
    """Compare the package's ranges and singular values of a single input with its samples."""
    turning = not topology.linkage.inputs[0].slider
    try:
        ranges = closure.input_ranges
        singular = closure.singular_inputs
        position = closure.position(*topology.start)
        distance = closure.singularity_margin(position).toggle_distance if position.joints else inf
    except Exception as error:  # noqa: BLE001 - it is counted
        findings.find('traceback: ranges', repr(error))
        return
    if walks is not None:
        _judge_branch(topology, closure, walks, findings)
        return
    far = np.pi if turning else _reach(topology)
    geometry = Geometry(topology.linkage, topology.groups or (), topology.sides)
    start = topology.start[0]
    travel = _travel(geometry, start, far, turning)
    zero = _zero_length(topology)
    if zero is not None:
        pose = topology.linkage.pose
        side = -1.0 if pose is not None and pose.inputs[0] < zero else 1.0
        start = zero + side * abs(start - zero)
        travel = _on_a_side(travel, zero, side)
    same = _SAME * (1.0 if turning else far)
    values = _samples(topology.start[0], far, turning)
    for value in values:
        inside = any(low - same <= value <= high + same for low, high in travel.parts)
        well_inside = any(low + same <= value <= high - same for low, high in travel.parts)
        in_range = any(
            interval.is_whole or interval.lowest - same <= value + turn <= interval.highest + same
            for interval in ranges
            for turn in ((-2 * tau, -tau, 0.0, tau, 2 * tau) if turning else (0.0,))
        )
        if well_inside and not in_range:
            findings.find('range: a part is missing', f'{value:.9g} closes, not in {ranges}')
            break
        if in_range and not inside:
            findings.find('range: too wide', f'{value:.9g} is open, but in {ranges}')
            break
    _judge_singular(topology, travel, singular, same, findings)
    true = [*travel.ends, *travel.changes, *travel.parallels]
    away = [_apart(start, place, turning) for place in true]
    nearest = min(away, default=inf)
    if nearest < inf and not abs(distance - nearest) <= same:
        findings.find('singular: distance', f'{distance:.6g}, in truth {nearest:.6g}')


def _zero_length(topology: Topology) -> float | None:
    """Return the slide at which the two pins of a cylinder coincide; None if there is none."""
    linkage = topology.linkage
    slider = linkage.sliders.get(linkage.inputs[0].slider)
    if slider is None or GROUND in (slider.along, slider.block):
        return None
    others = [name for one in linkage.sliders.values() for name in (one.along, one.block)]
    shared = [name for points in linkage.links.values() for name in points]
    ends = []
    for link in (slider.along, slider.block):
        pins = [name for name in linkage.links.get(link, {}) if shared.count(name) > 1]
        if len(pins) != 1 or others.count(link) > 1:
            return None
        ends.append(complex(*linkage.links[link][pins[0]]))
    tube, rod = linkage.links[slider.along], linkage.links[slider.block]
    line = complex(*slider.direction) / abs(complex(*slider.direction))
    arm = (ends[1] - complex(*rod[slider.point])) * np.exp(1j * slider.angle)
    between = complex(*tube[slider.through]) + arm - ends[0]
    across = (between * line.conjugate()).imag
    return None if abs(across) > 1e-12 * abs(between) else -(between * line.conjugate()).real


def _on_a_side(travel: Travel, zero: float, side: float) -> Travel:
    """Return the travel of a cylinder on one side of the slide at which its pins coincide."""
    low, high = (zero, inf) if side > 0.0 else (-inf, zero)
    parts = [(max(one, low), min(other, high)) for one, other in travel.parts]
    return Travel(
        [(one, other) for one, other in parts if one < other],
        *([one for one in places if low < one < high] for places in travel[1:]),
    )


def _judge_singular(
    topology: Topology,
    travel: Travel,
    singular: tuple[SingularInput, ...],
    same: float,
    findings: Judgement,
) -> None:
    """Compare the listed singular values with the true ones, by their kind."""
    turning = not topology.linkage.inputs[0].slider
    passed = any(isinstance(side, Passing) for side in topology.sides.values())
    at_changes = {Status.CHANGE_POINT if passed else Status.TOGGLE}
    if isinstance((topology.groups or ())[-1], RPR):
        at_changes.add(Status.INDETERMINATE)  # The pins of a straight rod coincide.
    unmatched = list(singular)
    for kind, places, statuses in (
        ('toggle', travel.ends, {Status.TOGGLE}),
        ('change point', travel.changes, at_changes),
        ('parallel lines', travel.parallels, {Status.INDETERMINATE}),
    ):
        for place in places:
            near = [one for one in singular if _apart(place, one.value, turning) <= same]
            unmatched = [one for one in unmatched if one not in near]
            listed = [one.value for one in singular]
            if not near:
                findings.find(f'singular: {kind} not listed', f'{place:.9g}, not in {listed}')
            elif not any(one.status in statuses for one in near):
                note = f'{place:.9g} is a {near[0].status.value}'
                findings.find(f'singular: {kind} has another status', note)
    if unmatched:
        findings.find('singular: listed, but regular', f'{unmatched[0].value:.9g}')


def _judge_branch(topology: Topology, closure: Closure, walks: Walks, findings: Judgement) -> None:
    """Compare the range about the pose with the part over which the linkage can be followed."""
    turning = not topology.linkage.inputs[0].slider
    start = topology.start[0]
    down, up = walks
    ranges = closure.input_ranges
    turns = (0.0, -tau, tau) if turning else (0.0,)
    about = [
        (interval, turn)
        for turn in turns
        for interval in ranges
        if interval.is_whole or interval.lowest <= start + turn <= interval.highest
    ]
    if not about:
        findings.find('range: a part is missing', f'the pose at {start:.9g} is not in {ranges}')
        return
    interval, turn = about[0]
    if interval.is_whole:
        if down.end + up.end < tau - _SAME:
            findings.find(
                'range: too wide', f'all, but {start - down.end:.9g} to {start + up.end:.9g}'
            )
        return
    for walk, sign, end in ((down, -1, interval.lowest), (up, 1, interval.highest)):
        true, listed_end = start + sign * walk.end, end - turn
        same = _SAME * max(1.0, abs(true))
        short = sign * (true - listed_end)
        # A slide is followed for a limited length only.
        if short > same and interval.limited[sign > 0]:
            findings.find('range: a part is missing', f'to {true:.9g}, listed to {listed_end:.9g}')
        elif short < -same and not walk.complete:
            findings.find('range: too wide', f'to {true:.9g}, listed to {listed_end:.9g}')
        listed = [one.value for one in closure.singular_inputs]
        if (
            not walk.complete
            and min((_apart(true, v, turning) for v in listed), default=inf) > same
        ):
            findings.find('singular: toggle not listed', f'{true:.9g}, not in {listed}')


def _samples(start: float, far: float, turning: bool) -> Array:
    if turning:
        first = (start + np.pi) % (tau / SAMPLES) - np.pi
        return np.asarray(first + np.arange(SAMPLES + 1) * (tau / SAMPLES))
    return np.sort(np.append(np.linspace(-far, far, SAMPLES), start))


def _travel(geometry: Geometry, start: float, far: float, turning: bool) -> Travel:
    samples = _samples(start, far, turning)
    spare = _spare_at(geometry, samples)
    values = np.union1d(samples, _turning_points(geometry, samples, spare))
    closes = np.asarray((_spare_at(geometry, values) >= -_FLAT).all(0))
    borders = [i for i in range(len(values) - 1) if closes[i] != closes[i + 1]]
    inner = np.array([values[i] if closes[i] else values[i + 1] for i in borders])
    outer = np.array([values[i + 1] if closes[i] else values[i] for i in borders])
    for _ in range(60 if borders else 0):
        middle = 0.5 * (inner + outer)
        good = (_spare_at(geometry, middle) >= 0.0).all(0)
        inner, outer = np.where(good, middle, inner), np.where(good, outer, middle)
    edges = inner.tolist()
    parts, ends = [], list(edges)
    low = -inf if closes[0] else None
    for i, edge in zip(borders, edges, strict=True):
        if closes[i] and low is not None:
            parts.append((low, edge))
            low = None
        else:
            low = edge
    if low is not None:
        parts.append((low, inf))
    # Lines may be parallel between an end and the next sample.
    fine = np.sort(np.concatenate([values, inner]))
    there = geometry.place(fine[None, :].astype(Real))
    open_ones = np.asarray((_spare(there.margins, len(fine)) < -_FLAT).any(0))
    parallels = _parallel(geometry, there.crossings, fine, ~open_ones)
    # Near parallel lines a dyad is far away, and its lengths are small relative to that.
    changes = _flat(geometry, samples, spare, [*ends, *parallels], turning)
    return Travel(parts, ends, changes, parallels)


def _turning_points(geometry: Geometry, values: Array, spare: Array) -> Array:
    """Return where the margin of a dyad changes sign twice between two samples."""
    found = []
    for k, row in enumerate([*spare, spare.min(0)]):
        before, here, after = row[:-2], row[1:-1], row[2:]
        # If a dyad always closes, or an earlier dyad is open, all its samples are equal.
        valley = (here > 0.0) & (here <= np.minimum(before, after)) & (here < before)
        summit = (here < 0.0) & (here >= np.maximum(before, after)) & (here > before)
        for sign, at in ((1.0, valley), (-1.0, summit)):
            places, width = values[1:-1][at], float(np.diff(values).max())
            least = sign * here[at]
            for _ in range(14 if len(places) else 0):
                near = places[:, None] + width * np.linspace(-1.0, 1.0, 41)
                fine = _spare_at(geometry, near.ravel())
                one = sign * (fine[k] if k < len(spare) else fine.min(0)).reshape(near.shape)
                nearest = np.argmin(one, axis=1)[:, None]
                places = np.take_along_axis(near, nearest, 1)[:, 0]
                least = np.take_along_axis(one, nearest, 1)[:, 0]
                width /= 15.0
            # A margin that only touches zero is no range, as near parallel lines, where the
            # lengths of a dyad are small relative to its distance.
            found.append(places[least < -_FLAT])
    return np.concatenate(found)


def _spare_at(geometry: Geometry, values: Array) -> Array:
    """Return the margin of each dyad at input values, relative to its lengths, (dyads, N)."""
    return _spare(geometry.place(values[None, :].astype(Real)).margins, len(values))


def _spare(margins: list[Margin], count: int) -> Array:
    """Return the margin of each dyad, relative to its lengths, (dyads, N)."""
    if not margins:
        return np.ones((1, count))
    found = np.array([margin.spare / margin.grain for margin in margins])
    return np.asarray(np.nan_to_num(found, nan=-1.0))


def _flat(
    geometry: Geometry,
    values: Array,
    spare: Array,
    borders: list[float],
    turning: bool,
) -> list[float]:
    """Return where the margin of a dyad is zero within a range."""
    found: list[float] = []
    closes = np.asarray((spare >= -_FLAT).all(0))
    for k, row in enumerate(spare):
        # At an end of the samples of a slide a zero margin may be an end of the range.
        for i in range(0 if turning else 1, len(row) - (0 if turning else 1)):
            # The first and the last sample of a turn are the same state.
            last = len(row) - 1
            before = row[i - 1 if i or not turning else last - 1]
            after = row[i + 1 if i < last else 1 if turning else last]
            if not (closes[i] and row[i] < _NEARLY_FLAT and row[i] <= min(before, after)):
                continue
            width = float(values[1] - values[0])
            at = float(values[i])
            for _ in range(11):
                near = at + width * np.linspace(-1.0, 1.0, 41)
                fine = _spare_at(geometry, near)[k]
                at, width = float(near[np.argmin(np.abs(fine))]), width / 15.0
            least = float(np.abs(fine).min())
            at_a_border = any(abs(at - border) < 1e-3 for border in borders)
            if least < _FLAT and not at_a_border:
                found.append(at)
    return found


def _parallel(
    geometry: Geometry, crossings: list[Array], values: Array, closes: Array
) -> list[float]:
    """Return the inputs at which two lines of a dyad are parallel."""
    found: list[float] = []
    for k, row in enumerate(crossings):
        both = closes[:-1] & closes[1:]
        borders = np.flatnonzero(both & (row[:-1] * row[1:] < 0.0))
        low, high, below = values[borders], values[borders + 1], row[borders]
        for _ in range(50 if len(borders) else 0):
            middle = 0.5 * (low + high)
            at = geometry.place(middle[None, :].astype(Real)).crossings[k]
            same = at * below > 0.0
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        found += low.tolist()
    return found


def _reach(topology: Topology) -> float:
    """Return the sum of how far each link reaches: no slide need be longer."""
    return sum(
        max(abs(complex(*p) - complex(*q)) for p in points.values() for q in points.values())
        for points in topology.linkage.links.values()
    )


def _apart(one: float, other: float, turning: bool) -> float:
    return abs(remainder(one - other, tau) if turning else one - other)
