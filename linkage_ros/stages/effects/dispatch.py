# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Effects by name: the package's own, and user-defined modules by their dotted names."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import Any, TYPE_CHECKING

from linkage_ros.stages.effects.stage import (
    DriveStage,
    EFFECTS,
    NEEDS,
    PUBLISHED_WITH,
    Sensor,
    Stage,
    Writer,
)

if TYPE_CHECKING:
    from linkage_ros.kinematics import Linkage


def module_of(effect: str) -> ModuleType:
    """Import an effect: one of this package, or a user-defined module by its dotted name."""
    if '.' not in effect:
        return import_module(EFFECTS[effect])
    from linkage_ros.stages.effects.user_effects import (
        user_module,  # local import: only where a scene has one
    )

    return user_module(effect)


def in_order(named: Collection[str]) -> tuple[str, ...]:
    """Return effects in the order in which they act."""
    if not any('.' in name for name in named):
        return tuple(name for name in EFFECTS if name in named)
    from linkage_ros.stages.effects.user_effects import with_user_effects  # local import: as above

    return with_user_effects(named)


def needed_effects(effect: str) -> tuple[str, ...]:
    """Return the effects that an effect starts from."""
    if '.' not in effect:
        return NEEDS.get(effect, ())
    from linkage_ros.stages.effects.user_effects import user_needs  # local import: as above

    return user_needs(effect)


def effect_dependencies(effect: str) -> tuple[str, ...]:
    """Return the effects that an effect adds to a scene."""
    return *needed_effects(effect), *PUBLISHED_WITH.get(effect, ())


def effects_requiring(name: str, named: Collection[str]) -> tuple[str, ...]:
    """Return the named effects that add another one to the scene."""
    own = [other for other in named if '.' in other or other in EFFECTS]
    return tuple(other for other in in_order(own) if name in effect_dependencies(other))


@dataclass(frozen=True, slots=True)
class Effect:
    """An effect: the contents of its module, with None or '' for optional ones that it lacks."""

    # Its name in a scene, and the type of its parameters.
    name: str
    parameters: Any
    # Its functions; see `linkage_ros.stages.effects.stage`.
    alter: Callable[..., Linkage] | None
    drive_stage: Callable[..., DriveStage] | None
    stage: Callable[..., Stage] | None
    sensor: Callable[..., Sensor] | None
    writer: Callable[..., Writer] | None
    # Topic and type of its own message.
    topic: str
    message: str
    of_reading: bool  # Whether that message is made of the reading alone


def effect_of(name: str) -> Effect:
    """Import an effect and return it."""
    module = module_of(name)
    return Effect(
        name,
        parameters=module.PARAMETERS,
        alter=getattr(module, 'alter', None),
        drive_stage=getattr(module, 'drive_stage', None),
        stage=getattr(module, 'stage', None),
        sensor=getattr(module, 'sensor', None),
        writer=getattr(module, 'writer', None),
        topic=getattr(module, 'TOPIC', ''),
        message=getattr(module, 'MESSAGE', ''),
        of_reading=getattr(module, 'OF_READING', False),
    )
