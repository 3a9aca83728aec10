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


"""The events of a run, in the order of its bag: samples, faults, resets, results of ticks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
import json
import re
from typing import Any, NamedTuple

from linkage_ros.bag.reader import Bag, BagMessage, RUN_FILE
from linkage_ros.bag.recording_stats import counts_in
from linkage_ros.errors import BagError

BEGUN, MID_RUN, WITH_THE_RUN = 'begun', 'mid-run', 'with the run'
"""The key under which a bag says when it was begun, and what it says."""

CHOSEN = 'solver'
"""The key under which it says what closes the loops, where the scene asks for an accuracy."""

OWN_EFFECTS = 'effects'
"""The key under which it says which modules the effects are that are not of this package."""

SEED = 'seed'
"""The key under which it says from what everything random came."""

_LONGEST_ACCOUNT = 4 * 2**20
"""In bytes; a kilobyte, but for what a bag says of the one that it was made from."""

VERSIONS = ('linkage_ros', 'python', 'machine')


class SampleEvent(NamedTuple):
    """A crank message that a tick took, by its clock and by that of the source, in [ns]."""

    log_time: int
    publish_time: int
    data: bytes


class FaultEvent(NamedTuple):
    """A message that a fault has begun or ended, and when, in [ns]."""

    log_time: int
    publish_time: int
    data: bytes


class Reset(NamedTuple):
    """A message that all was forgotten before this tick, and when, in [ns]."""

    log_time: int
    publish_time: int
    data: bytes


class TickEvent(NamedTuple):
    """
    What a tick made.

    Attributes
    ----------
    log_time, time
        When it was, and for when it solved, in [ns].
    messages
        The joint state and the extras, each empty where there is none; all are where the bag says
        that there was a tick without a message.

    """

    log_time: int
    time: int
    messages: tuple[bytes, ...]


Event = SampleEvent | FaultEvent | Reset | TickEvent


class RunAccount(NamedTuple):
    """
    What a run's account of itself says; of topics that there are not, ''.

    Attributes
    ----------
    scene, scene_folder
        The scene's name, and to what the paths in it are relative.
    crank_topic, joint_states_topic, faults_topic, withheld_topic, resets_topic, extras
        Names of the topics.
    begun
        When the bag was begun, as `MID_RUN`; '' where it does not say.
    versions
        Of what made it, by what they are of.
    solvers
        What was chosen to close the loops, as a scene could say it, by the name of the linkage.
    own_effects
        Which modules the effects are that are not of this package, by their names.
    seed
        From which everything random came. Runs that do not say it had 0, unless their scene did.

    """

    scene: str = ''
    scene_folder: str = ''
    crank_topic: str = ''
    joint_states_topic: str = ''
    faults_topic: str = ''
    withheld_topic: str = ''
    resets_topic: str = ''
    extras: tuple[str, ...] = ()
    begun: str = ''
    versions: Mapping[str, str] = {}
    solvers: Mapping[str, Any] = {}
    own_effects: Mapping[str, str] = {}
    seed: int = 0


def run_account(bag: Bag) -> RunAccount:
    """
    Return what a run says of itself in its bag.

    Raises
    ------
    BagError
        Where it says nothing, or that is damaged.

    """
    if RUN_FILE not in bag.attachments:
        raise BagError(
            bag.path, f'carries no {RUN_FILE}', 'name a bag that linkage_ros has recorded'
        )
    said = run_said(bag)
    extras = said.get('extra_topics', [])
    texts = {
        key: value
        for key, value in said.items()
        if key in (*_TEXTS, BEGUN, *VERSIONS) and isinstance(value, str)
    }
    missing = {'scene', 'joint_states_topic'} - set(texts)
    wrong = (said.keys() & {*_TEXTS, BEGUN}) - set(texts)
    solvers = said.get(CHOSEN, {})
    topics = [value for key, value in texts.items() if key.endswith('_topic')]
    named = _are_names(topics) and _are_names(extras)
    seed = said.get(SEED, 0)
    if missing or wrong or not named or not isinstance(solvers, dict) or type(seed) is not int:
        raise BagError(bag.path, f'its {RUN_FILE} is damaged', 'name another bag')
    # It is shown, and nothing else; a file's name may be anything.
    if not texts['scene'].isprintable():
        texts['scene'] = repr(texts['scene'])[1:-1]
    return RunAccount(
        **{key: texts[key] for key in _TEXTS if key in texts},
        extras=tuple(extras),
        begun=texts.get(BEGUN, ''),
        versions={key: texts[key] for key in VERSIONS if key in texts},
        solvers=solvers,
        own_effects=_own_effects(said),
        seed=seed,
    )


def _own_effects(said: Mapping[str, Any]) -> dict[str, str]:
    found = said.get(OWN_EFFECTS)
    return {name: str(which) for name, which in found.items()} if isinstance(found, dict) else {}


_TEXTS = (
    'scene',
    'scene_folder',
    'crank_topic',
    'joint_states_topic',
    'faults_topic',
    'withheld_topic',
    'resets_topic',
)
"""Keys under which a run says something of itself, which are fields of `RunAccount` too."""


def _are_names(values: Any) -> bool:
    # What is not printable is no topic, and some of it no text that a bag could hold.
    return isinstance(values, list) and all(
        isinstance(value, str) and value.isprintable() for value in values
    )


def run_said(bag: Bag) -> dict[str, Any]:
    """Return what a run says of itself, as it stands in its bag; nothing if it is damaged."""
    try:
        text = bag.attachments[RUN_FILE]
        said = json.loads(text) if len(text) <= _LONGEST_ACCOUNT else {}
    except (KeyError, ValueError, RecursionError):
        return {}
    return said if isinstance(said, dict) else {}


def recorded_events(
    run: RunAccount,
    own: Callable[[bytes], bool],
    messages: Iterable[BagMessage],
    crank_topic: str | None = None,
) -> Iterator[Event]:
    """
    Put the messages of a bag together to what happened in the run, in its order.

    Parameters
    ----------
    run
        The run's account of itself.
    own
        Tells the run's joint states from the crank's samples where both share a topic.
    messages
        The bag's.
    crank_topic
        Where the crank's samples are; absent, where the run has taken them.

    """
    crank = run.crank_topic if crank_topic is None else crank_topic
    shared = run.crank_topic == run.joint_states_topic
    topics = (run.joint_states_topic, *run.extras) if run.joint_states_topic else ()
    outputs = {topic: number for number, topic in enumerate(topics)}
    others = {run.faults_topic, run.withheld_topic, run.resets_topic} - {''}
    open_tick: tuple[int, int, list[bytes]] | None = None  # more of its messages may follow
    withheld: tuple[int, int] | None = None
    for topic, log_time, publish_time, data in messages:
        output = outputs.get(topic)
        if shared and output == 0 and not own(data):
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
        # In older bags two linkages that withhold at one tick say so twice.
        again, withheld = withheld == (log_time, publish_time), None
        if taken:
            yield SampleEvent(log_time, publish_time, data)
        if output is not None:
            open_tick = log_time, publish_time, [b''] * len(outputs)
            open_tick[2][output] = data
        elif topic == run.faults_topic:
            yield FaultEvent(log_time, publish_time, data)
        elif topic == run.resets_topic:
            yield Reset(log_time, publish_time, data)
        elif topic == run.withheld_topic:
            withheld = log_time, publish_time
            if not again:
                yield TickEvent(log_time, publish_time, (b'',) * len(outputs))
    if open_tick is not None:
        log, time, made = open_tick
        yield TickEvent(log, time, tuple(made))


_NUMBER = re.compile(r'_([0-9]{1,9})\.mcap$')


def lost_beginning(bag: Bag, run: RunAccount) -> str:
    """
    Return in words why the first messages of a run are not in its bag; '' where they are.

    Parameters
    ----------
    bag
        The bag.
    run
        What the run says of itself in it.

    """
    let_go = sum(counts_in(bag.custom, 'let_go').values())
    if let_go:
        return f'its first {let_go} messages have made way for newer ones'
    if run.begun == MID_RUN:
        return 'begun in mid-run'
    first = bag.files[0].name
    number = _NUMBER.search(first)
    if number and int(number[1]):
        return f'begins with {first}, which is not the first file of its recording'
    return ''
