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
said to meet a need does. Prices add up, too; one within noise costs nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

from linkage_ros.tools.study.budget import Budget, Knob, NeedAnswer, Setting
from linkage_ros.tools.study.budget_text import error_text, share_text

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
        cost = budget.tick.core_share + sum(_added_cost(budget, *pair) for pair in pairs)
        changed = sum(setting is not knob.own_setting for knob, setting in pairs)
        error = sum(setting.error.worst for setting in settings)
        choices.append(_SettingChoice(cost, changed, error, settings))
    best: list[_SettingChoice] = []
    for choice in sorted(choices, key=lambda one: one[:3]):
        if not best or choice.error < best[-1].error:
            best.append(choice)
    return best


def _error_knobs(budget: Budget) -> list[Knob]:
    return [knob for knob in budget.knobs if not knob.is_deliberate]


def _candidate_settings(budget: Budget, knob: Knob) -> Iterator[Setting]:
    """Yield the settings of a knob that can be asked for and that no other one beats."""
    asked = [each for each in knob.settings if each is knob.own_setting or each.instruction]
    least = float('inf')
    ranked = sorted(
        asked,
        key=lambda s: (_added_cost(budget, knob, s), s is not knob.own_setting, s.error.worst),
    )
    for setting in ranked:
        if setting is knob.own_setting or setting.error.worst < least:
            least = min(least, setting.error.worst)
            yield setting


def _added_cost(budget: Budget, knob: Knob, setting: Setting) -> float:
    """Return what a setting takes of a core more than the scene's own; 0 within noise."""
    price = setting.price
    if setting is knob.own_setting or price is None:
        return 0.0
    if price.is_noise and price.rate == budget.rate:
        return 0.0
    return budget.core_of(knob, setting) - budget.tick.core_share


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
