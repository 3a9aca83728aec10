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

"""Good samples at which a loop does not close, and nothing is published."""

from __future__ import annotations

from linkage_ros.kinematics.batch import CODES
from linkage_ros.kinematics.status import Status
from linkage_ros.report.arrays import Numbers, Times
from linkage_ros.report.run import LinkageRun
from linkage_ros.report.spans import Lane


def find_openings(linkage: LinkageRun, times: Times, angles: Numbers, lane: Lane) -> None:
    """
    Put samples at which a linkage does not close onto a lane.

    Parameters
    ----------
    linkage
        The linkage.
    times
        Of the samples, in the time of the run in [ns].
    angles
        Where they have its driven joints, of shape (samples, inputs), in [rad] or [m].
    lane
        The lane.

    """
    if not len(times):
        return
    status = linkage.closure.solve(*angles.T, derivatives=0).status
    found = status >= CODES[Status.OPEN]
    for time, given in zip(times[found].tolist(), angles[found].tolist(), strict=True):
        text = ''
        # The text is that of the first of those that are one span.
        if not lane.spans or time - lane.spans[-1].end > lane.near:
            position = linkage.closure.position(*given)
            text = f'{position.status.value}, the links miss by {position.gap:.3g} m'
        lane.add(time, time, f'{linkage.name} {text}'.strip())
