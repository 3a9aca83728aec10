# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Solutions of links that close only together, as a function of their inputs, without history.

A grid lies over the inputs. A cell has the solution at its centre, and the form of second order
about it. It is made when it is first met, from its neighbour on the way to the pose, and that one
likewise: there is one way to each cell, so the order of visits cannot matter. Ways that begin in
all directions join soon, so few cells are made; none leaves the straight line by more than an
eighth of its length. A cell is accepted if the theorem of Kantorovich proves, at each quarter of
the way and at the corners of the cell, that the prediction leads to one solution::

    η·ω ≤ 1/4    η = |J⁻¹F|, the first step of Newton's method    ω a bound of |J⁻¹·J'|

(≤ 1/2 is needed.) Otherwise the way and the cell are halved, four times at most. What no cell
covers lies next to a singularity, or beyond it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import chain, islice, product
from math import copysign, inf, isfinite, isinf, ldexp, pi, sqrt, tau
from operator import contains
from typing import Any, NamedTuple, Protocol, TYPE_CHECKING

from linkage_ros.generated_code import define_function
from linkage_ros.kinematics.arithmetic import call, has_result
from linkage_ros.kinematics.built_once import BUILD_LOCK, BuiltProperty
from linkage_ros.kinematics.compiling import compile_line
from linkage_ros.kinematics.plane.linkage import Input
from linkage_ros.progress import tell_progress

if TYPE_CHECKING:
    from linkage_ros.kinematics.batch import Array, Mask

_WIDTH = 0.125
"""Width of the widest cells, in [rad] or lengths."""

_LEVELS = 5
"""Number of widths; each is half the one before."""

_KEPT = 2**20
"""Most numbers of cells that are kept: any other is made again, to the same bits."""

_AT_ONCE = 2
"""Most inputs whose cells within limits are made before the first state."""

_TRIED = 2
"""So many times the most cells are tried, to make all: next to a singularity few are proven."""

_WAYS = 2**15
"""Most cells of which it is kept what leads on from them."""

_FARTHEST = 128
"""Widest cells from the pose to the farthest state: some 16 rad, or lengths."""

_ALL = 2.0**62
"""More cells than are followed."""

_PROVEN = 0.25
"""Largest η·ω that is accepted."""

_MOST_CORNERED = 3
"""Of more inputs only the ends of the axes and two diagonals are tested: 64 corners take long."""

_DIGITS = 28
"""Binary digits after the point of the numbers of a cell: a start needs no more."""

_BEYOND = 0.5 + 2.0**-20
"""In widths of a cell: how far from its centre the next one is looked for."""

_RETURNED = 1e-9
"""Farthest from the pose, apart from whole turns, that links are back."""

_SHORTEST = 2.0**-50
"""Shortest step beyond the cells, as a part of the way."""

_HOPELESS = 2.0**-12
"""The same, as a part of what is left: a way that needs shorter ones ends before the inputs."""

Key = tuple[int, ...]
"""A cell: the number of its width, and its place along each input, in widths from the pose."""


class GridInput(NamedTuple):
    """An input: its value in the pose, its limits, and whether it is an angle."""

    home: float
    low: float
    high: float
    is_angle: bool

    @property
    def turns(self) -> bool:
        """Return whether it turns without limits."""
        return self.is_angle and isinf(self.low) and isinf(self.high)


def grid_inputs(
    inputs: Sequence[Input], pose: Sequence[float], scale: float
) -> tuple[GridInput, ...]:
    """Return the inputs of a linkage as coordinates; lengths are in units of ``scale`` metres."""
    coordinates = []
    for driven, home in zip(inputs, pose, strict=True):
        unit, limits = scale if driven.slider else 1.0, driven.limits
        coordinates.append(
            GridInput(home, limits.low / unit, limits.high / unit, not driven.slider)
        )
    return tuple(coordinates)


LineForms = tuple[Sequence[float], Sequence[float]]
"""Slopes and bends of the unknowns on a straight line."""


class GridPlace(NamedTuple):
    """A solution at certain inputs."""

    inputs: Sequence[float]
    unknowns: Sequence[float]


