# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A linkage while one input goes through its range: samples, extremes, checks of limits."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise, product
from math import inf, isfinite, nan, pi, prod, remainder, tau
from operator import getitem
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import DefinitionError, list_names, quote
from linkage_ros.kinematics.analysis.ranges import (
    describe_ranges,
    even_samples,
    find_intervals,
    golden_section,
    interval_about,
    is_iterated,
    joints_repeat,
    sample_inputs,
    through_the_end,
    turns_to_repeat,
    within_own,
    within_published,
)
from linkage_ros.kinematics.built_once import BuiltProperty
from linkage_ros.kinematics.limits import Bound
from linkage_ros.kinematics.plane.linkage import AssemblyPose, Linkage
from linkage_ros.kinematics.results import InputRange, Position
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import FollowerJoint, LinkState, PLACED, StepPose
from linkage_ros.progress import tell_progress

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure

# The pose of one step of a solution, from the steps that it starts from and no others.

_SAMPLES = 720
_GRID, _MOST_ON_GRID = 24, 14_000
"""Values of each input on a grid, and states on it at most."""

_FEW, _MOST_OF_MANY, _MOST_ITERATED = 3, 60, 1000
"""Inputs that so many states are meant for; how many of more inputs, and of iterated links."""

_PART = 0.25
"""How far a grid of many inputs reaches from the pose to limits of angles, where links iterate."""

_SAME = 1e-9
"""Largest difference of values that count as equal, in [rad] or relative to a length."""

_NOISE = 1e-13
"""Largest difference of values that is rounding, in [rad]."""

_DEEPER = 10.0
"""Depth that a valley may have below its sample, relative to the height of those beside it."""

_APART = 1e-4
"""Places nearer to each other than this count as one, in [rad] or [m]."""

_MANY = 12
"""An extreme met at more places than this lists none of them; also the lines of a grid."""

_NEAR_ZERO, _ZERO = 0.25, 1e-7
"""Upper bounds of a sample next to a zero, and of a zero, in [rad]."""

_EASY = 0.25
"""Conditioning of a good pose to show: its transmission angle is above 20 degrees."""


def pose_alone(closure: Closure, number: int, *inputs: float) -> Callable[..., StepPose]:
    """
    Return a function that gives the pose of a step at inputs, in [rad] and [m].

    If a crank drives a hundred independent loops, it closes only one. ``inputs`` are inputs at
    which the linkage closes: they show where each step appends its results.
    """
    needed = closure.needed_groups(closure.step_groups[number])
    walked = closure.initial_state(*inputs)
    plan: list[tuple[Callable[[LinkState], StepPose], int, int]] = []
    for step, group in zip(closure.steps[: number + 1], closure.step_groups, strict=False):
        start = len(walked.coordinates), len(walked.pins)
        # A pin is placed for the first group that needs it, and used by others.
        if step.close(walked) is PLACED or group in needed:
            plan.append((step.close, *start))

    def pose_at(*values: float) -> StepPose:
        state = closure.initial_state(*values)
        pose: StepPose = PLACED
        for close, coordinates, pins in plan:
            # Steps that are left out keep their places in the lists, which nothing reads.
            state.coordinates.extend([0.0] * (coordinates - len(state.coordinates)))
            state.pins.extend([0j] * (pins - len(state.pins)))
            pose = close(state)
            if not pose.status.has_pose:
                break
        return pose

    return pose_at


class Extreme(NamedTuple):
    """A lowest or highest value, and the inputs where it occurs; none if it is constant."""

    value: float
    at: tuple[float, ...]


class Sampled(NamedTuple):
    """The values of a function at samples of an input, from one end of a range to the other."""

    interval: InputRange
    values: list[float]
    results: list[float]


class SweptCurve(NamedTuple):
    """The lowest and the highest value of a function over the ranges of an input."""

    lowest: Extreme
    highest: Extreme


