# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
User-defined effects: modules that a scene names by their dotted names, ``my_package.my_effect``.

Python finds them like any module, on ``PYTHONPATH`` or in a sourced workspace. Such a module
defines one class that derives from the bases of `linkage_ros.stages.effects.effect`, as the
effects of this package do. Its ``after`` names the effect of this package after which it acts,
whether or not the scene names that one; several after the same one act in alphabetical order.
"""

from __future__ import annotations

from functools import cache
from hashlib import sha256
from importlib import import_module
from importlib.util import find_spec
from inspect import isabstract
from pathlib import Path
import sys
from types import ModuleType

from linkage_ros.description import declared_fields, is_required
from linkage_ros.errors import DefinitionError, did_you_mean, list_names, quote
from linkage_ros.stages.effects.effect import (
    BASES,
    Effect,
    EFFECTS,
    MechanismEffect,
    MessageEffect,
    SensorEffect,
)
from linkage_ros.stages.plugin import load_class

_LAST_FOR_SENSORS = 'dropout'
_IDENTIFYING_DIGITS = 16
_ORDER = tuple(EFFECTS)


@cache
def user_effect(name: str) -> type[Effect]:
    """
    Import a user-defined effect, and check it.

    Parameters
    ----------
    name
        The dotted name of its module.

    Raises
    ------
    DefinitionError
        If there is no such module, or it has no effect; ``where`` is its name.

    """
    if not all(part.isidentifier() for part in name.split('.')):
        raise DefinitionError(name, 'is not a dotted module name', 'write package.module')
    try:
        module = import_module(name)
    except ModuleNotFoundError as error:
        if not f'{name}.'.startswith(f'{error.name}.'):
            raise _failure(name, error) from None
        raise DefinitionError(
            name,
            f'there is no module {error.name}',
            'add its folder to PYTHONPATH, or source its workspace',
        ) from None
    except (Exception, SystemExit) as error:  # noqa: BLE001 (a module of others may do anything)
        raise _failure(name, error) from None
    effect = _find_class(name, module)
    _check_class(name, effect)
    _check_order(name, effect)
    return effect


def found_in(name: str) -> str:
    """Return where Python would find a user-defined effect, without running it."""
    package = name.partition('.')[0]
    try:
        # The package alone: searching for a module within it would run the package.
        spec = find_spec(package)
    except (ImportError, ValueError):
        spec = None
    if spec is None:
        return 'no module'
    return quote(spec.origin or next(iter(spec.submodule_search_locations or ()), package))


def effect_version(name: str) -> str:
    """
    Return which version of a user-defined effect a run uses.

    It is the ``__version__`` of the module or its package, if any, and the first digits of the
    SHA-256 of the module's file.
    """
    module = sys.modules[user_effect(name).__module__]
    package = sys.modules[name.partition('.')[0]]
    version = getattr(module, '__version__', getattr(package, '__version__', ''))
    file = getattr(module, '__file__', None)
    code = sha256(Path(file).read_bytes()).hexdigest() if file else ''
    said = (str(version), code and f'sha256 {code[:_IDENTIFYING_DIGITS]}')
    return ', '.join(filter(None, said)) or 'unknown'


def _failure(name: str, error: BaseException) -> DefinitionError:
    return DefinitionError(
        name,
        f'cannot be imported: {type(error).__name__}: {quote(str(error))}',
        f'correct it; `python3 -c "import {name}"` says where',
    )


def _find_class(name: str, module: ModuleType) -> type[Effect]:
    """Return the effect that a module defines."""
    defined = [
        value
        for key, value in vars(module).items()
        if isinstance(value, type)
        and issubclass(value, Effect)
        and value.__module__ == name
        and not key.startswith('_')
    ]
    if len(defined) == 1:
        return defined[0]
    bases = list_names([base.__name__ for base in BASES])
    if not defined:
        raise DefinitionError(name, 'defines no effect', f'derive a class from one of {bases}')
    several = list_names([effect.__name__ for effect in defined], ' and ')
    raise DefinitionError(
        name, f'defines the effects {several}', 'leave one, and give each of the others a module'
    )


def _check_class(name: str, effect: type[Effect]) -> None:
    """Refuse a class that is not whole."""
    if isabstract(effect) or not issubclass(effect, BASES):
        missing = list_names(sorted(effect.__abstractmethods__))
        bases = list_names([base.__name__ for base in BASES])
        raise DefinitionError(
            name,
            f'{effect.__name__} does nothing',
            f'define {missing}' if missing else f'derive it from one of {bases}',
        )
    try:
        known = '__dataclass_fields__' in vars(effect) and declared_fields(effect) is not None
    except KeyError:
        known = False
    if not known:
        raise DefinitionError(
            name,
            f'{effect.__name__} is not a dataclass of parameters',
            'write @dataclass(frozen=True, slots=True) before it, and make its fields by the '
            'functions of linkage_ros.description.parameters',
        )
    if not issubclass(effect, MessageEffect):
        return
    if not effect.topic or not effect.message:
        raise DefinitionError(
            name,
            f'{effect.__name__} publishes a message without topic or type',
            "write topic = '~/name' and message = 'package/msg/Type'",
        )
    if not effect.topic.startswith('~/'):
        raise DefinitionError(
            name, f'has the topic {quote(effect.topic)}', "write one of the node's own: '~/name'"
        )


def _check_order(name: str, effect: type[Effect]) -> None:
    """Refuse an effect that acts before one that it starts from, or after the last sensor."""
    after, needs = effect.after, effect.needs
    if after not in EFFECTS:
        known = f'name one of {list_names(EFFECTS)}'
        said = f'after is {quote(after)}' if after else 'does not say after which'
        remedy = did_you_mean(after, EFFECTS, known) if isinstance(after, str) else known
        raise DefinitionError(name, f'{said}: that is not an effect', remedy)
    for need in needs:
        if need not in EFFECTS or not _is_quantity(need):
            quantities = [effect for effect in EFFECTS if _is_quantity(effect)]
            raise DefinitionError(
                name, f'needs {quote(need)}', f'name some of {list_names(quantities)}'
            )
    last = max((_ORDER.index(need) for need in needs), default=0)
    if last > _ORDER.index(after):
        raise DefinitionError(
            name, f'starts from {_ORDER[last]} and acts before it', f'set after = {_ORDER[last]!r}'
        )
    if issubclass(effect, SensorEffect) and _ORDER.index(after) > _ORDER.index(_LAST_FOR_SENSORS):
        raise DefinitionError(
            name,
            f'after is {after!r}, and delay is the last sensor',
            f'set after = {_LAST_FOR_SENSORS!r}',
        )


def _is_quantity(name: str) -> bool:
    """Return whether an effect computes a quantity, without any parameter that a scene gives."""
    effect = load_class(EFFECTS[name])
    return issubclass(effect, MechanismEffect) and not any(
        is_required(entry) for entry, _ in declared_fields(effect)
    )
