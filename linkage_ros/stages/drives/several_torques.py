# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The crank of the torque drive of several inputs, each with its own command and motor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TYPE_CHECKING

from linkage_ros.stages.drives.drive import Context, CrankAtRest, CrankState
from linkage_ros.stages.drives.torque_crank import PUSHES, TorqueCrank, without_winding

if TYPE_CHECKING:
    from linkage_ros.dynamics import InputMotors, InputVector, InputWindings
    from linkage_ros.stages.drives.torque import TorqueDrive


class SeveralTorqueCrank(TorqueCrank):
    """A mechanism whose inputs are moved by commanded efforts; the motors are mounted on it."""

    __slots__ = ('_chatter_seen', '_motors', '_ratios')

    def __init__(
        self,
        mechanism: Any,
        start: Any,
        uses: Sequence[TorqueDrive],
        context: Context,
        motors: InputMotors | InputWindings,
    ) -> None:
        self._motors, self._chatter_seen = motors, 0
        self._ratios = [use.motor.ratio if use.motor else 1.0 for use in uses]
        super().__init__(mechanism, start, uses, context)

    def _drive_by(self, commands: Sequence[float | None]) -> tuple[Any, Any, Any]:
        return self._motors.drive_by(self._mechanism, commands, self._brake)

    @property
    def motors(self) -> Sequence[tuple[float, float, float | None]]:
        """Angle, rate and torque before the gear of each motor at the last state."""
        motion, motors = self._shown, self._motors
        torques = motors.torques(self._acting[0], motion)
        return [
            (ratio * motion.value[at], ratio * motion.rate[at], torques.get(at))
            for ratio, at in zip(self._ratios, motors.drives, strict=True)
        ]

    def _hurries(self) -> bool:
        before, self._chatter_seen = self._chatter_seen, self.chatter_count
        return self.chatter_count > before

    def _crank_state(self, motion: Any, acceleration: InputVector) -> CrankState:
        count, drives = len(self._ratios), self._motors.drives
        of_inputs = motion.value[:count], motion.rate[:count], acceleration[:count]
        if not self.exerts_effort:
            return CrankState(*of_inputs, 0)
        # A stop may bear a part of an effort, which then does not follow from the motion.
        mechanism, forces, brakes = self._acting
        efforts, holding = self._motors.efforts(mechanism, motion, forces, brakes)
        bearing: tuple[float, ...] = ()
        moved = without_winding(motion)
        wound: Any = self._mechanism
        touching = getattr(wound, 'mechanism', wound).leaning_sides(moved)
        behind = sum(at >= count for at in drives)
        for at in drives:
            least, most = efforts[at] - holding[at], efforts[at] + holding[at]
            if at >= count:
                # The plays are the last stops of joints.
                number = len(moved.terms.limited) - behind + at - count
                own = moved.terms.inertia(at, at) * acceleration[at]
                low, high = PUSHES[touching.get(number, 0)]
                least, most = (min(max(end - own, low), high) for end in (least, most))
            bearing += least, most
        state = CrankAtRest(*of_inputs, 0)
        state.bearing = bearing
        return state