class InputSweep:
    """
    A linkage as a function of one input, the first one by default; the others are held.

    ``held`` has values of all inputs, in [rad] or [m], and is not needed for a single input.
    """

    def __init__(self, closure: Closure, held: Sequence[float] = (0.0,), number: int = 0) -> None:
        self.closure = closure
        after = number + 1
        self._before, self._after = tuple(held[:number]), tuple(held[after:])
        self.input = closure.linkage.inputs[number]
        self.turning = not self.input.slider

    @property
    def held_inputs(self) -> dict[str, float]:
        """Return the values of the inputs that are held."""
        values = zip(self.closure.input_names, self.inputs_at(0.0), strict=True)
        return {name: value for name, value in values if name != self.input.joint}

    def inputs_at(self, value: float) -> tuple[float, ...]:
        """Return the values of all inputs."""
        return *self._before, value, *self._after

    def along(self, function: Callable[..., Any]) -> Callable[[float, float], Any]:
        """Return a function of all inputs and their rates as one of this input and its rate."""
        before, after = self._before, self._after
        still_before, still_after = (0.0,) * len(before), (0.0,) * len(after)
        return lambda value, rate: function(
            *before, value, *after, *still_before, rate, *still_after
        )

    def position_at(self, value: float) -> Position:
        """Return the position at a value of the input."""
        return self.closure.position(*self.inputs_at(value))

    def is_closed(self, value: float) -> bool:
        """Return whether every loop closes there, with no joint beyond its limits."""
        return self._closing_margin(value) >= 0.0

    def _closing_margin(self, value: float) -> float:
        """Return how far loops are from closing there, negative; 0 at a toggle, else infinite."""
        inputs = self.inputs_at(value)
        position = self.closure.position(*inputs)
        if not position.joints:
            return -position.gap or -inf
        bounds = self.closure.bounds
        if bounds and bounds.first_exceeded(inputs, position.joints):
            return -inf
        return 0.0 if position.status is Status.TOGGLE else inf

    @BuiltProperty
    def ranges(self) -> tuple[InputRange, ...]:
        """
        Ranges in which every loop closes, with angles as a user expects them.

        A full turn begins at 0, and is two turns if the linkage repeats only after two; the
        middle of a limited range lies in (−π, π].
        """
        if len(self.closure.linkage.inputs) == 1:
            ranges = self.closure.input_ranges
        else:
            ranges = self.closure.keep_usual(
                tuple(self._name_ends(*ends) for ends in self._search_intervals())
            )
        return tuple(map(self._usual_range, ranges))

    def range_about(self, value: float) -> InputRange | None:
        """Return the range in which a value lies, or None."""
        if self.closure.grids and self.closure.zero_length is None:
            # States beyond the reach of such links take long: the other ranges are not asked for.
            part = interval_about(self._closing_margin, self._samples, value)
            if part and (self._is_cut or not {*part} & {self._samples[0], self._samples[-1]}):
                return self._usual_range(self._name_ends(*part))
        for interval in self.ranges:
            if interval.is_whole or interval.lowest <= value <= interval.highest:
                return interval
            if interval.turning and not self.input.limits.is_bounded:
                shift = self._turn_shift(interval, value)
                if shift:
                    return interval.shift_by(shift)
        return None

    def _turn_shift(self, interval: InputRange, value: float) -> float:
        """Return the turns, in [rad], that bring a range to a value in the same poses, or 0."""
        period, turns = tau * interval.turns, -interval.shift(value)
        # If the linkage repeats only after two turns, one turn leads to another pose.
        for shift in (turns, turns - period, turns + period):
            within = interval.lowest <= value - shift <= interval.highest
            if not (shift and within):
                continue
            limited = bool(self.closure.bounds.joints)
            if not limited or joints_repeat(self.closure, self.position_at, value, -shift):
                return shift
        return 0.0

    @property
    def widest_range(self) -> InputRange | None:
        """Return the widest range; of equal ones the last, in which slides are positive."""
        return max(
            reversed(self.ranges),
            key=lambda interval: round(interval.highest - interval.lowest, 6),
            default=None,
        )

    def _usual_range(self, interval: InputRange) -> InputRange:
        if not interval.turning or self.input.limits.is_bounded:
            return interval
        if not interval.turns:
            return interval
        if interval.is_whole:
            return interval._replace(
                lowest=0.0, highest=tau * turns_to_repeat(self.closure, self.position_at)
            )
        middle = 0.5 * (interval.lowest + interval.highest)
        shift = -interval.shift(0.0)
        if shift and joints_repeat(self.closure, self.position_at, middle, shift):
            return interval.shift_by(shift)
        return interval

    @property
    def _is_cut(self) -> bool:
        """Return whether the range of the input ends where its samples do."""
        return not self.turning or self.input.limits.is_bounded

    @BuiltProperty
    def _samples(self) -> list[float]:
        """Return the values at which several inputs are tried; none if limits exclude all."""
        far = pi if self.turning else self.closure.slide_bound
        limits = self.input.limits
        low, high = max(limits.low, -far), min(limits.high, far)
        if self.turning and limits.is_bounded:
            # Angles count with their turns.
            low = limits.low if limits.low > -inf else limits.high - tau
            high = limits.high if limits.high < inf else limits.low + tau
        return even_samples(low, high) if low < high else []

    def _search_intervals(self) -> list[tuple[float, float]]:
        """Return the intervals in which every loop closes, for several inputs."""
        samples = self._samples
        intervals = list(find_intervals(self.is_closed, samples)) if samples else []
        return intervals if self._is_cut else through_the_end(intervals, samples[0], samples[-1])

    def _name_ends(self, low: float, high: float) -> InputRange:
        """Return a range with the joints whose limits end it; the other inputs are held."""
        by = []
        whole = self.turning and high - low >= tau and not self.closure.bounds
        for end, outwards in ((low, low - high), (high, high - low)):
            beyond = self.inputs_at(end + 1e-9 * outwards)
            joints = () if whole else self.closure.position(*beyond).joints
            bound = self.closure.bounds.first_exceeded(beyond, joints) if joints else None
            by.append(bound.name if bound else '')
        return InputRange(low, high, self.turning, by=(by[0], by[1]))


