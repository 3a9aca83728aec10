# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Events of a run, in the order of its bag: samples, faults, resets, results of ticks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
import json
import re
from typing import Any, NamedTuple, Protocol

from linkage_ros.bag.metadata import counts_in
from linkage_ros.bag.reader import Bag, BagMessage
from linkage_ros.bag.run_account import (
    BEGUN,
    MID_RUN,
    RUN_FILE,
    SEED,
    USER_EFFECTS,
    VERSIONS,
    WRENCH_TOPICS,
)
from linkage_ros.errors import BagError

_LONGEST_ACCOUNT = 4 * 2**20
"""Greatest size [bytes]; usually a kilobyte, more if the bag was made from another one."""

_TEXTS = (
    'scene',
    'scene_folder',
    'crank_topic',
    'joint_states_topic',
    'faults_topic',
    'withheld_topic',
    'resets_topic',
)
"""Keys of the account that are also fields of `RunMetadata`."""

_NUMBER = re.compile(r'_([0-9]{1,9})\.mcap$')


class SampleEvent(NamedTuple):
    """Crank message that a tick took, with the tick's time and the source's, in [ns]."""

    log_time: int
    publish_time: int
    data: bytes


class WrenchEvent(NamedTuple):
    """Message with a wrench that a tick took."""

    # The tick's time and the source's, in [ns].
    log_time: int
    publish_time: int
    data: bytes  # The message
    number: int  # Index of its topic among the run's topics


class FaultEvent(NamedTuple):
    """Message that a fault begins or ends, with its time, in [ns]."""

    log_time: int
    publish_time: int
    data: bytes


class ResetEvent(NamedTuple):
    """Message that the pipeline was reset before this tick, with its time, in [ns]."""

    log_time: int
    publish_time: int
    data: bytes


class TickEvent(NamedTuple):
    """Result of a tick."""

    # Time of the tick, and time it solved for, in [ns].
    log_time: int
    time: int
    # The joint state and the auxiliary messages, each empty if there is none; all are empty for a
    # tick that the bag records as one without messages.
    messages: tuple[bytes, ...]


Event = SampleEvent | WrenchEvent | FaultEvent | ResetEvent | TickEvent


class RunMetadata(NamedTuple):
    """The run's account in its bag; '' for missing topics."""

    # Name of the scene, and the folder for its paths, relative to the bag's folder; '' if unknown.
    scene: str = ''
    scene_folder: str = ''
    # Names of the topics.
    crank_topic: str = ''
    joint_states_topic: str = ''
    faults_topic: str = ''
    withheld_topic: str = ''
    resets_topic: str = ''
    extras: tuple[str, ...] = ()
    wrenches: tuple[str, ...] = ()  # Names of the topics with wrenches, in the order of the scene
    begun: str = ''  # When the bag was begun, as in `MID_RUN`; '' if it does not say
    versions: Mapping[str, str] = {}  # Versions of the software of the run, by name
    user_effects: Mapping[str, str] = {}  # Modules of the user-defined effects, by name
    seed: int = 0  # Seed of all random numbers


class RunFiles(Protocol):
    """Holds the files of a run's scene: a bag, or a node's message."""

    @property
    def path(self) -> Any:
        """Return the origin of the files, for error messages."""

    @property
    def attachments(self) -> Mapping[str, bytes]:
        """Return the files by name."""


def read_run_metadata(bag: RunFiles) -> RunMetadata:
    """Return the run's account in its bag; raise `BagError` if it is missing or damaged."""
    if RUN_FILE not in bag.attachments:
        raise BagError(
            bag.path, f'carries no {RUN_FILE}', 'name a bag that linkage_ros has recorded'
        )
    account = read_raw_metadata(bag)
    extras, wrenches = account.get('extra_topics', []), account.get(WRENCH_TOPICS, [])
    texts = {
        key: value
        for key, value in account.items()
        if key in (*_TEXTS, BEGUN, *VERSIONS) and isinstance(value, str)
    }
    missing = {'scene', 'joint_states_topic'} - set(texts)
    wrong = (account.keys() & {*_TEXTS, BEGUN}) - set(texts)
    modules = account.get(USER_EFFECTS)
    if not isinstance(modules, dict):
        modules = {}
    topics = [value for key, value in texts.items() if key.endswith('_topic')]
    named = _are_names(topics) and _are_names(extras) and _are_names(wrenches)
    seed = account.get(SEED, 0)
    if missing or wrong or not named or type(seed) is not int:
        raise BagError(bag.path, f'its {RUN_FILE} is damaged', 'name another bag')
    # Only displayed; the name of a file may contain any character.
    if not texts['scene'].isprintable():
        texts['scene'] = repr(texts['scene'])[1:-1]
    return RunMetadata(
        **{key: texts[key] for key in _TEXTS if key in texts},
        extras=tuple(extras),
        wrenches=tuple(wrenches),
        begun=texts.get(BEGUN, ''),
        versions={key: texts[key] for key in VERSIONS if key in texts},
        user_effects={name: str(module) for name, module in modules.items()},
        seed=seed,
    )


