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
Hardware in the loop: a controller commands the effort of the input, which moves the linkage.

Time is divided into equal steps from the first tick on. A step is divided again where a command
arrives or expires, since the force changes there. So the motion depends only on the commands and
their times, not on when the state is read: the state between two steps comes from a shorter step
of the same method, which is then discarded.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, inf, isfinite, pi

from linkage_ros.drives.drive import Context, CrankState, Drive, Reader
from linkage_ros.dynamics.integrators import METHODS
from linkage_ros.dynamics.motion import LARGEST, Motion, OneFreedom
from linkage_ros.errors import DefinitionError
from linkage_ros.files.parameters import choice, number
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import without_limits
from linkage_ros.kinematics.ranges import describe
from linkage_ros.messages.joint_state import EffortCommand, JointEffortReader, Rejection
from linkage_ros.messages.layout import NANOSECONDS

TOPIC = 'crank_commands'

_MADE_UP = NANOSECONDS
"""Time that one tick integrates at most, in [ns]; two periods if these are longer."""

_NEVER = 1 << 63


@dataclass(frozen=True, slots=True)
class TorqueParameters:
    """Hardware in the loop: the effort commanded on crank_commands moves the linkage's masses."""

    start: float = number('input at the first tick', 0.0, unit='rad or m', least=-1e6, most=1e6)
    rate: float = number('its rate then', 0.0, unit='rad/s or m/s', least=-1e6, most=1e6)
    method: str = choice(
        'integration: of order 1, 4 or 6, at about 1, 4 or 20 evaluations a step',
        tuple(METHODS),
        'rk4',
    )
    step: float = number('length of a step', 1e-3, unit='s', least=1e-6, most=0.1)
    timeout: float = number(
        'validity of a command, unless another one comes', 0.1, unit='s', least=1e-6, most=3600.0
    )
    on_timeout: str = choice(
        'while no command is valid: no effort, or a brake', ('zero', 'brake'), 'zero'
    )
    brake: float = number(
        'holding torque or force of the brake', 0.0, unit='N·m or N', least=0.0, most=LARGEST
    )
    restitution: float = number(
        'ratio of the rates after and before an impact on a stop', 0.0, least=0.0, most=1.0
    )
    stop_margin: float = number(
        'distance of the stop from a toggle at an end of the range, as a fraction of the range: '
        'at the toggle the inertia is unbounded; a limit is itself a stop',
        1e-3,
        above=0.0,
        most=0.49,
    )


PARAMETERS = TorqueParameters


def reader(context: Context) -> Reader:
    """Build the reader of the messages."""
    return JointEffortReader(context.inputs_in_messages[0], context.dependent).read


def build(parameters: TorqueParameters, context: Context) -> TorqueDrive:
    """
    Build the drive.

    Raises
    ------
    DefinitionError
        The linkage has several inputs or lacks masses, no motion can start at the given start, or
        the brake is not specified.

    """
    closure = context.closure
    n_inputs = len(closure.linkage.inputs)
    if n_inputs > 1:
        raise DefinitionError(
            'drive.torque',
            f'the linkage has {n_inputs} inputs, and the torque drive moves one',
            'use a linkage with one input, or another drive',
        )
    brakes = parameters.on_timeout == 'brake'
    if brakes and parameters.brake == 0.0:
        raise DefinitionError(
            'drive.torque.brake',
            'the brake is 0 and holds nothing',
            'write its torque or force, in [N·m] or [N]',
        )
    if parameters.brake and not brakes:
        raise DefinitionError(
            'drive.torque.brake', 'the brake is never applied', 'add on_timeout: brake'
        )
    mechanics = context.mechanics
    yielding = mechanics.loads.applied.stops
    motion = OneFreedom(
        mechanics.equation,
        METHODS[parameters.method].step,
        _stops(
            Closure(without_limits(closure.linkage, yielding)) if yielding else closure,
            parameters.start,
            parameters.stop_margin,
        ),
        parameters.restitution,
        mechanics.laws,
    )
    start = motion.at(parameters.start, parameters.rate)
    if start is None:
        raise DefinitionError(
            'drive.torque.start',
            f'at {parameters.start:g} nothing can be moved: a toggle, or no inertia',
            'start elsewhere',
        )
    if mechanics.applied:
        low, high = (min(max(end, start.value - pi), start.value + pi) for end in motion.stops)
        mechanics.applied.check_step(
            lambda value: terms.inertia if (terms := mechanics.equation(value)) else 0.0,
            (low, high),
            parameters.method,
            parameters.step,
        )
    # A scene with slow ticks must not skip time between them.
    period = round(NANOSECONDS / context.rate) if context.rate else 0
    most = closure.linkage.inputs[0].limits.effort
    return TorqueDrive(motion, start, parameters, max(_MADE_UP, 2 * period), min(most, LARGEST))


