# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The crank of the torque drive of several inputs, each with its own command and motor.

A message commands the inputs that it names; the commands of the others go on. Each command is
valid for the same time from its own arrival.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Sequence
from math import isfinite
from operator import itemgetter
from typing import Any, TYPE_CHECKING

from linkage_ros.dynamics import InputVector, LARGEST
from linkage_ros.messages import EffortsCommand, NANOSECONDS, Rejection
from linkage_ros.stages.drives.drive import CrankAtRest, CrankState
from linkage_ros.stages.drives.torque_crank import NEVER, PUSHES, TorqueCrank, without_winding

if TYPE_CHECKING:
    from linkage_ros.dynamics import HeldWrench, InputMotors, InputWindings
    from linkage_ros.stages.drives.torque import TorqueDrive


class SeveralTorqueCrank(TorqueCrank):
    """
    A mechanism whose inputs are moved by commanded efforts.

    ``motors`` are mounted on the mechanism. ``uses`` has the parameters of the drive for each
    input. Commands of an input are clipped to ± its part of ``most_each``, in [N·m] or [N], or for
    a motor in [A] or [V].
    """

    __slots__ = (
        '_brake',
        '_chatter_seen',
        '_commands',
        '_delays',
        '_most_each',
        '_motors',
        '_newest_inputs',
        '_stamps',
        '_untils',
        '_uses',
    )

    def __init__(
        self,
        mechanism: Any,
        start: Any,
        uses: tuple[TorqueDrive, ...],
        period: int,
        most_each: tuple[float, ...],
        motors: InputMotors | InputWindings,
        wrenches: tuple[HeldWrench, ...] = (),
        exerts_effort: bool = False,
    ) -> None:
        super().__init__(
            mechanism, start, uses[0], period, wrenches=wrenches, exerts_effort=exerts_effort
        )
        self._uses, self._motors, self._most_each = uses, motors, most_each
        self._brake = uses[0].brake
        self._chatter_seen = 0
        plays = [use.play for use in uses if use.play]
        self._play = max(plays, key=lambda play: play.on_chatter == 'end', default=None)
        self._delays = [round(use.motor.delay * NANOSECONDS) if use.motor else 0 for use in uses]
        # The commands that wait: when they act, their input, and themselves.
        self._waiting: Any = []
        self._commands: list[float | None] = [None] * len(uses)
        self._untils = [NEVER] * len(uses)
        self._stamps = [0] * len(uses)
        self._newest_inputs: tuple[int, ...] = ()
        self._acting = self._idle = self._actuation()

    @property
    def stamps(self) -> tuple[int, ...]:
        """Arrival of the newest good command of each input, in [ns]; 0 before the first."""
        return tuple(self._stamps)

    @property
    def newest_inputs(self) -> tuple[int, ...]:
        """Numbers of the inputs that the last good message commands."""
        return self._newest_inputs

    def offer(  # type: ignore[override]
        self, command: EffortsCommand, now: int
    ) -> Rejection | None:
        """Take commands at a time [ns], or return why they are rejected; then nothing changes."""
        named = [(n, effort) for n, effort in enumerate(command.efforts) if effort is not None]
        for _, effort in named:
            if not -LARGEST <= effort <= LARGEST:
                if isfinite(effort):
                    return Rejection.EFFORT_TOO_LARGE
                return Rejection.EFFORT_NOT_FINITE
        self.stamp = now
        if self._time >= 0:
            self._advance(now)
        for number, effort in named:
            most = self._most_each[number]
            self.saturated += not -most <= effort <= most
            clipped = min(max(effort, -most), most)
            self._stamps[number] = now
            if self._delays[number]:
                insort(
                    self._waiting, (now + self._delays[number], number, clipped), key=itemgetter(0)
                )
                self._due = self._waiting[0][0]
            else:
                self._commands[number] = clipped
                self._untils[number] = now + self.max_age
        self._newest_inputs = tuple([number for number, _ in named])
        acting = self._actuation()
        if self._time >= 0 and acting != self._acting and now > self._time:
            self._go_to(now)
        self._acting, self._until = acting, min(self._untils)
        return None

    @property
    def motors(self) -> Sequence[tuple[float, float, float | None]]:
        """Angle, rate and torque before the gear of each motor at the last state."""
        motion, motors = self._shown, self._motors
        torques = motors.torques(self._acting[0], motion)
        found = []
        for use, at in zip(self._uses, motors.drives, strict=True):
            ratio = use.motor.ratio if use.motor else 1.0
            found.append((ratio * motion.value[at], ratio * motion.rate[at], torques.get(at)))
        return found

    def _hurries(self) -> bool:
        before, self._chatter_seen = self._chatter_seen, self.chatter_count
        return self.chatter_count > before

    def _expire(self, end: int) -> None:
        for number, until in enumerate(self._untils):
            if until == end:
                self._commands[number], self._untils[number] = None, NEVER
        self._acting, self._until = self._actuation(), min(self._untils)

    def _take_due(self, end: int) -> None:
        _, number, self._commands[number] = self._waiting.pop(0)
        self._untils[number] = end + self.max_age
        self._acting, self._until = self._actuation(), min(self._untils)

    def _actuation(self) -> tuple[Any, InputVector, InputVector]:
        """Return mechanism, forces on its inputs and brakes under the commands."""
        commands: list[float | None] = []
        for use, command in zip(self._uses, self._commands, strict=True):
            quantum = use.motor.quantum if use.motor else 0.0
            if command is None or not quantum:
                commands.append(command)
            else:
                commands.append(round(command / quantum) * quantum)
        mechanism, forces, holding = self._motors.drive_by(self._mechanism, commands)
        brakes = [*holding]
        for at, command in zip(self._motors.drives, commands, strict=True):
            brakes[at] += self._brake if command is None else 0.0
        return mechanism, forces, InputVector(brakes)

    def _crank_state(self, motion: Any, acceleration: InputVector) -> CrankState:
        count, drives = len(self._uses), self._motors.drives
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