def starts_at_pose(closure: Closure) -> bool:
    """Return whether the file's pose is the start, not only the start of an iteration."""
    linkage = closure.linkage
    several = len(linkage.inputs) > 1
    return linkage.pose is not None and not (
        linkage.pose.is_drawn and not several and is_iterated(closure)
    )


def usual_inputs(closure: Closure) -> tuple[float, ...]:
    """
    Return inputs at which a linkage is shown, or from which it starts.

    These are the inputs of the file's pose, if the linkage closes there; with a single input only
    if no links are iterated, for which the pose is the start. Otherwise a
    single input is at 60 degrees if it turns fully, or at two thirds of its widest range: in the
    middle the links of a symmetric linkage often lie on each other. Several inputs are at 60
    degrees each if that is far from a toggle, or else at the point of a coarse grid that is
    farthest from one.
    """
    linkage = closure.linkage
    pose: AssemblyPose | None = linkage.pose
    several = len(linkage.inputs) > 1
    # Without joints a loop is open.
    if pose and starts_at_pose(closure) and closure.position(*pose.inputs).joints:
        return pose.inputs
    if several:
        usual = (pi / 3.0,) * len(linkage.inputs)
        turning = not any(driven.slider for driven in linkage.inputs)
        if turning and _pose_conditioning(closure, closure.position(*usual)) > _EASY:
            return usual
        return max(
            grid_positions(closure, _MANY), key=lambda entry: _pose_conditioning(closure, entry[1])
        )[0]
    interval = InputSweep(closure).widest_range
    assert interval is not None, 'reading the file has proved that it closes somewhere'
    if interval.is_whole:
        return (pi / 3.0,)
    return (interval.lowest + (interval.highest - interval.lowest) * 2.0 / 3.0,)


def _pose_conditioning(closure: Closure, position: Position) -> float:
    if position.status is not Status.CLOSED:
        return -1.0
    return closure.singularity_margin(position).conditioning


def grid_positions(
    closure: Closure, count: int = _GRID
) -> Iterator[tuple[tuple[float, ...], Position]]:
    """Yield positions on a grid over all inputs."""
    for inputs in inputs_on_grid(closure, count):
        yield inputs, closure.position(*inputs)


def inputs_on_grid(closure: Closure, count: int = _GRID) -> Iterator[tuple[float, ...]]:
    """Yield a grid over all inputs: one turn each, or the reach of a slide."""
    yield from product(*_values_on_grid(closure, count))


def _values_on_grid(closure: Closure, count: int) -> list[list[float]]:
    """Return the values of each input on a grid of so many steps, or of fewer."""
    ways, inputs_count = [], len(closure.linkage.inputs)
    most = _MOST_ITERATED if closure.grids else _MOST_ON_GRID
    most = most if inputs_count <= _FEW else _MOST_OF_MANY
    count = min(count, max(1, int(most ** (1.0 / inputs_count))))
    for number, driven in enumerate(closure.linkage.inputs):
        low, high = driven.limits.low, driven.limits.high
        if driven.slider:
            least, farthest = closure.slide_reach(number)
            low, high = max(low, least), min(high, farthest)
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            ways.append([middle + half * (2 * i - count) / count for i in range(count + 1)])
        elif driven.limits.is_bounded:
            low = low if low > -inf else high - tau
            high = high if high < inf else low + tau
            ways.append([low + (high - low) * i / count for i in range(count + 1)])
        else:
            ways.append([tau * i / count for i in range(count)])
    return ways