class GridCell(NamedTuple):
    """A solution at certain inputs, and the quadratic form of the unknowns about it."""

    inputs: tuple[float, ...]
    unknowns: tuple[float, ...]
    slopes: tuple[tuple[float, ...], ...]  # For each input

    # For each input, and each from it on, the factors of the product of both.
    bends: tuple[tuple[float, ...], ...]

    @property
    def numbers(self) -> tuple[float, ...]:
        """Return all numbers, one after the other."""
        return (*self.inputs, *self.unknowns, *chain(*self.slopes, *self.bends))


class _Found(NamedTuple):
    """A cell, or None if it is not proven; and the last proven one on the way to it."""

    cell: GridCell | None
    last: GridCell
    numbers: tuple[float, ...] | None  # Of the cell, if it is proven


class GridFunctions(Protocol):
    """The equations of a group of links, at its inputs."""

    def shortfall(self, inputs: Sequence[float]) -> float:
        """Return by how much links are too short to close by any unknowns; 0 if none is known."""

    def proof(self, inputs: Sequence[float], unknowns: Sequence[float]) -> float:
        """Return η·ω of Kantorovich's theorem; infinite where there is none."""

    def solve_from(
        self, inputs: Sequence[float], unknowns: Sequence[float]
    ) -> Sequence[float] | None:
        """Return the solution that Newton's method leads to."""

    def forms_at(
        self, inputs: Sequence[float], unknowns: Sequence[float]
    ) -> tuple[list[Sequence[float]], list[Sequence[float]]] | None:
        """Return slopes and bends at a solution, as a cell has them."""

    def forms_along(
        self, inputs: Sequence[float], unknowns: Sequence[float], direction: Sequence[float]
    ) -> LineForms | None:
        """Return slopes and bends at a solution while the inputs go in a direction."""


