# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Effects by name: the package's own, and user-defined modules by their dotted names."""

from __future__ import annotations

from collections.abc import Collection

from linkage_ros.stages.effects.effect import Effect, EFFECTS
from linkage_ros.stages.plugin import load_class


def effect_class(name: str) -> type[Effect]:
    """Import an effect: one of this package, or a user-defined one by its dotted name."""
    if '.' not in name:
        return load_class(EFFECTS[name])
    from linkage_ros.stages.effects.user_effects import (
        user_effect,  # local import: only where a scene has one
    )

    return user_effect(name)


def in_order(named: Collection[str]) -> tuple[str, ...]:
    """Return effects in the order in which they act."""
    order = list(EFFECTS)
    return tuple(
        sorted(
            named,
            key=lambda name: (
                order.index(effect_class(name).after if '.' in name else name),
                name if '.' in name else '',
            ),
        )
    )


def needed_effects(effect: str) -> tuple[str, ...]:
    """Return the effects that an effect starts from, and those that these start from."""
    needs = effect_class(effect).needs
    return in_order({*needs, *(far for need in needs for far in needed_effects(need))})


def effects_requiring(name: str, named: Collection[str]) -> tuple[str, ...]:
    """Return the named effects that add another one to the scene."""
    own = [effect for effect in named if '.' in effect or effect in EFFECTS]
    return tuple(
        effect
        for effect in in_order(own)
        if name in (*needed_effects(effect), *effect_class(effect).publishes_with)
    )


def force_effects() -> tuple[str, ...]:
    """Return the effects of this package to which masses, loads and friction matter."""
    return tuple(name for name in EFFECTS if effect_class(name).needs_forces)
