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


"""Whether a loop closes, as an answer and not as an exception."""

from __future__ import annotations

from enum import Enum


class Status(Enum):
    """What a dyad found at one crank angle."""

    CLOSED = 'closed'
    """The loop closes; position and rates are valid."""

    TOGGLE = 'toggle'
    """The dyad is stretched or folded: the position is valid, its rate is not."""

    OPEN = 'open'
    """The links do not reach each other; they miss by the gap."""

    INDETERMINATE = 'indeterminate'
    """Two pins coincide, and with them every direction is a solution: no pose can be told."""
