# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Run the scene of a bag once more over its samples, and compare.

Every joint state, and every other published message, is computed again and compared with the
recorded bytes. Exit code 0: all are the same; 3: some differ, or the bag lacks messages that its
metadata promise; 1: undecided, stopped, or the bag is damaged and the part before the damage is
the same.

--scene runs another scene, --set the scene of the bag with other values; its joints are compared
with the recorded ones, tick by tick. The scene of the bag runs too: if it differs from
its own run, as at another rate or where the bag lacks the start, the first line says by how
much. -o writes a new bag, which replays by itself. Then a difference is not a failure.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
import sys
from threading import Event
from typing import Any

from linkage_ros.bag import (
    Bag,
    missing_start_reason,
    read_run_metadata,
    recorded_events,
    RUN_FILE,
    RunMetadata,
)
from linkage_ros.cli.arguments import (
    add_bag,
    add_force,
    add_set,
    DEGREES,
    DisplayUnits,
    finite_or_none,
    RESULTS,
    SCENE_HELP,
)
from linkage_ros.cli.bag_reading import (
    add_trust,
    BagReading,
    describe_gaps,
    open_bag,
    scene_of,
    unfinished_text,
)
from linkage_ros.cli.new_bag import names_for, ReplayBag, ReplaySource
from linkage_ros.cli.result import add_result, Result, show_result
from linkage_ros.cli.table import attributes_json, Column, Table, table_of_rows
from linkage_ros.description import load_scene, remove_bag, Scene, Units
from linkage_ros.errors import BagError, escape_unprintable, LinkageError, list_names
from linkage_ros.messages import JOINT_STATE_TYPE, Key, UNITS
from linkage_ros.replay import (
    beginning_text,
    check_drives,
    Comparison,
    Counterfactual,
    CounterfactualTick,
    Deviation,
    DIFFERENT,
    find_crank_topic,
    FirstDifference,
    IDENTICAL,
    own_joint_states,
    recorded_scene,
    ReplayedTick,
    ReplayVerification,
    TickPlace,
    turning_joints,
    ulp_distance,
    user_effects_here,
    verify_replay,
    versions_here,
)
from linkage_ros.signals import heed_signals
from linkage_ros.tick import EXTRA, Tick

EXIT_INCOMPLETE, EXIT_DIFFERENT = 1, 3

EXAMPLE = 'linkage replay my_bag --set angles=wrapped'


def unit_of(joint: str, quantity: str, turning: Mapping[str, bool]) -> str:
    """Return the unit of a quantity of a joint."""
    return UNITS[quantity][not turning.get(joint, True)]


def bag_account(bag: Bag, scene: Scene, reading: BagReading, begin: list[int]) -> dict[str, Any]:
    """Return the bag, the scene, how far the bag was replayed, and when it begins, in [ns]."""
    return {
        'bag': str(bag.path),
        'scene': scene.name,
        'begin_ns': begin[0] if begin else None,
        'truncated': bag.truncated,
        'unfinished': unfinished_text(bag) if bag.truncated else None,
        'gaps': list(describe_gaps(bag)),
        'damage': reading.damage or None,
        'missing': reading.missing,
        'stopped': reading.stopped,
    }


def _proof_account(
    proof: ReplayVerification,
    turning: Mapping[str, bool],
    versions: Mapping[str, Mapping[str, str]],
) -> dict[str, Any]:
    """Return the result of a verified replay as JSON holds it."""
    comparison = proof.comparison
    return {
        'verdict': proof.verdict,
        'ticks': proof.tick_count,
        'compared_ticks': comparison.ticks,
        'different_ticks': comparison.differing,
        'withheld_ticks': comparison.suppressed,
        'untold_ticks': proof.undecided,
        'beginning_missing': beginning_text(proof) if proof.missing_start else None,
        'topics': [attributes_json(topic, _TOPIC) for topic in comparison.topics],
        'first_difference': first_account(comparison.first or proof.first_undecided, turning),
        'last_different_tick': tick_json(comparison.last) if comparison.last else None,
        'greatest': greatest_differences(comparison, turning),
        'versions': {name: dict(of) for name, of in versions.items()},
    }


