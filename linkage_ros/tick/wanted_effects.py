# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The effects that a linkage of a scene computes, and the combinations that are refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from linkage_ros.description import SceneLinkage
from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.stages.effects import (
    Effect,
    effect_class,
    force_effects,
    ForceEffect,
    in_order,
    needed_effects,
)

_Base = TypeVar('_Base', bound=Effect)


@dataclass(frozen=True)
class WantedEffects:
    """The effects that a linkage computes, with their parameters."""

    named: frozenset[str]  # Those that the scene names, and those published with them
    effects: Mapping[str, Effect]  # All that are computed, by name, in physical order
    computes_forces: bool  # Whether an effect or the drive asks for forces
    moves_by_rates: bool  # Whether the drive moves the crank on by its rates between samples

    def of_kind(self, base: type[_Base]) -> dict[str, _Base]:
        """Return the effects that act in the place of a base, by name, in physical order."""
        return {name: effect for name, effect in self.effects.items() if isinstance(effect, base)}


def choose_effects(scene_linkage: SceneLinkage) -> WantedEffects:
    """Return the effects of a linkage, and those that they start from."""
    _refuse_not_imported(scene_linkage)
    _, drive = scene_linkage.drive
    effects = dict(scene_linkage.effects)
    for effect in scene_linkage.effects.values():
        for also in effect.publishes_with:
            effects.setdefault(also, effect_class(also)())
    named = frozenset(effects)
    moves_by_rates = drive.moves_by_rates
    needs = {
        need
        for effect in effects.values()
        for need in effect.needs_here(named, moves_by_rates=moves_by_rates)
    }
    for name in needs.union(*map(needed_effects, needs)):
        effects.setdefault(name, effect_class(name)())
    computes_forces = drive.gives_torque or any(e.computes_forces for e in effects.values())
    _refuse_idle(scene_linkage, computes_forces)
    ordered = {name: effects[name] for name in in_order(effects)}
    return WantedEffects(named, ordered, computes_forces, moves_by_rates)


def _refuse_not_imported(scene_linkage: SceneLinkage) -> None:
    if scene_linkage.not_imported:
        from linkage_ros.stages.effects import found_in

        name = scene_linkage.not_imported[0]
        raise DefinitionError(
            f'effects.{name}',
            f'names a module, and what a bag names is not imported unasked; the name leads to '
            f'{found_in(name)} here',
            '--trust-effects imports it',
        )


def _refuse_idle(scene_linkage: SceneLinkage, forced: bool) -> None:
    """Refuse an effect that has nothing to act on."""
    # With several linkages, one without forces may share an effect that another one needs.
    section = scene_linkage.content
    idle = ['loads'] if scene_linkage.loads and 'loads' in section else []
    if 'effects' in section:
        effects = scene_linkage.effects.items()
        idle += [f'effects.{name}' for name, each in effects if isinstance(each, ForceEffect)]
    if idle and not forced:
        raise DefinitionError(
            idle[0],
            'acts on nothing here: no effect and no drive asks for forces',
            f'leave it out, drive by torque, or name one of {list_names(force_effects())}',
        )
