# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Describe a bag and its run.

For a bag of linkage_ros the scene in it is run once more, state by state: how well every loop
closed, and where the linkage came nearest to a toggle. A foreign bag is described without these.
Ctrl-C ends the reading; the part read until then is described.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import sys
from threading import Event
from typing import Any

from linkage_ros.bag import Bag, contents_of, layout_of
from linkage_ros.cli.arguments import add_bag, add_radians, DEGREES, DisplayUnits
from linkage_ros.cli.bag_reading import (
    add_trust,
    bag_json,
    open_bag,
    scene_json,
    scene_of,
    worst_account,
)
from linkage_ros.cli.result import add_result, Result, show_result
from linkage_ros.cli.table import Column, facts_table, Table, table_of_rows
from linkage_ros.cli.terminal import show_progress
from linkage_ros.description import Scene
from linkage_ros.errors import escape_unprintable, LinkageError
from linkage_ros.kinematics import wrap_angle
from linkage_ros.replay import examine_states
from linkage_ros.signals import heed_signals

_MIB = 2**20

_TOPIC = (
    Column('topic', 'name'),
    Column('type', 'type'),
    Column('>messages', 'messages'),
    Column('>rate [Hz]', 'rate_hz', form='.6g'),
)

EXAMPLE = 'linkage info my_bag'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_bag(parser)
    add_result(parser)
    add_radians(parser)
    add_trust(parser)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Describe the bag; return 1 if stopped."""
    bag = open_bag(arguments.bag, stop)
    with heed_signals():  # a signal ends the reading; the part read so far is still shown
        account, scene = describe_bag(bag, stop, trust_effects=arguments.trust_effects)
    result = Result(account, [*bag_tables(account, arguments.angles, scene)])
    show_result(result, arguments, arguments.angles)
    if account['stopped']:
        print('linkage info: stopped; not all of the bag was read', file=sys.stderr)
    return int(account['stopped'])


def describe_bag(
    bag: Bag, stop: Event, *, trust_effects: bool = False
) -> tuple[dict[str, Any], Scene | None]:
    """
    Return the description of a bag, as JSON holds it, and its scene.

    A BagError is raised if a file of the bag cannot be read.
    """
    layouts = [layout_of(file) for file in bag.files]
    size = max(1, sum(layout.content for layout in layouts) // _MIB)
    with show_progress('read [MiB]') as advance:
        contents = contents_of(bag, lambda read: advance(read // _MIB, size), stop.is_set)
    account = bag_json(bag, layouts, contents)
    account |= {'scene': None, 'scene_missing': None, 'replay': None}
    scene = None
    try:
        scene = scene_of(bag, trust_effects=trust_effects)
        account['scene'] = scene_json(scene)
        states = max((topic['messages'] for topic in account['topics']), default=0)
        with show_progress('states looked at') as advance:
            examined = examine_states(
                bag, scene, lambda done: advance(done, max(done, states)), stop.is_set
            )
    except LinkageError as error:
        account['scene_missing'] = f'{error.where}: {error.reason}'
        return account, scene
    account['replay'] = {'joint_states': examined.joint_states, 'same_bytes': examined.same}
    account['stopped'] |= examined.stopped
    for linkage, worst in zip(account['scene']['linkages'], examined.linkages, strict=True):
        linkage.update(worst_account(worst))
    return account, scene


def bag_tables(
    account: dict[str, Any], units: DisplayUnits = DEGREES, scene: Scene | None = None
) -> Iterator[Table]:
    """Yield the description of a bag as tables, with the lengths of its scene's linkages."""
    yield _facts_table(account['bag'], _bag_facts(account))
    counters = [
        Column(f'>{word}', word, form=_count_text)
        for word in ('received', 'dropped', 'discarded')
        if word == 'dropped' or _sum_counters(account, word)
    ]
    columns = (*_TOPIC, *counters, Column('QoS', 'qos'))
    rows = ({**topic, 'qos': _qos_text(topic)} for topic in account['topics'])
    yield table_of_rows('Topics', 'topics', columns, rows)
    files = [linkage.linkage_content.units for linkage in scene.linkages] if scene else []
    for index, linkage in enumerate((account['scene'] or {'linkages': []})['linkages']):
        units = units.of_file(files[index]) if files else units
        title = f'Linkage {linkage["name"]}' if linkage['name'] else 'Linkage'
        yield _facts_table(title, _linkage_rows(linkage, account['begin_ns'], units))


def _count_text(count: int | None, _units: DisplayUnits) -> str:
    return '?' if count is None else str(count)


