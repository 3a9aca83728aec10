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
Links that no dyad covers (class III and higher), by Newton's method on their constraints.

The unknowns are the angle of each link and the place of one point of it. A pin makes two points
meet, a slider keeps an angle and a point on a line, a driven joint fixes an angle or a slide: as
many equations as unknowns, with the Jacobian written out. Velocities and accelerations solve the
same matrix for the constraints' own derivatives.

The assembly is the one that the given pose leads to by continuity. To make that a function of the
inputs alone, and not of where the linkage was before, the solution is continued once from the pose
to knots, 256 to a turn (or to the unit of length), each from its neighbour; a state starts from
the nearest knot. A step is taken only where Newton's method contracts from its first correction
on, the pose moves little, and the Jacobian keeps its orientation; else it is halved, and where it
gets too small, the assembly ends there: the linkage is at its limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, inf, remainder, tau
from typing import NamedTuple

from linkage_ros.kinematics.equations import (
    along,
    Array,
    Constraint,
    derivative,
    equations,
    line_motion,
    OnLine,
)
from linkage_ros.kinematics.rounding import UNIT_ROUNDOFF
from linkage_ros.kinematics.starting_pose import StartingPose
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State, Step
import numpy as np

_KNOTS = 256
_SMALLEST_STEP = 2.0**-20
_FARTHEST = 0.5
"""In [rad], or in lengths: a step that moves an angle or a place by more is halved."""

_ACCEPTED = 256.0 * UNIT_ROUNDOFF
"""Of the size of the coordinates: what a constraint may be off by at a solution."""

_SINGULAR = 1e-11
"""Smallest singular value of the Jacobian, of the largest, below which no rate is told."""


class IteratedPose(NamedTuple):
    """
    The links at one state.

    Attributes
    ----------
    status, gap
        Whether they close; where not, what a constraint is off by at best.
    unknowns
        For each body its angle and the place of its point.
    jacobian
        Of the constraints by the unknowns.

    """

    status: Status
    gap: float
    unknowns: Array
    jacobian: Array


