# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Read the messages of a bag for a command: with progress, up to damage or Ctrl-C."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from itertools import count
from pathlib import Path
import sys
from threading import Event
from typing import Any

from linkage_ros.bag import (
    Bag,
    BagMessage,
    Contents,
    counts_in,
    expected_counts,
    FAILURE,
    information_of,
    Layout,
    layout_of,
    missing_start_reason,
    MOST_ATTACHED,
    NOTHING_LOST,
    read_bag,
    read_raw_metadata,
    read_run_metadata,
    RECOVERED,
    REPORT_EVERY,
    RunMetadata,
    serialized_metadata,
)
from linkage_ros.cli.arguments import finite_or_none
from linkage_ros.cli.terminal import show_progress
from linkage_ros.description import Scene, SceneLinkage
from linkage_ros.errors import BagError, escape_unprintable, list_names
from linkage_ros.kinematics import four_bars, PlanarClosure
from linkage_ros.replay import recorded_scene, WorstResiduals
from linkage_ros.signals import heed_signals, StoppedError

_MIB = 2**20
_BESIDE = 47  # bytes that a message takes in an MCAP file and its index, without its content

_GAP = 'what depends on a missing one may differ'


def open_bag(path: Path, stop: Event) -> Bag:
    """
    Open a bag for reading as far as it goes; report attachments that are not read.

    Errors are those of `read_bag`; a StoppedError says that a signal came while the file was
    searched because its index is missing.
    """

    def check_stop(_read: int) -> None:
        if stop.is_set():
            raise StoppedError

    bag = read_bag(path, allow_truncated=True, progress=check_stop)
    if bag.passed_over:
        line = (
            f'linkage: {path}: attachments beyond {MOST_ATTACHED // _MIB} MiB are not read: '
            f'{list_names(bag.passed_over)}'
        )
        print(escape_unprintable(line), file=sys.stderr)
    return bag


def add_trust(parser: argparse.ArgumentParser) -> None:
    """Declare the option to import the modules that a bag's scene names."""
    parser.add_argument(
        '--trust-effects',
        action='store_true',
        help='import the modules that the scene of the bag names as effects, and list them; this '
        'runs their code',
    )


def scene_of(bag: Bag, *, trust_effects: bool, settings: Sequence[str] = ()) -> Scene:
    """
    Return the scene of a bag; print first which modules it imports.

    Errors are those of `recorded_scene`.
    """
    scene = recorded_scene(bag, settings=settings)
    if not trust_effects or not scene.not_imported:
        return scene
    from linkage_ros.stages.effects import found_in

    for name in scene.not_imported:
        where = found_in(name)
        line = f'linkage: {bag.path} is trusted: imports {name}, and the name leads to {where}'
        print(escape_unprintable(line), file=sys.stderr, flush=True)
    return recorded_scene(bag, trust_effects=True, settings=settings)


def path_beside(bag: Path, suffix: str) -> Path:
    """Return the path next to the bag that has its name and this suffix."""
    # The current folder, '.', has no name.
    named = bag if bag.name not in ('', '..') else bag.resolve()
    return named.with_name(named.name + suffix) if named.name else named


def unfinished_text(bag: Bag) -> str:
    """Return why a truncated bag has no end."""
    text = 'its recording was killed, or still runs'
    return text if bag.path.is_dir() else f'{text}, or goes on in another file'


def run_or_blank(bag: Bag) -> RunMetadata:
    """Return the run account in a bag; a blank one if it is missing or damaged."""
    try:
        return read_run_metadata(bag)
    except BagError:
        return RunMetadata()


def describe_gaps(bag: Bag) -> Iterator[str]:
    """Yield the gaps within a bag; what follows a gap may differ in a replay."""
    diagnostics = read_raw_metadata(bag).get('diagnostics_topic')
    dropped = sum(
        count for topic, count in counts_in(bag.custom, 'dropped').items() if topic != diagnostics
    )
    if dropped:
        yield f'{dropped} messages were dropped during the recording: {_GAP}'
    recovered = bag.custom.get(RECOVERED, '')
    if recovered and not recovered.endswith(NOTHING_LOST):
        yield f'recovered {recovered}: {_GAP}'


