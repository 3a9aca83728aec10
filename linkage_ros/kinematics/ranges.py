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
Where an input can go: the intervals in which every loop closes.

The limits of a dyad on a crank and the ground follow from its lengths, those of an iterated group
from its branch. What else there is, chains, is searched within these: sampled, and each limit
narrowed down to neighbouring floats.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import acos, asin, ceil, floor, inf, lcm, pi, remainder, sqrt, tau
from typing import TYPE_CHECKING

from linkage_ros.kinematics.diagonals import CrankDiagonal
from linkage_ros.kinematics.dyads.rpp import RPPDyad
from linkage_ros.kinematics.point_steps import FixedPoint, PointOnLink, PointOnRail, RelativeAngle
from linkage_ros.kinematics.results import InputRange, LoopClosure, Position

if TYPE_CHECKING:
    from linkage_ros.kinematics.branch import Branch
    from linkage_ros.kinematics.limits import Bound

# The lowest value of a function between two places, by golden sections (Kiefer, 1953).

_RATIO = (sqrt(5.0) - 1.0) / 2.0


def golden(function: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    """Return the lowest value between two places, and where it is."""
    one, other = high - _RATIO * (high - low), low + _RATIO * (high - low)
    at_one, at_other = function(one), function(other)
    for _ in range(80):
        if not low < one < other < high:
            break
        if at_one <= at_other:
            high, other, at_other = other, one, at_one
            one = high - _RATIO * (high - low)
            at_one = function(one)
        else:
            low, one, at_one = one, other, at_other
            other = low + _RATIO * (high - low)
            at_other = function(other)
    return min((at_one, one), (at_other, other))


_SAMPLES = 720

_POINT = 1e-9
"""Of an interval: what is open over no more than this is a place without a pose, and no gap."""

_ROUNDED = 1e-9
"""Of a margin: what is farther from zero has its sign."""

_CLOSE_EVERYWHERE = (FixedPoint, PointOnLink, PointOnRail, RPPDyad, RelativeAngle)


def closing_ranges(closure: LoopClosure) -> tuple[InputRange, ...]:
    """
    Return where the lengths let a single input go, whatever limits its joints have.

    None where it closes nowhere, and of several inputs.
    """
    if len(closure.linkage.inputs) > 1:
        return ()
    branches = _branches(closure)
    if branches:
        # Each is followed only where those before it close: the last one lies within all.
        return tuple(_on_a_branch(closure, branches[-1]))
    if closure.linkage.inputs[0].slider:
        far = reach(closure)
        return tuple(
            InputRange(low, high, False, (low > -far, high < far))
            for low, high in _searched(closure, -far, far, 4 * _SAMPLES)
        )
    intervals = [(-pi, pi)]
    exact = True
    for step in closure.steps:
        diagonal = getattr(step, 'diagonal', None)
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
        intervals = [part for ends in intervals for part in _searched(closure, *ends, _SAMPLES)]
        ends_meet = end - start >= tau and len(intervals) > 1
        if ends_meet and intervals[0][0] == start and intervals[-1][1] == end:
            # One interval that runs through the end of the turn.
            (_, high), *others, (low, _) = intervals
            intervals = [*others, (low, high + tau)]
    return tuple(InputRange(low, high) for low, high in intervals)


def iterated(closure: LoopClosure) -> bool:
    """Return whether a linkage has links that only iteration solves."""
    return any(hasattr(step, 'branch') for step in closure.steps)


def whole_turns(closure: LoopClosure) -> int:
    """Return how many whole turns of the inputs change nothing, 0 where each turn is another."""
    if len(closure.linkage.inputs) > 1:
        return 0 if iterated(closure) else 1
    return lcm(*(branch.interval.period if branch else 1 for branch in _branches(closure)))


def _branches(closure: LoopClosure) -> list[Branch | None]:
    """Return the branch of each iterated group."""
    return [step.branch() for step in closure.steps if hasattr(step, 'branch')]


def _on_a_branch(closure: LoopClosure, branch: Branch | None) -> Iterator[InputRange]:
    """Yield the intervals of a branch in which what comes behind it closes, too."""
    if branch is None:
        return
    after = 1 + max(i for i, step in enumerate(closure.steps) if hasattr(step, 'branch'))
    behind = [s for s in closure.steps[after:] if not isinstance(s, _CLOSE_EVERYWHERE)]
    turning = not closure.linkage.inputs[0].slider
    unit = 1.0 if turning else closure.scale
    low, high, limited, turns = branch.interval
    low, high = (-pi * turns, pi * turns) if turns else (low * unit, high * unit)
    parts = [(low, high)]
    if behind:
        count = _SAMPLES * max(1, ceil((high - low) / tau)) if turning else 4 * _SAMPLES
        parts = _searched(closure, low, high, count)
        if turns and len(parts) > 1 and parts[0][0] == low and parts[-1][1] == high:
            # One interval that runs through the end of the turns.
            (_, end), *others, (begin, _) = parts
            parts = [*others, (begin, end + turns * tau)]
    for begin, end in parts:
        ends = limited[0] or begin > low, limited[1] or end < high
        # What turns fully has no ends, and is said as it is of dyads.
        ends = ends if any(ends) else (True, True) if turns else ends
        yield InputRange(begin, end, turning, ends, whole_turns(closure))


def describe(ranges: tuple[InputRange, ...]) -> str:
    """Return ranges as a user reads them."""
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


def reach(closure: LoopClosure) -> float:
    """Return a length that no slide needs to exceed for a link to be stretched, in [m]."""
    return sum(
        max(abs(complex(*p) - complex(*q)) for p in points.values() for q in points.values())
        for points in closure.structure.links.values()
    )


def search(
    closes: Callable[[float], bool],
    low: float,
    high: float,
    samples: int = _SAMPLES,
    margin: Callable[[float], float] | None = None,
) -> Iterator[tuple[float, float]]:
    """
    Yield the parts of an interval in which something holds, as that loops close.

    Parameters
    ----------
    closes
        Whether it holds at a value.
    low, high
        The interval.
    samples
        Where it is looked at.
    margin
        By how much it holds at a value, negative where it does not. Where that has a valley or a
        summit between samples, it is looked at there, too; without it what is narrower than from
        sample to sample is missed.

    """
    values = [low + (high - low) * i / samples for i in range(samples)] + [high]
    known: dict[float, bool] = {}
    if margin is not None:
        margins = [margin(value) for value in values]
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


def _turning_points(
    margin: Callable[[float], float], values: Sequence[float], margins: Sequence[float]
) -> Iterator[float]:
    """Yield where a margin may reach to the other side of zero between samples."""
    for i in range(1, len(values) - 1):
        before, here, after = margins[i - 1], margins[i], margins[i + 1]
        if 0.0 < here <= min(before, after):
            yield golden(margin, values[i - 1], values[i + 1])[1]
        elif 0.0 > here >= max(before, after):
            yield golden(lambda x: -margin(x), values[i - 1], values[i + 1])[1]


def _margin(closure: LoopClosure, value: float) -> float:
    """Return how far a state is from the limits of its dyads, negative where it does not close."""
    position = closure.posed(value)
    if not position.status.has_pose:
        # Where two pins meet, or two lines are parallel, it does not end.
        return 0.0 if not position.gap else -position.gap
    angles = [
        step.transmission_angle(pose)
        for step, pose in zip(closure.steps, position.poses, strict=True)
        if hasattr(step, 'transmission_angle')
    ]
    return min(angles, default=inf)


def _searched(
    closure: LoopClosure, low: float, high: float, samples: int
) -> list[tuple[float, float]]:
    """Return the parts of an interval in which loops close, the narrow ones, too."""

    def closes(value: float) -> bool:
        return closure.posed(value).status.has_pose

    parts: list[tuple[float, float]] = []
    for begin, end in search(closes, low, high, samples, partial(_margin, closure)):
        if parts and begin - parts[-1][1] < _POINT * (high - low):
            # Between them two pins meet, or two lines are parallel, and nothing ends.
            parts[-1] = (parts[-1][0], end)
        else:
            parts.append((begin, end))
    return parts


def last_inside(closes: Callable[[float], bool], inside: float, outside: float) -> float:
    """Return the last value at which the loops close, on the way to one at which they do not."""
    for _ in range(60):
        middle = 0.5 * (inside + outside)
        if middle in (inside, outside):
            break
        if closes(middle):
            inside = middle
        else:
            outside = middle
    return inside


# Where the machine lets an input go: what its lengths allow, cut by the limits of its joints.
#
# The limits of the input itself cut exactly. Those of published joints are searched: the margin
# that is left to them is sampled over each range, its valleys and summits between samples are
# narrowed down, and each change of its sign to neighbouring floats.

_SAME = 1e-9
"""What joints may differ by and be the same, in [rad] or of a length."""

_COPIES = 8
"""How many turns of a range are told of an input whose limits are turns apart."""


def input_ranges(closure: LoopClosure) -> tuple[InputRange, ...]:
    """
    Return where a single input can go: every loop closes, every joint is within its limits.

    None where that is nowhere, and of several inputs.
    """
    ranges, bounds = closure.closing_ranges, closure.bounds
    if bounds.inputs:
        ranges = within_own(closure, ranges)
    if bounds.joints:
        ranges = within_published(closure, ranges, bounds.joints)
    return ranges


def within_own(closure: LoopClosure, ranges: Sequence[InputRange]) -> tuple[InputRange, ...]:
    """Return what the limits of the single input itself leave of ranges."""
    (bound,) = closure.bounds.inputs
    return tuple(part for one in ranges for part in _cut(closure, one, bound))


def within_published(
    closure: LoopClosure, ranges: Sequence[InputRange], bounds: Sequence[Bound]
) -> tuple[InputRange, ...]:
    """Return what limits of published joints leave of ranges of the single input."""
    if not closure.bounds.inputs:
        ranges = [copy for one in ranges for copy in _assemblies(closure, one)]
    return tuple(part for one in ranges for part in _within_limits(closure, one, bounds))


def _assemblies(closure: LoopClosure, interval: InputRange) -> Iterator[InputRange]:
    """Yield a range, and the same a turn on where the poses there are others."""
    yield interval
    if not interval.turning or interval.whole or interval.turns != 1:
        return
    # In the middle of a symmetrical range two pins may lie in one place.
    place = 0.6 * interval.lowest + 0.4 * interval.highest
    copy = _copied(closure, interval, tau)
    if copy is not None and not repeats(closure, closure.position, place, tau):
        yield copy


def turns(closure: LoopClosure, position: Callable[[float], Position]) -> int:
    """Return after how many turns of an input that turns fully all joints are the same."""
    count = max(1, whole_turns(closure))
    once = all(repeats(closure, position, 0.1 + i, count * tau) for i in range(6 * count))
    return count if once else 2 * count


def repeats(
    closure: LoopClosure, position: Callable[[float], Position], value: float, shift: float
) -> bool:
    """Return whether all joints are the same again after a shift, but for whole turns."""
    here, there = position(value).joints, position(value + shift).joints
    return len(here) == len(there) and all(
        abs(remainder(p - q, tau) if turning else p - q)
        < _SAME * (1.0 if turning else closure.scale)
        for p, q, turning in zip(here, there, closure.turning, strict=True)
    )


def _cut(closure: LoopClosure, interval: InputRange, bound: Bound) -> Iterator[InputRange]:
    """Yield what the limits of the input itself leave of a range; angles count with turns."""
    limits = closure.linkage.inputs[0].limits
    if not (interval.turning and interval.turns):
        yield from _between(interval, limits.low, limits.high, bound.name)
        return
    if interval.whole:
        period = tau * turns(closure, closure.position)
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
        copy = interval if not count else _copied(closure, interval, count * period)
        if copy is not None:
            yield from _between(copy, limits.low, limits.high, bound.name)


def _copied(closure: LoopClosure, interval: InputRange, shift: float) -> InputRange | None:
    """Return a range some turns on, none where the linkage does not close there."""
    inside = 0.6 * interval.lowest + 0.4 * interval.highest

    def closes(value: float) -> bool:
        return bool(closure.position(value).joints)

    if not closes(inside + shift):
        return None
    low, high = (
        end if closes(end) else last_inside(closes, inside + shift, end)
        for end in (interval.lowest + shift, interval.highest + shift)
    )
    return interval._replace(lowest=low, highest=high)


def _between(interval: InputRange, low: float, high: float, name: str) -> Iterator[InputRange]:
    """Yield what two limits leave of a range."""
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
    closure: LoopClosure, interval: InputRange, bounds: Sequence[Bound]
) -> Iterator[InputRange]:
    """Yield the parts of a range in which published joints are within their limits."""

    def margin(value: float) -> float:
        joints = closure.position(value).joints
        return min(b.margin(joints[b.number]) for b in bounds) if joints else -inf

    def within(value: float) -> bool:
        joints = closure.position(value).joints
        return bool(joints) and not any(b.beyond(joints[b.number]) for b in bounds)

    low, high = interval.lowest, interval.highest
    if interval.whole:
        high = low + tau * turns(closure, closure.position)
    parts = list(search(within, low, high, margin=margin))
    if parts == [(low, high)]:
        yield interval
        return
    if interval.whole and len(parts) > 1 and parts[0][0] == low and parts[-1][1] == high:
        # One part that runs through the end of the turn.
        (_, end), *others, (begin, _) = parts
        parts = [*others, (begin, end + high - low)]
    for begin, end in parts:
        limited, by = list(interval.limited), list(interval.by)
        for side, (at, outer) in enumerate(((begin, low), (end, high))):
            if interval.whole or at != outer:
                limited[side] = True
                by[side] = _by(closure, bounds, at, (begin, end)[1 - side])
        yield interval._replace(
            lowest=begin, highest=end, limited=(limited[0], limited[1]), by=(by[0], by[1])
        )


def _by(closure: LoopClosure, bounds: Sequence[Bound], end: float, inside: float) -> str:
    """Return the joint whose limits end a range."""
    step = 1e-9 * (end - inside)
    for outside in (end, end + step, end + 1e3 * step):
        joints = closure.position(outside).joints
        for bound in bounds if joints else ():
            if bound.beyond(joints[bound.number]):
                return bound.name
    joints = closure.position(end).joints
    return min(bounds, key=lambda bound: bound.margin(joints[bound.number])).name
