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
Newton's method on the loops of each dyad in turn, in the place of their closed form.

A dyad's two unknowns p and q, angles or slides, close one loop of vectors, F(p, q) = 0, which is
two real equations. With × for the z component of the cross product::

    F_p·δp + F_q·δq = −F      δp = F_q × F/(F_p × F_q)      δq = F × F_p/(F_p × F_q)

until both corrections are below the tolerance, in [rad] or [m]: the error that is left is of the
size of their square. Rates and accelerations solve the same for what F changes by with p and q
held. The sign of F_p × F_q is that of the assembly. It has to be the one that the closed form has
about there; where it is not, near a toggle or a change point, where the method does not converge,
and where the loops do not close, the state is that of the closed form. So the hard cases stay as
they are. Groups that no dyad covers are iterated in any case, here to the tolerance.

It starts from the closed form at the nearest of `knots`, carried forward by the rates there: a
state depends on the inputs alone. It may also start from its last state (``warm``); then a state
depends, within the tolerance, on those before it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import copysign
from typing import Any, TYPE_CHECKING

from linkage_ros.kinematics.closure import Acceleration, Closure, Position, Velocity
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.kinematics.places import FixedPoint, PointOnLink, PointOnRail, Turned
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import PLACED, State, Step
from linkage_ros.kinematics.structure import Dyad, Iterated
from linkage_ros.kinematics.survey import usual_inputs
from linkage_ros.parameters import number
from linkage_ros.solvers.knots import Knots
from linkage_ros.solvers.loops import LoopFinder
from linkage_ros.solvers.newton_dyad import NewtonDyad
from linkage_ros.solvers.solver import Solver

if TYPE_CHECKING:
    from linkage_ros.kinematics.batch import Batch
    from numpy.typing import ArrayLike

PLACING = (FixedPoint, PointOnLink, PointOnRail)
"""Steps that place a pin and find no coordinate."""


@dataclass(frozen=True, slots=True)
class NewtonParameters:
    """Newton's method on the loops of each dyad."""

    tolerance: float = number(
        'what the last correction is below', unit='rad or m', least=1e-15, most=1e-2
    )


PARAMETERS = NewtonParameters


def build(parameters: NewtonParameters, linkage: Linkage) -> NewtonClosure:
    """Build the closure."""
    return NewtonClosure(linkage, parameters.tolerance)


_CLOSED = Status.CLOSED


class _Found(list[Any]):
    """Poses of a state that Newton's method has found: of steps that are not its own."""


_NO_POSES = _Found()