class Iteration:
    """
    A group of links that is solved by iteration.

    Parameters
    ----------
    constraints
        As many equations as there are unknowns.
    slides
        The sliders whose slides are appended to the coordinates.
    start
        The pose to continue from.
    before
        The steps before this one.
    sliding
        For each input whether it is a slide.

    """

    __slots__ = ('_before', '_constraints', '_inputs', '_knots', '_period', '_slides', '_start')

    def __init__(
        self,
        constraints: tuple[Constraint, ...],
        slides: tuple[OnLine, ...],
        start: StartingPose,
        before: tuple[Step, ...],
        sliding: tuple[bool, ...],
    ) -> None:
        self._constraints = constraints
        self._slides = slides
        self._before = before
        self._inputs = start.inputs
        self._start = np.array(
            [
                value
                for angle, place in zip(start.angles, start.places, strict=True)
                for value in (angle, place.real, place.imag)
            ]
        )
        self._knots: dict[int, Array | None] = {}
        spacing = tau / _KNOTS if not sliding[0] else 1.0 / _KNOTS
        self._period = (spacing, not sliding[0] and len(sliding) == 1)

    @property
    def equation_count(self) -> int:
        """How many equations are solved at once."""
        return len(self._start)

    def close(self, known: State) -> IteratedPose:
        """Append the angles of the bodies, the slides, and the places of the bodies."""
        end = 1 + len(self._inputs)
        inputs = known[0][1:end]
        start, value = self._nearest(inputs)
        solved = None
        if start is not None:
            solved = self._continue(start, value, inputs, known)
        if solved is None:
            return self._open(known, start)
        unknowns, jacobian = solved
        x, pins = known
        x.extend(unknowns[0::3].tolist())
        pins.extend((unknowns[1::3] + 1j * unknowns[2::3]).tolist())
        for slide in self._slides:
            x.append(along(slide, known, unknowns).real)
        pose = IteratedPose(Status.CLOSED, 0.0, unknowns, jacobian)
        singular = self.conditioning(pose) <= _SINGULAR
        return pose._replace(status=Status.TOGGLE) if singular else pose

    def rates(self, pose: IteratedPose, known: State, speeds: State) -> Array:
        """Append the rates of what `close` has appended."""
        still = np.zeros_like(pose.unknowns)
        drift = derivative(self._constraints, pose.unknowns, known, speeds, still, None, still)
        rates = np.linalg.solve(pose.jacobian, -drift)
        self._append(speeds, rates)
        for slide in self._slides:
            motion = line_motion(slide, pose.unknowns, known, speeds, rates, None, still)
            speeds[0].append(motion[1].real)
        return rates

    def accelerations(
        self, pose: IteratedPose, rates: Array, known: State, speeds: State, changes: State
    ) -> None:
        """Append the accelerations of what `close` has appended."""
        still = np.zeros_like(rates)
        drift = derivative(self._constraints, pose.unknowns, known, speeds, rates, changes, still)
        solved = np.linalg.solve(pose.jacobian, -drift)
        self._append(changes, solved)
        for slide in self._slides:
            motion = line_motion(slide, pose.unknowns, known, speeds, rates, changes, solved)
            changes[0].append(motion[2].real)

    def conditioning(self, pose: IteratedPose) -> float:
        """Return the smallest singular value of the constraints' Jacobian, of the largest."""
        values = np.linalg.svd(pose.jacobian, compute_uv=False)
        return float(values[-1] / values[0])

    def _append(self, state: State, values: Array) -> None:
        state[0].extend(values[0::3].tolist())
        state[1].extend((values[1::3] + 1j * values[2::3]).tolist())

    def _known(self, inputs: Sequence[float]) -> State | None:
        """Return what is known before this step, at any inputs."""
        known = State([0.0, *inputs], [])
        for step in self._before:
            status = step.close(known)[0]
            if not status.has_pose:
                return None
        return known

    def _nearest(self, inputs: Sequence[float]) -> tuple[Array | None, Sequence[float]]:
        """Return the solution at the nearest knot, and the knot's inputs."""
        if len(inputs) > 1:
            return self._knot(0), self._inputs
        spacing, turning = self._period
        number = round((inputs[0] - self._inputs[0]) / spacing)
        at = (self._inputs[0] + number * spacing,)
        if turning and abs(number) > _KNOTS // 2:
            number = self._within_a_turn(number)
        return self._knot(number), at

    def _within_a_turn(self, number: int) -> int:
        """
        Return the knot, within a turn of the pose, of the same crank direction.

        Where the input turns on and on and its links do not come back to where they were, the
        assembly depends on the turn, and so does the knot.
        """
        if self._knot(_KNOTS) is not None and not self._closes_in_a_turn():
            return number
        near = round(remainder(number, _KNOTS))
        far = near - _KNOTS if near > 0 else near + _KNOTS
        return near if self._knot(near) is not None else far

    def _closes_in_a_turn(self) -> bool:
        """Return whether the links are back where they began after a turn of the input."""
        first, last = self._knot(0), self._knot(_KNOTS)
        if first is None or last is None:
            return False
        moved = last - first
        turns = np.abs(moved[0::3] - tau * np.round(moved[0::3] / tau))
        return bool(max(turns.max(), np.abs(moved[1::3]).max(), np.abs(moved[2::3]).max()) < 1e-9)

    def _knot(self, number: int) -> Array | None:
        """Return the solution at a knot, continued from the pose."""
        spacing = self._period[0]
        sign = 1 if number > 0 else -1
        for k in range(0, number + sign, sign):
            if k not in self._knots:
                value = (self._inputs[0] + k * spacing, *self._inputs[1:])
                known = self._known(value)
                solved = None
                if known is not None and k == 0:
                    solved = self._correct(known, self._start, inf)
                elif known is not None:
                    before = self._knots[k - sign]
                    at = (self._inputs[0] + (k - sign) * spacing, *self._inputs[1:])
                    solved = (
                        self._continue(before, at, value, known) if before is not None else None
                    )
                self._knots[k] = solved[0] if solved is not None else None
            if self._knots[k] is None:
                self._knots[number] = None
                return None
        return self._knots[number]

    def _continue(
        self, start: Array, begin: Sequence[float], end: Sequence[float], known: State
    ) -> tuple[Array, Array] | None:
        """Return the solution at some inputs, in steps from that at others."""
        span = max(abs(e - b) for b, e in zip(begin, end, strict=True))
        done, step = 0.0, 1.0 / max(1, ceil(span / (2.0 * self._period[0])))
        at = start
        orientation = None
        while True:
            target = min(1.0, done + step)
            if target == 1.0:
                there: State | None = known
            else:
                there = self._known(
                    [b + target * (e - b) for b, e in zip(begin, end, strict=True)]
                )
            solved = self._correct(there, at, _FARTHEST) if there is not None else None
            if solved is not None:
                sign = np.linalg.slogdet(solved[1])[0]
                if orientation not in (None, sign):
                    solved = None
                else:
                    orientation = sign
            if solved is None:
                step *= 0.5
                if step < _SMALLEST_STEP:
                    return None
                continue
            at, done = solved[0], target
            if done == 1.0:
                return solved

    def _correct(self, known: State, start: Array, farthest: float) -> tuple[Array, Array] | None:
        """Return a solution near a start, and its Jacobian, or nothing where none is proven."""
        unknowns, last = start, inf
        size = 1.0 + float(np.abs(start).max())
        for _ in range(30):
            errors, jacobian = equations(self._constraints, unknowns, known)
            try:
                step = np.linalg.solve(jacobian, -errors)
            except np.linalg.LinAlgError:
                return None
            length = float(np.abs(step).max())
            if not length < farthest or (farthest < inf and length > 0.7 * last > 1e-12 * size):
                return None
            if length >= last or length <= 4.0 * UNIT_ROUNDOFF * size:
                good = float(np.abs(errors).max()) <= _ACCEPTED * size
                return (unknowns, jacobian) if good else None
            unknowns, last = unknowns + step, length
        return None

    def _open(self, known: State, start: Array | None) -> IteratedPose:
        unknowns = self._start if start is None else start
        errors, jacobian = equations(self._constraints, unknowns, known)
        for _ in range(20):  # downhill, to tell how near the links come
            step = np.linalg.lstsq(jacobian, -errors, rcond=1e-6)[0]
            step *= min(1.0, 0.1 / max(float(np.abs(step).max()), 1e-300))
            trial, slope = equations(self._constraints, unknowns + step, known)
            if np.abs(trial).max() >= np.abs(errors).max():
                break
            unknowns, errors, jacobian = unknowns + step, trial, slope
        return IteratedPose(Status.OPEN, float(np.abs(errors).max()), unknowns, jacobian)
