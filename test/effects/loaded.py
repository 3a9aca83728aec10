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


"""A linkage with masses under gravity, and its motion through the effects that use forces."""

from __future__ import annotations

from importlib import import_module

from linkage_ros.drives.drive import Context, CrankState
from linkage_ros.dynamics.loads import Loads
from linkage_ros.effects import velocity
from linkage_ros.effects.stage import EFFECTS, MechanismState
from linkage_ros.kinematics.closure import Closure

GRAVITY = 9.81


def context(of, friction=None, gravity=(0.0, -GRAVITY), drive_inertia=0.0):
    loads = Loads(gravity=gravity, drive_inertia=drive_inertia)
    return Context(Closure(of), 1000.0, True, 'seed', loads, friction)


def parameters(effect, *given):
    return import_module(EFFECTS[effect]).PARAMETERS(*given)


def moved(within, crank, effects):
    """
    Return the motion that leaves the stages of some effects.

    Parameters
    ----------
    within
        A context.
    crank
        Angle or slide of the input, its rate and its acceleration.
    effects
        For each effect the parameters that it is given.

    """
    state = CrankState(*((value,) for value in crank), 0)
    motion = velocity.stage(velocity.PARAMETERS(), within)(
        MechanismState(state, within.closure.position(crank[0]), None, None, (), (), ())
    )
    for effect in EFFECTS:
        if effect == 'acceleration' or effect in effects:
            module = import_module(EFFECTS[effect])
            given = parameters(effect, *effects.get(effect, ()))
            motion = module.stage(given, within)(motion)
    return motion


SINGULAR = """
links:
  ground: {O2: [0, 0], O4: [3, 0]}
  crank: {O2: [0, 0], A: [1, 0]}
  coupler: {A: [0, 0], B: [1, 0]}
  rocker: {O4: [0, 0], B: [1, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: left}
joints: {rocker_joint: {parent: ground, child: rocker}}
masses:
  crank: {mass: 1, center: [0.5, 0], inertia: 0.1}
  coupler: {mass: 1, center: [0.5, 0], inertia: 0.1}
  rocker: {mass: 1, center: [0.5, 0], inertia: 0.1}
"""
"""A four-bar that is stretched out, at a toggle, where its crank is at 0."""
