# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""How a replay is told: as JSON has it, and as text. Times are in [ns], and named so."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Any

from linkage_ros.bag.reader import Bag
from linkage_ros.cli.bag_reading import BagReading, gaps, unfinished_text
from linkage_ros.cli.terminal import Table
from linkage_ros.errors import clean
from linkage_ros.messages.joint_values import UNITS
from linkage_ros.replay.compare import At, Comparison, First, TopicComparison, ulps
from linkage_ros.replay.verify import beginning_text, Proof
from linkage_ros.scene.scene import Scene


def unit_of(joint: str, quantity: str, turning: Mapping[str, bool]) -> str:
    """Return the unit of a joint's number."""
    return UNITS[quantity][not turning.get(joint, True)]


def bag_account(bag: Bag, scene: Scene, reading: BagReading, begin: list[int]) -> dict[str, Any]:
    """Return which bag was replayed as which scene, how far, and when it began, in [ns]."""
    return {
        'bag': str(bag.path),
        'scene': scene.name,
        'begin_ns': begin[0] if begin else None,
        'truncated': bag.truncated,
        'unfinished': unfinished_text(bag) if bag.truncated else None,
        'gaps': list(gaps(bag)),
        'damage': reading.damage or None,
        'stopped': reading.stopped,
    }


def proof_account(
    proof: Proof, turning: Mapping[str, bool], versions: Mapping[str, Mapping[str, str]]
) -> dict[str, Any]:
    """
    Return what there is to say of a proof.

    Parameters
    ----------
    proof
        The proof.
    turning
        Of each joint whether it turns, or slides.
    versions
        Those of the ``bag``, and those ``here``.

    """
    found = proof.comparison
    return {
        'verdict': proof.verdict,
        'ticks': proof.ticks,
        'compared_ticks': found.ticks,
        'different_ticks': found.differing,
        'withheld_ticks': found.withheld,
        'untold_ticks': proof.untold,
        'beginning_missing': beginning_text(proof) if proof.beginning else None,
        'topics': [topic_account(topic) for topic in found.topics],
        'first_difference': first_account(found.first or proof.first_untold, turning),
        'last_different_tick': at_account(found.last) if found.last else None,
        'greatest': greatest(found, turning),
        'versions': {name: dict(of) for name, of in versions.items()},
    }


def topic_account(topic: TopicComparison) -> dict[str, Any]:
    """Return how the messages of a topic came out."""
    return {
        'name': topic.name,
        'recorded': topic.recorded,
        'same': topic.same,
        'same_but_for_turns': topic.but_turns,
        'different': topic.different,
        'not_made_now': topic.gone,
        'not_recorded': topic.not_recorded,
    }


def first_account(first: First | None, turning: Mapping[str, bool]) -> dict[str, Any] | None:
    """Return a difference, with how far the two are apart."""
    if first is None:
        return None
    account: dict[str, Any] = {**at_account(first.at), 'topic': first.topic, 'what': first.what}
    if first.recorded is not None and first.now is not None:
        account |= {
            'joint': first.joint,
            'unit': unit_of(first.joint, first.what, turning),
            'recorded': _finite(first.recorded),
            'now': _finite(first.now),
            'difference': _finite(abs(first.now - first.recorded)),
            'ulp': ulps(first.recorded, first.now),
        }
    return account


def at_account(at: At) -> dict[str, Any]:
    """Return where something was."""
    return {'tick': at.tick, 'time_ns': at.time}


def greatest(found: Comparison, turning: Mapping[str, bool]) -> list[dict[str, Any]]:
    """Return the greatest differences of each quantity and unit that differs at all."""
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for topic in found.topics:
        for (joint, quantity), deviation in topic.deviations.items():
            if not deviation.differing:
                continue
            unit = unit_of(joint, quantity, turning)
            row = rows.setdefault((quantity, unit), {'difference': -1.0, 'ulp': -1})
            if deviation.greatest > row['difference']:
                where = {'joint': joint, **at_account(deviation.at)}
                row |= {'difference': deviation.greatest, 'difference_at': where}
            if deviation.ulps > row['ulp']:
                where = {'joint': joint, **at_account(deviation.ulps_at)}
                row |= {'ulp': deviation.ulps, 'ulp_at': where}
    return [
        {'quantity': quantity, 'unit': unit, **row, 'difference': _finite(row['difference'])}
        for (quantity, unit), row in rows.items()
    ]