def _are_names(values: Any) -> bool:
    # A string that is not printable is not a topic, and some cannot be stored in a bag.
    return isinstance(values, list) and all(
        isinstance(value, str) and value.isprintable() for value in values
    )


def read_raw_metadata(bag: RunFiles) -> dict[str, Any]:
    """Return the run's account as stored in its bag; empty if it is damaged."""
    try:
        text = bag.attachments[RUN_FILE]
        account = json.loads(text) if len(text) <= _LONGEST_ACCOUNT else {}
    except (KeyError, ValueError, RecursionError):
        return {}
    return account if isinstance(account, dict) else {}


def recorded_events(
    run: RunMetadata,
    is_own: Callable[[bytes], bool],
    messages: Iterable[BagMessage],
    crank_topic: str | None = None,
) -> Iterator[Event]:
    """
    Combine the messages of a bag into the events of the run, in order.

    ``is_own`` recognises the run's own joint states where they share a topic with crank samples;
    the samples are on ``crank_topic``, by default the run's own.
    """
    crank = run.crank_topic if crank_topic is None else crank_topic
    shared = run.crank_topic == run.joint_states_topic
    topics = (run.joint_states_topic, *run.extras) if run.joint_states_topic else ()
    outputs = {topic: index for index, topic in enumerate(topics)}
    others = {run.faults_topic, run.withheld_topic, run.resets_topic} - {''}
    wrenches = {topic: index for index, topic in enumerate(run.wrenches)}
    others |= set(wrenches)
    open_tick: tuple[int, int, list[bytes]] | None = None  # may get further messages
    for topic, log_time, publish_time, data in messages:
        output = outputs.get(topic)
        if shared and output == 0 and not is_own(data):
            output = None
        taken = topic == crank and (output is None or crank != run.crank_topic)
        if output is None and not taken and topic not in others:
            continue
        if output is not None and open_tick is not None:
            _, time, made = open_tick
            if time == publish_time and not any(made[output:]):
                made[output] = data
                continue
        if open_tick is not None:
            log, time, made = open_tick
            yield TickEvent(log, time, tuple(made))
            open_tick = None
        if taken:
            yield SampleEvent(log_time, publish_time, data)
        if output is not None:
            open_tick = log_time, publish_time, [b''] * len(outputs)
            open_tick[2][output] = data
        elif topic in wrenches:
            yield WrenchEvent(log_time, publish_time, data, wrenches[topic])
        elif topic == run.faults_topic:
            yield FaultEvent(log_time, publish_time, data)
        elif topic == run.resets_topic:
            yield ResetEvent(log_time, publish_time, data)
        elif topic == run.withheld_topic:
            yield TickEvent(log_time, publish_time, (b'',) * len(outputs))
    if open_tick is not None:
        log, time, made = open_tick
        yield TickEvent(log, time, tuple(made))


def missing_start_reason(bag: Bag, run: RunMetadata) -> str:
    """Return why the first messages of a run are not in its bag; '' if they are."""
    discarded = sum(counts_in(bag.custom, 'discarded').values())
    if discarded:
        return f'its first {discarded} messages were removed for newer ones'
    if run.begun == MID_RUN:
        return 'begun in mid-run'
    first = bag.files[0].name
    number = _NUMBER.search(first)
    if number and int(number[1]):
        return f'begins with {first}, which is not the first file of its recording'
    return ''