def follow_grid(closure: Closure) -> list[tuple[tuple[float, ...], Position]]:
    """
    Return inputs and positions on a grid over all inputs to which steps lead from the pose.

    Where links only close together an open state takes long: the steps end there. Of many inputs
    the grid reaches a part of the way to limits of angles: little closes in those corners.
    """
    ways, inputs_driven = _values_on_grid(closure, _GRID), closure.linkage.inputs
    home = closure.linkage.pose.inputs
    turns = [not (driven.slider or driven.limits.is_bounded) for driven in inputs_driven]
    for k, at in enumerate(home if len(ways) > _FEW else ()):
        if inputs_driven[k].limits.is_bounded and not inputs_driven[k].slider:
            ways[k] = [at + _PART * (x - at) for x in ways[k]]
    around = [
        [bisect_left(values, at % tau if turning else at) - k for k in (1, 0)]
        for values, at, turning in zip(ways, home, turns, strict=True)
    ]
    waiting, seen = [*product(*around)], set[tuple[int, ...]]()
    states: dict[tuple[int, ...], tuple[tuple[float, ...], Position]] = {}
    while waiting:
        index = tuple(
            k % len(values) if turning else min(max(k, 0), len(values) - 1)
            for k, values, turning in zip(waiting.pop(), ways, turns, strict=True)
        )
        if index in seen:
            continue
        tell_progress('states examined', len(seen), prod(map(len, ways)))
        seen.add(index)
        inputs = tuple(map(getitem, ways, index))
        position = closure.close_unlimited(*inputs)
        if position.status.has_pose:
            states[index] = inputs, position
            for axis, by in product(range(len(index)), (-1, 1)):
                waiting.append(tuple(k + by * (i == axis) for i, k in enumerate(index)))
    return [states[index] for index in sorted(states)]


def find_extremes(function: Callable[[float], float], ranges: Sequence[InputRange]) -> SweptCurve:
    """
    Find the lowest and the highest value of a function of the input.

    The function is sampled, and each valley and summit is narrowed down by golden sections.
    """
    sampled = []
    for interval in ranges:
        values = sample_inputs(interval)
        sampled.append(Sampled(interval, values, [function(value) for value in values]))
    return _min_max_curve(function, sampled)


def _min_max_curve(function: Callable[[float], float], sampled: Sequence[Sampled]) -> SweptCurve:
    lowest = _find_lowest(function, sampled)
    upside_down = [sample._replace(results=[-y for y in sample.results]) for sample in sampled]
    highest = _find_lowest(lambda value: -function(value), upside_down)
    return SweptCurve(lowest, Extreme(-highest.value, highest.at))


def _find_lowest(function: Callable[[float], float], sampled: Sequence[Sampled]) -> Extreme:
    lows: list[tuple[float, float]] = []
    best = min((y for sample in sampled for y in sample.results if isfinite(y)), default=nan)
    for interval, values, results in sampled:
        last = len(values) - 1
        for i, result in enumerate(results):
            # The ends of a full turn are one place: each continues at the other.
            turn = values[last] - values[0] if interval.is_whole else 0.0
            before = values[i - 1] if i else values[last - 1] - turn if turn else values[0]
            after = values[i + 1] if i < last else values[1] + turn if turn else values[last]
            beside = (
                results[i - 1 if i or turn else 0],
                results[(i + 1) % last if turn else min(i + 1, last)],
            )
            lows.append((result, values[i]))
            # A valley much higher than the deepest cannot reach it, even with a kink.
            deep = result - best <= _DEEPER * (max(beside) - result) + _SAME
            if deep and result <= min(beside) and result < max(beside) - _NOISE:
                lowest = golden_section(function, before, after)
                # The place of a smooth valley has half the digits; the sample may be better.
                if result - lowest[0] > _NOISE:
                    lows[-1] = lowest
    lows = [(result, value) for result, value in lows if isfinite(result)]
    if not lows:
        return Extreme(nan, ())
    best = min(result for result, _ in lows)
    places = sorted(value for result, value in lows if result - best <= _SAME)
    if len(places) > _MANY:
        return Extreme(best, ())
    at: list[float] = []
    for value in places:
        whole = any(interval.is_whole for interval, _, _ in sampled)
        if all(abs(remainder(value - p, tau) if whole else value - p) > _APART for p in at):
            at.append(value)
    return Extreme(best, tuple(at))


