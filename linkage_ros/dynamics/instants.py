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


"""When something happens within a step: the instant at which a margin is used up."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

_NARROWINGS = 80
NARROW = 1e-14
"""How exactly an instant is found, as a share of the step."""

State = TypeVar('State')


def last_before(
    reach: Callable[[float], State | None],
    margin: Callable[[State], float],
    start: State,
    end: float,
    beyond: State,
) -> tuple[float, State, bool]:
    """
    Return the instant at which the margin is 0, the last state before it, and whether it is that.

    Where there is no state it is not known what happens; then the instant is the end of what there
    is. By the Illinois form of regula falsi (M. Dowell, P. Jarratt, A modified regula falsi method
    for computing the root of an equation, BIT 11, 1971), and by halving where it has no two
    values: where the margin is 0 at the start too, or there is no state at the end.

    Parameters
    ----------
    reach
        The state after some seconds; None where there is none.
    margin
        Of a state, 0 or more before the instant.
    start
        The state at 0.
    end
        A time beyond the instant, in [s].
    beyond
        The state then, its margin below 0.

    """
    before, last, after, known = 0.0, start, end, True
    low, high = margin(start), margin(beyond)
    stays, narrow = 0, NARROW * end
    for _ in range(_NARROWINGS):
        if after - before <= narrow:
            break
        at = 0.5 * (before + after)
        if low > 0.0 and known:
            guess = before + (after - before) * low / (low - high)
            # Not nearer to an end than matters: so the last looks close in from both sides.
            at = min(max(guess, before + 0.5 * narrow), after - 0.5 * narrow)
        found = reach(at)
        if found is None:
            after, known = at, False
            continue
        now = margin(found)
        if now < 0.0:
            low *= 0.5 if stays > 0 else 1.0
            after, high, known, stays = at, now, True, 1
        else:
            high *= 0.5 if stays < 0 else 1.0
            before, last, low, stays = at, found, now, -1
            if now == 0.0:
                return at, found, True
    return after, last, known