def joints_account(found: Comparison, turning: Mapping[str, bool]) -> list[dict[str, Any]]:
    """Return of every number that both have how far they are apart."""
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for topic in found.topics:
        for key, deviation in topic.deviations.items():
            joint, quantity = key
            # Motions repeat what the joint states say.
            rows.setdefault(
                key,
                {
                    'joint': joint,
                    'quantity': quantity,
                    'unit': unit_of(joint, quantity, turning),
                    'compared': deviation.compared,
                    'different': deviation.differing,
                    'rms': _finite(deviation.rms),
                    'greatest': _finite(deviation.greatest),
                    'greatest_at': at_account(deviation.at) if deviation.differing else None,
                },
            )
    return list(rows.values())


def first_text(first: Mapping[str, Any], begin: int) -> str:
    """Return the first difference in words; times are told from a time in [ns]."""
    text = f'tick {first["tick"]}, at {(first["time_ns"] - begin) / 1e9:+.6f} s '
    text += f'({first["time_ns"]} ns), {first["topic"]}: '
    if 'joint' not in first:
        return text + str(first['what'])
    unit = first['unit']
    return text + (
        f'{first["joint"]} {first["what"]}: {first["recorded"]!r} recorded, {first["now"]!r} now, '
        f'{_number(first["difference"])} {unit} or {first["ulp"]} ulp apart'
    )


def topics_table(account: Mapping[str, Any]) -> Table:
    """Return the topics as a table."""
    heads = ['topic', '>recorded', '>same bytes', '>different', '>not made now', '>not recorded']
    keys = ['recorded', 'same', 'different', 'not_made_now', 'not_recorded']
    if any(topic['same_but_for_turns'] for topic in account['topics']):
        heads.insert(3, '>but for turns')
        keys.insert(2, 'same_but_for_turns')
    rows = [
        (clean(topic['name']), *(str(topic[key]) for key in keys)) for topic in account['topics']
    ]
    return Table('', heads, rows)


def greatest_table(account: Mapping[str, Any], begin: int) -> Table:
    """Return the greatest differences as a table."""
    rows = [
        (
            f'{row["quantity"]} [{row["unit"]}]',
            _number(row['difference']),
            _place(row['difference_at'], begin) if 'difference_at' in row else '',
            str(row['ulp']),
            _place(row['ulp_at'], begin) if 'ulp_at' in row else '',
        )
        for row in account['greatest']
    ]
    return Table('Greatest differences', ('', '>apart', 'where', '>ulp', 'where'), rows)


def joints_table(account: Mapping[str, Any], begin: int) -> Table:
    """Return the differences joint by joint as a table."""
    rows = [
        (
            clean(row['joint']),
            f'{row["quantity"]} [{row["unit"]}]',
            str(row['compared']),
            _number(row['rms']),
            _number(row['greatest']),
            _tick(row['greatest_at'], begin) if row['greatest_at'] else '',
        )
        for row in account['joints']
    ]
    return Table('', ('joint', '', '>compared', '>rms', '>greatest', 'where'), rows)


def versions_text(versions: Mapping[str, Mapping[str, str]]) -> Iterator[str]:
    """Yield the versions of what made the bag, and those of here where they are others."""
    then, here = versions['bag'], versions['here']
    same = dict(then) == dict(here)
    yield f'made {"and replayed " if same else ""}by {_versions(then)}'
    if not same:
        yield f'replayed by {_versions(here)}'


def _versions(said: Mapping[str, str]) -> str:
    words = {'linkage_ros': 'linkage_ros', 'python': 'Python', 'machine': 'on'}
    told = [f'{word} {clean(said[key])}' for key, word in words.items() if key in said]
    told += [f'{clean(key)} ({clean(said[key])})' for key in said if key not in words]
    return ', '.join(told) or 'versions that it does not tell'


def _place(where: Mapping[str, Any], begin: int) -> str:
    return f'{clean(where["joint"])}, {_tick(where, begin)}'


def _tick(where: Mapping[str, Any], begin: int) -> str:
    return f'tick {where["tick"]}, {(where["time_ns"] - begin) / 1e9:+.6f} s'


def _number(value: float | None) -> str:
    return 'no number' if value is None else f'{value:.3g}'


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None