def first_account(
    first: FirstDifference | None, turning: Mapping[str, bool]
) -> dict[str, Any] | None:
    """Return the first difference, and by how much the two values differ."""
    if first is None:
        return None
    account: dict[str, Any] = {**tick_json(first.at), 'topic': first.topic, 'what': first.what}
    if first.recorded is not None and first.now is not None:
        account |= {
            'joint': first.joint,
            'unit': unit_of(first.joint, first.what, turning),
            'recorded': finite_or_none(first.recorded),
            'now': finite_or_none(first.now),
            'difference': finite_or_none(abs(first.now - first.recorded)),
            'ulp': ulp_distance(first.recorded, first.now),
        }
    return account


def tick_json(at: TickPlace) -> dict[str, Any]:
    """Return the place of a message: its topic, tick and time."""
    return {'tick': at.tick, 'time_ns': at.time}


def greatest_differences(
    comparison: Comparison, turning: Mapping[str, bool]
) -> list[dict[str, Any]]:
    """Return the greatest difference of each quantity and unit that differs."""
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for topic in comparison.topics:
        for (joint, quantity), deviation in topic.deviations.items():
            if not deviation.differing:
                continue
            unit = unit_of(joint, quantity, turning)
            row = rows.setdefault((quantity, unit), {'difference': -1.0, 'ulp': -1})
            if deviation.greatest > row['difference']:
                where = {'joint': joint, **tick_json(deviation.at)}
                row |= {'difference': deviation.greatest, 'difference_at': where}
            if deviation.ulps > row['ulp']:
                where = {'joint': joint, **tick_json(deviation.ulps_at)}
                row |= {'ulp': deviation.ulps, 'ulp_at': where}
    return [
        {
            'quantity': quantity,
            'unit': unit,
            **row,
            'difference': finite_or_none(row['difference']),
        }
        for (quantity, unit), row in rows.items()
    ]


def joints_account(comparison: Comparison, turning: Mapping[str, bool]) -> list[dict[str, Any]]:
    """Return the differences of each number that both runs have, joint by joint."""
    deviations: dict[Key, Deviation] = {}
    for topic in comparison.topics:
        # ~/motion repeats the positions and velocities of the joint states.
        for key, deviation in topic.deviations.items():
            deviations.setdefault(key, deviation)
    return deviations_account(deviations, turning)


def deviations_account(
    deviations: Mapping[Key, Deviation], turning: Mapping[str, bool]
) -> list[dict[str, Any]]:
    """Return deviations, joint by joint."""
    return [
        {
            'joint': joint,
            'quantity': quantity,
            'unit': unit_of(joint, quantity, turning),
            'compared': deviation.compared,
            'different': deviation.differing,
            'rms': finite_or_none(deviation.rms),
            'greatest': finite_or_none(deviation.greatest),
            'greatest_at': tick_json(deviation.at) if deviation.differing else None,
        }
        for (joint, quantity), deviation in deviations.items()
    ]


def first_text(first: Mapping[str, Any], begin: int) -> str:
    """Return the first difference in words; times count from ``begin``, in [ns]."""
    text = f'tick {first["tick"]}, at {(first["time_ns"] - begin) / 1e9:+.6f} s '
    text += f'({first["time_ns"]} ns), {first["topic"]}: '
    if 'joint' not in first:
        return text + str(first['what'])
    unit = first['unit']
    return text + (
        f'{first["joint"]} {first["what"]}: {first["recorded"]!r} recorded, {first["now"]!r} now, '
        f'{_number_text(first["difference"])} {unit} or {first["ulp"]} ulp apart'
    )


_TOPIC = (
    Column('topic', 'name'),
    Column('>recorded', 'recorded'),
    Column('>same bytes', 'same'),
    Column('>but for turns', 'same_but_for_turns'),
    Column('>different', 'different'),
    Column('>not made now', 'not_made_now'),
    Column('>not recorded', 'not_recorded'),
)


