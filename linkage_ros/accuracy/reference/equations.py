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


"""All constraints of a linkage in extended precision, as `reference` has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from linkage_ros.kinematics.linkage import GROUND, Linkage, RevoluteJoint
from mpmath import MPContext

Row = dict[int, Any]
"""A line of equations: factors by the number of their unknown."""


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
        For each link that moves the number of its first unknown: its angle, then its place.
    sliders
        For each slider that of its slide.
    digits
        The precision.

    Attributes
    ----------
    mp
        What the numbers are made with.
    unit
        The size of the linkage.

    """

    def __init__(
        self,
        linkage: Linkage,
        links: Mapping[str, int],
        sliders: Mapping[str, int],
        digits: int,
    ) -> None:
        self.mp = MPContext()
        self.mp.dps = digits
        self._linkage, self._links, self._sliders = linkage, links, sliders
        self._points = {
            (link, name): self.mp.mpc(*place)
            for link, points in linkage.links.items()
            for name, place in points.items()
        }
        self.unit = max(abs(one) for one in self._points.values())
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
        """Return the published joints of the unknowns; or their derivatives of theirs."""

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
        Return what the equations are off by, derived as often as the motion has derivatives.

        Parameters
        ----------
        motion
            The unknowns, and their rates, and their accelerations.
        given
            Likewise of the inputs.

        """
        order = len(motion) - 1
        found: list[Any] = []
        for name, one, other in self._pins:
            between = self._place(motion, one, self._points[one, name])
            between -= self._place(motion, other, self._points[other, name])
            found += [between.real, between.imag]
        for name, slider in self._linkage.sliders.items():
            carrier = slider.block or self._carriers[slider.point]
            between = self._on_line(motion, name)
            between -= self._place(motion, carrier, self._points[carrier, slider.point])
            found += [between.real, between.imag]
            if slider.block:
                apart = self._turn(motion, slider.block) - self._turn(motion, slider.along)
                found.append(apart if order else self._wrapped(apart - slider.angle))
        for k, joint in enumerate(self._linkage.inputs):
            if joint.slider:
                found.append(motion[-1][self._sliders[joint.slider]] - given[order][k])
                continue
            apart = self._turn(motion, joint.child) - self._turn(motion, joint.parent)
            apart -= given[order][k]
            found.append(apart if order else self._wrapped(apart))
        return found

    def rows(self, values: list[Any]) -> list[Row]:
        """Return the derivatives of the equations by the unknowns."""
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
        """Return the derivatives of a point's place by the unknowns of its link."""
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
        """Return where a point of a link is; of a motion, the highest derivative of that."""
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
        """Return where a slider has its point, on its line; or the derivative of that."""
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
    """Return what solves linear equations, and the smallest pivot; most factors are not there."""
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
