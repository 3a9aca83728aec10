# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The margin to a singularity: transmission angle, conditioning, distance to a toggle."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from math import atan, inf, pi, remainder, sqrt, tau
from operator import attrgetter
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.arithmetic import sin
from linkage_ros.kinematics.plane.dyads.prp import CrankPRPDyad, PRPDyad
from linkage_ros.kinematics.plane.dyads.rpp import RPPDyad
from linkage_ros.kinematics.plane.dyads.rpr import RPRDyad
from linkage_ros.kinematics.results import SingularInput, SingularityMargin
from linkage_ros.kinematics.status import Status

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure
    from linkage_ros.kinematics.results import Position

_SAME = 1e-9
"""Singular inputs nearer to each other than this count as one, in [rad] or [m]."""

_BESIDE = 1e-6
"""Distance from a singular input at which the side of a dyad is compared, in [rad] or [m]."""

_STATES = 4096
"""Number of states that are kept during the search for singular inputs."""


class StepMargin(NamedTuple):
    """The margin of a step to a singularity, and the group that it belongs to."""

    transmission_angle: float
    conditioning: float
    group: int


_FARTHEST = StepMargin(0.5 * pi, 1.0, -1)
"""The margin where nothing can be singular."""


def singularity_margin(closure: Closure, position: Position) -> SingularityMargin:
    """Return the margin of a closed position to a singularity."""
    margins = [*step_margins(closure, position)]
    angle = min((margin.transmission_angle for margin in margins), default=0.5 * pi)
    weakest = min(margins, key=lambda margin: min(margin.conditioning, 1.0), default=_FARTHEST)
    distance = inf
    if len(closure.linkage.inputs) == 1:
        sliding = bool(closure.linkage.inputs[0].slider)
        unit = closure.scale if sliding else 1.0
        value = _move_within(closure, position.state.coordinates[1] * unit)
        for singular in closure.singular_inputs:
            distance = min(distance, abs(signed_distance(closure, value, singular.value)))
    return SingularityMargin(angle, min(weakest.conditioning, 1.0), distance, weakest.group)


def step_margins(closure: Closure, position: Position) -> Iterator[StepMargin]:
    """Yield the margins of the steps of a closed position, of numbers or symbols."""
    groups = closure.step_groups
    for step, pose, group in zip(closure.steps, position.poses, groups, strict=True):
        if step.has_transmission_angle:
            angle = step.transmission_angle(pose)
            yield StepMargin(angle, sqrt(2.0) * sin(0.5 * angle), group)
        elif step.iterates:
            yield StepMargin(0.5 * pi, step.conditioning(pose), group)


def signed_distance(closure: Closure, value: float, place: float) -> float:
    """
    Return the distance of a value of the single input from a place, in [rad] or [m].

    Whole turns do not count, except from the end of a range whose turns have different poses.
    """
    if closure.linkage.inputs[0].slider:
        return value - place
    for interval in closure.input_ranges:
        if not interval.is_whole and place in interval[:2]:
            period = interval.turns * tau
            return remainder(value - place, period) if period else value - place
    period = closure.ratio_turns * tau
    return remainder(value - place, period) if period else value - place


def singular_inputs(closure: Closure) -> tuple[SingularInput, ...]:
    """
    Return the toggles and change points of a single input, in ascending order.

    Toggles end the ranges of the input. If the links of a dyad's two outer pins turn with the
    input, its constants give the angles at which its links are collinear, or its lines parallel.
    For all other dyads the zeros of the transmission angle are searched over the ranges; for a
    straight rod in a swivel, whose angle is never 0, the zeros of the distance of its two pins.
    """
    from linkage_ros.kinematics.analysis.sweep_analysis import (
        find_zeros,  # local import: it needs the closure
    )

    inputs = closure.linkage.inputs
    if len(inputs) > 1:
        return ()
    ends = [end for interval in closure.closing_ranges for end in interval.toggles]
    singular = [SingularInput(end, Status.TOGGLE) for end in ends]
    # All dyads are evaluated at the same states.
    posed = lru_cache(_STATES)(closure.close_unlimited)
    for index, step in enumerate(closure.steps):
        if not step.has_transmission_angle or isinstance(step, RPPDyad):
            continue
        places = _turned_by_input(closure, step)
        if places is None:
            places = find_zeros(
                partial(_singular_distance, step, index, posed), closure.closing_ranges
            )
        for place in places:
            status = _singular_status(closure, index, place)
            distances = (abs(signed_distance(closure, place, known.value)) for known in singular)
            if status is not None and all(apart > _SAME for apart in distances):
                singular.append(SingularInput(place, status))
    return tuple(sorted(singular, key=attrgetter('value')))


def _move_within(closure: Closure, value: float) -> float:
    """Return the input of the same pose within the ranges: for a cylinder its other length."""
    zero = closure.zero_length
    ranges = closure.closing_ranges
    if zero is None or any(interval.lowest <= value <= interval.highest for interval in ranges):
        return value
    return 2.0 * zero - value


def _turned_by_input(closure: Closure, step: Any) -> list[float] | None:
    """Return the singular angles of a dyad as inputs, if the input turns its outer pins' links."""
    span = step.span
    if span is None or not span.arms or closure.linkage.ratios:
        return None
    first, second = span.arms[:2]
    turns = closure.turns_with
    if first not in turns or second not in turns:
        return None
    factor = turns[first][0] - turns[second][0]
    return [remainder(angle / factor, tau) for angle in span.singular_angles] if factor else []


def _singular_status(closure: Closure, number: int, place: float) -> Status | None:
    """Return the kind of a dyad's singular input; None if no loop closes next to it."""
    status = closure.close_unlimited(place).status
    beside = [closure.close_unlimited(place + step) for step in (-_BESIDE, _BESIDE)]
    if not any(position.status.has_pose for position in beside):
        return None
    if not status.has_pose or _never_toggles(closure.steps[number]):
        # The nearest float to parallel lines, or to coincident pins, may have a pose.
        return Status.INDETERMINATE
    if status is Status.CLOSED and all(position.status.has_pose for position in beside):
        # A dyad after others, next to the singular float: is it on its other side afterwards?
        step: Any = closure.steps[number]
        before, after = (step.side_of(position.poses[number]) for position in beside)
        return Status.CHANGE_POINT if before * after < 0.0 else Status.TOGGLE
    return status if status is Status.CHANGE_POINT else Status.TOGGLE


def _never_toggles(step: Any) -> bool:
    """Return whether a dyad is singular only where its lines are parallel or its pins meet."""
    return isinstance(step, PRPDyad | CrankPRPDyad) or (
        isinstance(step, RPRDyad) and not step.offset
    )


def _singular_distance(
    step: Any, number: int, posed: Callable[[float], Position], value: float
) -> float:
    """Return the angle of a dyad to its singularity at an input, in [rad]; 0 without a pose."""
    position = posed(value)
    if len(position.poses) <= number or not position.status.has_pose:
        return 0.0
    pose: Any = position.poses[number]
    if isinstance(step, RPRDyad) and not step.offset:
        return atan(abs(pose.slide))
    return float(step.transmission_angle(pose))
