# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The pieces of a range of the crank on which an output moves one way.

A piece ends where the output turns back, where the range ends, and where a link passes through
infinity, because lines on which it slides are parallel. There a slide has a pole: it goes up to
infinity, and comes back from the same side or the other. An angle jumps: a link that points to
such a pin points the other way after it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import atan2, ceil, inf, isfinite, pi, remainder, tau
from typing import NamedTuple, Protocol

from linkage_ros.kinematics.analysis.ranges import golden_section, last_inside, sample_inputs
from linkage_ros.kinematics.results import InputRange

_SAMPLES, _MOST_SAMPLES = 720, 20_000
_FLAT = 1e-13
"""
A joint that turns back and again within this only slows down, in [rad] or of the linkage's size.
"""

_BESIDE = 1e-2
"""Greatest distance of cranks between which an output slows down, in [rad] or [m]."""

_DEEPER = 10.0
"""Depth that a valley may have below its sample, relative to the height of those beside it."""

_JUMP = 1e-2
"""The least jump of an output that is looked for, in [rad]."""

_HALVINGS = 10
"""How often the way from one sample to the next is halved, to find jumps and narrow turns."""

FARTHEST = 2.0**20
"""The longest slide, in sizes of the linkage: next to a pole the crank has too few digits."""

_BISECTIONS = 120
_BESIDE_JUMP = 1e-12
"""How far from a jump a piece ends, of the range's width."""


class OutputOfCrank(Protocol):
    """An output over the crank, with its slope, both NaN where the linkage does not close."""

    turning: bool
    size: float

    def __call__(self, crank: float) -> tuple[float, float]:
        """Return the output and its slope at a crank."""


def monotonic_pieces(
    evaluate: OutputOfCrank, interval: InputRange
) -> Iterator[tuple[list[tuple[float, float]], bool]]:
    """
    Yield the pieces of a range on which the output moves one way, and whether it turns on.

    Each is a list of cranks with the output, in order.
    """
    farthest = inf if evaluate.turning else FARTHEST * evaluate.size

    def is_near(value: float) -> bool:
        return abs(value) < farthest

    def is_near_at(crank: float) -> bool:
        return is_near(evaluate(crank)[0])

    low, high = interval.lowest, interval.highest
    count = _SAMPLES
    if interval.turning:
        count = min(_MOST_SAMPLES, _SAMPLES * max(1, ceil((high - low) / tau)))
    cranks = sample_inputs(interval, count)
    if interval.is_whole:
        # Symmetric linkages turn back at round angles, where the slope has no sign.
        cranks = [crank + (high - low) * 0.307 / count for crank in cranks]
    sampler = _Sampler(evaluate)
    refined = list(sampler.refine(cranks))
    sampled = [sample[:3] for sample in refined]
    jumps, beside = list(sampler.jumps(refined)), _BESIDE_JUMP * (high - low)
    turns = [
        turn
        for turn in _turning_points(evaluate, sampled)
        if all(abs(turn - jump) > beside for jump in jumps)
    ]
    turns = sorted([*turns, *jumps, *_poles(evaluate, sampled, turns, farthest)])
    if interval.is_whole:
        turns = sorted(low + (turn - low) % (high - low) for turn in turns)
    turns = _real_turns(evaluate, turns, interval)
    known = [(crank, value) for crank, value, _ in sampled if is_near(value)]
    begin, end = low, high
    if interval.is_whole:
        if turns:
            begin, end = turns[0], turns[0] + (high - low)
        known = sorted((begin + (crank - begin) % (high - low), value) for crank, value in known)
    places = [begin, *(turn for turn in turns if begin < turn < end), end]
    outer = () if interval.is_whole else (low, high)
    if not jumps:
        beside = 0.0
    for begin, end in pairwise(places):
        first = begin if begin in outer else begin + beside
        last = end if end in outer else end - beside
        inner = [(crank, value) for crank, value in known if first < crank < last]
        if not inner:
            middle = 0.5 * (first + last)
            inner = [(middle, evaluate(middle)[0])]
            if not is_near(inner[0][1]):
                continue
        # The end of a range is rounded, and may lie beyond the toggle; or it is at a pole.
        ends = [
            end if is_near_at(end) else last_inside(is_near_at, inside, end)
            for inside, end in ((inner[0][0], first), (inner[-1][0], last))
        ]
        piece = [(end, evaluate(end)[0]) for end in ends]
        piece[1:1] = inner
        yield _unwrap_piece(piece) if evaluate.turning else piece, interval.is_whole and not turns


def _turning_points(
    evaluate: OutputOfCrank, sampled: Sequence[tuple[float, float, float]]
) -> Iterator[float]:
    """Yield the cranks at which the slope changes its sign, also twice between samples."""
    known = [(crank, slope) for crank, _, slope in sampled if isfinite(slope) and slope]

    def signed_slope(sign: float) -> Callable[[float], float]:
        return lambda crank: evaluate(crank)[1] * sign

    def keeps_sign(sign: float) -> Callable[[float], bool]:
        return lambda crank: evaluate(crank)[1] * sign > 0.0

    for i in range(1, len(known)):
        (before, slope_before), (here, slope) = known[i - 1], known[i]
        if slope_before * slope < 0.0:
            yield last_inside(keeps_sign(slope_before), before, here)
        elif i + 1 < len(known):
            after, slope_after = known[i + 1]
            sign = 1.0 if slope > 0.0 else -1.0
            sides = sign * slope_before, sign * slope_after
            # A valley that is shallow beside its height does not reach zero.
            if min(sides) >= abs(slope) and _DEEPER * (sum(sides) - 2.0 * abs(slope)) > abs(slope):
                least, at = golden_section(signed_slope(sign), before, after)
                if least < 0.0:
                    yield last_inside(keeps_sign(slope), before, at)
                    yield last_inside(keeps_sign(slope), after, at)