class NewtonClosure(Solver):
    """
    A linkage whose dyads Newton's method closes.

    Parameters
    ----------
    linkage
        The linkage.
    tolerance
        What the last corrections are below, in [rad] or [m].
    warm
        Where to start: from the last state; if false, from the pose of the file each time; if not
        said, from the nearest knot, so that a state depends on its inputs alone.

    Attributes
    ----------
    exact_states
        How many states were left to the closed form so far.

    """

    by_steps = False

    def __init__(self, linkage: Linkage, tolerance: float, warm: bool | None = None) -> None:
        super().__init__(Closure(linkage))
        self.tolerance = tolerance
        self.exact_states = 0
        self._warm = warm is True
        self._last: list[float] | None = None
        self._plan, self._iterates = self._planned(tolerance)
        self._dyads = [one for one in self._plan if isinstance(one, NewtonDyad)]
        self._knots = Knots(self.closed, self._orientations, repeats=not self._iterates)
        self._pose: list[float] | None = None
        if warm is False:
            pose = self.closed.position(*usual_inputs(self.closed))
            self._pose = pose.state.coordinates

    def position(self, *inputs: float) -> Position:
        """
        Close the loops.

        Parameters
        ----------
        *inputs
            Values of the driven joints, in [rad] or [m], finite.

        """
        x = self._coordinates('inputs', inputs)
        if x is None:
            return self._exact(inputs)
        knot, offsets = self._knots.near(x[1:])
        if knot is None:
            return self._exact(inputs)
        start = self._pose or self._last
        if start is None:
            start = knot.coordinates
            for offset, slopes in zip(offsets, knot.slopes, strict=True):
                start = [
                    value + offset * slope for value, slope in zip(start, slopes, strict=True)
                ]
        signs = iter(knot.signs)
        pins: list[complex] = []
        state = State(x, pins)
        poses = _Found() if self._iterates else _NO_POSES
        for part in self._plan:
            if isinstance(part, NewtonDyad):
                k = len(x)
                if not part.close(x, pins, start[k], start[k + 1], next(signs)):
                    return self._exact(inputs)
                continue
            pose = part.close(state)
            if pose.status is not _CLOSED:
                return self._exact(inputs)
            if self._iterates:
                poses.append(pose)
        if self._warm:
            self._last = x.copy()
        joints: tuple[float, ...] = ()
        for i, j, factor, constant in self._terms:
            joints += (factor * (x[i] - x[j]) + constant,)
        return Position(_CLOSED, 0.0, joints, state, poses, self)

    def velocity(self, position: Position, *rates: float) -> Velocity:
        """
        Return the rates at a closed position; at a toggle there are none.

        Parameters
        ----------
        position
            A closed position.
        *rates
            Of the driven joints, in [rad/s] or [m/s].

        """
        state, poses = position.state, position.poses
        if not isinstance(poses, _Found):
            return self.closed.velocity(position, *rates)
        v = self._coordinates('rates', rates)
        if v is None:
            return self.closed.velocity(position, *rates)
        x, pins = state
        speeds = State(v, [])
        others = iter(poses)
        found = []
        for part in self._plan:
            if isinstance(part, NewtonDyad):
                part.rates(x, pins, v, speeds.pins)
            else:
                found.append(part.rates(next(others, PLACED), state, speeds))
        return Velocity(self._joints(v), speeds, found, self)

    def acceleration(
        self, position: Position, velocity: Velocity, *accelerations: float
    ) -> Acceleration:
        """
        Return the accelerations at a closed position.

        Parameters
        ----------
        position, velocity
            As this closure has found them.
        *accelerations
            Of the driven joints, in [rad/s²] or [m/s²].

        """
        state, poses = position.state, position.poses
        if not isinstance(poses, _Found):
            return self.closed.acceleration(position, velocity, *accelerations)
        a = self._coordinates('accelerations', accelerations)
        if a is None:
            return self.closed.acceleration(position, velocity, *accelerations)
        speeds, rates = velocity.state, velocity.rates
        changes = State(a, [])
        others, moving = iter(poses), iter(rates)
        for part in self._plan:
            if isinstance(part, NewtonDyad):
                part.accelerations(state.coordinates, speeds.coordinates, a, changes.pins)
            else:
                pose, rate = next(others, PLACED), next(moving)
                part.accelerations(pose, rate, state, speeds, changes)
        return Acceleration(self._joints(a), changes, self)

    def solve(
        self,
        *inputs: ArrayLike,
        rates: Any = None,
        accelerations: Any = None,
        derivatives: int = 2,
        out: Batch | None = None,
    ) -> Batch:
        """Solve many states, one after the other; as `Closure.solve` says."""
        from linkage_ros.solvers.one_by_one import solve_one_by_one  # local import: no tick asks

        return solve_one_by_one(self, inputs, rates, accelerations, derivatives, out)

    def placed(self, position: Position) -> Position:
        """Return a position that knows angles, slides and pins of all links."""
        if not isinstance(position.poses, _Found):
            return position
        if self._iterates:
            return position
        state = State(position.state.coordinates, [])
        for step in self.steps:
            if isinstance(step, PLACING):
                step.close(state)
        return replace(position, state=state)

    def _exact(self, inputs: tuple[float, ...]) -> Position:
        """Return the state in closed form, from which the next one starts."""
        self.exact_states += 1
        position = self.closed.position(*inputs)
        if self._warm and position.status is _CLOSED:
            self._last = position.state.coordinates
        return position

    def _planned(self, tolerance: float) -> tuple[tuple[NewtonDyad | Step, ...], bool]:
        """Return the dyads and the other steps, in order, and whether something is iterated."""
        finder = LoopFinder(self.linkage, self.structure, self._known)
        loops = iter(finder.find())
        groups = self.structure.groups
        iterates = any(isinstance(group, Iterated) for group in groups)
        plan: list[NewtonDyad | Step] = []
        for step, group in zip(self.steps, self.step_groups, strict=True):
            if isinstance(step, PLACING):
                # Where nothing is iterated, no loop asks for a pin.
                if iterates:
                    plan.append(step)
            elif isinstance(step, Turned):
                plan.append(step)
            elif isinstance(groups[group], Dyad):
                plan.append(NewtonDyad(next(loops), tolerance, tolerance / self.scale))
            else:
                from linkage_ros.solvers.looser import looser  # local import: it loads numpy

                next(loops)
                plan.append(looser(step, tolerance))
        return tuple(plan), iterates

    def _orientations(self, x: list[float]) -> tuple[float, ...]:
        return tuple(copysign(1.0, dyad.orientation(x)) for dyad in self._dyads)
