# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How far joints are from the exact ones, for inputs that are not the exact ones."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import dist, nan, tau
from typing import Any

from linkage_ros.kinematics import Closure, Linkage, RevoluteJoint, SpaceLinkage
from linkage_ros.tools.study.budget import JointError
from linkage_ros.tools.study.member_motion import Crank
import numpy as np


def size_of(linkage: Linkage | SpaceLinkage) -> float:
    """Return the greatest distance between two points of a link, in space of the pose, in [m]."""
    if isinstance(linkage, SpaceLinkage):
        places = [*linkage.points.values(), *(hinge.at for hinge in linkage.hinges.values())]
        return max((dist(*pair) for pair in combinations(places, 2)), default=1.0) or 1.0
    return max(
        abs(complex(*one) - complex(*other))
        for points in linkage.links.values()
        for one, other in combinations(points.values(), 2)
    )


def joints_at(closure: Closure, cranks: Sequence[Crank | None]) -> tuple[Any, Any]:
    """
    Return joints and their rates for some states of the crank, (joints, states) each.

    The units are [rad] or [m], and per [s]; NaN where the crank is unknown or the loops do not
    close.
    """
    count = len(closure.linkage.inputs)
    nothing = ((nan,) * count, (nan,) * count)
    rows = np.array([crank or nothing for crank in cranks])
    values, rates = rows[:, 0, :].T, rows[:, 1, :].T
    batch = closure.solve(*values, rates=[*rates], derivatives=1)
    return batch.positions, batch.velocities


def joint_distances(closure: Closure, joints: Any, exact: Any) -> Any:
    """
    Return for each state the greatest distance of a joint from the exact one.

    It is in [rad]; slides in parts of the linkage's size. NaN where either does not exist.
    """
    apart = joints - exact
    for index, joint in enumerate(closure.linkage.joints.values()):
        if isinstance(joint, RevoluteJoint):
            apart[index] -= tau * np.round(apart[index] / tau)
        else:
            apart[index] /= size_of(closure.linkage)
    return np.abs(apart).max(axis=0)


def error_of(apart: Sequence[Any]) -> JointError | None:
    """Return the error of some distances, of all linkages together; None if there are none."""
    known = np.fmax.reduce([np.ravel(each) for each in apart])
    known = known[np.isfinite(known)]
    if not len(known):
        return None
    return JointError(float(np.sqrt(np.mean(known * known))), float(known.max()))
