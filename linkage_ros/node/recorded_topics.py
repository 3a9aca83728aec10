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
The topics that a run records, each by its handle: its number in the bag.

They are numbered here alone. The tick offers messages to the recorder by handle, and the bag's
topics are described by handle.
"""

from __future__ import annotations

from itertools import count
from typing import NamedTuple

from linkage_ros.pipeline.pipeline import Pipeline


class RecordedTopics(NamedTuple):
    """
    The handles; None of a topic that a run does not have.

    Attributes
    ----------
    joint_states, diagnostics
        What every run publishes.
    crank
        What the drives listen to.
    faults
        When faults begin and end.
    withheld
        Ticks without a message of which a replay has to know.
    extras
        The pipeline's further topics.
    resets
        When the pipeline was built anew.
    description
        The robot model. No tick publishes it.

    """

    joint_states: int
    diagnostics: int
    crank: int | None
    faults: int | None
    withheld: int | None
    extras: tuple[int, ...]
    resets: int
    description: int


def recorded_topics(pipeline: Pipeline) -> RecordedTopics:
    """Return the handles of the topics that a run of a pipeline records."""
    handles = count()
    return RecordedTopics(
        joint_states=next(handles),
        diagnostics=next(handles),
        crank=next(handles) if pipeline.topic else None,
        faults=next(handles) if pipeline.injection is not None else None,
        withheld=next(handles) if pipeline.withholds else None,
        extras=tuple(next(handles) for _ in pipeline.extras),
        resets=next(handles),
        description=next(handles),
    )
