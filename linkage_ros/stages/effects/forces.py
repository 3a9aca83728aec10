# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Effort and pin forces: what the drive exerts, and what the pins and sliders bear.

`effort`: effort of the drive for the motion, by virtual work (inverse dynamics).

With friction that grows with the forces in the joints it comes from these forces, by
`linkage_ros.dynamics.reactions`; a linkage that jams has no effort.

It covers the inertia of links and drive, gravity, springs and friction: see
`linkage_ros.dynamics.equation` for the equation and its source. It uses the crank's acceleration
from the drive; a topic's acceleration counts as 0 unless it is estimated.

Under the torque drive, the effort that causes a motion is the commanded one. An input at rest
shows no motion from which it follows: friction and stops bear a part. The drive then exerts its
command. A brake, or the friction in a motor's gear, holds within a range; the drive exerts the
effort in it that is nearest to the effort that the loads alone require.

After backlash, a motor that moves within the play pushes nothing. Friction holds the crank, and
the effort of that drive is for its own inertia only: drive_inertia·φ̈, with φ̈ of the motor.

At a toggle neither rates nor efforts exist.

With ``measured`` masses and loads play no part: the efforts are those in the samples of the
inputs, or those that do the same work as efforts in samples of other joints, and ``joints`` have
the efforts to which these come there. See `linkage_ros.kinematics.analysis.carried_efforts`.

`pin_forces`: forces between the links of a linkage in their joints.

They are computed for the rigid linkage, by Newton's and Euler's equations of every link; see
`linkage_ros.dynamics.reactions`. In an over-constrained linkage, and where wheels of a ratio press
on their bearings, some forces are not certain: those are 0, and a joint of whose force nothing is
certain is left out; ``linkage scene`` names them.

One message holds all forces of an instant, hence the type ``sensor_msgs/MultiDOFJointState`` and
not a ``geometry_msgs/WrenchStamped`` per pin: these would be separate topics, to be matched by
stamp, each with a frame that no node broadcasts. ``wrench`` holds for each of ``joint_names`` the
force and the moment, in the frame of the ground: in the plane the force (x, y) and the moment
about z. ``transforms`` and ``twist`` are empty. At a toggle no forces exist, and there is no
message.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from linkage_ros.description import flag, name_or_names
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import all_finite, CarriedEfforts, PlanarClosure
from linkage_ros.stages.drives import Context, CrankAtRest, CrankBehindPlay
from linkage_ros.stages.effects.effect import MechanismEffect, MessageEffect
from linkage_ros.stages.effects.stage import MechanismState, SensorReading, Stage, Writer


@dataclass(frozen=True, slots=True)
class EffortEffect(MechanismEffect):
    """Effort of the drive, in JointState.effort of the input where that is published."""

    measured: bool = flag(
        'efforts are those in the samples of the drive topic, not those for masses and loads',
        False,
    )
    joints: tuple[str, ...] = name_or_names(
        'with measured, as many joints as there are inputs, at which the efforts of the inputs '
        'are published, too, as those that do the same work; absent, the joints of the samples',
        'a joint',
    )

    needs = ('acceleration',)
    needs_forces = True
    is_compiled = True
    gives = 'efforts'
    without_inputs = (
        'is the effort of the input joint, which is not published',
        'set publish_input: true, or name pin_forces',
    )

    @property
    def computes_forces(self) -> bool:
        """Return whether masses, loads and friction matter to it with these parameters."""
        return not self.measured

    @property
    def takes_efforts(self) -> bool:
        """Return whether it starts from efforts in the samples of the drive."""
        return self.measured

    def stage(self, context: Context) -> Stage:
        """Build the stage; raise `DefinitionError` if the joints do not fit."""
        if self.measured:
            return _measured_effort_stage(self.joints, context)
        if self.joints:
            raise DefinitionError(
                'effects.effort.joints', 'has no effort to start from', 'add measured: true'
            )
        efforts_of = context.mechanics.drive_efforts
        if context.friction and context.friction.load_dependent_joint:
            efforts_of = context.reactions.drive_efforts

        def effort(motion: MechanismState) -> MechanismState:
            velocity, acceleration = motion.velocity, motion.acceleration
            if velocity is None or acceleration is None:
                return motion
            efforts = efforts_of(motion.position, velocity, acceleration, motion.given)
            # Near a toggle efforts grow with the accelerations, and faster.
            if not all_finite(efforts):
                return motion
            return motion._replace(efforts=efforts)

        if 'backlash' in context.effects:
            return _behind_play(effort, context)
        return _at_rest(effort)


