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


"""Which methods are compared on which poses, and with which settings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from linkage_ros.accuracy.solving.methods.casadi_peer import casadi
from linkage_ros.accuracy.solving.methods.closed_form import closed_form, ITERATED
from linkage_ros.accuracy.solving.methods.extended import extended
from linkage_ros.accuracy.solving.methods.method import Method
from linkage_ros.accuracy.solving.methods.mujoco_peer import mujoco
from linkage_ros.accuracy.solving.methods.newton import COLD, FROM_KNOTS, newton, STARTS, WARM
from linkage_ros.accuracy.solving.methods.pinocchio_peer import pinocchio
from linkage_ros.accuracy.solving.methods.pylinkage_peer import pylinkage
from linkage_ros.accuracy.solving.methods.single_precision import single_precision
from linkage_ros.accuracy.solving.methods.table import table
from linkage_ros.accuracy.solving.methods.textbook import textbook
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.solvers.table import ORDERS

TOLERANCES = tuple(10.0**-k for k in range(2, 16))
KNOTS = tuple(2**k for k in range(4, 21))

PEERS = (pylinkage, casadi, mujoco, pinocchio)
"""Other packages, where they are installed; to import some of them takes a second."""

_FEW = {FROM_KNOTS: (1e-8,), WARM: (1e-2, 1e-8, 1e-14), COLD: (1e-8,)}
"""Tolerances by where Newton's method starts."""

_LARGEST = 2**22
"""Knots times joints of a table: what memory bears beside all others."""

_LARGEST_ITERATED = 2**14
"""Where each knot is iterated."""


def methods_for(linkage: Linkage, key: str, quick: bool) -> Iterator[Method]:
    """
    Yield the methods that a linkage has.

    Parameters
    ----------
    linkage
        The linkage.
    key
        Of the poses: all settings for easy ones, a few for the others.
    quick
        Whether a few settings are to do everywhere, and no other packages.

    """
    closed = closed_form(linkage)
    yield closed
    for made in (single_precision, textbook, *(() if quick else PEERS)):
        method = made(linkage)
        if method is not None:
            yield method
    whole = key == 'easy' and not quick
    for start in STARTS:
        many = TOLERANCES if start == WARM else TOLERANCES[::3]
        for tolerance in many if whole else _FEW[start]:
            yield newton(linkage, tolerance, start)
    if len(linkage.inputs) == 1:
        many_knots = _knots_of(linkage, closed.name == ITERATED, key, quick)
        for order in ORDERS:
            for knots in many_knots:
                yield table(linkage, knots, order)
    yield extended(linkage)


def _knots_of(linkage: Linkage, iterated: bool, key: str, quick: bool) -> Sequence[int]:
    if quick and key != 'easy':
        return KNOTS[4:5] if iterated else KNOTS[6:7]
    if quick or key != 'easy':
        return KNOTS[2:11:4]
    largest = _LARGEST_ITERATED if iterated else _LARGEST // len(linkage.joints)
    return [knots for knots in KNOTS if knots <= largest]