def _topics_table(account: Mapping[str, Any]) -> Table:
    turned = any(topic['same_but_for_turns'] for topic in account['topics'])
    columns = [column for column in _TOPIC if turned or column.key != 'same_but_for_turns']
    return table_of_rows('', 'topics', columns, account['topics'])


def _number_text(value: float | None, _units: DisplayUnits = DEGREES) -> str:
    return 'not a number' if value is None else f'{value:.3g}'


def _greatest_table(account: Mapping[str, Any], begin: int, units: Units) -> Table:
    def place(where: Mapping[str, Any] | None, _units: DisplayUnits) -> str:
        return f'{where["joint"]}, {_tick_text(where, begin)}' if where else ''

    columns = (
        Column('', 'quantity'),
        Column('>apart', 'difference', form=_number_text),
        Column('where', 'difference_at', form=place),
        Column('>ulp', 'ulp'),
        Column('where', 'ulp_at', form=place),
    )
    blank = {'difference_at': None, 'ulp_at': None}
    rows = (blank | _in_units(row, units) for row in account['greatest'])
    return table_of_rows('Greatest differences', 'greatest', columns, rows)


def joints_table(account: Mapping[str, Any], begin: int, units: Units) -> Table:
    """Return the table of differences joint by joint, in the units of a file."""
    columns = (
        Column('joint', 'joint'),
        Column('', 'quantity'),
        Column('>compared', 'compared'),
        Column('>rms', 'rms', form=_number_text),
        Column('>greatest', 'greatest', form=_number_text),
        Column('where', 'greatest_at', form=lambda at, _: _tick_text(at, begin) if at else ''),
    )
    rows = (_in_units(row, units) for row in account['joints'])
    return table_of_rows('', 'joints', columns, rows)


def _in_units(row: Mapping[str, Any], units: Units) -> dict[str, Any]:
    """Return a row of differences in the units of a file; its quantity names the unit."""
    unit = row['unit']
    numbers = {
        name: units.to_file_unit(row[name], unit)
        for name in ('difference', 'rms', 'greatest')
        if row.get(name) is not None
    }
    return {**row, **numbers, 'quantity': f'{row["quantity"]} [{units.file_unit(unit)}]'}


def versions_text(versions: Mapping[str, Mapping[str, str]]) -> Iterator[str]:
    """Yield the versions that wrote the bag, and those installed here if they differ."""
    then, here = versions['bag'], versions['here']
    same = dict(then) == dict(here)
    yield f'made {"and replayed " if same else ""}by {_versions_text(then)}'
    if not same:
        yield f'replayed by {_versions_text(here)}'


def _versions_text(said: Mapping[str, str]) -> str:
    words = {'linkage_ros': 'linkage_ros', 'python': 'Python', 'machine': 'on'}
    texts = [
        f'{word} {escape_unprintable(said[key])}' for key, word in words.items() if key in said
    ]
    texts += [
        f'{escape_unprintable(key)} ({escape_unprintable(said[key])})'
        for key in said
        if key not in words
    ]
    return ', '.join(texts) or 'unknown versions'


def _tick_text(where: Mapping[str, Any], begin: int) -> str:
    return f'tick {where["tick"]}, {(where["time_ns"] - begin) / 1e9:+.6f} s'


# Counterfactual replay: another scene runs over the samples of a bag.


