# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A linkage with masses under gravity, and its motion through the effects that use forces."""

from linkage_ros.dynamics import Loads
from linkage_ros.kinematics import Closure
from linkage_ros.stages.drives import Context, CrankState
from linkage_ros.stages.effects import effect_class, EFFECTS, MechanismState, VelocityEffect

from ...support.scenes import four_bar_text

GRAVITY = 9.81


def context(of, friction=None, gravity=(0.0, -GRAVITY), drive_inertia=0.0):
    loads = Loads(gravity=gravity, drive_inertia=drive_inertia)
    return Context(Closure(of), 1000.0, True, 'seed', loads, friction)


def moved(within, crank, effects):
    """Return the motion that effects make of a crank's (value, rate, acceleration)."""
    state = CrankState(*((value,) for value in crank), 0)
    motion = VelocityEffect().stage(within)(
        MechanismState(state, within.closure.position(crank[0]), None, None, (), (), ())
    )
    for effect in EFFECTS:
        if effect == 'acceleration' or effect in effects:
            motion = effect_class(effect)(*effects.get(effect, ())).stage(within)(motion)
    return motion


SINGULAR = four_bar_text(1, 1, 1, 3, [(1, 0.5, 0.1)] * 3)
"""A four-bar that is stretched out, at a toggle, where its crank is at 0."""
