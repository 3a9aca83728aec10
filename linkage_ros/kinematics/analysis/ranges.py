# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The ranges of an input: the intervals in which every loop closes.

The limits of a dyad on a crank and the ground follow from its lengths, the limits of an iterated
group from its branch. The limits of all other dyads are searched within these ranges: the input is
sampled, and each limit is narrowed down to neighbouring floats.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import takewhile, zip_longest
from math import acos, asin, ceil, cos, floor, inf, isfinite, lcm, pi, remainder, sqrt, tau
from typing import Any, TYPE_CHECKING

from linkage_ros.kinematics.plane.diagonals import CrankDiagonal
from linkage_ros.kinematics.plane.dyads.rpp import RPPDyad
from linkage_ros.kinematics.plane.linkage import Point
from linkage_ros.kinematics.results import InputRange, Position
from linkage_ros.kinematics.step import (
    FixedPoint,
    GearedAngle,
    PLACED,
    PointOnLink,
    PointOnRail,
    RelativeAngle,
)
from linkage_ros.progress import tell_progress

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure
    from linkage_ros.kinematics.iterated.branch import Branch
    from linkage_ros.kinematics.limits import Bound

# The lowest value of a function between two places, by golden sections (Kiefer, 1953).

_RATIO = (sqrt(5.0) - 1.0) / 2.0

_SAMPLES = 720

_POINT = 1e-9
"""Fraction of an interval: a narrower open part is a single place without a pose, and no gap."""

_ROUNDED = 1e-9
"""A margin farther from zero than this has a certain sign."""

_SECANT = 0.97
"""Part of the way to the zero of a secant."""

_FLAT = 1e-12
"""A margin that changes less between samples, relative to itself, is constant there."""

_CLOSE_EVERYWHERE = (FixedPoint, PointOnLink, PointOnRail, RPPDyad, RelativeAngle, GearedAngle)

_SAME = 1e-9
"""Largest difference of joints that count as equal, in [rad] or relative to the scale."""

_COPIES = 8
"""Largest number of turns of a range that are listed for an input with wide limits."""


def golden_section(
    function: Callable[[float], float], low: float, high: float
) -> tuple[float, float]:
    """Return the minimum and minimiser of a function on an interval, by golden section."""
    first, second = high - _RATIO * (high - low), low + _RATIO * (high - low)
    at_first, at_second = function(first), function(second)
    for _ in range(80):
        if not low < first < second < high:
            break
        if at_first <= at_second:
            high, second, at_second = second, first, at_first
            first = high - _RATIO * (high - low)
            at_first = function(first)
        else:
            low, first, at_first = first, second, at_second
            second = low + _RATIO * (high - low)
            at_second = function(second)
    return min((at_first, first), (at_second, second))


def closing_ranges(closure: Closure) -> tuple[InputRange, ...]:
    """
    Return the ranges of a single input in which every loop closes, without limits of joints.

    Empty if it closes nowhere, or if there are several inputs.
    """
    if len(closure.linkage.inputs) > 1:
        return ()
    branches = _iterated_branches(closure)
    if branches:
        # Each branch is followed only where those before it close: the last one lies within all.
        return tuple(_on_a_branch(closure, branches[-1]))
    if closure.linkage.inputs[0].slider:
        far = closure.slide_bound
        return tuple(
            InputRange(low, high, False, (low > -far, high < far))
            for low, high in _search_intervals(closure, -far, far, 4 * _SAMPLES)
        )
    if closure.ratio_turns != 1:
        return tuple(_in_turns(closure, closure.ratio_turns))
    intervals = [(-pi, pi)]
    exact = True
    for step in closure.steps:
        diagonal = step.span
        if isinstance(diagonal, CrankDiagonal) and diagonal.arms[:2] == (1, 0):
            found = _crank_intervals(diagonal)
            shifted = [(low - diagonal.offset, high - diagonal.offset) for low, high in found]
            # The first dyad sets the frame; further ones on the same crank are cut out below.
            exact = exact and intervals == [(-pi, pi)]
            intervals = shifted if exact else intervals
        elif not isinstance(step, _CLOSE_EVERYWHERE):
            exact = False
    if intervals and not exact:
        start, end = intervals[0][0], intervals[-1][1]
        intervals = [
            part for ends in intervals for part in _search_intervals(closure, *ends, _SAMPLES)
        ]
        if end - start >= tau:
            intervals = through_the_end(intervals, start, end)
    return tuple(InputRange(low, high) for low, high in intervals)


