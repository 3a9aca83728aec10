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
How large the parts of a page may be, whatever its bag holds: they come to less than its bound.

Numbers come onto a page as base64, which takes 4 bytes for 3.
"""

from __future__ import annotations

BOUND = 20_000_000
"""No page is larger, in [bytes], however long the run; a quarter of it is the plotting library."""

STATES, SAMPLES, DURATIONS, FRAMES = 3_600_000, 1_500_000, 500_000, 2_500_000
"""
The numbers, in [bytes], before they are text.

Of the curves of joints and of the crank, of lateness and of age (each), and of the instants of the
moving picture with the places of the links.
"""

MOST_FRAMES = 20_000

DRAWN = 500_000
"""The shapes of the linkages, in [bytes]."""

TABLES = 600_000
"""The tables, in [bytes]."""
