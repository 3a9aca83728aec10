# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The effects that a linkage of a scene computes, and the combinations that are refused."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass
from typing import Any

from linkage_ros.description import SceneLinkage
from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects import (
    Effect,
    effect_of,
    FORCE_EFFECTS,
    in_order,
    module_of,
    needed_effects,
    PUBLISHED_WITH,
)


@dataclass(frozen=True)
class WantedEffects:
    """The effects that a linkage computes, with their parameters."""

    named: frozenset[str]  # Those that the scene names, and those published with them
    effects: list[Effect]  # All that are computed, in physical order
    parameters: Mapping[str, Any]  # Of each of these, by its name
    computes_forces: bool  # Whether an effect or the drive asks for forces
    moves_by_rates: bool  # Whether the drive moves the crank on by its rates between samples

    def build(
        self, part: str, context: Context, names: Container[str] | None = None
    ) -> dict[str, Any]:
        """Build one part of each effect (or of those named) that has it, in physical order."""
        return {
            effect.name: builder(self.parameters[effect.name], context)
            for effect in self.effects
            if (builder := getattr(effect, part)) is not None
            and (names is None or effect.name in names)
        }


def choose_effects(scene_linkage: SceneLinkage) -> WantedEffects:
    """Return the effects of a linkage, and those that they start from."""
    _refuse_not_imported(scene_linkage)
    drive, drive_parameters = scene_linkage.drive
    named = frozenset(scene_linkage.effects)
    named |= {also for effect in named for also in PUBLISHED_WITH.get(effect, ())}
    moves_by_rates = getattr(drive_parameters, 'carry_forward', True)
    starting = named - _rate_free_effects(scene_linkage, named, moves_by_rates)
    computed = named | {need for effect in starting for need in needed_effects(effect)}
    effects = [effect_of(name) for name in in_order(computed)]
    computes_forces = drive == 'torque' or not computed.isdisjoint(FORCE_EFFECTS)
    _refuse_idle(scene_linkage, computes_forces)
    parameters = {
        effect.name: scene_linkage.effects.get(effect.name) or effect.parameters()
        for effect in effects
    }
    return WantedEffects(named, effects, parameters, computes_forces, moves_by_rates)


def _rate_free_effects(
    scene_linkage: SceneLinkage, named: frozenset[str], moves_by_rates: bool
) -> set[str]:
    """Return 'jitter' and 'delay' where this scene lets them work without the crank's rates."""
    mixing = {'jitter', 'delay'} & named
    if moves_by_rates and 'delay' in mixing:
        delay = module_of('delay')
        parameters = scene_linkage.effects.get('delay') or delay.PARAMETERS()
        return set() if delay.interpolates_readings(parameters, named) else {'delay'}
    return set() if moves_by_rates else mixing


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
    for given, key in (
        (scene_linkage.loads and 'loads' in section, 'loads'),
        ('friction' in scene_linkage.effects and 'effects' in section, 'effects.friction'),
    ):
        if given and not forced:
            raise DefinitionError(
                key,
                'acts on nothing here: no effect and no drive asks for forces',
                f'leave it out, drive by torque, or name one of {list_names(FORCE_EFFECTS)}',
            )