def _in_turns(closure: Closure, turns: int) -> Iterator[InputRange]:
    """Yield the ranges of an angle whose poses repeat after some turns, or never (0)."""
    limits = closure.linkage.inputs[0].limits
    far = (turns or _COPIES) * pi
    low, high = -far, far
    if not turns and limits.low > -inf and limits.high < inf:
        low, high = limits.low, limits.high
    parts = _search_intervals(closure, low, high, _SAMPLES * ceil((high - low) / tau))
    if turns:
        parts = through_the_end(parts, low, high, turns * tau)
    for begin, end in parts:
        ends = (True, True) if turns else (begin > low, end < high)
        yield InputRange(begin, end, True, ends, turns)


def through_the_end(
    parts: list[tuple[float, float]], low: float, high: float, turn: float = tau
) -> list[tuple[float, float]]:
    """
    Return the parts of whole turns; the parts at both ends are one through the end.

    There too a single place without a pose is no gap.
    """
    if not parts or parts[0][0] - low + high - parts[-1][1] > _POINT * (high - low):
        return parts
    if len(parts) == 1:
        return [(low, high)]
    (_, end), *others, (begin, _) = parts
    return [*others, (begin, end + turn)]


def _iterating_steps(closure: Closure) -> dict[int, Any]:
    """Return the steps that iterate, by their numbers."""
    return {index: step for index, step in enumerate(closure.steps) if step.follows_branch}


def is_iterated(closure: Closure) -> bool:
    """Return whether a linkage has links that only iteration solves."""
    return any(step.iterates for step in closure.steps)


def whole_turns(closure: Closure) -> int:
    """Return the number of whole turns after which poses repeat; 0 if each turn differs."""
    if len(closure.linkage.inputs) > 1:
        return 0 if is_iterated(closure) else 1
    periods = (
        branch.interval.period_turns if branch else 1 for branch in _iterated_branches(closure)
    )
    return lcm(closure.ratio_turns, *periods)


def _iterated_branches(closure: Closure) -> list[Branch | None]:
    """Return the branch of each iterated group."""
    return [step.branch() for step in _iterating_steps(closure).values()]


def _on_a_branch(closure: Closure, branch: Branch | None) -> Iterator[InputRange]:
    """Yield the intervals of a branch in which the steps after it close too."""
    if branch is None:
        return
    after = 1 + max(_iterating_steps(closure))
    turning = not closure.linkage.inputs[0].slider
    unit = 1.0 if turning else closure.scale
    low, high, limited, turns, _ = branch.interval
    low, high = (-pi * turns, pi * turns) if turns else (low * unit, high * unit)
    parts = [(low, high)]
    poses = closure.close_unlimited(0.5 * (low + high)).poses
    behind = zip_longest(closure.steps[after:], poses[after:])
    if not all(pose is PLACED or isinstance(step, _CLOSE_EVERYWHERE) for step, pose in behind):
        count = _SAMPLES * max(1, ceil((high - low) / tau)) if turning else 4 * _SAMPLES
        parts = _search_intervals(closure, low, high, count)
        if turns:
            parts = through_the_end(parts, low, high, turns * tau)
    for begin, end in parts:
        ends = limited[0] or begin > low, limited[1] or end < high
        # A full turn has no ends; it is reported as for dyads.
        ends = ends if any(ends) else (True, True) if turns else ends
        yield InputRange(begin, end, turning, ends, whole_turns(closure))


def describe_ranges(ranges: tuple[InputRange, ...]) -> str:
    """Return ranges as text for a user."""
    return ' or '.join(map(str, ranges)) or 'no single range: it depends on every input'


def _crank_intervals(diagonal: CrankDiagonal) -> list[tuple[float, float]]:
    """
    Return the intervals of φ in which a dyad on a crank closes.

    The diagonal s grows with |φ| from |d − a| to a + d. Its limits are met at::

        sin²(φ/2) = (lower² − (d − a)²)/(4ad)        cos²(φ/2) = ((a + d)² − upper²)/(4ad)
    """
    a, d = diagonal.sides
    lower, upper, _ = diagonal.limits
    lowest, highest = 0.0, pi
    if diagonal.fold_margin < 0.0:
        square = -diagonal.fold_margin / a * (lower + abs(d - a)) / d / 4.0
        if square > 1.0:
            return []
        lowest = 2.0 * asin(sqrt(square))
    if upper != inf and diagonal.stretch_margin < 0.0:
        square = -diagonal.stretch_margin / a * (a + d + upper) / d / 4.0
        if square > 1.0:
            return []
        highest = 2.0 * acos(sqrt(square))
    if lowest == 0.0:
        return [(-highest, highest)]
    if highest == pi:
        return [(lowest, tau - lowest)]
    return [(-highest, -lowest), (lowest, highest)]


