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


"""Steps that place a point of a link whose angle is known, over arrays."""

from __future__ import annotations

from linkage_ros.kinematics.batch.arrays import turned
from linkage_ros.kinematics.places import PointOnLink, PointOnRail


class PointOnLinkArrays(PointOnLink):
    """A point at a constant distance from a pin of the same link."""

    __slots__ = ()

    _facing = staticmethod(turned)


class PointOnRailArrays(PointOnRail):
    """A point that travels along a line of a link."""

    __slots__ = ()

    _facing = staticmethod(turned)
