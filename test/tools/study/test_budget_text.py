# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A budget as text: numbers that people read, the greatest error first, no price of noise."""

from __future__ import annotations

import json
from math import inf, isclose
from random import Random
import re

from linkage_ros.tools.study import (
    Budget,
    budget_json,
    budget_table,
    change_text,
    closing_lines,
    error_knobs,
    error_text,
    JointError,
    lead_lines,
    neighbours_of,
    NOISE,
    Price,
    price_text,
    rows_of,
    Setting,
    share_text,
    Spread,
    time_text,
    total_error,
)
import pytest

from .random_budgets import random_budgets
from .shown_budget import AGE, BUDGET, error, SOLVING, STEP

TEXTS = {
    0.0: '0', 2.14e-2: '0.021', 0.31: '0.31', 1.3: '1.3', 12.0: '12', 999.0: '1000',
    1.2e-3: '1.2e-3', 9.99e-3: '0.010', 3e-16: '3e-16', 9e-84: 'below 1e-20', inf: '∞',
    2.4e5: '2.4e5',
}  # fmt: skip


@pytest.mark.parametrize('value', TEXTS)
def test_error_texts_are_human_readable(value: float) -> None:
    assert error_text(value) == TEXTS[value]


def test_error_text_keeps_two_digits() -> None:
    random = Random(1)
    for _ in range(3000):
        value = 10.0 ** random.uniform(-20.0, 6.0)
        text = error_text(value)
        assert isclose(float(text), value, rel_tol=0.051), value
        assert re.fullmatch(r'\d(\.\d)?e-?\d+|\d+(\.\d+)?', text), value


@pytest.mark.parametrize(
    ('spread', 'text'),
    [
        ((6.0, 6.2, 6.4), '6.2 ± 0.2'),
        ((0.55, 0.6, 0.65), '0.60 ± 0.05'),
        ((565.0, 570.0, 595.0), '570 ± 15'),
        ((-34.0, -33.85, -33.0), '−33.9 ± 0.5'),
        ((2.0, 2.0, 2.0), '2.00'),
        ((0.0, 0.0, 0.0), '0.000'),
    ],
)
def test_time_text_has_the_digits_of_its_spread(
    spread: tuple[float, float, float], text: str
) -> None:
    assert time_text(Spread(*spread)) == text


@pytest.mark.parametrize(
    ('share', 'text'),
    [
        (0.061, '6.1 %'),
        (0.006, '0.6 %'),
        (1e-4, '0.01 %'),
        (1e-6, 'below 0.01 %'),
        (-4e-4, '−0.04 %'),
        (0.42, '42 %'),
        (-0.031, '−3.1 %'),
    ],
)
def test_share_text_gives_the_core_percentage(share: float, text: str) -> None:
    assert share_text(share) == text


@pytest.mark.parametrize(
    ('middle', 'low', 'high', 'is_noise'),
    [(1.0, 0.9, 1.1, False), (-33.85, -34.0, -33.0, False), (-0.2, -3.0, 2.0, True),
     (0.1, 0.0, 0.2, True), (0.3, 0.25, 0.35, False)],
)  # fmt: skip
def test_price_within_its_spread_is_printed_as_noise(
    middle: float, low: float, high: float, is_noise: bool
) -> None:
    price = Price(Spread(low, middle, high), 1000.0)
    assert price.is_noise == is_noise
    assert (price_text(price) == NOISE) == is_noise
    assert (NOISE in change_text(BUDGET, STEP, Setting('x', error(1.0), price))) == is_noise


CHEAPEST = STEP.settings[2].instruction


def test_lead_lines_name_worst_error_and_cheapest_remedy() -> None:
    assert lead_lines(BUDGET) == [
        'hil: 0.023 rad off at worst after 10 s, mostly by the step of the drive',
        f'less than a fifth of it: {CHEAPEST} (+6.1 µs a tick, 0.6 % of a core)',
        'on purpose: encoder 1.8e-3 rad',
    ]


