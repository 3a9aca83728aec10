# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A budget as text: what is off, by how much, what to write for less; and the table behind that.

A time is a median with half the distance of its quartiles; one that is smaller than that distance
is within noise, and has no number.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, isfinite, log10
from typing import Any, NamedTuple

from linkage_ros.cli import Column, Quantity, Table
from linkage_ros.tools.study.budget import Budget, Knob, Price, RecordingLoss, Setting
from linkage_ros.tools.study.measuring import Spread

NOISE = 'within noise'

ALL_TOGETHER = 'all of them together'
"""Name of what all effects and faults make different."""

_LEAST_TOLD = 1e-20
"""Smaller errors mean nothing to a reader, in [rad]."""

_SAME = 0.9
"""An error that is at least this part of another one is the same."""


def error_text(error: float) -> str:
    """Return an error with two digits: 0.021, 1.2e-3, 3e-16."""
    if not error:
        return '0'
    if not isfinite(error):
        return '∞'
    if error < _LEAST_TOLD:
        return f'below {error_text(_LEAST_TOLD)}'
    mantissa, exponent = f'{error:.1e}'.split('e')
    power = int(exponent)
    if -2 <= power < 4:
        return f'{float(mantissa) * 10.0**power:.{max(0, 1 - power)}f}'
    return f'{mantissa.removesuffix(".0")}e{power}'


def time_text(time: Spread) -> str:
    """Return a time in [µs] with its spread: 6.2 ± 0.2."""
    half = 0.5 * (time.high - time.low)
    finest = max(half, 0.02 * abs(time.middle), 0.005)
    decimals = max(0, -floor(log10(finest)))
    middle, around = f'{time.middle:.{decimals}f}', f'{half:.{decimals}f}'
    middle = middle.replace('-', '−')
    return f'{middle} ± {around}' if float(around) else middle


def share_text(share: float) -> str:
    """Return a share, as of a core: 0.6 %."""
    percent = 100.0 * abs(share)
    sign = '−' if share < 0.0 else ''
    if percent < 0.005:
        return 'below 0.01 %'
    return f'{sign}{percent:.{0 if percent >= 9.95 else 1 if percent >= 0.095 else 2}f} %'


def seconds_text(seconds: float) -> str:
    """Return a duration: 0.91 s."""
    return f'{seconds:.2g} s'


def price_text(price: Price | None) -> str:
    """Return what the scene's own setting takes of a tick."""
    if price is None:
        return '–'
    return NOISE if price.is_noise else time_text(price.tick)


def change_text(budget: Budget, knob: Knob, setting: Setting) -> str:
    """Return what another setting changes of the cost: '+6.1 µs', '−3.1 % of a core'."""
    price = setting.price
    if price is None:
        return 'no cost'
    if price.rate != budget.rate:
        change = budget.core_of(knob, setting) - budget.tick.core_share
        return f'{"+" if change >= 0.0 else ""}{share_text(change)} of a core'
    if price.is_noise:
        return f'{NOISE} of cost'
    middle = f'{abs(price.tick.middle):.2g}'
    if 'e' in middle:
        middle = f'{abs(price.tick.middle):.0f}'
    return f'{"+" if price.tick.middle >= 0.0 else "−"}{middle} µs'


class Neighbours(NamedTuple):
    """Settings other than the scene's own that a user can ask for; None where there is none."""

    cheaper: Setting | None  # The most exact of those that cost less
    better: Setting | None  # Of the more exact ones the first that comes with more cost


def neighbours_of(budget: Budget, knob: Knob) -> Neighbours:
    """Return the next cheaper and the next better setting of a knob."""
    own = knob.own_setting
    others = [setting for setting in knob.settings if setting is not own and setting.instruction]
    cheaper = [setting for setting in others if added_core(budget, knob, setting) < 0.0]
    better = [setting for setting in others if setting.error.worst < _SAME * own.error.worst]
    return Neighbours(
        min(cheaper, key=lambda setting: setting.error.worst, default=None),
        min(better, key=lambda setting: _setting_effort(budget, knob, setting), default=None),
    )


