# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The masses of links in space: a centre and a tensor of inertia, in the pose.

A tensor has six numbers, in the order of ``geometry_msgs/Inertia``: ixx, ixy, ixz, iyy, iyz, izz.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.space.vectors import dot, minus, plus, scale, Vector, ZERO

Tensor = tuple[float, float, float, float, float, float]

_NONE: Tensor = (0.0,) * 6
_ROUNDED = 0.01
"""By how much rounded principal moments may miss what a body has, relative to the greatest."""


@dataclass(frozen=True, slots=True)
class SpatialMass:
    """
    The mass of a link.

    Attributes
    ----------
    mass
        In [kg]; 0 for a massless link.
    center
        Centre of mass in the pose, in the frame of the ground, in [m].
    inertia
        Moments of inertia about the centre of mass, about axes that are parallel to those of the
        ground in the pose, in [kg·m²].

    """

    mass: float
    center: Vector = ZERO
    inertia: Tensor = _NONE


MASSLESS = SpatialMass(0.0)


def thin_rod(mass: float, first: Vector, second: Vector) -> SpatialMass:
    """Return a uniform thin rod between two places, in [m]."""
    center = scale(0.5, plus(first, second))
    # Two halves of its mass a twelfth of its square apart from the centre, on either side.
    return SpatialMass(mass, center, scale_tensor(mass / 12.0, _spread(minus(second, first))))


def combine_masses(parts: Sequence[SpatialMass]) -> SpatialMass:
    """Return the mass of bodies that are fixed to each other (parallel axis theorem)."""
    total = sum(part.mass for part in parts)
    if not total:
        return MASSLESS
    center = ZERO
    for part in parts:
        center = plus(center, scale(part.mass / total, part.center))
    inertia = _NONE
    for part in parts:
        moved = scale_tensor(part.mass, _spread(minus(part.center, center)))
        inertia = _sum(_sum(inertia, part.inertia), moved)
    return SpatialMass(total, center, inertia)


def turned_tensor(axes: Sequence[Vector], tensor: Tensor) -> Tensor:
    """Return a tensor about the axes of the ground, given one about other axes."""
    ways = [*zip(*axes, strict=True)]
    rows = tensor_rows(tensor)

    def moment(i: int, j: int) -> float:
        across = (dot(rows[0], ways[j]), dot(rows[1], ways[j]), dot(rows[2], ways[j]))
        return dot(ways[i], across)

    return moment(0, 0), moment(0, 1), moment(0, 2), moment(1, 1), moment(1, 2), moment(2, 2)


def tensor_rows(tensor: Tensor) -> tuple[Vector, Vector, Vector]:
    """Return the rows of a tensor as a matrix."""
    xx, xy, xz, yy, yz, zz = tensor
    return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)


def scale_tensor(factor: float, tensor: Tensor) -> Tensor:
    """Return a tensor times a factor."""
    xx, xy, xz, yy, yz, zz = tensor
    return factor * xx, factor * xy, factor * xz, factor * yy, factor * yz, factor * zz


def check_inertia(key: str, tensor: Tensor) -> None:
    """Refuse moments of inertia that no body has."""
    import numpy as np  # local import: only with masses

    least, middle, most = sorted(np.linalg.eigvalsh(np.array(tensor_rows(tensor))).tolist())
    room = _ROUNDED * max(abs(least), most)
    moments = f'[{least:.4g}, {middle:.4g}, {most:.4g}] kg·m²'
    if least < -room:
        raise DefinitionError(
            key, f'its principal moments are {moments}, of which one is negative',
            'write ixx, ixy, ixz, iyy, iyz, izz of a body about its centre of mass',
        )  # fmt: skip
    if most > least + middle + room:
        raise DefinitionError(
            key,
            f'its principal moments are {moments}, and the greatest is more than the sum of the '
            'others, as of no body',
            'write ixx, ixy, ixz, iyy, iyz, izz of a body about its centre of mass',
        )


def _spread(arm: Vector) -> Tensor:
    """Return the tensor of a unit of mass at a place."""
    x, y, z = arm
    return y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y


def _sum(first: Tensor, second: Tensor) -> Tensor:
    xx, xy, xz, yy, yz, zz = (a + b for a, b in zip(first, second, strict=True))
    return xx, xy, xz, yy, yz, zz
