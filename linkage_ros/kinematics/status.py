# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Whether a loop closes, as a result and not as an exception."""

from __future__ import annotations

from enum import Enum


class Status(Enum):
    """
    The result at one state of the inputs, from the best to the worst.

    The status of a linkage is the worst status of its dyads.

    Attributes
    ----------
    has_pose
        Whether positions are valid.
    has_rates
        Whether velocities and accelerations are valid too.

    """

    CLOSED = 'closed'
    """The loop closes; position and rates are valid."""

    CHANGE_POINT = 'change point'
    """
    All links of a loop are collinear, and its two assemblies meet.

    Position and rates are valid; they belong to the motion that passes through.
    """

    LIMITED = 'limited'
    """The loop closes with valid rates, but a joint is beyond its limits in the file."""

    TOGGLE = 'toggle'
    """The dyad is stretched or folded: the position is valid, its rate is not."""

    OPEN = 'open'
    """The links do not reach each other; the gap is their distance."""

    INDETERMINATE = 'indeterminate'
    """Two pins coincide, so that every direction is a solution: the pose is undefined."""

    has_pose: bool
    has_rates: bool


for _status in Status:
    _status.has_pose = _status not in (Status.OPEN, Status.INDETERMINATE)
    _status.has_rates = _status.has_pose and _status is not Status.TOGGLE
