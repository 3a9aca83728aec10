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
The truth: joints of any linkage to fifty digits, with their rates and accelerations.

It is written from what the linkage's file says and from nothing that is measured. Unknown are, in
extended precision, the angle θ and the place p of the frame of every link, and the slide s of
every slider. With e = e^{iθ} and z a point in its link's frame::

    pin        p1 + e1·z1 = p2 + e2·z2
    slider     p1 + e1·(t + s·d) = p2 + e2·z2      t the line's point, d its unit direction
    block      θ2 = θ1 + angle
    input      θ2 − θ1, or s, is given

Newton's method solves them. It starts from the closure's solution in doubles, for one reason: that
says which assembly is meant. The k-th derivatives by time satisfy the same equations derived k
times, in which they stand behind the same matrix::

    d/dt   (p + e·z) = p' + iθ'·e·z
    d²/dt² (p + e·z) = p'' + (iθ'' − θ'²)·e·z

At a toggle and at a change point that matrix is singular: there is no derivative at the one, there
are several at the other, and neither has a reference here. Next to them it is only
ill-conditioned, and the precision is raised until fifty digits are left over.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from linkage_ros.accuracy.reference.equations import ExactEquations, SingularError, solved
from linkage_ros.kinematics.closure import Closure, Position
from linkage_ros.kinematics.linkage import GROUND, Linkage

__all__ = ('DIGITS', 'Reference', 'SingularError', 'Truth')

DIGITS = 50

_GUARD = 50
"""Digits that a neighbourhood of trouble may cost, to begin with."""

_MOST = 800
"""Digits beyond which a pose counts as singular."""


class Truth(NamedTuple):
    """
    A state, as it is.

    Attributes
    ----------
    joints, rates, accelerations
        Of the published joints, mpmath's numbers, in [rad] or [m] and by the second.
    error
        What they may be off by, of 1.
    links
        For each link but the ground the angle and the place (x, y) of its frame, then the rates of
        these, then their accelerations.

    """

    joints: tuple[Any, ...]
    rates: tuple[Any, ...]
    accelerations: tuple[Any, ...]
    error: float
    links: Mapping[str, tuple[Sequence[Any], ...]]

    @property
    def orders(self) -> tuple[tuple[Any, ...], ...]:
        """Joints, rates and accelerations."""
        return self[:3]


class Reference:
    """
    A linkage, ready to be solved in extended precision.

    Parameters
    ----------
    linkage
        What to solve.
    digits
        How many are wanted.
    guard
        How many more are worked with, to begin with.

    """

    def __init__(self, linkage: Linkage, digits: int = DIGITS, guard: int = _GUARD) -> None:
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
            Values of the driven joints, taken as the numbers that they are, in [rad] or [m].
        rates, accelerations
            Theirs; 1 and 0 if not given.

        Raises
        ------
        SingularError
            At a toggle and at a change point.
        ValueError
            Where the linkage does not close.

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
        found = []
        for link in self._links:
            name, arm = next(iter(self._linkage.links[link].items()))
            turn = complex(*arm) * rect(1.0, angles[link])
            place = points[link, name] - turn
            found += [angles[link], place.real, place.imag]
        return [*found, *(slides[name] for name in self._sliders)]


def _near(
    equations: ExactEquations,
    numbers: Mapping[str, int],
    driven: Sequence[Sequence[float]],
    start: Sequence[float],
) -> Truth:
    """Return the state near a start."""
    mp = equations.mp
    given = [[mp.mpf(value) for value in values] for values in driven]
    motion = [[mp.mpf(value) for value in start]]
    unit, goal = equations.unit, mp.mpf(10) ** (-0.55 * mp.dps)
    length = mp.inf
    # A step of the goal leaves its square, which is less than rounding does.
    while length > goal:
        last = length
        step, least = solved(equations.rows(motion[0]), equations.off(motion, given))
        length = max(abs(one) for one in step) / unit
        # Where Newton's method does not contract, it may end in another assembly.
        if length > 0.25 * last:
            raise SingularError
        motion = [[x - s for x, s in zip(motion[0], step, strict=True)]]
    rows = equations.rows(motion[0])
    for _ in range(2):
        motion.append([mp.mpf(0)] * len(start))
        change, least = solved(rows, equations.off(motion, given))
        motion[-1] = [-one for one in change]
    # Each order inherits the error of the one before, once more by the inverse matrix.
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
