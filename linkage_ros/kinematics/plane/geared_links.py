# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Links that ratios turn against links whose whole turns are known: their angles are sums."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import tau

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.plane.linkage import Linkage, RevoluteJoint
from linkage_ros.kinematics.plane.solved_links import Angle, count_turns
from linkage_ros.kinematics.plane.topology import GearedLinks
from linkage_ros.kinematics.step import GearedAngle

_Row = dict[int, Fraction]


def solve_geared_links(
    linkage: Linkage,
    group: GearedLinks,
    known: Mapping[str, Angle],
    pose: tuple[Sequence[float], Sequence[float]] | None,
) -> list[GearedAngle]:
    """
    Return the angle of each link of a group.

    Each ratio is an equation Σ a·(angle of the group) = Σ b·x + c with the coordinates x of the
    ``known`` links. ``pose`` has these coordinates, and roughly the angles of the group: they tell
    the tooth. Without a pose the joints follow each other by their values as they are written.
    """
    matrix: list[list[Fraction]] = []
    rights: list[_Row] = []  # Factors of the coordinates; −1 has the constant
    for name in group.ratios:
        given = linkage.ratios[name]
        row, right = [Fraction(0)] * len(group.links), {-1: Fraction(given.offset)}
        for joint, factor in ((name, Fraction(1)), (given.of, -Fraction(given.ratio))):
            ends = linkage.joints[joint]
            assert isinstance(ends, RevoluteJoint)
            for link, by in ((ends.child, factor), (ends.parent, -factor)):
                if link in group.links:
                    row[group.links.index(link)] += by
                else:
                    angle = known[link]
                    right[angle.coordinate] = right.get(angle.coordinate, Fraction(0)) - by
                    right[-1] -= by * Fraction(angle.constant)
        if pose is not None and (turns := count_turns(given.ratio)):
            # Without the turns of its links, an angle determines the other one modulo a tooth.
            x, angles = pose
            values = [1.0 if k < 0 else x[k] for k in right]
            off = sum(float(a) * value for a, value in zip(row, angles, strict=True)) - sum(
                float(b) * value for b, value in zip(right.values(), values, strict=True)
            )
            right[-1] += round(off * turns / tau) * Fraction(tau) / turns
        matrix.append(row)
        rights.append(right)
    _eliminate(matrix, rights, group)
    return [
        GearedAngle(
            tuple((k, float(b)) for k, b in sorted(right.items()) if k > 0 and b),
            float(right[-1]),
        )
        for right in rights
    ]


def _eliminate(matrix: list[list[Fraction]], rights: list[_Row], group: GearedLinks) -> None:
    """Make the matrix that of unity, by rows."""
    count = len(matrix)
    for k in range(count):
        pivot = next((i for i in range(k, count) if matrix[i][k]), None)
        if pivot is None:
            raise DefinitionError(
                f'ratios.{group.ratios[-1]}',
                f'leaves {group.links[k]!r} free, or locks it',
                'give another ratio, or let another joint follow',
            )
        matrix[k], matrix[pivot] = matrix[pivot], matrix[k]
        rights[k], rights[pivot] = rights[pivot], rights[k]
        scale = matrix[k][k]
        matrix[k] = [value / scale for value in matrix[k]]
        rights[k] = {n: value / scale for n, value in rights[k].items()}
        for i in range(count):
            by = matrix[i][k]
            if i == k or not by:
                continue
            matrix[i] = [a - by * b for a, b in zip(matrix[i], matrix[k], strict=True)]
            for n, value in rights[k].items():
                rights[i][n] = rights[i].get(n, Fraction(0)) - by * value
