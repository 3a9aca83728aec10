# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Drives that generate the crank by themselves: a curve for each input, on one clock.

Time is the integer number of nanoseconds since the first tick. A curve takes that integer, so that
no digit is lost before the multiplication by a rate or a frequency.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from linkage_ros.errors import DefinitionError, list_names, quote
from linkage_ros.kinematics import call, Closure, InputSweep
from linkage_ros.stages.drives.drive import Context, CrankState, Drive, FormulaCrank

Curve = Callable[[int], tuple[float, float, float]]
"""
Value, rate and acceleration of an input at a time since the first tick, in [ns].

In [rad], [rad/s] and [rad/s²]; of an input that slides in [m], [m/s] and [m/s²]. Each is the
derivative by time of the one before it.
"""


def refuse_beyond(
    closure: Closure, number: int, where: str, start: float, extent: tuple[float, float]
) -> None:
    """
    Refuse a motion of an input that leaves the limits of a joint, where it can be known.

    It can be known for the limits of the input itself and, with a single input, for the limits of
    published joints. A motion that leaves the range through a toggle is not refused: there the
    loop is open. ``number`` is the index of the input, ``where`` the key of the motion, ``start``
    its first value, and ``extent`` its least and greatest value, in [rad] or [m]; infinite without
    bound. Raise `DefinitionError`, which names the joint.
    """
    driven = closure.linkage.inputs[number]
    low, high = extent
    unit = driven.unit
    goes = f'takes {quote(driven.joint)} from {low:.6g} {unit} to {high:.6g} {unit}'
    for bound in closure.bounds.inputs:
        if bound.number == number and (bound.is_beyond(low) or bound.is_beyond(high)):
            raise DefinitionError(
                where,
                f'{goes}, beyond its limits {driven.limits} {unit}',
                'stay within them, or widen them in the linkage file',
            )
    if not closure.bounds.joints or len(closure.linkage.inputs) > 1:
        return
    way = InputSweep(closure)
    interval = way.range_about(start)
    if interval is None:
        if beyond := closure.limit_exceeded(way.position_at(start)):
            raise DefinitionError(
                where,
                f'starts at {start:.6g} {unit}, beyond limits: {beyond}',
                'start within them',
            )
        return
    for value, end, outward, by in zip(
        extent, interval[:2], (-1.0, 1.0), interval.by, strict=True
    ):
        if by and outward * (value - end) > 1e-12 * (abs(end) + 1.0):
            raise DefinitionError(
                where,
                f'{goes}, beyond {end:.6g} {unit}, where {quote(by)} is at its limit',
                'stay within it, or widen it in the linkage file',
            )


class ClockedCrank(FormulaCrank):
    """Inputs that follow curves, one for each input of the linkage, from the first tick on."""

    __slots__ = ('_curves', 'start')

    HELD = 'start'
    stamp = 0
    max_age = 0
    start: int | None
    """Time of the first tick, in [ns]; None before it."""

    def __init__(self, curves: tuple[Curve, ...]) -> None:
        self._curves = curves
        self.start = None

    def usual(self, _inputs: int) -> tuple[int, Any]:
        """Return the time of a tick and of the first one, in [ns]."""
        return 1, 0

    def state(self, now: int) -> CrankState | None:
        """Return the crank state at a time, in [ns]; the first call sets the time 0."""
        if self.start is None:
            self.start = now
        return self.crank_state(now, self.start)

    def crank_state(self, now: int, held: int) -> CrankState:
        """Return the crank state at a time, in [ns], by the time of the first tick."""
        elapsed = now - held
        if len(self._curves) == 1:  # a loop over one would double the time
            value, rate, acceleration = call(self._curves[0], elapsed)
            return CrankState((value,), (rate,), (acceleration,), 0)
        several = [call(curve, elapsed) for curve in self._curves]
        values, rates, accelerations = (
            tuple([derivatives[i] for derivatives in several]) for i in range(3)
        )
        return CrankState(values, rates, accelerations, 0)


class InputMotion(ABC):
    """The parameters of the motion of one input."""

    __slots__ = ()

    @abstractmethod
    def value_range(self) -> tuple[float, float]:
        """Return the least and the greatest value, in [rad] or [m]; infinite without bound."""

    @abstractmethod
    def motion_curve(self, where: str = '') -> Curve:
        """Return the motion; ``where`` is its key, for errors."""


class ClockedDrive(InputMotion, Drive):
    """A drive that moves each input on a curve."""

    __slots__ = ()

    KEY: ClassVar[str]
    """Key of the drive in a scene."""
    inputs: Mapping[str, InputMotion]
    """Inputs that move otherwise, by name."""

    def build(self, context: Context) -> ClockedCrank:
        """
        Build the crank.

        Raise `DefinitionError` if every input has its own parameters, so that the common ones have
        no effect, or if an input leaves the limits of a joint.
        """
        names = [driven.joint for driven in context.closure.linkage.inputs]
        where = self.KEY
        if self.inputs and len(self.inputs) == len(names):
            raise DefinitionError(
                f'{where}.inputs',
                f'names every input ({list_names(names)}), so the values outside it are unused',
                f'leave one of them out: it then takes the values outside {where}.inputs',
            )
        curves = []
        for index, name in enumerate(names):
            own = self.inputs.get(name)
            moved, key = (own, f'{where}.inputs.{name}') if own else (self, where)
            curves.append(moved.motion_curve(key))
            if context.hard_limited.bounds:
                start, extent = curves[-1](0)[0], moved.value_range()
                refuse_beyond(context.hard_limited, index, key, start, extent)
        return ClockedCrank(tuple(curves))


def as_integers(*numbers: float) -> tuple[list[int], int]:
    """
    Return doubles as integers over one denominator.

    This is exact, since each double is an integer over a power of 2. Python divides integers of
    any length to the nearest double. So a formula of products and sums of such integers, with the
    time as another integer, is rounded only once.
    """
    ratios = [number.as_integer_ratio() for number in numbers]
    denominator = max(below for _, below in ratios)
    return [above * (denominator // below) for above, below in ratios], denominator
