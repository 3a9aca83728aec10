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
Motion generation: a four-bar whose coupler takes three poses.

Any two points of the coupler can be its pins, and any two of the ground its pivots: the poses give
the other end of each link (`pivots`).
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Sequence
from itertools import combinations
from math import degrees

from linkage_ros.errors import SynthesisError
from linkage_ros.kinematics.batch import Complex
from linkage_ros.kinematics.rounding import UNIT_ROUNDOFF
from linkage_ros.synthesis.design import Design, FourBar, Wanted
from linkage_ros.synthesis.motion.pivots import fixed_pivots, Links, moving_pivots, TRUSTED
from linkage_ros.synthesis.motion.poses import check_task, columns, Pose
from linkage_ros.synthesis.proof import assembled
import numpy as np

_LONGEST = 1e9
"""In chords: a link beyond it is an infinite one but for rounding."""

_NEAR = 1e-3
"""Places nearer than this, in parts of the motion, are at the pole rather than on a line."""


def from_moving_pivots(poses: Sequence[Pose], a: complex, b: complex) -> tuple[Design, Links]:
    """
    Design the four-bar whose coupler has its pins in two given points.

    Parameters
    ----------
    poses
        Three.
    a, b
        The pins of crank and rocker, in the coupler's frame, in [m].

    Raises
    ------
    SynthesisError
        Where no link carries one of the pins through its places, or the ground has no length.

    """
    check_task(poses, {'A': a, 'B': b})
    pins = np.array((a, b))
    links = fixed_pivots(*columns(poses), pins)
    for number, name in enumerate('AB'):
        _check_link(poses, name, links, number, 'fixed', np.abs(pins[number]))
    _check_distance(links, 'A and B', 'fixed', 'ground')
    return _design(poses, links, links.pivots, pins), links


def from_fixed_pivots(poses: Sequence[Pose], o2: complex, o4: complex) -> tuple[Design, Links]:
    """
    Design the four-bar that stands on two given places.

    Parameters
    ----------
    poses
        Three.
    o2, o4
        The pivots of crank and rocker, in the ground's frame, in [m].

    Raises
    ------
    SynthesisError
        Where no link leads from one of the pivots to the coupler, or the coupler has no length.

    """
    check_task(poses, {'O2': o2, 'O4': o4})
    pivots = np.array((o2, o4))
    links = moving_pivots(*columns(poses), pivots)
    for number, name in enumerate(('O2', 'O4')):
        _check_link(poses, name, links, number, 'moving', np.abs(pivots[number]))
    _check_distance(links, 'O2 and O4', 'moving', 'coupler')
    return _design(poses, links, pivots, links.pivots), links


def _design(poses: Sequence[Pose], links: Links, fixed: Complex, moving: Complex) -> Design:
    o2, o4 = (complex(pivot) for pivot in fixed)
    a, b = (complex(pivot) for pivot in moving)
    crank, rocker = (complex(length, 0.0) for length in links.lengths)
    four_bar = FourBar((o2, o4), crank, (a, b), rocker, 'left', traced=0j)
    wanted = tuple(
        Wanted(phase(arm), coupler=pose.angle, place=pose.place)
        for arm, pose in zip(links.arms[0].tolist(), poses, strict=True)
    )
    return assembled(Design(four_bar, wanted))


def _check_link(
    poses: Sequence[Pose], name: str, links: Links, index: int, kind: str, far: float
) -> None:
    """Refuse a pivot from which no link of one length leads to its other end."""
    chords = np.abs(links.chords[index])
    longest = float(chords.max())
    resting = [
        f'{i + 1} and {j + 1}'
        for i, j in combinations(range(3), 2)
        if chords[3 - i - j]
        <= 16.0 * UNIT_ROUNDOFF * (abs(poses[i].place) + abs(poses[j].place) + far)
    ]
    if len(resting) == 3:
        raise SynthesisError(
            name,
            'the coupler turns about it in all three poses: its link would have no length',
            'choose another place for it',
        )
    if resting:
        raise SynthesisError(
            name,
            f'is the pole of poses {resting[0]}, about which the coupler turns from one to the '
            'other: links of any length would do',
            'choose another place for it',
        )
    digits, length = float(links.digits[index]), float(links.lengths[index])
    if digits >= 1.0 and length <= _LONGEST * longest:
        return
    if chords.min() > _NEAR * longest:
        slope = degrees(phase(complex(links.chords[index][int(chords.argmax())]))) % 180.0
        seen, slider = ('', '') if kind == 'fixed' else (', seen from the coupler,', ' of it')
        raise SynthesisError(
            name,
            f'its three places{seen} lie on a line at {slope:.4g}°, so that its {kind} pivot is '
            f'infinitely far: a slider along that line{slider} does it, not a link',
            'choose another place for it, or turn a pose',
        )
    raise SynthesisError(
        name,
        f'is so near a pole that not a digit of its {kind} pivot is certain',
        'choose another place for it',
    )


def _check_distance(links: Links, names: str, kind: str, link: str) -> None:
    """Refuse two links that meet in the pivot that was found."""
    one, other = (complex(pivot) for pivot in links.pivots)
    size = TRUSTED * float(links.sensitivity.sum()) + 4.0 * float(links.lengths.max())
    if abs(one - other) <= UNIT_ROUNDOFF * size:
        raise SynthesisError(
            names,
            f'have the same {kind} pivot, since the coupler only turns about it: the {link} '
            'would have no length',
            'choose other places for them, or turn a pose',
        )