def _stops(closure: Closure, start: float, margin: float) -> tuple[float, float]:
    """Return the stops of the input, in [rad] or [m]: at limits, or before a toggle."""
    # If the input has limits, its angle is not reduced by whole turns.
    counted = closure.linkage.inputs[0].limits.bounded
    for each in closure.input_ranges:
        if each.whole:
            return -inf, inf
        turns = 0.0 if counted else each.shift(start)
        low, high = each.lowest - turns, each.highest - turns
        within = margin * (high - low)
        low, high = (
            (end if by else end + inwards) if limited else copy
            for end, inwards, copy, limited, by in zip(
                (low, high), (within, -within), (-inf, inf), each.limited, each.by, strict=True
            )
        )
        if low <= start <= high:
            return low, high
    raise DefinitionError(
        'drive.torque.start',
        f'{start:g} is not between the stops; reachable: {describe(closure.input_ranges)}',
        f'start there, {margin:g} of the range or more from its ends',
    )


class TorqueDrive(Drive):
    """
    A mechanism moved by commanded efforts.

    A tick integrates a limited time, so that a late tick does not become later still: beyond the
    limit whole steps are skipped, as if the mechanism had stood still.

    Parameters
    ----------
    mechanism
        The equation of motion.
    start
        State at the first tick.
    use
        Step size, and the effort without a valid command.
    made_up
        Longest time that one tick integrates, in [ns].
    most
        Greatest effort in either direction, in [N·m] or [N]; commands are clipped to it.

    """

    __slots__ = (
        '_begun',
        '_boundary',
        '_force',
        '_idle',
        '_made_up',
        '_mechanism',
        '_most',
        '_motion',
        '_step',
        '_time',
        '_until',
        'lost',
        'max_age',
        'saturated',
        'stamp',
    )

    stamp: int
    """Arrival of the newest good command, in [ns]; 0 before the first."""
    max_age: int
    """Validity of a command, in [ns]."""
    lost: int
    """Skipped time, in [ns]."""
    saturated: int
    """Number of commands clipped to the effort limit."""

    def __init__(
        self,
        mechanism: OneFreedom,
        start: Motion,
        use: TorqueParameters,
        made_up: int,
        most: float = LARGEST,
    ) -> None:
        self._mechanism = mechanism
        self._motion = start
        self._step = round(use.step * NANOSECONDS)
        self._made_up = made_up
        self._idle = self._force = (0.0, use.brake)
        self._time = self._boundary = self._begun = -1
        self._until = _NEVER
        self.max_age = round(use.timeout * NANOSECONDS)
        self._most = most
        self.stamp = self.lost = self.saturated = 0

    def offer(self, command: EffortCommand, now: int) -> Rejection | None:
        """
        Take a command from now on, or return why it is rejected; a rejected one changes nothing.

        Parameters
        ----------
        command
            The command.
        now
            The time, in [ns].

        """
        effort = command.effort
        if not -LARGEST <= effort <= LARGEST:
            if isfinite(effort):
                return Rejection.EFFORT_TOO_LARGE
            return Rejection.EFFORT_NOT_FINITE
        if not -self._most <= effort <= self._most:
            effort = copysign(self._most, effort)
            self.saturated += 1
        force = (effort, 0.0)
        if self._time >= 0:
            self._advance(now)
            if force != self._force and now > self._time:
                self._go_to(now)
        self._force = force
        self._until = now + self.max_age
        self.stamp = now
        return None

    def state(self, now: int) -> CrankState:
        """Return the crank state at a time, in [ns]; for an earlier time, the last state."""
        if self._time < 0:
            self._time = self._begun = now
            self._boundary = now + self._step
        self._advance(now)
        motion, force, time = self._motion, self._force, (self._time - self._begun) * 1e-9
        if now > self._time:
            seconds = (now - self._time) * 1e-9
            motion = self._mechanism.advance(motion, seconds, *force, time)
            time += seconds
        acceleration = self._mechanism.acceleration(motion, *force, time)
        return CrankState((motion.value,), (motion.rate,), (acceleration,), 0)

    def _advance(self, now: int) -> None:
        """Integrate all steps that end by a time, in [ns]."""
        late = now - self._time - self._made_up
        if late > 0:
            left_out = -(-late // self._step) * self._step
            self._time += left_out
            self._boundary += left_out
            self.lost += left_out
        while (end := min(self._boundary, self._until)) <= now:
            self._go_to(end)
            if end == self._until:
                self._force, self._until = self._idle, _NEVER
            if end == self._boundary:
                self._boundary += self._step

    def _go_to(self, end: int) -> None:
        """Integrate a step, or the rest of one."""
        if end > self._time:
            seconds, time = (end - self._time) * 1e-9, (self._time - self._begun) * 1e-9
            self._motion = self._mechanism.advance(self._motion, seconds, *self._force, time)
            self._time = end
