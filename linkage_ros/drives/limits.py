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


"""Drives that would take a joint beyond its limits, refused when they are built."""

from __future__ import annotations

from linkage_ros.errors import DefinitionError, quoted
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.sweep_analysis import Way


def refuse_beyond(
    closure: Closure, number: int, where: str, start: float, extent: tuple[float, float]
) -> None:
    """
    Refuse a motion of an input that leaves the limits of a joint, where that can be known.

    Of the input's own limits it can; of those of published joints where there is one input. A
    motion that leaves the range by a toggle is none of this: there the loop is open.

    Parameters
    ----------
    closure
        The linkage.
    number
        Of the input.
    where
        Key of the motion, for messages.
    start
        Its first value, in [rad] or [m].
    extent
        Between which values it stays; infinite ones where it goes on and on.

    Raises
    ------
    DefinitionError
        With the joint whose limits it leaves.

    """
    given = closure.linkage.inputs[number]
    low, high = extent
    goes = f'takes {quoted(given.joint)} from {low:.6g} to {high:.6g}'
    for bound in closure.bounds.inputs:
        if bound.number == number and (bound.beyond(low) or bound.beyond(high)):
            raise DefinitionError(
                where,
                f'{goes}, beyond its limits {given.limits}',
                'stay within them, or widen them in the linkage file',
            )
    if not closure.bounds.joints or len(closure.linkage.inputs) > 1:
        return
    way = Way(closure)
    interval = way.range_about(start)
    if interval is None:
        if beyond := closure.beyond(way.position(start)):
            raise DefinitionError(
                where, f'starts at {start:.6g}, beyond limits: {beyond}', 'start within them'
            )
        return
    for value, end, outward, by in zip(
        extent, interval[:2], (-1.0, 1.0), interval.by, strict=True
    ):
        if by and outward * (value - end) > 1e-12 * (abs(end) + 1.0):
            raise DefinitionError(
                where,
                f'{goes}, beyond {end:.6g}, where {quoted(by)} is at its limit',
                'stay within it, or widen it in the linkage file',
            )