def added_core(budget: Budget, knob: Knob, setting: Setting) -> float:
    """Return what a scene takes of a core more with a setting; 0 within noise and for its own."""
    price = setting.price
    if price is None or (price.is_noise and price.rate == budget.rate):
        return 0.0
    return budget.core_of(knob, setting) - budget.tick.core_share


def _setting_effort(budget: Budget, knob: Knob, setting: Setting) -> tuple[float, int, float]:
    """Return how much a more exact setting asks for: cost, then keys. Saving is not a gain."""
    more = max(0.0, added_core(budget, knob, setting))
    return more, len(setting.changes or ()), setting.error.worst


def error_knobs(budget: Budget) -> list[Knob]:
    """Return the knobs of what nobody has asked for, by size."""
    knobs = [knob for knob in budget.knobs if not knob.is_deliberate]
    return sorted(knobs, key=lambda knob: knob.own_setting.error.worst, reverse=True)


def total_error(budget: Budget) -> float:
    """Return the sum of the worst errors, in [rad]: all of them at once and in one direction."""
    return sum(knob.own_setting.error.worst for knob in error_knobs(budget))


def lead_lines(budget: Budget) -> list[str]:
    """Return what is off, by how much, and what to write for less, in at most three lines."""
    lines = []
    knobs = error_knobs(budget)
    if knobs:
        lines += [_error_line(budget, knobs), _advice_line(budget, knobs[0])]
    asked = [
        f'{knob.name} {error_text(knob.own_setting.error.worst)} rad'
        for knob in budget.knobs
        if knob.is_deliberate and knob.own_setting.error.worst and knob.name != ALL_TOGETHER
    ]
    deliberate = any(knob.is_deliberate for knob in budget.knobs)
    if asked:
        lines.append(f'on purpose: {"; ".join(asked)}')
    elif deliberate and not knobs:
        lines.append(f'{budget.scene}: its effects change no joint')
    if budget.recording and not knobs:
        own = budget.recording[0]
        lines.append(f'{budget.scene}: a crash loses {seconds_text(own.seconds)} at worst')
    return lines


def _error_line(budget: Budget, knobs: Sequence[Knob]) -> str:
    total, most = total_error(budget), knobs[0]
    if not total:
        return f'{budget.scene}: exact'
    share = most.own_setting.error.worst / total if isfinite(total) else 1.0
    if len(knobs) == 1 or share > 0.99:
        cause = f'by {_knob_name(most)}'
    elif share >= 0.9:
        cause = f'nearly all by {_knob_name(most)}'
    elif share >= 0.5:
        cause = f'mostly by {_knob_name(most)}'
    else:
        cause = f'by {_knob_name(most)} and {_knob_name(knobs[1])}'
    after = f' after {most.after:g} s' if most.after is not None else ''
    return f'{budget.scene}: {error_text(total)} rad off at worst{after}, {cause}'


def _knob_name(knob: Knob) -> str:
    return f'the {knob.name}' if knob.name.startswith(('step', 'age')) else knob.name


def _advice_line(budget: Budget, knob: Knob) -> str:
    """Return what to write for less of the greatest error."""
    total = total_error(budget)
    rest = sum(k.own_setting.error.worst for k in error_knobs(budget) if k is not knob)
    others = [
        setting
        for setting in knob.settings
        if setting is not knob.own_setting and setting.instruction
    ]
    for factor, words in ((0.1, 'a tenth'), (0.2, 'a fifth'), (0.5, 'half')):
        good = [setting for setting in others if rest + setting.error.worst <= factor * total]
        if good:
            best = min(good, key=lambda setting: _setting_effort(budget, knob, setting))
            return (
                f'less than {words} of it: {best.instruction} ({_cost_text(budget, knob, best)})'
            )
    better = neighbours_of(budget, knob).better
    if better is not None:
        left = rest + better.error.worst
        cost = _cost_text(budget, knob, better)
        return f'{error_text(left)} rad are left with: {better.instruction} ({cost})'
    return 'no measured setting reduces it'