class BagReading:
    """Read the messages of a bag up to damage or the event of a stop request, with progress."""

    def __init__(self, bag: Bag, stop: Event) -> None:
        self.damage = ''
        """The damage, on one line; '' if the bag was read to its end."""
        self.stopped = False
        """True if a signal stopped the reading."""
        self.missing = 0
        """Messages that the bag's metadata promise and that are not there; known at its end."""
        self._bag, self._stop = bag, stop
        self._advance: Callable[[int, int], None] = lambda _done, _of: None
        self._size = max(1, sum(layout_of(file).content for file in bag.files) // _MIB)

    def read_silently(self) -> Iterator[BagMessage]:
        """Yield the messages without progress; raise StoppedError if a signal came."""
        for number, message in enumerate(self._bag.messages(), 1):
            yield message
            if not number % REPORT_EVERY and self._stop.is_set():
                raise StoppedError

    @contextmanager
    def with_progress(self) -> Iterator[Iterator[BagMessage]]:
        """Give an iterator over the messages, and show the progress on the terminal."""
        with heed_signals(), show_progress('replayed [MiB]') as self._advance:
            yield self._read_messages()

    def _read_messages(self) -> Iterator[BagMessage]:
        read = 0
        messages = self._bag.messages()
        for number in count(1):
            try:
                message = next(messages, None)
            except BagError as error:
                self.damage = f'{error.where}: {error.reason}'
                return
            if message is None:
                promised = expected_counts(_read_metadata(self._bag))
                self.missing = max(0, sum(promised.values()) - (number - 1))
                return
            read += len(message.data) + _BESIDE
            yield message
            if not number % REPORT_EVERY:
                self._advance(read // _MIB, max(self._size, read // _MIB))
                if self._stop.is_set():
                    self.stopped = True
                    return


# A bag as JSON: numbers are in SI units or [ns], and their keys say so.


def bag_json(bag: Bag, layouts: list[Layout], contents: Contents) -> dict[str, Any]:
    """Return the description of any bag, recorded by this package or not."""
    begin, end = contents.begin, contents.end
    metadata = _read_metadata(bag)
    within = next((layout.rosbag2 for layout in layouts if layout.rosbag2), None)
    if not metadata and within is not None:
        metadata = serialized_metadata(within)
    run = read_raw_metadata(bag)
    # Only bags that have metadata left out say so.
    discarded = counts_in(bag.custom, 'discarded')
    counted = {word: counts_in(bag.custom, word) for word in ('received', 'dropped')}
    return {
        'bag': str(bag.path),
        'duration_ns': None if begin is None or end is None else end - begin,
        'begin_ns': begin,
        'begin': local_time_text(begin),
        'end_ns': end,
        'end': local_time_text(end),
        'size_bytes': sum(file.stat().st_size for file in bag.files),
        'files': [{'name': file.name, 'size_bytes': file.stat().st_size} for file in bag.files],
        'compressions': _sum_compressions(layouts),
        'truncated': bag.truncated,
        'unfinished': unfinished_text(bag) if bag.truncated else None,
        'beginning_missing': missing_start_reason(bag, run_or_blank(bag)) or None,
        'damage': contents.damage or None,
        'stopped': contents.stopped,
        'recording_failure': bag.custom.get(FAILURE),
        'messages': sum(topic.messages for topic in contents.topics),
        'topics': [
            {
                'name': topic.name,
                'type': topic.type,
                'messages': topic_record.messages,
                'rate_hz': topic_record.mean_rate,
                'size_bytes': topic_record.size,
                'reliability': topic.qos.reliability,
                'durability': topic.qos.durability,
                'qos_understood': topic.qos.understood,
                'received': counted['received'].get(topic.name),
                'dropped': counted['dropped'].get(topic.name),
                'discarded': discarded.get(topic.name, 0)
                if discarded or counted['received']
                else None,
            }
            for topic_record in contents.topics
            for topic in [topic_record.topic]
        ],
        'versions': {
            'linkage_ros': _text_or_none(run.get('linkage_ros')),
            'python': _text_or_none(run.get('python')),
            'machine': _text_or_none(run.get('machine')),
            'ros_distro': _text_or_none(metadata.get('ros_distro')),
            'rosbag2_metadata': _whole_number(metadata.get('version')),
            'written_by': ', '.join(dict.fromkeys(layout.library for layout in layouts)) or None,
        },
    }


def _read_metadata(bag: Bag) -> Mapping[str, Any]:
    return information_of(bag.path) if bag.path.is_dir() else {}


def scene_json(scene: Scene) -> dict[str, Any]:
    """Return the description of the scene that a bag carries."""
    return {
        'name': scene.name,
        'rate_hz': scene.rate,
        'seed': scene.seed,
        'faults': list(scene.faults),
        'linkages': [_linkage_json(scene_linkage) for scene_linkage in scene.linkages],
    }


def worst_account(worst: WorstResiduals) -> dict[str, Any]:
    """Return the worst residuals of a linkage, to be merged with its description."""
    residual = near = None
    if worst.residual is not None:
        value, place = worst.residual
        residual = {'residual_m': value, 'time_ns': place.time, 'inputs': list(place.inputs)}
    if worst.nearest is not None:
        nearness, place = worst.nearest
        near = {
            'conditioning': nearness.conditioning,
            'transmission_angle_rad': nearness.transmission_angle,
            'input_to_toggle': finite_or_none(nearness.toggle_distance),
            'time_ns': place.time,
            'inputs': list(place.inputs),
        }
    closure = worst.closure
    bars = four_bars(closure.structure) if isinstance(closure, PlanarClosure) else []
    return {
        'four_bars': [{'kind': bar.kind.name, 'lengths_m': list(bar.lengths)} for bar in bars],
        'states': worst.states,
        'toggles': worst.toggles,
        'limited': worst.limited,
        'worst_residual': residual,
        'nearest_to_toggle': near,
    }


_FIRST_DATE = 946_684_800
"""Begin of the year 2000, in [s]: nothing was recorded before."""


def local_time_text(time: int | None) -> str | None:
    """
    Return a time in [ns] as local date and time, to the nanosecond.

    A simulated clock begins near 0: its times have no date.
    """
    if time is None:
        return None
    seconds, rest = divmod(time, 1_000_000_000)
    if 0 <= seconds < _FIRST_DATE:
        return f'{seconds}.{rest:09d} s of a simulated clock'
    there = datetime.fromtimestamp(seconds).astimezone()
    return f'{there:%Y-%m-%d %H:%M:%S}.{rest:09d}{there:%z}'


def _linkage_json(scene_linkage: SceneLinkage) -> dict[str, Any]:
    linkage = scene_linkage.linkage
    return {
        'name': scene_linkage.name,
        'links': len(linkage.link_names),
        'inputs': [
            {'joint': name, 'unit': driven.unit}
            for name, driven in zip(scene_linkage.input_names, linkage.inputs, strict=True)
        ],
        'joints': list(scene_linkage.joint_names),
        'drive': scene_linkage.drive[0],
        'effects': list(scene_linkage.effects),
        'effects_not_imported': list(scene_linkage.not_imported),
    }


def _sum_compressions(layouts: list[Layout]) -> list[dict[str, Any]]:
    sums: dict[str, tuple[int, int]] = {}
    for layout in layouts:
        for name, (stored, content) in layout.compressions.items():
            before = sums.get(name, (0, 0))
            sums[name] = before[0] + stored, before[1] + content
    return [
        {'name': name, 'stored_bytes': stored, 'content_bytes': content}
        for name, (stored, content) in sums.items()
    ]


def _text_or_none(value: Any) -> str | None:
    # Not for lists: with YAML aliases, a small file can make an enormous text.
    return str(value) if isinstance(value, str | int | float) else None


def _whole_number(value: Any) -> int | None:
    return value if isinstance(value, int) else None
