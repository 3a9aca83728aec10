# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The encoder on the shaft of each motor, before its gear and the play behind it.

With n counts a turn the reading is ⌊φ·n/2π⌋·2π/n, and its rate the difference of counts since the
last message over the time between (as in `linkage_ros.stages.effects.encoder`). With 0 counts both
are exact. The effort is the torque of the motor, as its amplifier knows it by the current.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import floor, nan, tau

from linkage_ros.messages import JointStateWriter


class MotorEncoder:
    """
    Writes what the encoders of motors read.

    ``counts`` is the number of counts per turn of a motor; 0 for exact readings. ``motors``
    returns angle, rate and torque of each motor, in [rad], [rad/s] and [N·m]; None for no torque.
    """

    def __init__(
        self,
        names: Sequence[str],
        counts: int,
        motors: Callable[[], Sequence[tuple[float, float, float | None]]],
    ) -> None:
        self._write = JointStateWriter(names).write
        self._counts = counts
        self._motors = motors
        self._last: tuple[int, list[int]] | None = None
        self._rates = [0.0] * len(names)

    def __call__(self, now: int, _motion: object, _reading: object) -> bytes:
        """Return the message at a time, in [ns]."""
        angles, rates, torques = map(list, zip(*self._motors(), strict=True))
        if self._counts:
            counted = [floor(angle * self._counts / tau) for angle in angles]
            if self._last is not None and now > self._last[0]:
                time, before = self._last
                seconds = (now - time) * 1e-9
                self._rates = [
                    (count - earlier) * tau / (self._counts * seconds)
                    for count, earlier in zip(counted, before, strict=True)
                ]
            self._last = now, counted
            angles, rates = [count * tau / self._counts for count in counted], self._rates
        # A message has an effort of each joint or of none.
        known = any(torque is not None for torque in torques)
        efforts = [nan if torque is None else torque for torque in torques] if known else []
        return self._write(now, angles, rates, efforts)