def _cost_text(budget: Budget, knob: Knob, setting: Setting) -> str:
    """Return what a setting costs more, in a sentence: '+6.1 µs a tick, 0.6 % of a core'."""
    text = change_text(budget, knob, setting)
    if not text.endswith('µs'):
        return text
    change = budget.core_of(knob, setting) - budget.tick.core_share
    return f'{text} a tick, {share_text(change)} of a core'


_NONE = Quantity(None, shown='–')


def _error_cell(error: float) -> Quantity:
    return Quantity(error if isfinite(error) else None, shown=error_text(error))


def _price_cell(price: Price | None) -> Quantity:
    time = None if price is None or price.is_noise else price.tick.middle
    return Quantity(time, shown=price_text(price))


def _core_cell(share: float | None) -> Quantity:
    return _NONE if share is None else Quantity(share, shown=share_text(share))


class Row(NamedTuple):
    """A row of the table: its cells, in the order of the columns."""

    name: str
    rms: Quantity  # In [rad]
    worst: Quantity
    cost: Quantity  # Of a tick, in [µs]
    core: Quantity
    cheaper: str = ''
    better: str = ''  # Or a sentence where there is no other setting


def rows_of(budget: Budget) -> list[Row]:
    """Return the rows of the table: errors, differences on purpose, recording, the whole tick."""
    rows = [_error_row(budget, knob) for knob in error_knobs(budget)]
    deliberate = [knob for knob in budget.knobs if knob.is_deliberate]
    rows += [_deliberate_row(knob) for knob in deliberate]
    if budget.recording:
        rows.append(_recording_row(budget.recording))
    rows.append(Row('the whole tick', _NONE, _NONE, *_own_price(budget.tick)))
    return rows


def _own_price(price: Price) -> tuple[Quantity, Quantity]:
    """Return what a price takes of a tick and of a core, also within noise."""
    time = Quantity(price.tick.middle, shown=time_text(price.tick))
    return time, _core_cell(price.core_share)


def _error_row(budget: Budget, knob: Knob) -> Row:
    own = knob.own_setting
    after = f', after {knob.after:g} s' if knob.after is not None else ''
    name = f'{knob.name} ({own.label}){after}'
    # A rate sets what the whole tick takes of a core.
    sets_rate = any(key == 'rate' for setting in knob.settings for key, _ in setting.changes or ())
    core = budget.tick.core_share if sets_rate else own.price.core_share if own.price else None
    cheaper, better = (
        setting
        and f'{setting.instruction} ({error_text(setting.error.worst)}, '
        f'{change_text(budget, knob, setting)})'
        for setting in neighbours_of(budget, knob)
    )
    return Row(
        name,
        _error_cell(own.error.rms),
        _error_cell(own.error.worst),
        _price_cell(own.price),
        _core_cell(core),
        cheaper or '–',
        better or 'nothing is better',
    )


def _deliberate_row(knob: Knob) -> Row:
    own = knob.own_setting
    after = f', after {knob.after:g} s' if knob.after is not None else ''
    is_silent = not own.error.worst
    rms, worst = (
        _NONE if is_silent else _error_cell(error) for error in (own.error.rms, own.error.worst)
    )
    return Row(
        f'on purpose: {knob.name}{after}',
        rms,
        worst,
        _price_cell(own.price),
        _core_cell(None if own.price is None or own.price.is_noise else own.price.core_share),
        '–',
        knob.note or ('adds to the messages' if is_silent else 'what you asked for'),
    )