def test_lead_lines_follow_the_greatest_error() -> None:
    age = AGE._replace(chosen=0)
    lines = lead_lines(BUDGET._replace(knobs=[age, SOLVING]))
    assert lines[0] == 'hil: 0.030 rad off at worst, by the age in use'
    assert 'carry the state forward by its rates (no cost)' in lines[1]
    lines = lead_lines(BUDGET._replace(knobs=[SOLVING]))
    assert lines[1] == 'no measured setting reduces it'


def test_lead_line_names_greatest_error_and_sum() -> None:
    for budget in random_budgets():
        _check_first_line(budget)


def _check_first_line(budget: Budget) -> None:
    lines = lead_lines(budget)
    assert len(lines) <= 3
    errors = {
        knob.name: knob.settings[knob.chosen].error.worst
        for knob in budget.knobs
        if not knob.is_deliberate
    }
    if not errors:
        return
    greatest = max(errors, key=errors.__getitem__)
    assert total_error(budget) == pytest.approx(sum(errors.values()))
    if errors[greatest]:
        assert greatest in lines[0]
        assert f' {error_text(sum(errors.values()))} rad off' in lines[0]


def test_advised_settings_can_be_requested() -> None:
    for budget in random_budgets():
        _check_advice(budget)


def _check_advice(budget: Budget) -> None:
    own_core = budget.tick.tick.middle * 1e-6 * budget.rate
    for knob in error_knobs(budget):
        cheaper, better = neighbours_of(budget, knob)
        for setting in (cheaper, better):
            assert setting is None or (setting.changes or setting.advice)
        if cheaper is not None:
            price = cheaper.price
            assert price is not None
            assert (budget.tick.tick.middle + price.tick.middle) * 1e-6 * price.rate < own_core
        if better is not None:
            assert better.error.worst < knob.own_setting.error.worst


def test_budget_rows_are_sorted_complete_and_without_noise() -> None:
    for budget in random_budgets():
        _check_rows(budget)


def _check_rows(budget: Budget) -> None:
    rows = rows_of(budget)
    assert len(rows) == len(budget.knobs) + 2
    assert all(len(row) == len(budget_table(budget).heads) for row in rows)
    worst = [knob.own_setting.error.worst for knob in error_knobs(budget)]
    assert worst == sorted(worst, reverse=True)
    noisy = {
        knob.name
        for knob in budget.knobs
        if (price := knob.own_setting.price) is not None
        and abs(price.tick.middle) <= price.tick.high - price.tick.low
    }
    for row in rows[: len(budget.knobs)]:
        name = next(each.name for each in budget.knobs if each.name in row.name)
        assert (row.cost.shown == NOISE) == (name in noisy)
    count = sum(
        setting.price is not None and setting.price.is_noise
        for knob in budget.knobs
        for setting in knob.settings
    )
    assert not count or f'; {count} of ' in closing_lines(budget)[0]


def test_budget_json_holds_every_knob() -> None:
    for budget in random_budgets():
        _check_json(budget)


def _check_json(budget: Budget) -> None:
    said = json.loads(json.dumps(budget_json(budget), allow_nan=False))
    assert [each['name'] for each in said['sources']] == [knob.name for knob in budget.knobs]
    for each, knob in zip(said['sources'], budget.knobs, strict=True):
        own = each['settings'][each['chosen']]
        assert own['worst'] == (
            knob.own_setting.error.worst if knob.own_setting.error.worst < inf else None
        )
        assert own['core'] == pytest.approx(said['tick']['core'])


def test_setting_instruction_is_valid_yaml() -> None:
    setting = Setting('x', JointError(0.0, 0.0), None, [('a.b', 1e-5), ('c', 500.0), ('d', False)])
    assert setting.instruction == 'a.b: 0.00001, c: 500, d: false'
