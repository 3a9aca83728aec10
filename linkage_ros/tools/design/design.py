# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A designed four-bar: its pins, link by link, and the wanted positions.

Each link has the frame of the wanted values: the crank's angle is the wanted one, even if the
crank's pin does not lie on the x axis of its frame (a free zero), or lies behind the pivot (a
negative length, a link that points the other way).
"""

from __future__ import annotations

from cmath import rect
from dataclasses import dataclass
from typing import Literal, NamedTuple

from linkage_ros.kinematics import AssemblyPose, GROUND, Input, Linkage, Point, RevoluteJoint

CRANK, COUPLER, ROCKER = 'crank', 'coupler', 'rocker'

SHORTEST, FARTHEST = 1e-12, 1e9
"""Least and greatest length or coordinate of a task, in [m]."""

Assembly = Literal['left', 'right']


@dataclass(frozen=True, slots=True)
class FourBar:
    """A four-bar with its pivots; all places in [m]."""

    # Pivots of crank and rocker, O2 and O4, in the frame of the ground.
    pivots: tuple[complex, complex]
    crank: complex  # The crank's pin A in the crank's frame, whose origin is O2
    coupler: tuple[complex, complex]  # The coupler's pins A and B in the coupler's frame
    rocker: complex  # The rocker's pin B in the rocker's frame, whose origin is O4
    side: Assembly  # The side of A→O4 on which B lies
    traced: complex | None = None  # A point P of the coupler, in its frame, or None

    @classmethod
    def of_lengths(
        cls,
        a: float,
        b: float,
        c: float,
        d: float,
        alpha: float = 0.0,
        beta: float = 0.0,
        side: Assembly = 'left',
    ) -> FourBar:
        """
        Return a four-bar whose ground lies on the x axis, with the crank pivot at the origin.

        Parameters
        ----------
        a, c
            Lengths of crank and rocker; a link of negative length points the other way.
        b, d
            Lengths of coupler and ground, above 0.
        alpha, beta
            Directions of the pins of crank and rocker in their frames, in [rad] from the x axis.
        side
            The assembly.

        """
        # Without a turn, rect is avoided: it could write -0.0 or rounded digits into the file.
        crank = rect(a, alpha) if alpha else complex(a, 0.0)
        rocker = rect(c, beta) if beta else complex(c, 0.0)
        return cls((0j, complex(d, 0.0)), crank, (0j, complex(b, 0.0)), rocker, side)

    @property
    def lengths(self) -> tuple[float, float, float, float]:
        """Return the lengths of crank, coupler, rocker and ground, in [m]."""
        (o2, o4), (a, b) = self.pivots, self.coupler
        return abs(self.crank), abs(b - a), abs(self.rocker), abs(o4 - o2)

    def linkage(self, start: float | None = None) -> Linkage:
        """
        Return the design as a linkage.

        Parameters
        ----------
        start
            Crank angle of the start, in [rad], or None.

        """
        (o2, o4), (a, b) = self.pivots, self.coupler
        coupler = {'A': _as_point(a), 'B': _as_point(b)}
        if self.traced is not None:
            coupler['P'] = _as_point(self.traced)
        return Linkage(
            links={
                GROUND: {'O2': _as_point(o2), 'O4': _as_point(o4)},
                CRANK: {'O2': (0.0, 0.0), 'A': _as_point(self.crank)},
                COUPLER: coupler,
                ROCKER: {'O4': (0.0, 0.0), 'B': _as_point(self.rocker)},
            },
            inputs=(Input('crank_joint', GROUND, CRANK),),
            assembly={'B': self.side},
            joints={
                'coupler_joint': RevoluteJoint(CRANK, COUPLER),
                'rocker_joint': RevoluteJoint(GROUND, ROCKER),
            },
            sliders={},
            traced=('P',) if self.traced is not None else (),
            pose=None if start is None else AssemblyPose((start,), {}),
        )


class DesignRequest(NamedTuple):
    """One wanted position."""

    crank: float  # The crank's angle, given or computed, in [rad]
    rocker: float | None = None  # The rocker's angle, in [rad], or None
    coupler: float | None = None  # The coupler's angle to the ground, in [rad], or None
    # Place of the traced point in the frame of the ground, in [m], or None.
    place: complex | None = None


class Design(NamedTuple):
    """A four-bar and the positions that it was designed for, in the wanted order."""

    four_bar: FourBar
    wanted: tuple[DesignRequest, ...]


def _as_point(place: complex) -> Point:
    return place.real, place.imag
