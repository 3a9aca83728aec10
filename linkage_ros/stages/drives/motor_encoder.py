# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The encoder on the shaft of a motor, before its gear and the play behind it.

With n counts a turn the reading is ⌊φ·n/2π⌋·2π/n, and its rate the difference of counts since the
last message over the time between (as in `linkage_ros.stages.effects.encoder`). With 0 counts both
are exact. The effort is the torque of the motor, as its amplifier knows it by the current.
"""

from __future__ import annotations

from collections.abc import Callable
from math import floor, tau

from linkage_ros.messages import JointStateWriter


class MotorEncoder:
    """
    Writes what the encoder of a motor reads.

    ``counts`` is the number of counts per turn of the motor; 0 for an exact reading. ``motor``
    returns angle, rate and torque of the motor, in [rad], [rad/s] and [N·m]; None for no torque.
    """

    def __init__(
        self, name: str, counts: int, motor: Callable[[], tuple[float, float, float | None]]
    ) -> None:
        self._write = JointStateWriter([name]).write
        self._counts = counts
        self._motor = motor
        self._last: tuple[int, int] | None = None
        self._rate = 0.0

    def __call__(self, now: int, _motion: object, _reading: object) -> bytes:
        """Return the message at a time, in [ns]."""
        angle, rate, torque = self._motor()
        if self._counts:
            count = floor(angle * self._counts / tau)
            if self._last is not None and now > self._last[0]:
                time, before = self._last
                self._rate = (count - before) * tau / (self._counts * (now - time) * 1e-9)
            self._last = now, count
            angle, rate = count * tau / self._counts, self._rate
        return self._write(now, [angle], [rate], [] if torque is None else [torque])