class _OutputSample(NamedTuple):
    """An output at a crank, as an angle u: that of a slide does not jump at a pole."""

    crank: float
    value: float
    slope: float
    angle: float
    angle_slope: float


class _Sampler:
    """Samples of an output, denser where its slopes do not lead from one to the next."""

    def __init__(self, evaluate: OutputOfCrank) -> None:
        self._evaluate, self._size = evaluate, evaluate.size
        self._period = tau if evaluate.turning else pi

    def sample(self, crank: float) -> _OutputSample:
        """Return a sample."""
        value, slope = self._evaluate(crank)
        if self._evaluate.turning:
            return _OutputSample(crank, value, slope, value, slope)
        size = self._size
        angle_slope = slope * size / (size * size + value * value)
        return _OutputSample(crank, value, slope, atan2(value, size), angle_slope)

    def refine(self, cranks: Sequence[float]) -> Iterator[_OutputSample]:
        """Yield the samples at cranks, and those between that are needed."""
        waiting = [self.sample(crank) for crank in reversed(cranks)]
        depths = [0] * len(waiting)
        before, _ = waiting.pop(), depths.pop()
        yield before
        while waiting:
            after, depth = waiting[-1], depths[-1]
            if depth < _HALVINGS and self.excess(before, after) > _JUMP:
                waiting.append(self.sample(0.5 * (before.crank + after.crank)))
                depths[-1] = depth + 1
                depths.append(depth + 1)
            else:
                before, _ = waiting.pop(), depths.pop()
                yield before

    def excess(self, first: _OutputSample, second: _OutputSample) -> float:
        """Return the change of the angle beyond what its slopes lead to, without whole turns."""
        change = 0.5 * (first.angle_slope + second.angle_slope) * (second.crank - first.crank)
        return abs(remainder(second.angle - first.angle - change, self._period))

    def jumps(self, sampled: Sequence[_OutputSample]) -> Iterator[float]:
        """
        Yield the cranks at which the output jumps: where links pass through infinity.

        A link that points to such a pin points the other way after it.
        """
        known = [sample for sample in sampled if isfinite(sample.angle_slope)]
        for low, high in pairwise(known):
            if self.excess(low, high) >= _JUMP:
                yield from self._jump_between(low, high)

    def _jump_between(self, low: _OutputSample, high: _OutputSample) -> Iterator[float]:
        middle = low.crank
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low.crank + high.crank)
            here = self.sample(middle)
            if middle in (low.crank, high.crank) or not isfinite(here.angle_slope):
                break
            is_lower = self.excess(low, here) > self.excess(here, high)
            low, high = (low, here) if is_lower else (here, high)
        if abs(remainder(high.angle - low.angle, self._period)) > _JUMP:
            yield middle


def _poles(
    evaluate: OutputOfCrank,
    sampled: Sequence[tuple[float, float, float]],
    turns: Sequence[float],
    farthest: float,
) -> Iterator[float]:
    """
    Yield the cranks at which a slide passes through infinity to the other side.

    It rises there up to the pole, and from far below after it, or falls likewise. Where it returns
    on the same side, the pole is a turning point.
    """
    if evaluate.turning:
        return
    known = sorted([*sampled, *((turn, *evaluate(turn)) for turn in turns)])
    known = [sample for sample in known if isfinite(sample[1])]
    for (before, first, _), (after, second, _) in pairwise(known):
        # Symmetric linkages have poles in the middle between samples.
        slope = evaluate(before + 0.307 * (after - before))[1]
        if not (second - first) * slope < 0.0:
            continue
        low, high = (before, first), (after, second)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low[0] + high[0])
            value = evaluate(middle)[0]
            if not isfinite(value):  # The pole itself is in the middle
                middle = low[0] + 0.307 * (high[0] - low[0])
                value = evaluate(middle)[0]
            if middle in (low[0], high[0]) or not isfinite(value):
                break
            if (value - low[1]) * slope < 0.0:
                high = middle, value
            else:
                low = middle, value
        if min(abs(low[1]), abs(high[1])) > farthest:
            yield middle


def _real_turns(
    evaluate: OutputOfCrank, ends: Sequence[float], interval: InputRange
) -> list[float]:
    """Return the turning points without those where the output only slows down."""
    slight = _FLAT * evaluate.size
    kept: list[float] = []

    def are_same(first: float, second: float) -> bool:
        off = evaluate(first)[0] - evaluate(second)[0]
        return abs(remainder(off, tau) if evaluate.turning else off) <= slight

    for end in ends:
        if kept and end - kept[-1] < _BESIDE and are_same(kept[-1], end):
            kept.pop()
        else:
            kept.append(end)
    if not interval.is_whole:
        outer = (interval.lowest, interval.highest)
        return [
            end
            for end in kept
            if not any(
                abs(end - outer_end) < _BESIDE and are_same(end, outer_end) for outer_end in outer
            )
        ]
    if len(kept) > 1 and interval.highest - kept[-1] + kept[0] - interval.lowest < _BESIDE:
        return kept[1:-1] if are_same(kept[0], kept[-1]) else kept
    return kept


def _unwrap_piece(piece: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return a piece with unwrapped angles, its middle in (−π, π]."""
    (first, value), *others = piece
    unwrapped = [(first, value)]
    for crank, angle in others:
        unwrapped.append((crank, angle - tau * round((angle - unwrapped[-1][1]) / tau)))
    turns = tau * round(0.5 * (unwrapped[0][1] + unwrapped[-1][1]) / tau)
    return [(crank, angle - turns) for crank, angle in unwrapped]