def link_lengths(links: Mapping[str, Mapping[str, Point]]) -> list[float]:
    """Return the longest distance between two points of each link, in [m]."""
    return [
        max(abs(complex(*p) - complex(*q)) for p in points.values() for q in points.values())
        for points in links.values()
    ]


def sample_inputs(interval: InputRange, count: int = _SAMPLES) -> list[float]:
    """
    Return values from one end of a range to the other.

    Near the limits of a range joints move as the square root of the input: there samples are
    denser.
    """
    low, high = interval.lowest, interval.highest
    if interval.is_whole:
        return even_samples(low, high, count)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    inner = [middle - half * cos(pi * i / count) for i in range(1, count)]
    return [low, *(min(max(value, low), high) for value in inner), high]


def even_samples(low: float, high: float, count: int = _SAMPLES) -> list[float]:
    """Return values from one end of an interval to the other, at equal distances."""
    return [low + (high - low) * i / count for i in range(count)] + [high]


def find_intervals(
    closes: Callable[[float], bool],
    values: Sequence[float],
    margin: Callable[[float], float] | None = None,
) -> Iterator[tuple[float, float]]:
    """
    Yield the parts of an interval, sampled at ``values``, in which loops close or the like.

    ``margin`` is the margin by which it holds at a value, negative if it does not. Its valleys and
    summits between samples are tested too; without it, parts narrower than a sample are missed.
    """
    low, high = values[0], values[-1]
    known: dict[float, bool] = {}
    if margin is not None:
        margins = []
        for number, value in enumerate(values):
            tell_progress('values of the input tried', number, len(values))
            margins.append(margin(value))
        # Next to zero the margin may round to either side.
        known = {v: m > 0.0 for v, m in zip(values, margins, strict=True) if abs(m) > _ROUNDED}
        values = sorted({*values, *_turning_points(margin, values, margins)})
    begin = None
    before = low
    for value in values:
        if known[value] if value in known else closes(value):
            if begin is None:
                begin = last_inside(closes, value, before) if value > low else value
        elif begin is not None:
            yield begin, last_inside(closes, before, value)
            begin = None
        before = value
    if begin is not None:
        yield begin, high


def interval_about(
    margin: Callable[[float], float], values: Sequence[float], place: float
) -> tuple[float, float] | None:
    """
    Return the part about a place in which a margin is not negative, or None.

    Of `find_intervals` it is one part, without the others.
    """
    number, ends = bisect_left(values, place), []
    below, above = values[:number][::-1], values[number:]
    for way, back in ((below, above), (above, below)):
        inside = [*takewhile(lambda value: margin(value) >= 0.0, way)]
        inside = inside or [value for value in back[:1] if margin(value) >= 0.0]
        if not inside:
            return None
        count = len(inside)
        outside = way[count:] if inside[0] in way else way
        ends.append(_find_end(margin, inside[-1], outside[0]) if outside else inside[-1])
    low, high = ends
    return (low, high) if low <= place <= high else None


def _find_end(margin: Callable[[float], float], inside: float, outside: float) -> float:
    """
    Return a value at which a margin is 0, else the last one at which it is not negative.

    Next to such a value it falls in a straight line, so secants lead there.
    """
    far, near = (inside, inf), (outside, margin(outside))
    while (middle := 0.5 * (inside + near[0])) not in (inside, near[0]):
        slope = (near[1] - far[1]) / (near[0] - far[0])
        # A little before the zero of the secant, for inside nothing says how far it is.
        value = near[0] - _SECANT * near[1] / slope if isfinite(slope) and slope else inside
        if not min(inside, near[0]) < value < max(inside, near[0]):
            value = middle
        found = margin(value)
        if found == 0.0:
            return value
        if found > 0.0:
            inside, far = value, (value, inf)
        else:
            far, near = near, (value, found)
    return inside


def _turning_points(
    margin: Callable[[float], float], values: Sequence[float], margins: Sequence[float]
) -> Iterator[float]:
    """Yield the values between samples at which a margin may cross zero and return."""
    last = len(values) - 1
    for i, here in enumerate(margins):
        # At an end it may cross zero before the first sample inside.
        before, after = max(i - 1, 0), min(i + 1, last)
        if abs(margins[before] - here) + abs(margins[after] - here) < _FLAT * abs(here):
            continue
        if 0.0 < here <= min(margins[before], margins[after]) and here < inf:
            yield golden_section(margin, values[before], values[after])[1]
        elif 0.0 > here >= max(margins[before], margins[after]):
            yield golden_section(lambda x: -margin(x), values[before], values[after])[1]


