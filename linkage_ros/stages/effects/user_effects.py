# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
User-defined effects: modules that a scene names by their dotted names, ``my_package.my_effect``.

Python finds them like any module, on ``PYTHONPATH`` or in a sourced workspace. They have the same
contents as the effects of this package (see `linkage_ros.stages.effects.stage`), and

``AFTER``
    The effect of this package after which it acts, whether or not the scene names that one.
    Several after the same one act in alphabetical order.
``NEEDS``
    Optional: the quantities that it starts from, of `QUANTITIES`; they are then computed. A
    ``stage`` always starts from `velocity`.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from hashlib import sha256
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
import sys
from types import ModuleType
from typing import Any

from linkage_ros.description import declared_fields
from linkage_ros.errors import DefinitionError, did_you_mean, list_names, quote
from linkage_ros.stages.effects.stage import EFFECTS, NEEDS

QUANTITIES = ('velocity', 'acceleration', 'effort', 'pin_forces')
"""Quantities that an effect can request."""

FUNCTIONS = ('alter', 'drive_stage', 'stage', 'sensor', 'writer')
"""Functions of which it has at least one."""

_LAST_FOR_SENSORS = 'dropout'
_IDENTIFYING_DIGITS = 16
_ORDER = tuple(EFFECTS)


@cache
def user_module(name: str) -> ModuleType:
    """
    Import a user-defined effect, and check it.

    Parameters
    ----------
    name
        The dotted name of its module.

    Raises
    ------
    DefinitionError
        If there is no such module, or it is not an effect; ``where`` is its name.

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
    _check_module(name, module)
    return module


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


def user_needs(name: str) -> tuple[str, ...]:
    """Return the quantities that a user-defined effect starts from, and those they start from."""
    module = user_module(name)
    own = (*(('velocity',) if hasattr(module, 'stage') else ()), *getattr(module, 'NEEDS', ()))
    needs = {need for one in own for need in (*NEEDS.get(one, ()), one)}
    return tuple(effect for effect in QUANTITIES if effect in needs)


def with_user_effects(named: Iterable[str]) -> tuple[str, ...]:
    """Return effects in the order in which they act."""
    return tuple(sorted(named, key=_order_key))


def effect_version(name: str) -> str:
    """
    Return which version of a user-defined effect a run uses.

    It is the ``__version__`` of the module or its package, if any, and the first digits of the
    SHA-256 of the module's file.
    """
    module = user_module(name)
    package = sys.modules[name.partition('.')[0]]
    version = getattr(module, '__version__', getattr(package, '__version__', ''))
    file = getattr(module, '__file__', None)
    code = sha256(Path(file).read_bytes()).hexdigest() if file else ''
    said = (str(version), code and f'sha256 {code[:_IDENTIFYING_DIGITS]}')
    return ', '.join(filter(None, said)) or 'unknown'


def _order_key(name: str) -> tuple[int, str]:
    if name in EFFECTS:
        return _ORDER.index(name), ''
    return _ORDER.index(user_module(name).AFTER), name


def _failure(name: str, error: BaseException) -> DefinitionError:
    return DefinitionError(
        name,
        f'cannot be imported: {type(error).__name__}: {quote(str(error))}',
        f'correct it; `python3 -c "import {name}"` says where',
    )


def _check_module(name: str, module: ModuleType) -> None:
    """Refuse a module that is not an effect."""
    parameters: Any = getattr(module, 'PARAMETERS', None)
    try:
        known = isinstance(parameters, type) and declared_fields(parameters) is not None
    except (TypeError, KeyError):
        known = False
    if not known:
        raise DefinitionError(
            name,
            'has no PARAMETERS',
            'name a frozen dataclass whose fields linkage_ros.description.parameters has made',
        )
    own = [function for function in FUNCTIONS if hasattr(module, function)]
    if not own:
        raise DefinitionError(name, 'does nothing', f'define one of {list_names(FUNCTIONS)}')
    topics = [key for key in ('TOPIC', 'MESSAGE', 'writer') if hasattr(module, key)]
    if topics and len(topics) < 3:
        raise DefinitionError(
            name,
            f'has {list_names(topics, " and ")} alone',
            'TOPIC, MESSAGE and writer(parameters, context) go together',
        )
    if topics and not str(module.TOPIC).startswith('~/'):
        raise DefinitionError(
            name, f'has the TOPIC {quote(module.TOPIC)}', "write one of the node's own: '~/name'"
        )
    _check_order(name, module)


def _check_order(name: str, module: ModuleType) -> None:
    """Refuse an effect that acts before one that it starts from, or after the last sensor."""
    after = getattr(module, 'AFTER', None)
    if after not in EFFECTS:
        known = f'name one of {list_names(EFFECTS)}'
        said = f'AFTER is {quote(after)}' if after is not None else 'does not say AFTER which'
        remedy = did_you_mean(after, EFFECTS, known) if isinstance(after, str) else known
        raise DefinitionError(name, f'{said}: that is not an effect', remedy)
    needs = getattr(module, 'NEEDS', ())
    for need in needs:
        if need not in QUANTITIES:
            raise DefinitionError(
                name, f'NEEDS {quote(need)}', f'name some of {list_names(QUANTITIES)}'
            )
    last = max((_ORDER.index(need) for need in needs), default=0)
    if last > _ORDER.index(after):
        raise DefinitionError(
            name, f'starts from {_ORDER[last]} and acts before it', f'set AFTER = {_ORDER[last]!r}'
        )
    if hasattr(module, 'sensor') and _ORDER.index(after) > _ORDER.index(_LAST_FOR_SENSORS):
        raise DefinitionError(
            name,
            f'AFTER is {after!r}, and delay is the last sensor',
            f'set AFTER = {_LAST_FOR_SENSORS!r}',
        )