def _bag_facts(account: dict[str, Any]) -> Iterator[tuple[str, str]]:
    duration = account['duration_ns']
    yield 'duration', 'no messages' if duration is None else f'{duration / 1e9:.9f} s'
    for name in ('begin', 'end') if duration is not None else ():
        yield name, f'{account[name]} ({account[f"{name}_ns"]} ns)'
    yield 'size', f'{account["size_bytes"]} bytes'
    yield 'files', ', '.join(escape_unprintable(file['name']) for file in account['files'])
    yield 'compression', ', '.join(map(_compression_text, account['compressions'])) or 'none'
    yield 'unfinished', account['unfinished'] or 'no'
    if account['beginning_missing']:
        yield 'beginning', account['beginning_missing']
    if account['damage']:
        yield 'DAMAGED', f'{account["damage"]}; only the part before it is described'
    if account['recording_failure']:
        yield 'FAILED', account['recording_failure']
    yield 'messages', str(account['messages'])
    received, dropped, discarded = (
        _sum_counters(account, word) for word in ('received', 'dropped', 'discarded')
    )
    if received is not None:
        yield 'received', str(received)
    unknown = 'unknown: linkage_ros did not close the bag'
    yield 'dropped', unknown if dropped is None else str(dropped)
    if discarded:
        yield 'discarded', f'{discarded}, in files that newer ones replaced'
    yield 'versions', ', '.join(_version_texts(account['versions'])) or 'unknown'
    scene = account['scene']
    if scene:
        rate = (
            f'{scene["rate_hz"]:g} ticks a second' if scene['rate_hz'] else 'one tick per sample'
        )
        faults = f', faults {", ".join(scene["faults"])}' if scene['faults'] else ''
        yield 'scene', f'{scene["name"]}, {rate}, seed {scene["seed"]}{faults}'
    if account['scene_missing']:
        yield (
            'missing' if not scene else 'not run again',
            f'{account["scene_missing"]}; residual and nearness to a toggle are unknown',
        )
    if account['replay']:
        of, same = account['replay'].values()
        yield 'run again', f'{same} of {of} joint states give the recorded bytes'


def _sum_counters(account: dict[str, Any], word: str) -> int | None:
    """Return the bag's counters over all topics; None if it has none."""
    counts = [topic[word] for topic in account['topics']]
    return sum(counts) if counts and None not in counts else None


def _linkage_rows(
    linkage: dict[str, Any], begin: int | None, units: DisplayUnits
) -> Iterator[tuple[str, str]]:
    bars = [
        f'{bar["kind"]} ({_lengths_text(bar["lengths_m"], units)})'
        for bar in linkage.get('four_bars', ())
    ]
    yield 'links', '; '.join([str(linkage['links']), *bars])
    yield 'joints', ', '.join(linkage['joints']) or 'none'
    own = [f'{name} (not imported)' for name in linkage['effects_not_imported']]
    yield 'effects', ', '.join([*linkage['effects'], *own]) or 'none'
    inputs = linkage['inputs']
    yield 'drive', f'{linkage["drive"]}, of {", ".join(driven["joint"] for driven in inputs)}'
    if 'states' not in linkage:
        return
    toggles = f', {linkage["toggles"]} of them at a toggle' if linkage['toggles'] else ''
    limited = f', {linkage["limited"]} beyond limits' if linkage['limited'] else ''
    yield 'states', f'{linkage["states"]} closed{toggles}{limited}'
    worst, near = linkage['worst_residual'], linkage['nearest_to_toggle']
    if worst:
        residual = units.format_length(worst['residual_m'], '.1e')
        yield 'worst residual', f'{residual}, {_event_text(worst, inputs, begin, units)}'
    if near:
        distance = near['input_to_toggle']
        away = '' if distance is None else f', {_input_text(distance, inputs[0], units)} from one'
        angle = f'transmission angle {units.format_angle(near["transmission_angle_rad"])}'
        nearness = f'conditioning {near["conditioning"]:.4g}, {angle}{away}'
        yield 'nearest toggle', f'{nearness}, {_event_text(near, inputs, begin, units)}'


def _lengths_text(lengths: list[float], units: DisplayUnits) -> str:
    texts = (f'{units.convert(length, "m"):g}' for length in lengths)
    return f'{", ".join(texts)} {units.length}'


def _event_text(
    event: dict[str, Any], inputs: list[dict[str, str]], begin: int | None, units: DisplayUnits
) -> str:
    """Return the time and place of an event."""
    values = ', '.join(
        f'{driven["joint"]} {_input_text(value, driven, units)}'
        for driven, value in zip(inputs, event['inputs'], strict=True)
    )
    return f'at {(event["time_ns"] - (begin or 0)) / 1e9:+.6f} s, {values}'


def _input_text(value: float, driven: dict[str, str], units: DisplayUnits) -> str:
    turning = driven['unit'] == 'rad'
    return units.value_text(wrap_angle(value) if turning else value, turning)


def _compression_text(compression: dict[str, Any]) -> str:
    if compression['name'] == 'none':
        return 'none'
    return (
        f'{escape_unprintable(compression["name"])}, {compression["content_bytes"]} bytes in '
        f'{compression["stored_bytes"]}'
    )


def _version_texts(versions: dict[str, Any]) -> Iterator[str]:
    for key, name in (
        ('linkage_ros', 'linkage_ros'),
        ('python', 'Python'),
        ('machine', 'on'),
        ('ros_distro', 'ROS 2'),
        ('rosbag2_metadata', 'rosbag2 metadata'),
        ('written_by', 'written by'),
    ):
        if versions[key] is not None:
            yield f'{name} {escape_unprintable(str(versions[key]))}'


def _qos_text(topic: dict[str, Any]) -> str:
    """Return a quality of service in one word; two for transient local."""
    if not topic['qos_understood']:
        return 'unknown, taken as reliable'
    latched = ', transient local' if topic['durability'] == 'transient_local' else ''
    return escape_unprintable(topic['reliability']).replace('_', ' ') + latched


def _facts_table(title: str, facts: Iterator[tuple[str, str]]) -> Table:
    texts = ((name, escape_unprintable(value)) for name, value in facts)
    return facts_table(escape_unprintable(title), texts)