def _closing_margin(closure: Closure, value: float) -> float:
    """Return the distance of a state from the limits of its dyads; negative if it is open."""
    position = closure.close_unlimited(value)
    if not position.status.has_pose:
        # Where two pins meet, or two lines are parallel, the range does not end.
        return 0.0 if not position.gap else -position.gap
    angles = [
        step.transmission_angle(pose)
        for step, pose in zip(closure.steps, position.poses, strict=True)
        if step.has_transmission_angle
    ]
    return min(angles, default=inf)


def _search_intervals(
    closure: Closure, low: float, high: float, samples: int
) -> list[tuple[float, float]]:
    """Return the parts of an interval in which loops close, including narrow ones."""

    def has_pose(value: float) -> bool:
        return closure.close_unlimited(value).status.has_pose

    parts: list[tuple[float, float]] = []
    for begin, end in find_intervals(
        has_pose, even_samples(low, high, samples), partial(_closing_margin, closure)
    ):
        if parts and begin - parts[-1][1] < _POINT * (high - low):
            # Between them two pins meet, or two lines are parallel: the range does not end.
            parts[-1] = (parts[-1][0], end)
        else:
            parts.append((begin, end))
    return parts


def last_inside(closes: Callable[[float], bool], inside: float, outside: float) -> float:
    """Return the last value at which loops close, between one at which they do and one not."""
    for _ in range(60):
        middle = 0.5 * (inside + outside)
        if middle in (inside, outside):
            break
        if closes(middle):
            inside = middle
        else:
            outside = middle
    return inside


# The ranges of an input in the machine: the closing ranges, cut by the limits of joints.
#
# The limits of the input itself cut exactly. Those of published joints are searched: their margin
# is sampled over each range, its valleys and summits between samples are narrowed down, and each
# change of its sign is narrowed down to neighbouring floats.


def input_ranges(closure: Closure) -> tuple[InputRange, ...]:
    """
    Return the ranges of a single input: every loop closes, every joint is within its limits.

    Empty if there is none, or if there are several inputs.
    """
    ranges, bounds = closure.closing_ranges, closure.bounds
    if bounds.inputs and ranges:
        ranges = within_own(closure, ranges)
    if bounds.joints:
        ranges = within_published(closure, ranges, bounds.joints)
    return ranges


def within_own(closure: Closure, ranges: Sequence[InputRange]) -> tuple[InputRange, ...]:
    """Return the parts of ranges within the limits of the single input itself."""
    (bound,) = closure.bounds.inputs
    return tuple(part for interval in ranges for part in _cut_by_limits(closure, interval, bound))


def within_published(
    closure: Closure, ranges: Sequence[InputRange], bounds: Sequence[Bound]
) -> tuple[InputRange, ...]:
    """Return the parts of ranges of the single input within limits of published joints."""
    if not closure.bounds.inputs:
        ranges = [copy for interval in ranges for copy in _range_and_copy(closure, interval)]
    return tuple(part for interval in ranges for part in _within_limits(closure, interval, bounds))


def _range_and_copy(closure: Closure, interval: InputRange) -> Iterator[InputRange]:
    """Yield a range, and the same one turn later if the poses there differ."""
    yield interval
    if not interval.turning or interval.is_whole or interval.turns != 1:
        return
    # In the middle of a symmetrical range two pins may lie in one place.
    place = 0.6 * interval.lowest + 0.4 * interval.highest
    copy = _copy_turns_later(closure, interval, tau)
    if copy is not None and not joints_repeat(closure, closure.position, place, tau):
        yield copy


def turns_to_repeat(closure: Closure, position: Callable[[float], Position]) -> int:
    """Return the number of turns after which all joints repeat, for an input that turns fully."""
    count = max(1, whole_turns(closure))
    once = all(joints_repeat(closure, position, 0.1 + i, count * tau) for i in range(6 * count))
    return count if once else 2 * count


def joints_repeat(
    closure: Closure, position: Callable[[float], Position], value: float, shift: float
) -> bool:
    """Return whether all joints are the same after a shift, apart from whole turns."""
    here, there = position(value).joints, position(value + shift).joints
    if not (here and there):
        return len(here) == len(there)
    return all(
        abs(remainder(p - q, tau) if turning else p - q)
        < _SAME * (1.0 if turning else closure.scale)
        for p, q, turning in zip(here, there, closure.turning, strict=True)
    )