def _replayed_with(
    bag: Bag,
    reading: BagReading,
    scene: Scene,
    crank_topic: str | None,
    output: Path | None,
    *,
    force: bool,
) -> dict[str, Any]:
    """Run another scene over a bag's samples; return the comparison with the recorded run."""
    check_drives(scene, scene.linkages[0].content.file)
    run, recorded, unreadable = _own_account(bag)
    topic = find_crank_topic(bag, reading.read_silently(), scene, run, recorded, crank_topic)
    source = ReplaySource(bag, run, recorded, topic)
    own_samples = topic == run.crank_topic
    counterfactual = Counterfactual(bag, scene, recorded, takes_own_samples=own_samples)
    names = names_for(source, scene, counterfactual)
    _check_joints(bag, scene, recorded, output)
    if unreadable:
        print(f'linkage replay: nothing to compare with: {unreadable}', file=sys.stderr)
    kinds = {run.joint_states_topic: JOINT_STATE_TYPE}
    extras = {name: topic.type for topic, name in names.items() if topic.key == EXTRA}
    kinds |= extras
    outputs = [run.joint_states_topic, *run.extras]
    shared = [name for name in outputs if name and name in kinds]
    comparison, unchanged = (Comparison([(name, kinds[name]) for name in shared]) for _ in '12')
    own = own_joint_states(recorded) if recorded is not None else bool
    begin: list[int] = []
    published = 0
    new_bag = None
    with heed_signals(), ExitStack() as at_end:
        if output is not None:
            remove_bag(output, force=force)
            new_bag = ReplayBag(output, source, scene, counterfactual, names)
            at_end.callback(new_bag.close)
        with reading.with_progress() as messages:
            for event in counterfactual.run(recorded_events(run, own, messages, topic)):
                if new_bag is not None:
                    new_bag.write_event(event)
                if isinstance(event, CounterfactualTick):
                    if event.tick is not None and event.tick.message:
                        published += 1
                    recorded_now = dict(zip(outputs, event.recorded, strict=False))
                    then = [recorded_now.get(name, b'') for name in shared]
                    now = _messages(event.tick, [run.joint_states_topic, *extras], shared)
                    if any(then) or any(now):
                        begin = begin or [event.time]
                        at = TickPlace(comparison.ticks + 1, event.time)
                        comparison.add_tick(at, then, now)
                        if any(then) and event.unchanged is not None:
                            again = _messages(event.unchanged, outputs, shared)
                            unchanged.add_tick(at, then, again)
    comparison.update_deviations()
    turning = turning_joints(scene) | (turning_joints(recorded) if recorded else {})
    recorded_joints = recorded.joint_names if recorded is not None else ()
    return bag_account(bag, scene, reading, begin) | {
        'crank_topic': topic,
        'unchanged': _unchanged_account(unchanged, bag, run, scene, recorded, turning),
        'joint_states': published,
        'topics': [attributes_json(topic, _TOPIC) for topic in comparison.topics],
        'joints': joints_account(comparison, turning),
        'joints_only_recorded': [
            name for name in recorded_joints if name not in scene.joint_names
        ],
        'joints_only_now': [name for name in scene.joint_names if name not in recorded_joints],
        'new_bag': str(output) if new_bag is not None else None,
        'written': new_bag.message_counts if new_bag is not None else {},
    }


def _unchanged_account(
    comparison: Comparison,
    bag: Bag,
    run: RunMetadata,
    scene: Scene,
    recorded: Scene | None,
    turning: Mapping[str, bool],
) -> dict[str, Any] | None:
    """Return how the recorded scene differs from its own run, and why; None if it was not run."""
    if recorded is None or not comparison.ticks:
        return None
    why = [missing] if (missing := missing_start_reason(bag, run)) else []
    if scene.rate != recorded.rate:
        why.insert(0, f'{_rate_text(scene)} instead of {_rate_text(recorded)}')
    return {
        'compared_ticks': comparison.ticks,
        'different_ticks': comparison.differing,
        'why': ', '.join(why) or None,
        'greatest': greatest_differences(comparison, turning),
    }


def _rate_text(scene: Scene) -> str:
    return f'{scene.rate:g} Hz' if scene.rate else 'a tick for each sample'


def _own_account(bag: Bag) -> tuple[RunMetadata, Scene | None, str]:
    """Return the run account and the scene in a bag; blank, None and why not if unreadable."""
    try:
        return read_run_metadata(bag), recorded_scene(bag), ''
    except LinkageError as error:
        return RunMetadata(), None, f'{error.where}: {error.reason}'


