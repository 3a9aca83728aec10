# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage solved by Newton's method from the file's terms alone: the dyads are not used.

Unknown are the angle of every link and the place of its frame, and the slide of every slider;
pins that share a name coincide, the points of sliders lie on their lines, blocks keep their
angle. Which of its assemblies a linkage is in is given by where the iteration starts.
"""

from __future__ import annotations

from typing import Any

from campaigns.accuracy.mechanism import CRANK, GROUND, Mechanism, Turn
from mpmath import mp, mpc, mpf

DIGITS = 150


class Newton:
    """A mechanism's equations."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._links = [name for name in mechanism.links if name != GROUND]
        self._sliders = list(mechanism.sliders)

    def solve(self, phi: Any, start: dict[str, tuple[Any, ...]]) -> dict[str, tuple[Any, ...]]:
        """
        Return angle and place of every link, and every slide, near a start.

        Parameters
        ----------
        phi
            Input angle, in [rad].
        start
            For a link its angle and the coordinates of its frame, for a slider its slide.

        """
        unknown = [x for name in (*self._links, *self._sliders) for x in start[name]]
        for _ in range(12):
            rest, rows = self._equations(phi, unknown)
            step = mp.lu_solve(mp.matrix(rows), mp.matrix(rest))
            unknown = [x - s for x, s in zip(unknown, step, strict=True)]
            if mp.norm(step) < mpf(10) ** (-DIGITS * 2 // 3) * mp.norm(mp.matrix(unknown)):
                return self._named(unknown)
        raise ArithmeticError('Newton did not converge')

    def joints(self, solution: dict[str, tuple[Any, ...]]) -> list[Any]:
        """Return the published joints."""
        return [
            solution[joint.child][0] - solution.get(joint.parent, (mpf(0),))[0]
            if isinstance(joint, Turn)
            else solution[joint][0]
            for joint in self._mechanism.joints.values()
        ]

    def _named(self, unknown: list[Any]) -> dict[str, tuple[Any, ...]]:
        places = [*zip(unknown[0::3], unknown[1::3], unknown[2::3], strict=False)]
        links = dict(zip(self._links, places, strict=False))
        end = 3 * len(self._links)
        rest = unknown[end:]
        return {**links, **{name: (rest[i],) for i, name in enumerate(self._sliders)}}

    def _equations(self, phi: Any, unknown: list[Any]) -> tuple[list[Any], list[list[Any]]]:
        """Return the residuals of the equations, and their derivatives."""
        at = self._named(unknown)
        columns = {name: 3 * i for i, name in enumerate(self._links)}
        slides = {n: 3 * len(self._links) + i for i, n in enumerate(self._sliders)}
        rest: list[Any] = []
        rows: list[list[Any]] = []

        def place(link: str, z: Any) -> tuple[Any, dict[int, Any]]:
            """Return where a point of a link is, and the derivatives of that."""
            if link == GROUND:
                return mpc(z), {}
            angle, x, y = at[link]
            arm = mp.expj(angle) * z
            column = columns[link]
            return mpc(x, y) + arm, {column: 1j * arm, column + 1: mpc(1), column + 2: mpc(0, 1)}

        def add(value: Any, slopes: dict[int, Any], both: bool = True) -> None:
            for part in ('real', 'imag') if both else ('real',):
                rest.append(getattr(mpc(value), part))
                row = [mpf(0)] * len(unknown)
                for column, slope in slopes.items():
                    row[column] += getattr(mpc(slope), part)
                rows.append(row)

        add(at[CRANK][0] - phi, {columns[CRANK]: 1}, both=False)
        first: dict[str, str] = {}
        for link, points in self._mechanism.links.items():
            for point, z in points.items():
                if point not in first:
                    first[point] = link
                    continue
                one, slopes = place(link, mpc(*z))
                other, negative = place(first[point], self._point(first[point], point))
                add(one - other, _difference(slopes, negative))
        for name, slide in self._mechanism.sliders.items():
            direction = mpc(*slide.direction)
            direction /= abs(direction)
            z = self._point(slide.along, slide.through) + at[name][0] * direction
            on_line, slopes = place(slide.along, z)
            turned = at[slide.along][0] if slide.along != GROUND else mpf(0)
            slopes = {**slopes, slides[name]: mp.expj(turned) * direction}
            carrier = slide.block or first[slide.point]
            where, negative = place(carrier, self._point(carrier, slide.point))
            add(on_line - where, _difference(slopes, negative))
            if slide.block is not None:
                slopes = {columns[slide.block]: 1}
                if slide.along != GROUND:
                    slopes[columns[slide.along]] = -1
                add(at[slide.block][0] - turned - mpf(slide.angle), slopes, both=False)
        return rest, rows

    def _point(self, link: str, point: str) -> Any:
        return mpc(*self._mechanism.links[link][point])


def _difference(one: dict[int, Any], other: dict[int, Any]) -> dict[int, Any]:
    return {
        column: one.get(column, mpc(0)) - other.get(column, mpc(0)) for column in {*one, *other}
    }