def find_zeros(function: Callable[[float], float], ranges: Sequence[InputRange]) -> list[float]:
    """
    Return the zeros of a function that is never negative, inside its ranges, not at their ends.

    Values within the rounding errors of a chain of dyads count as 0.
    """
    zeros = []
    for interval in ranges:
        values = sample_inputs(interval)
        results = [function(value) for value in values]
        valleys = range(1, len(values) - 1)
        if interval.is_whole:
            # The ends of a full turn are one place.
            step = values[1] - values[0]
            values, results = [*values, values[-1] + step], [*results, results[1]]
            valleys = range(1, len(values) - 1)
        for i in valleys:
            if results[i] <= min(results[i - 1], results[i + 1]) and results[i] < _NEAR_ZERO:
                lowest, at = golden_section(function, values[i - 1], values[i + 1])
                if min(lowest, results[i]) < _ZERO:
                    zeros.append(at if lowest <= results[i] else values[i])
    return zeros


def transmission_angles(sweep: InputSweep) -> dict[int, SweptCurve]:
    """
    Return the extreme transmission angles of each group over the range, by its number, in [rad].

    They are folded into [0, π/2]. Groups that are iterated have none.
    """
    steps = enumerate(sweep.closure.steps)
    methods = {n: step.transmission_angle for n, step in steps if step.has_transmission_angle}
    return _step_extremes(sweep, methods, _SAMPLES)