class Grid:
    """
    The cells of a group of links about a pose, whose unknowns are given.

    ``numbers`` are those of its inputs among all that the linkage has; cells are halved so often.
    """

    def __init__(
        self,
        group: GridFunctions,
        inputs: Sequence[GridInput],
        numbers: Sequence[int],
        unknowns: Sequence[float],
        halvings: int = 0,
    ) -> None:
        self._group, self._inputs, self.numbers = group, inputs, numbers
        count = len(inputs)
        level = (0.0,) * len(unknowns)
        bends = (level,) * (count * (count + 1) // 2)
        self.home = tuple(driven.home for driven in inputs)
        """The inputs of the pose, at the centre of the first cell."""
        self._given = GridCell(self.home, tuple(unknowns), (level,) * count, bends)
        self._kept: dict[Key, _Found] = {}
        self._ways: dict[Key, _Found] = {}
        self.most_cells = _KEPT // len(self._given.numbers)
        """Most cells that are kept."""
        self.widths = [ldexp(_WIDTH, -halvings - level) for level in range(_LEVELS)]
        self._look_up = self._write_look_up()
        self._corners: list[tuple[float, ...]] = list(product((-0.5, 0.5), repeat=count))
        if count > _MOST_CORNERED:
            axes = [
                tuple(sign * (k == axis) for k in range(count))
                for axis in range(count)
                for sign in (-0.5, 0.5)
            ]
            self._corners = [*axes, self._corners[0], self._corners[-1]]

    def __call__(self, *inputs: float) -> tuple[float, ...] | None:
        """
        Return inputs, unknowns and slopes of the widest proven cell at inputs; None if none is.

        This is what `find_start` calls in compiled code.
        """
        try:
            return self._look_up(*inputs)
        except OverflowError:
            return None  # So far away that no number says how many cells it is.

    def rows_at(self, *inputs: Array) -> tuple[Array, Mask]:
        """Return what a call returns at each of many inputs, one a column; and where there is."""
        import numpy as np  # local import: a tick does without it

        values, home = np.stack(np.broadcast_arrays(*inputs)), np.array(self.home)[:, None]
        count = len(self._given.numbers)
        rows, has_result = np.zeros((count, values.shape[1])), np.zeros(values.shape[1], bool)
        left = np.arange(values.shape[1])
        for level, width in enumerate(self.widths):
            if not left.size:
                break
            ways = np.clip((values[:, left] - home) / width, -_ALL, _ALL)
            places, of_states = np.unique(np.rint(ways), axis=1, return_inverse=True)
            with BUILD_LOCK:
                cells = [
                    self._follow((level, *map(int, place))).numbers for place in places.T.tolist()
                ]
            of_states = of_states.reshape(-1)
            proven = np.array([cell is not None for cell in cells])[of_states]
            table = np.array([cell or (0.0,) * count for cell in cells]).T
            rows[:, left[proven]] = table[:, of_states[proven]]
            has_result[left[proven]] = True
            left = left[~proven]
        return rows, has_result

    def _write_look_up(self) -> Callable[..., tuple[float, ...] | None]:
        """Return a call as a function, written for these inputs: most lie in a widest cell."""
        names = [f'q{k}' for k in range(len(self.home))]
        places = [
            f'round(({name} - {home!r}) / {self.widths[0]!r})'
            for name, home in zip(names, self.home, strict=True)
        ]
        parameters = ', '.join(names)
        lines = (
            f'def look_up({parameters}):',
            f'    found = get((0, {", ".join(places)}))',
            '    if found is None or found.numbers is None:',
            f'        return search({parameters})',
            '    return found.numbers',
        )
        bound = {'get': self._kept.get, 'search': self._search}
        look_up: Callable[..., Any] = define_function('\n'.join(lines), 'look_up', bound)
        return look_up

    def _search(self, *inputs: float) -> tuple[float, ...] | None:
        may_close = False
        for level in range(_LEVELS):
            key = self._key_of(level, inputs)
            cell = self._kept.get(key)
            if cell is None:
                may_close = may_close or not self._group.shortfall(inputs)
                if not may_close:
                    return None
                with BUILD_LOCK:
                    cell = self._follow(key)
            if cell.numbers is not None:
                return cell.numbers
        return None

    def look_ahead(self, inputs: Sequence[float], rates: Sequence[float]) -> None:
        """Make the cell that inputs at these rates enter next, from one that is made."""
        turned, _ = self.turn_back(inputs)
        keys = (self._key_of(level, turned) for level in range(_LEVELS))
        for key in keys:
            cell = self._kept.get(key)
            if cell is not None and cell.numbers is not None:
                break
        else:
            return
        soonest, beyond = inf, _BEYOND * self.widths[key[0]]
        for x, rate, centre in zip(turned, rates, self._centre(key), strict=True):
            if rate:
                edge = centre + copysign(beyond, rate)
                soonest = min(soonest, (edge - x) / rate)
        if soonest < inf:
            self(*(x + rate * soonest for x, rate in zip(turned, rates, strict=True)))

    def _key_of(self, level: int, inputs: Sequence[float]) -> Key:
        width, ways = self.widths[level], zip(inputs, self.home, strict=True)
        return (level, *[round(max(-_ALL, min((x - at) / width, _ALL))) for x, at in ways])

    def find_start(self, inputs: Sequence[Any]) -> list[Any] | None:
        """Return where Newton's method starts, with symbols too; None if no cell is there."""
        turned, gains = self.turn_back(inputs)
        numbers = call(self, *turned)
        if not has_result(numbers):
            return None
        values = _predict(numbers, turned, len(self._given.unknowns))
        return [value + gain if gain else value for value, gain in zip(values, gains, strict=True)]

    def turn_back(self, inputs: Sequence[Any]) -> tuple[list[Any], list[Any]]:
        """
        Return the inputs within half a turn of the pose, and what the unknowns gain by the turns.

        Only inputs are turned after a turn of which the links are back.
        """
        turned, gains = [*inputs], [0.0] * len(self._given.unknowns)
        for k, gained in enumerate(self._gained_in_turns):
            if gained is not None:
                turns = round((inputs[k] - self.home[k]) / tau)
                turned[k] = inputs[k] - tau * turns
                gains = [
                    gain + by * turns if by else gain
                    for gain, by in zip(gains, gained, strict=True)
                ]
        return turned, gains

    @BuiltProperty
    def _gained_in_turns(self) -> list[tuple[float, ...] | None]:
        """Return for each input what the unknowns gain in a turn; None if it does not return."""
        gains: list[tuple[float, ...] | None] = []
        for k, driven in enumerate(self._inputs):
            later = tuple(x + tau * (i == k) for i, x in enumerate(self.home))
            end, left = self.reach(later) if driven.turns else (self._start, 1.0)
            moved = [b - a for a, b in zip(self._start.unknowns, end.unknowns, strict=True)]
            gained = tuple(tau * round(change / tau) for change in moved)
            returns = all(abs(a - b) < _RETURNED for a, b in zip(moved, gained, strict=True))
            gains.append(gained if returns and not left else None)
        return gains

    @property
    def is_filled_at_once(self) -> bool:
        """Whether the cells are so few that all are made before the first state."""
        bounded = all(isfinite(driven.low) and isfinite(driven.high) for driven in self._inputs)
        return bounded and len(self._inputs) <= _AT_ONCE

    def fill(self, most: int) -> dict[Key, tuple[float, ...]] | None:
        """
        Make all cells within the limits of the inputs; return their numbers by level and place.

        None where these are more than ``most``. An input that returns needs no more than a turn.
        """
        limits, cells = [*self._limits_to_fill()], dict[Key, tuple[float, ...]]()
        tried: dict[Key, bool] = {}

        def are_too_many() -> bool:
            return len(cells) > most or len(tried) > _TRIED * most

        def make(key: Key) -> bool:
            """Make a cell, or the narrower ones in it; return whether any is proven."""
            if key in tried or are_too_many():
                return tried.get(key, False)
            with BUILD_LOCK:
                numbers = self._follow(key).numbers
            tried[key] = numbers is not None
            if numbers is not None:
                cells[key] = numbers
            elif key[0] + 1 < _LEVELS:
                halves = list(map(make, self._halve(key, limits)))
                tried[key] = any(halves)
            return tried[key]

        ranges, waiting = self._keys_between(0, limits), {(0,) * len(self.home)}
        while waiting:
            places = waiting.pop()
            if make((0, *places)):
                # Ways go from cell to cell, also across a corner.
                around = product(*(range(k - 1, k + 2) for k in places))
                inside = (to for to in around if all(map(contains, ranges, to)))
                waiting |= {to for to in inside if (0, *to) not in tried}
        return None if are_too_many() else cells

    def _halve(self, key: Key, limits: Sequence[tuple[float, float]]) -> Iterator[Key]:
        """Yield the cells of half the width that lie in a cell and within limits."""
        level, half = key[0] + 1, 0.5 * self.widths[key[0]]
        within = [
            (max(low, x - half), min(high, x + half))
            for x, (low, high) in zip(self._centre(key), limits, strict=True)
        ]
        yield from product((level,), *self._keys_between(level, within))

    def _limits_to_fill(self) -> Iterator[tuple[float, float]]:
        """Yield the limits of each input; half a turn about the pose if the links are back."""
        farthest = _FARTHEST * self.widths[0]
        for driven, gained in zip(self._inputs, self._gained_in_turns, strict=True):
            reach = farthest if gained is None else pi
            yield max(driven.low, driven.home - reach), min(driven.high, driven.home + reach)

    def _keys_between(self, level: int, limits: Sequence[tuple[float, float]]) -> list[range]:
        """Return for each input the places of the cells between two values."""
        width = self.widths[level]
        return [
            range(*(round((end - at) / width) + k for k, end in enumerate(ends)))
            for at, ends in zip(self.home, limits, strict=True)
        ]

    def _centre(self, key: Key) -> list[float]:
        level, *places = key
        width = self.widths[level]
        return [at + k * width for at, k in zip(self.home, places, strict=True)]

    def predict(self, cell: GridCell, inputs: Sequence[float]) -> Sequence[float]:
        """Return the unknowns at inputs near a cell."""
        (unknowns,) = self._prediction(*inputs, *cell.numbers)
        return tuple(unknowns)

    @BuiltProperty
    def _prediction(self) -> Callable[..., Any]:
        count, unknowns = len(self.home), len(self._given.unknowns)

        def compute(*numbers: Any) -> list[Any]:
            return _predict(numbers[count:], numbers[:count], unknowns)

        return compile_line(compute, [*self.home, *self._given.numbers])

    @BuiltProperty
    def _start(self) -> GridCell:
        """Return the solution in the pose, with its forms."""
        return self._step_to(self._given, self.home) or self._given

    def home_corners(self) -> Iterator[tuple[Sequence[float], Sequence[float]]]:
        """Yield the corners of the cell about the pose, with the unknowns predicted there."""
        home = (0,) * len(self.home)
        for level, width in enumerate(self.widths):
            with BUILD_LOCK:
                cell = self._follow((level, *home)).cell
            if cell is not None:
                for corner in self._corners:
                    at = [c + part * width for c, part in zip(cell.inputs, corner, strict=True)]
                    yield at, self.predict(cell, at)
                return

    def reach(self, inputs: Sequence[float]) -> tuple[GridPlace, float]:
        """
        Follow the straight line from the last cell to inputs, in proven steps.

        Return the solution where it ends, and how far from the inputs that is: 0 if it leads to
        them.
        """
        key, along = self._key_of(_LEVELS - 1, inputs), self._group.forms_along
        with BUILD_LOCK:
            last = self._follow(key).last
            way = [b - a for a, b in zip(last.inputs, inputs, strict=True)]
            # Its proofs are at quarters only, so no step is longer than those to the widest cells.
            longest = self.widths[0] / max(self.widths[0], *map(abs, way))
            place, done, step = GridPlace(last.inputs, last.unknowns), 0.0, longest
            forms = along(*place, way)
            while forms and done < 1.0 and step > max(_SHORTEST, _HOPELESS * (1.0 - done)):
                part = min(1.0, done + step)
                end = _part_of_way(last.inputs, inputs, part)
                predict = partial(_predict_along, place.unknowns, forms, part - done)
                solution = self._prove_step(place.inputs, end, predict)
                if solution is None:
                    step *= 0.5
                else:
                    place, done, step = GridPlace(end, solution), part, min(longest, 2.0 * step)
                    forms = along(*place, way)
        return place, max(abs(a - b) for a, b in zip(place.inputs, inputs, strict=True))

    def _follow(self, key: Key) -> _Found:
        """Return a cell, made from its neighbour on the straight line to the pose."""
        kept = self._kept.get(key)
        if kept is not None:
            return kept
        kept = self._ways.get(key)
        if kept is not None and kept.cell is None:
            return kept
        level, *places = key
        count = max(map(abs, places), default=0)
        kept = _Found(self._start, self._start, None)
        if count > _FARTHEST << level:
            return kept._replace(cell=None)
        way: list[Key] = []
        for left in range(count, 0, -1):
            places = [round(k * (left - 1) / left) for k in places]
            before = (level, *places)
            passed = self._ways.get(before)
            if passed is not None:
                kept = passed
                break
            way.append(before)
        for before in reversed(way):
            if kept.cell is None:
                break
            kept = self._pass_cell(before, kept.cell)
        if kept.cell is None:
            return self._remember_way(key, kept)
        return self._keep_cell(key, kept.cell)

    def _pass_cell(self, key: Key, before: GridCell) -> _Found:
        """
        Return what leads on from a cell: a wider proven one, or else the cell itself.

        Wider cells lead to where they are no longer proven. That the narrow one may be kept, since
        a state was in it, or kept as not proven, changes nothing.
        """
        wider = self._wider_cell(key)
        kept = self._kept.get(key)
        if wider is not None:
            kept = _Found(wider, wider, None)
        elif kept is None:
            kept = self._keep_cell(key, before)
        return self._remember_way(key, kept)

    def _remember_way(self, key: Key, way: _Found) -> _Found:
        if len(self._ways) >= _WAYS:
            self._ways.clear()
        self._ways[key] = way
        return way

    def _wider_cell(self, key: Key) -> GridCell | None:
        """Return the widest proven cell, of wider ones, at the centre of a cell."""
        level, *places = key
        for wider in range(level):
            width = 1 << level - wider
            cell = self._follow((wider, *[round(k / width) for k in places])).cell
            if cell is not None:
                return cell
        return None

    def _keep_cell(self, key: Key, before: GridCell) -> _Found:
        """Return a cell that a neighbour leads to, and keep it."""
        cell = self._make_cell(key, before)
        kept = _Found(cell, cell or before, cell.numbers if cell else None)
        tell_progress('cells of links that close only together made', len(self._kept))
        if len(self._kept) >= self.most_cells:
            del self._kept[next(iter(self._kept))]
        self._kept[key] = kept
        return kept

    def _make_cell(self, key: Key, known: GridCell) -> GridCell | None:
        """Return a cell, if it is proven from a known one."""
        width, centre = self.widths[key[0]], self._centre(key)
        solution = self._step_to(known, centre)
        if solution is None:
            return None
        # The last digits of functions differ from machine to machine.
        forms = (tuple(map(_round_binary, form)) for form in (solution.slopes, solution.bends))
        cell = GridCell(solution.inputs, _round_binary(solution.unknowns), *forms)
        for corner in self._corners:
            at = [c + part * width for c, part in zip(centre, corner, strict=True)]
            if not self._group.proof(at, self.predict(cell, at)) <= _PROVEN:
                return None
        return cell

    def _step_to(self, known: GridCell, inputs: Sequence[float]) -> GridCell | None:
        """Return the solution that a known one is proven to lead to, with its forms."""

        def predict(part: float) -> Sequence[float]:
            return self.predict(known, _part_of_way(known.inputs, inputs, part))

        unknowns = self._prove_step(known.inputs, inputs, predict)
        forms = None if unknowns is None else self._group.forms_at(inputs, unknowns)
        if unknowns is None or forms is None:
            return None
        slopes, bends = (tuple(map(tuple, form)) for form in forms)
        return GridCell(tuple(inputs), tuple(unknowns), slopes, bends)

    def _prove_step(
        self,
        begin: Sequence[float],
        end: Sequence[float],
        predict: Callable[[float], Sequence[float]],
    ) -> Sequence[float] | None:
        """
        Return the solution to which the unknowns predicted on a way are proven to lead.

        ``predict`` gives them at a part of the way.
        """
        for part in (1.0, 0.5, 0.25, 0.75):  # Where it fails first
            at = _part_of_way(begin, end, part)
            if not self._group.proof(at, predict(part)) <= _PROVEN:
                return None
        return self._group.solve_from(end, predict(1.0))


def _predict_along(
    unknowns: Sequence[float], forms: LineForms, length: float, part: float
) -> Sequence[float]:
    """
    Return the unknowns at a part of a length on a straight line.

    Next to a toggle they go as the root of the way that is left to it, which slope and bend tell:
    along a root longer steps are proven than along a parabola.
    """
    (slopes, bends), off = forms, part * length
    bending = 4.0 * sum(slope * bend for slope, bend in zip(slopes, bends, strict=True))
    left = sum(slope * slope for slope in slopes) / bending if bending > 0.0 else inf
    if not left > off:
        left = inf
    along = 2.0 * off / (1.0 + sqrt(1.0 - off / left))
    return [
        value + along * slope + off * off * (bend - 0.25 * slope / left)
        for value, slope, bend in zip(unknowns, slopes, bends, strict=True)
    ]


def _predict(numbers: Any, inputs: Sequence[Any], count: int) -> list[Any]:
    """Return the unknowns by the numbers of a cell; both may be symbols."""
    n, number = len(inputs), len(inputs) * (1 + count) + count
    offs = [value - numbers[i] for i, value in enumerate(inputs)]
    unknowns = [numbers[n + k] for k in range(count)]
    for i, off in enumerate(offs):
        slopes = [numbers[n + count * (1 + i) + k] for k in range(count)]
        for off_by in islice(offs, i, None):
            slopes = [slope + off_by * numbers[number + k] for k, slope in enumerate(slopes)]
            number += count
        unknowns = [unknown + off * slope for unknown, slope in zip(unknowns, slopes, strict=True)]
    return unknowns


def _part_of_way(first: Sequence[float], second: Sequence[float], part: float) -> Sequence[float]:
    """Return inputs at a part of the way; the other end itself at 1."""
    if part == 1.0:
        return second
    return [a + part * (b - a) for a, b in zip(first, second, strict=True)]


def _round_binary(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(ldexp(float(round(ldexp(value, _DIGITS))), -_DIGITS) for value in values)
