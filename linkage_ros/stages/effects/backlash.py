# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Backlash: play between motor and crank; the crank follows the motor with hysteresis.

Friction holds the crank until the motor reaches one end of the play b and pushes it (the play
operator; A. Visintin, Differential Models of Hysteresis, 1994; for gears: M. Nordin and P.-O.
Gutman, Controlling mechanical systems with backlash, a survey, Automatica 38, 2002)::

    θ(t) = min(max(θ(t−), φ − b/2), φ + b/2)    θ of the crank, φ of the motor

Where the motor touches an end and its rate pushes on, the crank has the rate and acceleration of
the motor; else it rests. The crank does not run ahead of a motor that slows down, which would take
inertia. At the first tick it is in the middle of the play.

A resting crank is held by friction, which bears the weight of the links, the springs, and the
effect of other inputs. Its motor then moves alone, and `effort` is the effort for the motor's own
inertia (see `CrankBehindPlay`). Where the motor pushes, it bears all of these. Without play, at
b = 0, it always pushes.

Under the torque drive a scene with backlash is refused: there motor and crank are two masses that
meet and part, which is `play` of that drive (`linkage_ros.dynamics.two_masses`).

The model depends on the path and not on the speed, so motion between two ticks is lost: a motor
that goes back and forth between them has moved nothing. A rotating motor may be given as a wrapped
angle: it turns by less than half a turn per tick.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, tau
from typing import ClassVar

from linkage_ros.description import each_part, Number, number
from linkage_ros.stages.drives import Context, CrankBehindPlay, CrankState
from linkage_ros.stages.effects.effect import DriveEffect
from linkage_ros.stages.effects.stage import DriveStage

_LARGEST = 6.0


@dataclass(frozen=True, slots=True)
class BacklashEffect(DriveEffect):
    """Play between motor and crank: the crank rests until the motor has crossed the play."""

    play: float = number(
        'from one end to the other, of every input', unit='rad or m', least=0.0, most=_LARGEST
    )
    inputs: Mapping[str, float] = each_part(
        'inputs with a different play',
        'input',
        Number('from one end to the other', 'rad or m', least=0.0, most=_LARGEST),
    )

    runs_in_gaps = True
    refused_drives: ClassVar = {
        'torque': (
            'is play without masses, and torque moves masses',
            'write drive.torque.play: {width: …, inertia: …} instead',
        )
    }
    sample = '{play: 0.01}'

    def drive_stage(self, context: Context) -> DriveStage:
        """Build the stage; it stores the positions of the cranks."""
        linkage = context.closure.linkage
        plays = tuple(
            Play(self.inputs.get(driven.joint, self.play), turns=not driven.slider)
            for driven in linkage.inputs
        )

        def backlash(motor: CrankState) -> CrankState:
            angles, rates, accelerations, free_motors = zip(
                *[
                    play.follow_motor(*of_one)
                    for play, *of_one in zip(
                        plays, motor.angles, motor.rates, motor.accelerations, strict=True
                    )
                ],
                strict=True,
            )
            crank = CrankBehindPlay(angles, rates, accelerations, motor.age)
            crank.free_motors = free_motors
            return crank

        return backlash


class Play:
    """
    The motion of one crank within its play, in [rad] or [m].

    ``turns`` is True if the position is an angle, which may be wrapped.
    """

    __slots__ = ('_crank', '_half', '_motor', '_turns')

    def __init__(self, play: float, turns: bool) -> None:
        self._half = 0.5 * play
        self._turns = turns
        self._crank: float | None = None
        self._motor = 0.0

    def follow_motor(
        self, motor: float, rate: float, acceleration: float
    ) -> tuple[float, float, float, float | None]:
        """
        Return position, rate and acceleration of the crank, and ``free``.

        ``free`` is the acceleration of the motor while it moves alone; None while it pushes the
        crank.
        """
        crank = self._crank
        if crank is None:
            crank = motor
        elif self._turns and not -pi < motor - self._motor < pi:
            crank += round((motor - self._motor) / tau) * tau
        low, high = motor - self._half, motor + self._half
        self._crank = crank = min(max(crank, low), high)
        self._motor = motor
        pushed = (
            (crank <= low and (rate > 0.0 or (rate == 0.0 and acceleration > 0.0)))
            or (crank >= high and (rate < 0.0 or (rate == 0.0 and acceleration < 0.0)))
            or not self._half
        )
        return (crank, rate, acceleration, None) if pushed else (crank, 0.0, 0.0, acceleration)
