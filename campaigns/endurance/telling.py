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


"""Lines of progress, now and then."""

from __future__ import annotations

from collections.abc import Callable
import time

from bench.report import say

_PERIOD = 15.0  # [s]


def telling(of: str) -> Callable[[float], None]:
    """Return what takes how much is done, and tells it if the last time was a while ago."""
    told = time.monotonic()

    def tell(done: float) -> None:
        nonlocal told
        if time.monotonic() - told > _PERIOD:
            told = time.monotonic()
            say(f'  {done:.1f} {of}')

    return tell
