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

"""Linkages of one loop, from their lengths, with frames as one would draw them."""

from __future__ import annotations

from campaigns.accuracy.dyads.rpr import RPR
from campaigns.accuracy.dyads.rrp import RRP
from campaigns.accuracy.dyads.rrr import RRR
from campaigns.accuracy.mechanism import CRANK, GROUND, Mechanism, Slide, Spot, Tie, Turn

A, B, C, D = ('crank', 'A', 'x'), ('coupler', 'B', 'x'), ('rocker', 'B', 'x'), ('ground', 'D', 'x')
"""Where the four lengths of a four-bar stand."""


def four_bar(
    lengths: tuple[float, float, float, float],
    side: int,
    *,
    fold: bool = False,
    stretch: bool = False,
    ties: tuple[Tie, ...] | None = None,
) -> Mechanism:
    """
    Return a four-bar.

    Parameters
    ----------
    lengths
        Crank a, coupler b, rocker c, ground d.
    side
        +1: B lies left of A→D, -1: right.
    fold, stretch
        Whether it passes change points where the crank lies along the ground.
    ties
        How its lengths hang together.

    """
    a, b, c, d = lengths
    return Mechanism(
        {
            GROUND: {'O': (0.0, 0.0), 'D': (d, 0.0)},
            CRANK: {'O': (0.0, 0.0), 'A': (a, 0.0)},
            'coupler': {'A': (0.0, 0.0), 'B': (b, 0.0)},
            'rocker': {'D': (0.0, 0.0), 'B': (c, 0.0)},
        },
        {},
        (RRR('coupler', 'rocker', Spot(CRANK, 'A'), Spot(GROUND, 'D'), 'B', side, fold, stretch),),
        {'coupler_joint': Turn(GROUND, 'coupler'), 'rocker_joint': Turn(GROUND, 'rocker')},
        ties,
    )


def slider_crank(a: float, b: float, offset: float, side: int) -> Mechanism:
    """Return crank a and rod b, whose far pin slides along x at an offset from the pivot."""
    return Mechanism(
        {
            GROUND: {'O': (0.0, 0.0), 'Q': (0.0, offset)},
            CRANK: {'O': (0.0, 0.0), 'A': (a, 0.0)},
            'rod': {'A': (0.0, 0.0), 'B': (b, 0.0)},
        },
        {'slide': Slide('B', GROUND, 'Q', (1.0, 0.0))},
        (RRP('rod', Spot(CRANK, 'A'), 'B', 'slide', side),),
        {'rod_joint': Turn(GROUND, 'rod'), 'slide_joint': 'slide'},
    )


def inverted_slider_crank(
    lengths: tuple[float, float, float],
    side: int,
    *,
    fold: bool = False,
    ties: tuple[Tie, ...] | None = None,
) -> Mechanism:
    """
    Return a crank with a rod that slides through a swivel.

    Parameters
    ----------
    lengths
        Crank a, ground d to the swivel, and what the rod's line passes the crank's pin by, left.
    side
        +1: the swivel lies ahead of the crank's pin along the rod, -1: behind.
    fold
        Whether the pins meet where the crank lies along the ground, and the rod goes through.
    ties
        How its lengths hang together.

    """
    a, d, offset = lengths
    return Mechanism(
        {
            GROUND: {'O': (0.0, 0.0), 'D': (d, 0.0)},
            CRANK: {'O': (0.0, 0.0), 'A': (a, 0.0)},
            'rod': {'A': (0.0, 0.0), 'Q': (0.0, offset)} if offset else {'A': (0.0, 0.0)},
        },
        {'slide': Slide('D', 'rod', 'Q' if offset else 'A', (1.0, 0.0))},
        (RPR('rod', Spot(CRANK, 'A'), Spot(GROUND, 'D'), 'slide', side, fold),),
        {'rod_joint': Turn(GROUND, 'rod'), 'slide_joint': 'slide'},
        ties,
    )
