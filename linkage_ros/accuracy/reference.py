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
Reference to fifty digits: joints of any linkage, with their rates and accelerations.

It follows from the linkage file alone, not from the code that is measured. The unknowns, in
extended precision, are the angle θ and the position p of the frame of every link, and the slide s
of every slider. With e = e^{iθ} and z a point in its link's frame::

    pin        p1 + e1·z1 = p2 + e2·z2
    slider     p1 + e1·(t + s·d) = p2 + e2·z2      t the line's point, d its unit direction
    block      θ2 = θ1 + angle
    input      θ2 − θ1, or s, is given

Newton's method solves them. It starts from the closure's solution in doubles, only because that
selects the assembly. The k-th time derivatives satisfy the equations differentiated k times, which
have the same matrix::

    d/dt   (p + e·z) = p' + iθ'·e·z
    d²/dt² (p + e·z) = p'' + (iθ'' − θ'²)·e·z

At a toggle and at a change point that matrix is singular: at the first there is no derivative, at
the second there are several, so neither has a reference here. Next to them it is only
ill-conditioned, and the precision is raised until fifty digits remain.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from linkage_ros.errors import LinkageError, listed
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import GROUND, Linkage, RevoluteJoint
from linkage_ros.kinematics.results import Position
from mpmath import MPContext

__all__ = ('DIGITS', 'Reference', 'SingularError', 'Truth')

DIGITS = 50

_GUARD = 50
"""Extra digits for poses near a singular one, to begin with."""

_MOST = 800
"""Maximum number of digits; a pose that needs more counts as singular."""


class Truth(NamedTuple):
    """An exact state."""

    # Of the published joints, as mpmath numbers, in [rad] or [m], per [s] and [s²].
    joints: tuple[Any, ...]
    rates: tuple[Any, ...]
    accelerations: tuple[Any, ...]
    error: float  # Bound of the relative error
    # For each link but the ground the angle and the position (x, y) of its frame, then their
    # rates, then their accelerations.
    links: Mapping[str, tuple[Sequence[Any], ...]]

    @property
    def orders(self) -> tuple[tuple[Any, ...], ...]:
        """Joints, rates and accelerations."""
        return self[:3]


class Reference:
    """A linkage to be solved to a number of digits, with guard digits to compute with at first."""

    def __init__(self, linkage: Linkage, digits: int = DIGITS, guard: int = _GUARD) -> None:
        if linkage.ratios:
            raise LinkageError(
                'ratios',
                f'has {listed(linkage.ratios)}, which the reference does not know',
                'measure the linkage without them, each joint as an input',
            )
        self._linkage = linkage
        self._closure = Closure(linkage)
        self._digits, self._guard = digits, guard
        self._links = {
            name: 3 * k for k, name in enumerate(n for n in linkage.links if n != GROUND)
        }
        first = 3 * len(self._links)
        self._sliders = {name: first + k for k, name in enumerate(linkage.sliders)}
        self._systems: dict[int, ExactEquations] = {}

    def solve(
        self,
        inputs: Sequence[float],
        rates: Sequence[float] | None = None,
        accelerations: Sequence[float] | None = None,
    ) -> Truth:
        """
        Solve one state.

        Parameters
        ----------
        inputs
            Values of the driven joints, taken as exact, in [rad] or [m].
        rates, accelerations
            Of the driven joints; 1 and 0 if not given.

        Raises
        ------
        SingularError
            At a toggle and at a change point.
        ValueError
            If the linkage does not close.

        """
        position = self._closure.position(*map(float, inputs))
        if not position.joints:
            raise ValueError(f'{inputs}: the linkage is {position.status.name.lower()}')
        start = self._start(position)
        driven = (
            inputs,
            [1.0] * len(inputs) if rates is None else rates,
            [0.0] * len(inputs) if accelerations is None else accelerations,
        )
        working = self._digits + self._guard
        while working <= _MOST:
            if working not in self._systems:
                self._systems[working] = ExactEquations(
                    self._linkage, self._links, self._sliders, working
                )
            try:
                truth = _near(self._systems[working], self._links, driven, start)
            except SingularError:
                truth = None
            if truth is not None and truth.error <= 10.0**-self._digits:
                return truth
            working *= 2
        raise SingularError(f'{tuple(inputs)}: singular to {_MOST} digits')

    def _start(self, position: Position) -> list[float]:
        """Return the unknowns as doubles."""
        angles, points = self._closure.link_angles(position), self._closure.points(position)
        slides = self._closure.slide_values(position)
        unknowns = []
        for link in self._links:
            name, arm = next(iter(self._linkage.links[link].items()))
            turn = complex(*arm) * rect(1.0, angles[link])
            place = points[link, name] - turn
            unknowns += [angles[link], place.real, place.imag]
        return [*unknowns, *(slides[name] for name in self._sliders)]


def _near(
    equations: ExactEquations,
    numbers: Mapping[str, int],
    driven: Sequence[Sequence[float]],
    start: Sequence[float],
) -> Truth:
    """Return the state near a start value."""
    mp = equations.mp
    given = [[mp.mpf(value) for value in values] for values in driven]
    motion = [[mp.mpf(value) for value in start]]
    unit, goal = equations.unit, mp.mpf(10) ** (-0.55 * mp.dps)
    length = mp.inf
    # After a step as small as the goal, the error is its square, below the rounding error.
    while length > goal:
        last = length
        step, least = solved(equations.rows(motion[0]), equations.off(motion, given))
        length = max(abs(one) for one in step) / unit
        # If Newton's method does not contract, it may end in another assembly.
        if length > 0.25 * last:
            raise SingularError
        motion = [[x - s for x, s in zip(motion[0], step, strict=True)]]
    rows = equations.rows(motion[0])
    for _ in range(2):
        motion.append([mp.mpf(0)] * len(start))
        change, least = solved(rows, equations.off(motion, given))
        motion[-1] = [-one for one in change]
    # Each order inherits the error of the one before, multiplied by the inverse matrix.
    size = 1 + max(abs(one) for values in motion[1:] for one in values)
    condition = unit / min(least, unit)
    rounding = mp.mpf(10) ** (3 - mp.dps)
    error = (condition * length**2 + rounding) * size * condition**3
    joints, speeds, changes = (equations.joints(values) for values in motion)
    links = {
        name: tuple([values[k + i] for i in range(3)] for values in motion)
        for name, k in numbers.items()
    }
    return Truth(joints, speeds, changes, float(error), links)


Row = dict[int, Any]
"""A row of the system: factors by the number of their unknown."""


class SingularError(ArithmeticError):
    """The constraints do not determine the motion: a toggle, or a change point."""


class ExactEquations:
    """
    The equations of a linkage at a precision.

    Parameters
    ----------
    linkage
        The linkage.
    links
        For each moving link the number of its first unknown: its angle; its position follows.
    sliders
        For each slider the number of its slide.
    digits
        The precision, in decimal digits.

    """

    def __init__(
        self,
        linkage: Linkage,
        links: Mapping[str, int],
        sliders: Mapping[str, int],
        digits: int,
    ) -> None:
        self.mp = MPContext()  # The context of the numbers
        self.mp.dps = digits
        self._linkage, self._links, self._sliders = linkage, links, sliders
        self._points = {
            (link, name): self.mp.mpc(*place)
            for link, points in linkage.links.items()
            for name, place in points.items()
        }
        self.unit = max(abs(one) for one in self._points.values())  # Size of the linkage, in [m]
        self._pins = []
        self._carriers: dict[str, str] = {}
        for link, name in self._points:
            if name in self._carriers:
                self._pins.append((name, self._carriers[name], link))
            self._carriers.setdefault(name, link)
        self._directions = {}
        for name, slider in linkage.sliders.items():
            direction = self.mp.mpc(*slider.direction)
            self._directions[name] = direction / abs(direction)

    def joints(self, values: Sequence[Any]) -> tuple[Any, ...]:
        """Return the published joints from the unknowns, or derivatives from derivatives."""

        def angle(link: str) -> Any:
            return values[self._links[link]] if link != GROUND else self.mp.mpf(0)

        return tuple(
            angle(joint.child) - angle(joint.parent)
            if isinstance(joint, RevoluteJoint)
            else values[self._sliders[joint.slider]]
            for joint in self._linkage.joints.values()
        )

    def off(self, motion: list[list[Any]], given: Sequence[Sequence[Any]]) -> list[Any]:
        """
        Return the residuals of the equations, differentiated as often as the motion.

        The motion is the unknowns, then their rates, then their accelerations; so are the given
        inputs.
        """
        order = len(motion) - 1
        residuals: list[Any] = []
        for name, one, other in self._pins:
            between = self._place(motion, one, self._points[one, name])
            between -= self._place(motion, other, self._points[other, name])
            residuals += [between.real, between.imag]
        for name, slider in self._linkage.sliders.items():
            carrier = slider.block or self._carriers[slider.point]
            between = self._on_line(motion, name)
            between -= self._place(motion, carrier, self._points[carrier, slider.point])
            residuals += [between.real, between.imag]
            if slider.block:
                apart = self._turn(motion, slider.block) - self._turn(motion, slider.along)
                residuals.append(apart if order else self._wrapped(apart - slider.angle))
        for k, joint in enumerate(self._linkage.inputs):
            if joint.slider:
                residuals.append(motion[-1][self._sliders[joint.slider]] - given[order][k])
                continue
            apart = self._turn(motion, joint.child) - self._turn(motion, joint.parent)
            apart -= given[order][k]
            residuals.append(apart if order else self._wrapped(apart))
        return residuals

    def rows(self, values: list[Any]) -> list[Row]:
        """Return the derivatives of the equations with respect to the unknowns."""
        rows: list[Row] = []

        def add(slopes: Sequence[tuple[int, Any]]) -> None:
            for part in (0, 1):
                row: Row = {}
                for column, slope in slopes:
                    row[column] = row.get(column, 0) + (slope.imag if part else slope.real)
                rows.append(row)

        def turned(child: str, parent: str) -> Row:
            pairs = ((child, 1), (parent, -1))
            return {self._links[link]: self.mp.mpf(sign) for link, sign in pairs if link != GROUND}

        for name, one, other in self._pins:
            add(
                self._slopes(values, one, self._points[one, name], 1)
                + self._slopes(values, other, self._points[other, name], -1)
            )
        for name, slider in self._linkage.sliders.items():
            carrier = slider.block or self._carriers[slider.point]
            direction = self._directions[name]
            start = self._points[slider.along, slider.through]
            column = self._sliders[name]
            add(
                [
                    *self._slopes(values, slider.along, start + values[column] * direction, 1),
                    (column, self._facing(values, slider.along) * direction),
                    *self._slopes(values, carrier, self._points[carrier, slider.point], -1),
                ]
            )
            if slider.block:
                rows.append(turned(slider.block, slider.along))
        for joint in self._linkage.inputs:
            if joint.slider:
                rows.append({self._sliders[joint.slider]: self.mp.mpf(1)})
            else:
                rows.append(turned(joint.child, joint.parent))
        return rows

    def _slopes(self, values: list[Any], link: str, z: Any, sign: int) -> list[tuple[int, Any]]:
        """Return the derivatives of a point's position by the unknowns of its link."""
        if link == GROUND:
            return []
        k = self._links[link]
        arm = self._facing(values, link) * z
        one = self.mp.mpc(sign)
        return [(k, one * 1j * arm), (k + 1, one), (k + 2, one * 1j)]

    def _facing(self, values: list[Any], link: str) -> Any:
        return self.mp.expj(values[self._links[link]]) if link != GROUND else self.mp.mpc(1)

    def _turn(self, motion: list[list[Any]], link: str) -> Any:
        return motion[-1][self._links[link]] if link != GROUND else self.mp.mpf(0)

    def _place(self, motion: list[list[Any]], link: str, z: Any) -> Any:
        """Return the position of a point of a link; for a motion, its highest derivative."""
        if link == GROUND:
            return z if len(motion) == 1 else self.mp.mpc(0)
        k = self._links[link]
        arm = self._facing(motion[0], link) * z
        place = self.mp.mpc(motion[-1][k + 1], motion[-1][k + 2])
        if len(motion) == 1:
            return place + arm
        if len(motion) == 2:
            return place + 1j * motion[1][k] * arm
        return place + (1j * motion[2][k] - motion[1][k] ** 2) * arm

    def _on_line(self, motion: list[list[Any]], name: str) -> Any:
        """Return the position of a slider's point on its line, or its derivative."""
        slider, column = self._linkage.sliders[name], self._sliders[name]
        along = self._directions[name]
        z = self._points[slider.along, slider.through] + motion[0][column] * along
        place = self._place(motion, slider.along, z)
        along = along * self._facing(motion[0], slider.along)
        if len(motion) > 1:
            place += motion[-1][column] * along
        if len(motion) > 2 and slider.along != GROUND:
            place += 2j * motion[1][self._links[slider.along]] * motion[1][column] * along
        return place

    def _wrapped(self, angle: Any) -> Any:
        whole = 2 * self.mp.pi
        return angle - whole * self.mp.nint(angle / whole)


def solved(rows: Sequence[Row], rest: Sequence[Any]) -> tuple[list[Any], Any]:
    """Return the solution of sparse linear equations, and the smallest pivot."""
    left = [(dict(row), value) for row, value in zip(rows, rest, strict=True)]
    steps: list[tuple[int, Row, Any]] = []
    least: Any = None
    for column in range(len(rows)):
        chosen = max(left, key=lambda line: abs(line[0].get(column, 0)))
        pivot = chosen[0].get(column, 0)
        if not pivot:
            raise SingularError
        least = abs(pivot) if least is None else min(least, abs(pivot))
        kept = []
        for line in left:
            if line is chosen:
                continue
            row, value = line
            factor = row.pop(column, 0)
            if factor:
                factor /= pivot
                for k, slope in chosen[0].items():
                    if k != column:
                        row[k] = row.get(k, 0) - factor * slope
                value -= factor * chosen[1]
            kept.append((row, value))
        left = kept
        steps.append((column, *chosen))
    solved: dict[int, Any] = {}
    for column, row, value in reversed(steps):
        known = sum(slope * solved[k] for k, slope in row.items() if k != column)
        solved[column] = (value - known) / row[column]
    return [solved[k] for k in range(len(rows))], least