def conditioning_curves(sweep: InputSweep) -> dict[int, SweptCurve]:
    """Return the extreme conditioning of each iterated group over the range, by its number."""
    steps = enumerate(sweep.closure.steps)
    methods = {n: step.conditioning for n, step in steps if step.iterates}
    return _step_extremes(sweep, methods, _SAMPLES // 4)


def _step_extremes(
    sweep: InputSweep, methods: Mapping[int, Callable[[Any], float]], count: int
) -> dict[int, SweptCurve]:
    """Return the extremes of methods of steps, by their numbers, of their poses; by group."""
    closure = sweep.closure
    if not methods:
        return {}
    # One sweep for all steps: otherwise each of n loops would be closed n times.
    sampled: dict[int, list[Sampled]] = {number: [] for number in methods}
    closed = nan
    for interval in sweep.ranges:
        values = sample_inputs(interval, count)
        for of_step in sampled.values():
            of_step.append(Sampled(interval, values, []))
        for done, value in enumerate(values):
            tell_progress('states examined', done, len(values))
            position = sweep.position_at(value)
            if position.status.has_pose:
                closed = value
            for number, method in methods.items():
                result = method(position.poses[number]) if position.status.has_pose else nan
                sampled[number][-1].results.append(result)
    if closed != closed:
        return {
            closure.step_groups[number]: _min_max_curve(lambda _: nan, []) for number in methods
        }
    return {
        closure.step_groups[number]: _min_max_curve(
            _as_input_function(sweep, number, method, closed), sampled[number]
        )
        for number, method in methods.items()
    }


def _as_input_function(
    sweep: InputSweep, number: int, method: Callable[..., float], closed: float
) -> Callable[[float], float]:
    """Return a method of a step as a function of the input; NaN where its loops do not close."""
    pose_at = pose_alone(sweep.closure, number, *sweep.inputs_at(closed))

    def pose_value(value: float) -> float:
        pose = pose_at(*sweep.inputs_at(value))
        return method(pose) if pose.status.has_pose else nan

    return pose_value


# Checks that a linkage closes, and that it can be within its limits.


def check_closes(closure: Closure) -> None:
    """
    Refuse a linkage whose loops close at no value of its only input.

    The DefinitionError says which links miss each other, and by how much where they are nearest.
    """
    if len(closure.linkage.inputs) != 1 or closure.closing_ranges:
        return

    def miss_distance(position: Position) -> tuple[int, float]:
        return -len(position.poses), position.gap

    states = [(inputs[0], position) for inputs, position in grid_positions(closure, _SAMPLES)]
    value, nearest = min(states, key=lambda state: miss_distance(state[1]))
    step = abs(states[1][0] - states[0][0])
    between = golden_section(lambda at: closure.position(at).gap, value - step, value + step)[1]
    nearest = min(nearest, closure.position(between), key=miss_distance)
    links = closure.links_of_group(closure.step_groups[len(nearest.poses) - 1])
    if len(links) == 1:
        links.append('the rest')
    raise DefinitionError(
        'links',
        f'the loops close at no value of the input; {list_names(links, " and ")} miss each '
        'other by '
        f'{nearest.gap:.3g} m or more',
        'the longest link of a loop must be shorter than its others together',
    )


def check_turns(closure: Closure) -> None:
    """Refuse a ratio of an angle that leaves the half turns in which its turns are known."""
    for step in closure.steps:
        if not isinstance(step, FollowerJoint) or step.middle is None:
            continue
        for interval in closure.closing_ranges:
            positions = [closure.close_unlimited(value) for value in sample_inputs(interval)]
            states = [
                position.state.coordinates for position in positions if position.status.has_pose
            ]
            followed = [x[step.one] - x[step.other] + step.constant - step.middle for x in states]
            turned = [remainder(value, tau) for value in followed]
            if any(abs(first - second) > pi for first, second in pairwise(turned)):
                of = closure.linkage.ratios[step.joint].of
                raise DefinitionError(
                    f'ratios.{step.joint}.of',
                    f'{quote(of)} passes {step.middle + pi:.4g} rad, where its turns are not '
                    'known, and the ratio is not a whole number',
                    f'write limits for {quote(of)}, with the middle of its swing as their middle',
                )


def check_limits(closure: Closure) -> None:
    """
    Refuse limits between which a linkage cannot be.

    A DefinitionError is raised if the pose is beyond limits, or no state of the input's range is
    within the limits of the input, of a published joint, or of all joints together.
    """
    bounds, linkage = closure.bounds, closure.linkage
    if not bounds:
        return
    if linkage.pose:
        joints = closure.position(*linkage.pose.inputs).joints
        bound = bounds.first_exceeded(linkage.pose.inputs, joints) if joints else None
        if bound is not None:
            raise DefinitionError(
                'pose.inputs',
                f'bring {quote(bound.name)} to {bound.turn_to_middle(joints[bound.number]):.6g} '
                f'{_joint_unit(linkage, bound)}, '
                f'beyond its limits {_limits_text(closure, bound)}',
                'start within the limits, or widen them',
            )
    if len(linkage.inputs) == 1:
        _check_single(closure)
    elif not (linkage.pose and joints) and not _met_on_grid(closure):
        names = list_names(map(quote, linkage.limits))
        raise DefinitionError(
            'input.limits',
            f'no state was found within the limits of {names}',
            'widen them, or name a pose within them',
        )


def _check_single(closure: Closure) -> None:
    ranges, bounds = closure.closing_ranges, closure.bounds
    if bounds.inputs:
        (bound,) = bounds.inputs
        ranges = within_own(closure, ranges)
        if not ranges:
            raise DefinitionError(
                'input.limits',
                f'{_limits_text(closure, bound)} of {quote(bound.name)} never meet its range, '
                f'{describe_ranges(closure.closing_ranges)}',
                'widen them',
            )
    for bound in bounds.joints:
        if not within_published(closure, ranges, [bound]):
            low, high = _joint_range(closure, ranges, bound)
            raise DefinitionError(
                f'joints.{bound.name}.limits',
                f'{_limits_text(closure, bound)} of {quote(bound.name)} are never met: it goes '
                'from '
                f'{low:.6g} to {high:.6g} {_joint_unit(closure.linkage, bound)}',
                'widen them',
            )
    if bounds.joints and not within_published(closure, ranges, bounds.joints):
        names = list_names(quote(bound.name) for bound in bounds.joints)
        raise DefinitionError(
            'joints',
            f'the limits of {names} are met, but never together',
            'widen them',
        )


def _joint_range(
    closure: Closure, ranges: Iterable[InputRange], bound: Bound
) -> tuple[float, float]:
    """Return the range of a published joint, with the turns that bring it nearest its limits."""
    values = [value for interval in ranges for value in sample_inputs(interval)]
    positions = [closure.position(value).joints for value in values]
    turned = [bound.turn_to_middle(joints[bound.number]) for joints in positions if joints]
    return min(turned), max(turned)


def _met_on_grid(closure: Closure) -> bool:
    return any(
        position.joints and closure.bounds.first_exceeded(inputs, position.joints) is None
        for inputs, position in grid_positions(closure)
    )


def _limits_text(closure: Closure, bound: Bound) -> str:
    limits = closure.linkage.limits[bound.name]
    return f'{limits} {_joint_unit(closure.linkage, bound)}'


def _joint_unit(linkage: Linkage, bound: Bound) -> str:
    units = {driven.joint: driven.unit for driven in linkage.inputs}
    return units.get(bound.name) or linkage.joints[bound.name].unit