def _cut_by_limits(closure: Closure, interval: InputRange, bound: Bound) -> Iterator[InputRange]:
    """Yield the parts of a range within the limits of the input; angles count with turns."""
    limits = closure.linkage.inputs[0].limits
    if not (interval.turning and interval.turns):
        yield from _clip_range(interval, limits.low, limits.high, bound.name)
        return
    if interval.is_whole:
        period = tau * turns_to_repeat(closure, closure.position)
        low = limits.low if limits.low > -inf else limits.high - period
        high = limits.high if limits.high < inf else limits.low + period
        ends = limits.low > -inf, limits.high < inf
        by = tuple(bound.name if end else '' for end in ends)
        yield interval._replace(lowest=low, highest=high, limited=ends, by=(by[0], by[1]))
        return
    period = tau * interval.turns
    first = ceil((limits.low - interval.highest) / period) if limits.low > -inf else -inf
    last = floor((limits.high - interval.lowest) / period) if limits.high < inf else inf
    if first == -inf:
        first = last - _COPIES + 1
    middle = round(0.5 * (first + last)) if last < inf else first
    first = max(first, middle - _COPIES // 2)
    last = min(last, first + _COPIES - 1)
    for count in range(int(first), int(last) + 1):
        copy = interval if not count else _copy_turns_later(closure, interval, count * period)
        if copy is not None:
            yield from _clip_range(copy, limits.low, limits.high, bound.name)


def _copy_turns_later(closure: Closure, interval: InputRange, shift: float) -> InputRange | None:
    """Return a range some turns later, or None if the linkage does not close there."""
    inside = 0.6 * interval.lowest + 0.4 * interval.highest

    def is_closed(value: float) -> bool:
        return bool(closure.position(value).joints)

    if not is_closed(inside + shift):
        return None
    low, high = (
        end if is_closed(end) else last_inside(is_closed, inside + shift, end)
        for end in (interval.lowest + shift, interval.highest + shift)
    )
    return interval._replace(lowest=low, highest=high)


def _clip_range(interval: InputRange, low: float, high: float, name: str) -> Iterator[InputRange]:
    """Yield the part of a range between two limits, if any."""
    lowest, highest = interval.lowest, interval.highest
    limited, by = list(interval.limited), list(interval.by)
    if low > lowest:
        lowest, limited[0], by[0] = low, True, name
    if high < highest:
        highest, limited[1], by[1] = high, True, name
    if lowest < highest:
        yield interval._replace(
            lowest=lowest,
            highest=highest,
            limited=(limited[0], limited[1]),
            by=(by[0], by[1]),
        )


def _within_limits(
    closure: Closure, interval: InputRange, bounds: Sequence[Bound]
) -> Iterator[InputRange]:
    """Yield the parts of a range in which published joints are within their limits."""

    def limit_margin(value: float) -> float:
        joints = closure.position(value).joints
        return min(b.limit_margin(joints[b.number]) for b in bounds) if joints else -inf

    def is_within(value: float) -> bool:
        joints = closure.position(value).joints
        return bool(joints) and not any(b.is_beyond(joints[b.number]) for b in bounds)

    low, high = interval.lowest, interval.highest
    if interval.is_whole:
        high = low + tau * turns_to_repeat(closure, closure.position)
    values = sample_inputs(interval._replace(highest=high))
    parts = list(find_intervals(is_within, values, limit_margin))
    if parts == [(low, high)]:
        yield interval
        return
    if interval.is_whole and len(parts) > 1 and parts[0][0] == low and parts[-1][1] == high:
        # One part that runs through the end of the turn.
        (_, end), *others, (begin, _) = parts
        parts = [*others, (begin, end + high - low)]
    for begin, end in parts:
        limited, by = list(interval.limited), list(interval.by)
        for side, (at, outer) in enumerate(((begin, low), (end, high))):
            if interval.is_whole or at != outer:
                limited[side] = True
                by[side] = _limiting_joint(closure, bounds, at, (begin, end)[1 - side])
        yield interval._replace(
            lowest=begin, highest=end, limited=(limited[0], limited[1]), by=(by[0], by[1])
        )


def _limiting_joint(closure: Closure, bounds: Sequence[Bound], end: float, inside: float) -> str:
    """Return the joint whose limits end a range."""
    step = 1e-9 * (end - inside)
    for outside in (end, end + step, end + 1e3 * step):
        joints = closure.position(outside).joints
        for bound in bounds if joints else ():
            if bound.is_beyond(joints[bound.number]):
                return bound.name
    joints = closure.position(end).joints
    return min(bounds, key=lambda bound: bound.limit_margin(joints[bound.number])).name
