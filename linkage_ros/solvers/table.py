# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A table over the range of a single input, interpolated, instead of the closed form.

Between two knots at a distance h, a published joint f is approximated by a polynomial in t =
(x − x_k)/h from 0 to 1: with ``linear`` the chord, with ``hermite`` the cubic that has the closed
form's values f and derivatives f' at both ends (G. Birkhoff and A. Priver, J. Math. and Phys. 46,
1967)::

    chord    |f − p| ≤ h²/8·max|f''|         |f' − p'| ≤ h/2·max|f''|
    cubic    |f − p| ≤ h⁴/384·max|f''''|     |f' − p'| ≤ √3·h³/216·max|f''''|
                                             |f'' − p''| ≤ h²/12·max|f''''|

Rates and accelerations are derivatives of the polynomial; the tolerance bounds positions.
`table_proof` bounds the derivatives over the whole range; so if a tolerance is given instead of
knots, it is met everywhere, or the table is refused. Beyond the range of the table, and at its
ends, the closed form gives the states.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import fmod, inf, tau
from struct import Struct
from time import perf_counter
from typing import Any, cast, Literal, NamedTuple, TYPE_CHECKING

from linkage_ros.description import number, point
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import (
    Acceleration,
    Closure,
    InputSweep,
    link_lengths,
    Linkage,
    LinkState,
    Position,
    Status,
    to_double,
    Velocity,
)
from linkage_ros.solvers.solver import refuse_ratios, Solver
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

Order = Literal['linear', 'hermite']
ORDERS: dict[Order, int] = {'linear': 1, 'hermite': 3}
"""Degree of the polynomials by order."""

_CLOSED = Status.CLOSED
_TURN_ROUNDED = 2.4492935982947064e-16
"""2π minus the double `tau`."""

_FARTHEST = 2.0**40
"""In [rad]: larger angles have lost the digits that matter here."""


@dataclass(frozen=True, slots=True)
class TableParameters:
    """A table of one input's range, interpolated by cubics."""

    tolerance: float = number(
        'proven bound of the error of positions', unit='rad and m', least=1e-12, most=1e-2
    )
    span: tuple[float, float] | tuple[()] = point(
        'range of the input; [] for its whole range. Beyond it the closed form is used',
        (),
        unit='rad or m',
        most=1e6,
    )


PARAMETERS = TableParameters


def build(parameters: TableParameters, linkage: Linkage) -> TableClosure:
    """Build the closure."""
    return TableClosure(linkage, parameters.tolerance, span=parameters.span or None)


class _TablePlace(NamedTuple):
    """A position in the table: coefficients of its cell, fraction of the cell, cells by x."""

    coefficients: tuple[float, ...]
    part: float
    density: float


class _TablePart(NamedTuple):
    """An interval of the table: the index of its first cell, and cells by the unit of input."""

    low: float
    high: float
    first: int
    density: float


class TableClosure(Solver):
    """
    A linkage of one input whose joints are interpolated in a table.

    The number of knots follows from the tolerance, a bound of the error of positions in [rad] or
    [m], unless ``knots`` gives the number of cells in each range. ``span`` is the range that the
    table covers, in [rad] or [m]; by default all that the input can reach. Several inputs, and a
    tolerance that cannot be proven, raise DefinitionError.
    """

    by_steps = False

    def __init__(
        self,
        linkage: Linkage,
        tolerance: float | None = None,
        *,
        knots: int | None = None,
        order: Order = 'hermite',
        span: tuple[float, float] | None = None,
    ) -> None:
        begun = perf_counter()
        refuse_ratios(linkage, 'table')
        super().__init__(Closure(linkage))
        self._request = (linkage, tolerance, knots, order, span)
        if len(linkage.inputs) > 1:
            raise DefinitionError(
                'solver.table',
                f'needs a linkage with one input, and this one has {len(linkage.inputs)}',
                'write solver: closed_form',
            )
        self._period, intervals = self._covered_ranges(span)
        # Bounds of the error of positions, in [rad] or [m], and of their derivatives by the input.
        self.proven = self.proven_rate = inf
        if knots is None:
            from linkage_ros.solvers.loops import LoopFinder  # local import: to prove only
            from linkage_ros.solvers.table_proof import (  # local import: likewise
                knots_for,
                TableRequest,
            )

            assert tolerance is not None
            finder = LoopFinder(linkage, self.structure, self._known)
            joints = [
                (finder.expand_difference(i, j), factor, constant)
                for i, j, factor, constant in self._terms
            ]
            request = TableRequest(self.closed, finder.find_loops(), joints, tolerance, order)
            knots, self.proven, self.proven_rate = knots_for(request, intervals)
        self.knots = knots
        self._degree = ORDERS[order]
        self._parts = [
            _TablePart(low, high, index * knots, knots / (high - low))
            for index, (low, high) in enumerate(intervals)
        ]
        self._first = self._parts[0]
        self._coefficients = np.concatenate(
            [self._build_table(part.low, part.high) for part in self._parts]
        )
        self._data = self._coefficients.tobytes()
        _, joints, width = self._coefficients.shape
        self._stride = 8 * width * joints
        self._cell = Struct(f'{width * joints}d').unpack_from
        self._joint_places = tuple(range(0, width * joints, width))
        self._no_pins: list[complex] = []
        self.memory = len(self._data)
        self.build_time = perf_counter() - begun

    def __reduce__(self) -> tuple[Any, ...]:
        linkage, tolerance, knots, order, span = self._request
        build = partial(type(self), linkage, tolerance, knots=knots, order=order, span=span)
        return build, (), super().__reduce__()[2]

    def position(self, *inputs: float) -> Position:
        (x,) = inputs
        if type(x) is not float:
            x = to_double('inputs', x, '; solve() takes arrays')
        low, high, first, density = self._first
        if not low <= x < high:
            part, at = self._find_part(x)
            if part is None:
                return self.closed.position(x)
            low, high, first, density = part
        else:
            at = x
        t = (at - low) * density
        k = min(int(t), self.knots - 1)
        t -= k
        c = self._cell(self._data, (first + k) * self._stride)
        joints: tuple[float, ...] = ()
        if self._degree == 3:
            for i in self._joint_places:
                joints += (c[i] + t * (c[i + 1] + t * (c[i + 2] + t * c[i + 3])),)
        else:
            for i in self._joint_places:
                joints += (c[i] + t * c[i + 1],)
        given = x if self._factors is None else x * self._factors[0]
        state = LinkState([0.0, given], self._no_pins)
        return Position(_CLOSED, 0.0, joints, state, cast('Any', _TablePlace(c, t, density)), self)

    def residual(self, position: Position) -> float:
        """
        Return the closure error of a closed position, in [m].

        A table has joints but no links. The error is therefore the distance of its joints from
        the joints of the closed form (an angle at the length of the longest link), plus the error
        of the closed form.
        """
        exact = self.exact_position(position)
        joints = zip(position.joints, exact.joints, self.turning, strict=True)
        arm = max(link_lengths(self.linkage.links))
        off = max(abs(ours - true) * (arm if turns else 1.0) for ours, true, turns in joints)
        return off + self.closed.residual(exact)

    def velocity(self, position: Position, *rates: float) -> Velocity:
        if not isinstance(cast('Any', position.poses), _TablePlace):
            return self.closed.velocity(position, *rates)
        c, t, density = cast('_TablePlace', position.poses)
        (rate,) = rates
        if type(rate) is not float:
            rate = to_double('rates', rate, '; solve() takes arrays')
        factor = rate * density
        joints: tuple[float, ...] = ()
        if self._degree == 3:
            for i in self._joint_places:
                joints += (factor * (c[i + 1] + t * (2.0 * c[i + 2] + t * (3.0 * c[i + 3]))),)
        else:
            for i in self._joint_places:
                joints += (factor * c[i + 1],)
        given = rate if self._factors is None else rate * self._factors[0]
        return Velocity(joints, LinkState([0.0, given], self._no_pins), [factor], self)

    def acceleration(
        self, position: Position, velocity: Velocity, *accelerations: float
    ) -> Acceleration:
        if not isinstance(cast('Any', position.poses), _TablePlace):
            return self.closed.acceleration(position, velocity, *accelerations)
        c, t, density = cast('_TablePlace', position.poses)
        (factor,), (change,) = velocity.rates, accelerations
        if type(change) is not float:
            change = to_double('accelerations', change, '; solve() takes arrays')
        square, pull = factor * factor, change * density
        joints: tuple[float, ...] = ()
        if self._degree == 3:
            for i in self._joint_places:
                slope = c[i + 1] + t * (2.0 * c[i + 2] + t * (3.0 * c[i + 3]))
                joints += (square * (2.0 * c[i + 2] + t * (6.0 * c[i + 3])) + pull * slope,)
        else:
            for i in self._joint_places:
                joints += (pull * c[i + 1],)
        given = change if self._factors is None else change * self._factors[0]
        return Acceleration(joints, LinkState([0.0, given], self._no_pins), self)

    def _find_part(self, x: float) -> tuple[_TablePart | None, float]:
        """Return the part of the table that holds an input, or None, and the input within it."""
        if self._period and abs(x) < _FARTHEST:
            # The exact turn is longer than the double, which this corrects.
            at = fmod(x, self._period)
            at -= (x - at) / tau * _TURN_ROUNDED
            at += self._period if at < 0.0 else 0.0
            return self._first, min(at, self._period)
        for part in self._parts:
            if part.low <= x < part.high:
                return part, x
        return None, x

    def _covered_ranges(
        self, span: tuple[float, float] | None
    ) -> tuple[float, list[tuple[float, float]]]:
        """Return the period, or 0, and the ranges of the input."""
        if span is not None:
            low, high = span
            if not low < high:
                raise DefinitionError(
                    'solver.table.span',
                    f'{low:g} to {high:g} {self.closed.linkage.inputs[0].unit} is empty',
                    'write [low, high]',
                )
            return 0.0, [(low, high)]
        ranges = InputSweep(self.closed).ranges
        whole = [one for one in ranges if one.is_whole]
        period = whole[0].highest - whole[0].lowest if whole else 0.0
        return period, [(one.lowest, one.highest) for one in ranges]

    def _build_table(self, low: float, high: float) -> NDArray[np.float64]:
        """Return the polynomials, of shape (cells, joints, degree + 1)."""
        x = np.linspace(low, high, self.knots + 1)
        solved = self.closed.solve(x, rates=1.0, derivatives=1)
        assert solved.velocities is not None
        h = (high - low) / self.knots
        f, slopes = solved.positions, h * solved.velocities
        step = np.diff(f, axis=1)
        turning = np.array(self.turning)[:, None]
        # The closed form gives angles modulo a turn.
        expected = np.nan_to_num(0.5 * (slopes[:, 1:] + slopes[:, :-1]))
        step -= np.where(turning, tau * np.round((step - expected) / tau), 0.0)
        table = np.empty((self.knots, len(f), self._degree + 1))
        table[:, :, 0] = f[:, :-1].T
        if self._degree == 1:
            table[:, :, 1] = step.T
            return table
        # A toggle at an end has no slope; use the slope of the chord.
        begin = np.where(np.isfinite(slopes[:, :-1]), slopes[:, :-1], step)
        end = np.where(np.isfinite(slopes[:, 1:]), slopes[:, 1:], step)
        table[:, :, 1] = begin.T
        table[:, :, 2] = (3.0 * step - 2.0 * begin - end).T
        table[:, :, 3] = (begin + end - 2.0 * step).T
        return table
