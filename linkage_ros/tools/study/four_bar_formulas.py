# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A four-bar as formulas describe it, and two of these: the textbook form, and single precision.

**Textbook form:** a quadratic in the height of the pin, with K1 … K4. With A = (a·cos θ2,
a·sin θ2) the pin of the crank and (Bx, By) the pin of coupler and rocker::

    K1 = (b² − c² − a² + d²)/(2(d − Ax))      K2 = Ay/(d − Ax)           Bx = K1 + K2·By
    K3 = 2(d − K1)·K2/(K2² + 1)               K4 = ((d − K1)² − c²)/(K2² + 1)
    By = K3/2 ± √((K3/2)² − K4)

It divides by zero where A lies above or below the rocker's pivot (Ax = d, an ordinary pose), and
loses digits near it. The sign of the root is not the assembly: on the other side of that pose the
same sign belongs to the other assembly. The formula is used as it is printed, with one sign
throughout. It gives no rates.

**Single precision:** the closed form in numbers of 32 bits, inputs and constants included. It is
the stable form by the half angle, as in `linkage_ros.kinematics.plane.diagonals`. With
near = 2√(ad)·sin(φ/2) and far = 2√(ad)·cos(φ/2), s² = (d − a)² + near²::

    K² = (s² − (b − c)²)·((b + c)² − s²)
       = ((d − a)² − (b − c)² + near²)·((b + c)² − (a + d)² + far²)
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Callable, Sequence
from math import atan2, cos, sin, sqrt
from typing import Any, NamedTuple

from linkage_ros.kinematics import (
    assur_groups,
    Driven,
    four_bars,
    GROUND,
    Linkage,
    PlanarClosure,
    RevoluteJoint,
    written_sides,
)
import numpy as np

Solve = Callable[..., Sequence[Any]]
"""Takes the inputs of a state; returns the published joints, or nothing where it has no answer."""

_Single = np.float32


class PlainFourBar(NamedTuple):
    """A linkage that is a single four-bar with its crank on the ground."""

    # Lengths of crank, coupler, rocker and ground, in [m].
    a: float
    b: float
    c: float
    d: float
    # 1 where the pin of coupler and rocker lies left of what leads from the crank's to the
    # ground's, −1 where right.
    side: float
    turn: float  # What the input is multiplied by, ±1, to be a crank that turns counter-clockwise
    offset: float  # What is added then, to be measured from the line of the ground, in [rad]
    # For each published joint the numbers of two directions and a constant: the first less the
    # second, and the constant. The directions are of ground (0), crank, coupler, rocker.
    terms: tuple[tuple[int, int, float], ...]

    def joint_angles(self, directions: Sequence[Any]) -> tuple[Any, ...]:
        """Return the published joints for directions measured from the line of the ground."""
        return tuple(directions[i] - directions[j] + constant for i, j, constant in self.terms)


def plain_four_bar(linkage: Linkage) -> PlainFourBar | None:
    """Return a linkage as a four-bar, or None if it is anything else."""
    structure = assur_groups(linkage)
    loops = list(four_bars(structure))
    driven = [group for group in structure.groups if isinstance(group, Driven)]
    if len(loops) != 1 or len(structure.groups) != 2 or len(driven) != 1 or linkage.sliders:
        return None
    crank, coupler, rocker, ground = loops[0].links
    if ground != GROUND or not all(
        isinstance(joint, RevoluteJoint) for joint in linkage.joints.values()
    ):
        return None
    ends: Callable[[str, str], str] = lambda first, second: next(  # noqa: E731  # a word for it
        name for name in linkage.links[first] if name in linkage.links[second]
    )
    pivot, pin = ends(crank, ground), ends(crank, coupler)
    closing, far = ends(coupler, rocker), ends(rocker, ground)

    def direction_angle(link: str, start: str, end: str) -> float:
        points = linkage.links[link]
        return phase(complex(*points[end]) - complex(*points[start]))

    arms = {
        ground: direction_angle(ground, pivot, far),
        crank: direction_angle(crank, pivot, pin),
        coupler: direction_angle(coupler, pin, closing),
        rocker: direction_angle(rocker, far, closing),
    }
    numbers = {link: k for k, link in enumerate(arms)}
    level = arms[ground]
    turn = 1.0 if linkage.inputs[0].child == crank else -1.0
    # The angle of a link is its direction less its arm's; 0 for the ground.
    constants = {link: level - arm for link, arm in arms.items()}
    return PlainFourBar(
        *loops[0].lengths,
        side=1.0 if written_sides(PlanarClosure(linkage))[closing] == 'left' else -1.0,
        turn=turn,
        offset=arms[crank] - level,
        terms=tuple(
            (numbers[j.child], numbers[j.parent], constants[j.child] - constants[j.parent])
            for j in linkage.joints.values()
            if isinstance(j, RevoluteJoint)
        ),
    )


def solve_by_textbook(shape: PlainFourBar) -> Solve:
    """Return the textbook form of a four-bar."""
    a, b, c, d, sign, turn, offset, _ = shape
    joints = shape.joint_angles

    def position(angle: float) -> Sequence[Any]:
        theta = turn * angle + offset
        ax, ay = a * cos(theta), a * sin(theta)
        try:
            k1 = (b**2 - c**2 - a**2 + d**2) / (2.0 * (d - ax))
            k2 = ay / (d - ax)
            k3 = 2.0 * (d - k1) * k2 / (k2**2 + 1.0)
            k4 = ((d - k1) ** 2 - c**2) / (k2**2 + 1.0)
            by = 0.5 * k3 + sign * sqrt((0.5 * k3) ** 2 - k4)
        except (ZeroDivisionError, ValueError):
            return ()
        bx = k1 + k2 * by
        return joints((0.0, theta, atan2(by - ay, bx - ax), atan2(by, bx - d)))

    return position


def solve_in_single_precision(shape: PlainFourBar) -> Solve:
    """Return the closed form of a four-bar in numbers of 32 bits."""
    a, b, c, d = shape[:4]
    half, sign = _Single(0.5), _Single(shape.side)
    turn, offset = _Single(shape.turn), _Single(shape.offset)
    twice_a, apart = _Single(2.0 * a), _Single(d - a)
    root = _Single(2.0 * sqrt(a * d))
    fold = _Single((abs(d - a) - abs(b - c)) * (abs(d - a) + abs(b - c)))
    stretch = _Single((b + c - a - d) * (a + b + c + d))
    more, less = (_Single((b - c) * (b + c) + way * (d - a) ** 2) for way in (1.0, -1.0))
    terms = [(i, j, _Single(constant)) for i, j, constant in shape.terms]
    zero = _Single(0.0)

    def position(angle: float) -> Sequence[Any]:
        phi = turn * _Single(angle) + offset
        halved = half * phi
        sine, cosine = np.sin(halved), np.cos(halved)
        near, far = root * sine, root * cosine
        near_square, far_square = near * near, far * far
        # At a change point the root is signed with the half angle. A negative rest is rounding
        # where the loop closes; without this a toggle is refused.
        inner = np.sqrt(np.maximum(fold + near_square, zero)) if fold else near
        outer = np.sqrt(np.maximum(stretch + far_square, zero)) if stretch else far
        cross = sign * inner * outer
        direction = np.arctan2(-twice_a * sine * cosine, apart + twice_a * sine * sine)
        coupler = direction + np.arctan2(cross, more + near_square)
        rocker = direction + np.arctan2(cross, less - near_square)
        lines = (zero, phi, coupler, rocker)
        return tuple(lines[i] - lines[j] + constant for i, j, constant in terms)

    return position