def _recording_row(losses: Sequence[RecordingLoss]) -> Row:
    own, *others = losses
    cheaper, better = (
        next((loss for loss in others if (loss.seconds < own.seconds) == is_better), None)
        for is_better in (False, True)
    )
    lost = f'recording: a crash loses {seconds_text(own.seconds)} at worst'
    return Row(
        f'{lost}, and {own.dropped} messages found no room' if own.dropped else lost,
        _NONE,
        _NONE,
        *_own_price(own.price),
        *(
            f'{loss.instruction} ({seconds_text(loss.seconds)}, '
            f'{_more_text(loss.price, own.price)})'
            if loss
            else '–'
            for loss in (cheaper, better)
        ),
    )


def _more_text(price: Price, own: Price) -> str:
    """Return how much more one price is than the other; both have a spread of their own."""
    more = price.tick.middle - own.tick.middle
    noise = max(price.tick.high - price.tick.low, own.tick.high - own.tick.low)
    return f'{more:+.1f} µs'.replace('-', '−') if abs(more) > noise else f'{NOISE} of cost'


def closing_lines(budget: Budget) -> list[str]:
    """Return how sure the prices are, and what was left out."""
    prices = [
        setting.price
        for knob in budget.knobs
        for setting in knob.settings
        if setting.price is not None
    ]
    noisy = sum(price.is_noise for price in prices)
    low, middle, high = budget.tick.tick
    spread = (high - low) / middle if middle else 0.0
    said = f'measured with a spread of {100.0 * spread:.0f} %'
    if prices:
        said += f'; {noisy} of {len(prices)} prices lie {NOISE} and are called so'
    notes = [f'{knob.name}: {knob.note}' for knob in error_knobs(budget) if knob.note]
    return [said, *notes, *(f'left out: {reason}' for reason in budget.left_out)]


def budget_table(budget: Budget) -> Table:
    """Return the table of errors and what each setting costs."""
    columns = (
        Column('error of the published joints', 'name'),
        Column('>rms [rad]', 'rms_rad'),
        Column('>worst [rad]', 'worst_rad'),
        Column('>costs a tick [µs]', 'cost_us'),
        Column(f'>core at {rate_text(budget.rate)}', 'core'),
        Column('cheaper', 'cheaper'),
        Column('better', 'better'),
    )
    return Table('', columns, rows_of(budget), 'sources')


def rate_text(rate: float) -> str:
    """Return a rate: 1 kHz, 50 Hz."""
    return f'{rate / 1000.0:g} kHz' if rate >= 1000.0 else f'{rate:g} Hz'


def budget_json(budget: Budget) -> dict[str, Any]:
    """Return a budget as JSON holds it; errors in [rad], times in [µs]."""

    def setting_json(knob: Knob, setting: Setting) -> dict[str, Any]:
        return {
            'label': setting.label,
            # What runs away is infinitely far off, and JSON has no such number.
            **{
                name: value if isfinite(value) else None
                for name, value in setting.error._asdict().items()
            },
            'price': _price_json(setting.price),
            'core': budget.core_of(knob, setting),
            'write': setting.instruction,
        }

    return {
        'scene': budget.scene,
        'lines': lead_lines(budget),
        'error': total_error(budget) if isfinite(total_error(budget)) else None,
        'rate': budget.rate,
        'tick': _price_json(budget.tick),
        'sources': [
            {
                'name': knob.name,
                'on_purpose': knob.is_deliberate,
                'after_s': knob.after,
                'note': knob.note,
                'chosen': knob.chosen,
                'settings': [setting_json(knob, setting) for setting in knob.settings],
            }
            for knob in budget.knobs
        ],
        'recording': [
            {
                'write': loss.instruction,
                'lost_s': loss.seconds,
                'price': _price_json(loss.price),
                'dropped': loss.dropped,
            }
            for loss in budget.recording
        ],
        'left_out': list(budget.left_out),
        'machine': dict(budget.machine),
    }


def _price_json(price: Price | None) -> dict[str, Any] | None:
    if price is None:
        return None
    times = dict(zip(('low_us', 'us', 'high_us'), price.tick, strict=True))
    return {**times, 'core': price.core_share, 'within_noise': price.is_noise}