def _check_joints(bag: Bag, scene: Scene, recorded: Scene | None, output: Path | None) -> None:
    """Raise if the replay could neither compare joints nor write a bag."""
    if (
        output is not None
        or recorded is None
        or set(recorded.joint_names) & set(scene.joint_names)
    ):
        return
    raise LinkageError(
        scene.linkages[0].content.file,
        f'publishes {list_names(scene.joint_names)}, and {bag.path} holds '
        f'{list_names(recorded.joint_names)}: '
        'nothing to compare',
        'write a new bag with -o',
    )


def _messages(tick: Tick | None, names: Sequence[str], shared: Sequence[str]) -> list[bytes]:
    """Return the messages of a tick, whose topics have ``names``, on the shared topics."""
    made = (tick.message, *tick.extras) if tick is not None else ()
    by_name = dict(zip(names, made, strict=False))
    return [by_name.get(name, b'') for name in shared]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_bag(parser)
    parser.add_argument('--scene', metavar='SCENE', help=f'another scene to run: {SCENE_HELP}')
    add_set(parser)
    parser.add_argument(
        '-o',
        '--output',
        type=Path,
        metavar='FOLDER',
        help='new bag, with --scene or --set; or the result, OUTPUT.csv, .xlsx, .parquet, .json '
        'or .txt',
    )
    add_force(parser)
    parser.add_argument(
        '--crank-topic',
        metavar='TOPIC',
        help="the samples' topic, with --scene or --set; absent, the run's own, /crank_states, or "
        'the only one that has the input joints',
    )
    add_result(parser, output=False)
    add_trust(parser)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Replay the bag; return the exit code that the module docstring describes."""
    is_counterfactual = arguments.scene is not None or bool(arguments.set)
    new_bag = arguments.output
    if new_bag is not None and new_bag.suffix.lower() in RESULTS:
        new_bag = None
    for option, value in (('-o', new_bag), ('--crank-topic', arguments.crank_topic)):
        if value is not None and not is_counterfactual:
            raise LinkageError(option, 'is for another scene', 'name it with --scene or --set')
    bag = open_bag(arguments.bag, stop)
    reading = BagReading(bag, stop)
    if not is_counterfactual:
        scene = _own_scene(bag, arguments)
        account = replay_report(bag, reading, scene)
        code = {IDENTICAL: 0, DIFFERENT: EXIT_DIFFERENT}.get(account['verdict'], EXIT_INCOMPLETE)
    else:
        scene = _other_scene(bag, arguments)
        if RUN_FILE in bag.attachments and 'seed' not in scene.linkages[0].content:
            # The same seeds: the scene makes the difference, not the noise.
            scene = replace(scene, seed=read_run_metadata(bag).seed)
        account = _replayed_with(
            bag,
            reading,
            scene,
            arguments.crank_topic,
            new_bag,
            force=arguments.force,
        )
        code = 0
    parts = (_counterfactual_parts if is_counterfactual else _proof_parts)(account, scene.units)
    show_result(Result(account, [*parts]), arguments)
    for line in _find_shortcomings(account):
        print(f'linkage replay: {line}', file=sys.stderr)
    if reading.missing:
        return EXIT_DIFFERENT
    return code or (EXIT_INCOMPLETE if reading.damage or reading.stopped else 0)


def _other_scene(bag: Bag, arguments: argparse.Namespace) -> Scene:
    """Return the scene of --scene, or of the bag, with the keys of --set."""
    if arguments.scene is not None:
        return load_scene(arguments.scene, arguments.set)
    return scene_of(bag, trust_effects=arguments.trust_effects, settings=arguments.set)


def _own_scene(bag: Bag, arguments: argparse.Namespace) -> Scene:
    """Return the scene of the bag."""
    try:
        return scene_of(bag, trust_effects=arguments.trust_effects)
    except BagError as error:
        raise BagError(error.where, error.reason, 'name a scene to run with --scene') from None


def replay_report(bag: Bag, reading: BagReading, scene: Scene) -> dict[str, Any]:
    """
    Run a bag's own scene once more; return the comparison with the recorded run.

    A LinkageError is raised if the bag holds no joint states to compare.
    """
    begin: list[int] = []

    def note_begin(tick: ReplayedTick) -> None:
        if not begin:
            begin.append(tick.time)

    with reading.with_progress() as messages:
        proof = verify_replay(bag, scene, messages, note_begin)
    if not begin and not reading.damage and not reading.stopped:
        raise BagError(bag.path, 'holds no joint states', 'record a run with a crank')
    run = read_run_metadata(bag)
    versions = {
        'bag': {**run.versions, **run.user_effects},
        'here': {**versions_here(), **user_effects_here(scene)},
    }
    account = _proof_account(proof, turning_joints(scene), versions)
    return bag_account(bag, scene, reading, begin) | account


def _proof_parts(account: dict[str, Any], units: Units) -> Iterator[Table | str]:
    begin = account['begin_ns'] or 0
    differ, ticks = account['different_ticks'], account['compared_ticks']
    verdict = account['verdict']
    if verdict == IDENTICAL:
        text = f'identical: all {ticks} ticks give the recorded bytes'
    else:
        text = f'{verdict}: {differ} of {ticks} ticks differ' if ticks else verdict
    yield f'{account["bag"]}: {text}'
    if account['beginning_missing']:
        yield account['beginning_missing']
    for gap in account['gaps'] if differ else ():
        yield escape_unprintable(gap)
    first = account['first_difference']
    if first and differ:
        yield escape_unprintable(f'first: {first_text(first, begin)}')
        last = account['last_different_tick']['tick']
        if last < account['ticks'] and last != first['tick']:
            yield f'from tick {last + 1} on all are the same'
    elif first:
        yield escape_unprintable(f'undecided, first: {first_text(first, begin)}')
    if account['withheld_ticks']:
        yield f'{account["withheld_ticks"]} ticks are without a message, then and now'
    yield from versions_text(account['versions'])
    yield _topics_table(account)
    if account['greatest']:
        yield _greatest_table(account, begin, units)


def _counterfactual_parts(account: dict[str, Any], units: Units) -> Iterator[Table | str]:
    unchanged = account['unchanged']
    if unchanged and unchanged['different_ticks']:
        yield escape_unprintable(_unchanged_text(account['bag'], unchanged))
    yield (
        f'{account["bag"]}, as {account["scene"]}: {account["joint_states"]} joint states, '
        f'from {escape_unprintable(account["crank_topic"])}'
    )
    for key, when in (('joints_only_recorded', 'recorded'), ('joints_only_now', 'now')):
        if account[key] and account['topics']:
            yield f'only {when}: {", ".join(account[key])}'
    if account['topics']:
        yield _topics_table(account)
    if account['joints']:
        yield joints_table(account, account['begin_ns'] or 0, units)
    if account['new_bag']:
        yield ''
        counts = ', '.join(f'{count} of {name}' for name, count in account['written'].items())
        yield f'{account["new_bag"]}: {counts}'


def _unchanged_text(bag: str, unchanged: Mapping[str, Any]) -> str:
    """Return the line that says how much of the difference is not of the other scene."""
    apart = ', '.join(
        f'{_number_text(row["difference"])} {row["unit"]}' for row in unchanged['greatest']
    )
    return (
        f'{bag}: the unchanged scene itself differs in {unchanged["different_ticks"]} of '
        f'{unchanged["compared_ticks"]} ticks'
        + (f', by up to {apart}' if apart else '')
        + (f' ({unchanged["why"]})' if unchanged['why'] else '')
    )


def _find_shortcomings(account: dict[str, Any]) -> Iterator[str]:
    """Yield the reasons why a part of the bag was not replayed."""
    if account['truncated']:
        yield f'{account["bag"]}: unfinished: {account["unfinished"]}; its content was replayed'
    if account['missing']:
        yield (
            f'{account["bag"]}: {account["missing"]:,} messages that its metadata.yaml promises '
            'are not there; the others were replayed'
        )
    if account['damage']:
        yield f'{account["damage"]}; the part before it was replayed'
    if account['stopped']:
        yield 'stopped; the rest of the bag was not replayed'
