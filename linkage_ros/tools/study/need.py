# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The cheapest settings whose errors together do not exceed a need.

Errors of different sources are added at their worst: all at once and in one direction. So what is
said to meet a need does. Prices add up, too; one within noise costs nothing. The answer is also
the scene's file with other keys, to be written into any folder.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
import os
from pathlib import Path
from typing import Any, NamedTuple

from linkage_ros.description import (
    apply_settings,
    kind_of,
    parse_yaml,
    read_yaml,
    Scene,
    SCENE_FILE,
)
from linkage_ros.errors import FileError
from linkage_ros.resources import linkage_names, linkage_of_scene, named_file
from linkage_ros.tools.study.budget import Budget, Knob, NeedAnswer, Setting
from linkage_ros.tools.study.budget_text import added_core, error_text, share_text
from linkage_ros.tools.study.prices import Change, settings_of

_ROUNDED = 1.0 + 1e-9


class _SettingChoice(NamedTuple):
    """One setting for each knob."""

    cost: float  # Share of a core, 0 to 1
    changed: int  # Number of knobs that are not as in the scene
    error: float  # Sum of the worst errors, in [rad]
    settings: tuple[Setting, ...]


def answer_need(budget: Budget, need: float) -> NeedAnswer:
    """Return the cheapest settings that meet a need, in [rad], or what stands in the way."""
    choices = _best_choices(budget)
    good = [choice for choice in choices if choice.error <= need * _ROUNDED]
    if good:
        return _met_answer(budget, min(good), f'for {error_text(need)} rad: ')
    return _unmet_answer(budget, choices, f'for {error_text(need)} rad: ')


def answers_of(budget: Budget) -> list[NeedAnswer]:
    """
    Return the answers to all needs that differ, from the greatest error to the least.

    The last one is to a need that nothing meets. There are none if no errors were measured.
    """
    if not _error_knobs(budget):
        return []
    choices = _best_choices(budget)
    return [
        *(_met_answer(budget, choice, '') for choice in choices),
        _unmet_answer(budget, choices, ''),
    ]


def _best_choices(budget: Budget) -> list[_SettingChoice]:
    """Return the choices that no other one beats in both error and cost, the cheapest first."""
    knobs = _error_knobs(budget)
    choices = []
    for settings in product(*(_candidate_settings(budget, knob) for knob in knobs)):
        pairs = [*zip(knobs, settings, strict=True)]
        cost = budget.tick.core_share + sum(added_core(budget, *pair) for pair in pairs)
        changed = sum(setting is not knob.own_setting for knob, setting in pairs)
        error = sum(setting.error.worst for setting in settings)
        choices.append(_SettingChoice(cost, changed, error, settings))
    best: list[_SettingChoice] = []
    for choice in sorted(choices, key=lambda choice: choice[:3]):
        if not best or choice.error < best[-1].error:
            best.append(choice)
    return best


def _error_knobs(budget: Budget) -> list[Knob]:
    return [knob for knob in budget.knobs if not knob.is_deliberate]


def _candidate_settings(budget: Budget, knob: Knob) -> Iterator[Setting]:
    """Yield the settings of a knob that can be asked for and that no other one beats."""
    asked = [
        setting for setting in knob.settings if setting is knob.own_setting or setting.instruction
    ]
    least = float('inf')
    ranked = sorted(
        asked,
        key=lambda s: (added_core(budget, knob, s), s is not knob.own_setting, s.error.worst),
    )
    for setting in ranked:
        if setting is knob.own_setting or setting.error.worst < least:
            least = min(least, setting.error.worst)
            yield setting


def _met_answer(budget: Budget, choice: _SettingChoice, before: str) -> NeedAnswer:
    """Return the answer with a choice."""
    changes: dict[str, object] = {}
    lines: list[str] = []
    for knob, setting in zip(_error_knobs(budget), choice.settings, strict=True):
        if setting is not knob.own_setting:
            changes |= dict(setting.changes or ())
            lines.append(setting.instruction)
    write = '; '.join(dict.fromkeys(lines)) or 'nothing is to be written'
    more = choice.cost - budget.tick.core_share
    cost = 'no more cost'
    if more:
        cost = f'{"+" if more > 0.0 else ""}{share_text(more)} of a core'
    text = f'{before}{write} ({error_text(choice.error)} rad off at worst, {cost})'
    return NeedAnswer(True, choice.error, [*changes.items()], text)


def _unmet_answer(budget: Budget, choices: Sequence[_SettingChoice], before: str) -> NeedAnswer:
    """Return what stands in the way of less than what the best choice leaves."""
    if not _error_knobs(budget):
        return NeedAnswer(False, float('inf'), [], f'{before}no errors were measured')
    best = choices[-1]
    pairs = zip(_error_knobs(budget), best.settings, strict=True)
    knob, setting = max(pairs, key=lambda pair: pair[1].error.worst)
    text = (
        f'{before}no measured setting reaches it; {knob.name} prevents it: '
        f'{error_text(setting.error.worst)} rad with {setting.label}'
    )
    return NeedAnswer(False, best.error, [], text)


def tune_scene(
    scene: Scene, named: str | os.PathLike[str], changes: Sequence[Change], folder: Path
) -> bytes:
    """
    Return the file of a scene with changed keys, to be written into a folder.

    The scene has what was set for it already; ``named`` is what it was loaded from: a scene file,
    a linkage file, or a name. Paths of linkages and bags lead from the folder.
    """
    content = parse_yaml(scene.files[SCENE_FILE], scene.name)
    scene_mapping: Any = content.mapping
    file = named_file(named, 'scenes', 'linkages')
    if kind_of(read_yaml(file)[0]) == 'linkage':
        scene_mapping['linkage'] = _path_from(folder, file)
    else:
        for within, key in _path_entries(scene_mapping):
            path = file.parent / within[key]
            if key == 'linkage':
                path = linkage_of_scene(within[key], file.parent)
            within[key] = _path_from(folder, path)
    return apply_settings(content, settings_of(changes))


def _path_entries(scene: Any) -> Iterator[tuple[Any, str]]:
    """Yield the mappings of a scene that hold the path of a file, with its key."""
    entries = scene.get('linkages') or []
    for entry in (scene, *(entries if isinstance(entries, list) else entries.values())):
        if 'linkage' in entry:
            yield entry, 'linkage'
        drive = entry.get('drive') or {}
        if 'bag' in drive:
            yield drive['bag'], 'file'


def _path_from(folder: Path, path: Path) -> str:
    """Return a path as a file in a folder names it; a linkage of the package by its name."""
    try:
        is_shipped = (
            path.stem in linkage_names()
            and path.resolve() == named_file(path.stem, 'linkages').resolve()
        )
    except FileError:
        is_shipped = False
    return path.stem if is_shipped else os.path.relpath(path, folder)
