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


"""The linkages that come with the package."""

from __future__ import annotations

from pathlib import Path

LINKAGES = Path(__file__).parents[2] / 'config' / 'linkages'
SEVERAL_INPUTS = 'five_bar'
GALLERY = sorted(file.stem for file in LINKAGES.glob('*.yaml') if file.stem != SEVERAL_INPUTS)
"""Names of all that a file alone drives."""


def size_of(closure):
    """Return the length that errors are measured by: the longest side of a link, in [m]."""
    return max(
        abs(complex(*p) - complex(*q))
        for points in closure.linkage.links.values()
        for p in points.values()
        for q in points.values()
    )