@dataclass(frozen=True, slots=True)
class PinForcesEffect(MechanismEffect, MessageEffect):
    """Forces in joints, on ~/pin_forces."""

    needs = ('acceleration',)
    needs_forces = True
    is_compiled = True
    topic = '~/pin_forces'
    message = 'sensor_msgs/msg/MultiDOFJointState'
    of_forces = True

    def stage(self, context: Context) -> Stage:
        """Build the stage."""
        solve = context.reactions.solve

        def pin_forces(motion: MechanismState) -> MechanismState:
            velocity, acceleration = motion.velocity, motion.acceleration
            if velocity is None or acceleration is None:
                return motion
            reactions = solve(motion.position, velocity, acceleration, motion.given)
            return motion if reactions is None else motion._replace(reactions=reactions)

        return pin_forces

    def writer(self, context: Context) -> Writer:
        """Build the writer of the message; b'' where there are no forces."""
        from linkage_ros.messages import JointWrenchWriter  # local import: if published

        forces = context.reactions
        if not forces.published_joints:
            raise DefinitionError(
                'effects.pin_forces',
                f'none of them is certain: {forces.uncertain}',
                'leave it out',
            )
        names = [context.prefix + forces.names[number] for number in forces.published_joints]
        write = JointWrenchWriter(names, planar=isinstance(context.closure, PlanarClosure)).write
        if len(names) == len(forces.names):

            def write_forces(now: int, motion: MechanismState, _reading: SensorReading) -> bytes:
                return write(now, motion.reactions) if motion.reactions else b''

            return write_forces

        def write_certain(now: int, motion: MechanismState, _reading: SensorReading) -> bytes:
            reactions = motion.reactions
            return (
                write(now, [reactions[n] for n in forces.published_joints]) if reactions else b''
            )

        return write_certain


def _measured_effort_stage(named: Sequence[str], context: Context) -> Stage:
    """Return the stage for efforts in samples."""
    closure = context.closure
    published, inputs = closure.joint_names, closure.input_names
    count = len(inputs)
    if not named and {*context.instead_of_inputs} <= {*published}:
        named = context.instead_of_inputs
    carried = None
    if named:
        try:
            carried = CarriedEfforts(closure, inputs, named)
        except DefinitionError as error:
            raise DefinitionError(
                'effects.effort.joints', f'{error.where}: {error.reason}', error.remedy
            ) from None

    def measured_effort(motion: MechanismState) -> MechanismState:
        efforts = motion.given[-count:]
        if not (motion.position.status.has_rates and all_finite(efforts)):
            return motion
        at = dict.fromkeys(published, 0.0)
        if carried is not None:
            carried_efforts = carried.carry_from(motion.position, efforts)
            if not carried_efforts:
                return motion
            at |= dict(zip(named, carried_efforts, strict=True))
        at |= dict(zip(inputs, efforts, strict=True))
        return motion._replace(efforts=tuple([at[name] for name in published]))

    return measured_effort


def _at_rest(effort: Stage) -> Stage:
    """Return the stage for drives that exert an effort, which an input at rest does not show."""

    def effort_at_rest(motion: MechanismState) -> MechanismState:
        required = effort(motion)
        crank = motion.crank
        if not isinstance(crank, CrankAtRest) or not crank.bearing or not motion.acceleration:
            return required
        # A linkage that jams requires none.
        ends = crank.bearing[::2], crank.bearing[1::2]
        alone = required.efforts or (0.0,) * len(ends[0])
        return required._replace(efforts=tuple(map(min, map(max, alone, ends[0]), ends[1])))

    return effort_at_rest


def _behind_play(effort: Stage, context: Context) -> Stage:
    """Return the stage for drives with play: within it a motor bears its own inertia only."""
    inertia = context.mechanics.loads.drive_inertia

    def effort_behind_play(motion: MechanismState) -> MechanismState:
        borne = effort(motion)
        crank = motion.crank
        # A user-defined effect between the two may have made another crank state, without play.
        if not borne.efforts or not isinstance(crank, CrankBehindPlay) or not crank.free_motors:
            return borne
        return borne._replace(
            efforts=tuple(
                of_all if free is None else inertia * free
                for of_all, free in zip(borne.efforts, crank.free_motors, strict=True)
            )
        )

    return effort_behind_play
