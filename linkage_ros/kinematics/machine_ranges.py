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
Where the machine lets an input go: what its lengths allow, cut by the limits of its joints.

The limits of the input itself cut exactly. Those of published joints are searched: the margin that
is left to them is sampled over each range, its valleys and summits between samples are narrowed
down, and each change of its sign to neighbouring floats.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import ceil, floor, inf, remainder, tau
from typing import TYPE_CHECKING

from linkage_ros.kinematics.ranges import InputRange, last_inside, search, whole_turns

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure, Position
    from linkage_ros.kinematics.limits import Bound

_SAME = 1e-9
"""What joints may differ by and be the same, in [rad] or of a length."""

_COPIES = 8
"""How many turns of a range are told of an input whose limits are turns apart."""


def input_ranges(closure: Closure) -> tuple[InputRange, ...]:
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


def within_own(closure: Closure, ranges: Sequence[InputRange]) -> tuple[InputRange, ...]:
    """Return what the limits of the single input itself leave of ranges."""
    (bound,) = closure.bounds.inputs
    return tuple(part for one in ranges for part in _cut(closure, one, bound))


def within_published(
    closure: Closure, ranges: Sequence[InputRange], bounds: Sequence[Bound]
) -> tuple[InputRange, ...]:
    """Return what limits of published joints leave of ranges of the single input."""
    if not closure.bounds.inputs:
        ranges = [copy for one in ranges for copy in _assemblies(closure, one)]
    return tuple(part for one in ranges for part in _searched(closure, one, bounds))


def _assemblies(closure: Closure, interval: InputRange) -> Iterator[InputRange]:
    """Yield a range, and the same a turn on where the poses there are others."""
    yield interval
    if not interval.turning or interval.whole or interval.turns != 1:
        return
    # In the middle of a symmetrical range two pins may lie in one place.
    place = 0.6 * interval.lowest + 0.4 * interval.highest
    copy = _copied(closure, interval, tau)
    if copy is not None and not repeats(closure, closure.position, place, tau):
        yield copy


def turns(closure: Closure, position: Callable[[float], Position]) -> int:
    """Return after how many turns of an input that turns fully all joints are the same."""
    count = max(1, whole_turns(closure))
    once = all(repeats(closure, position, 0.1 + i, count * tau) for i in range(6 * count))
    return count if once else 2 * count


def repeats(
    closure: Closure, position: Callable[[float], Position], value: float, shift: float
) -> bool:
    """Return whether all joints are the same again after a shift, but for whole turns."""
    here, there = position(value).joints, position(value + shift).joints
    return len(here) == len(there) and all(
        abs(remainder(p - q, tau) if turning else p - q)
        < _SAME * (1.0 if turning else closure.scale)
        for p, q, turning in zip(here, there, closure.turning, strict=True)
    )


def _cut(closure: Closure, interval: InputRange, bound: Bound) -> Iterator[InputRange]:
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


def _copied(closure: Closure, interval: InputRange, shift: float) -> InputRange | None:
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


def _searched(
    closure: Closure, interval: InputRange, bounds: Sequence[Bound]
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


def _by(closure: Closure, bounds: Sequence[Bound], end: float, inside: float) -> str:
    """Return the joint whose limits end a range."""
    step = 1e-9 * (end - inside)
    for outside in (end, end + step, end + 1e3 * step):
        joints = closure.position(outside).joints
        for bound in bounds if joints else ():
            if bound.beyond(joints[bound.number]):
                return bound.name
    joints = closure.position(end).joints
    return min(bounds, key=lambda bound: bound.margin(joints[bound.number])).name
