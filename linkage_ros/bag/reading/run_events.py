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


"""What happened in a run, put together from its bag: samples, faults, and what each tick made."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
import json
from typing import NamedTuple

from linkage_ros.bag.reading.reader import Bag, BagMessage, RUN_FILE
from linkage_ros.errors import BagError

BEGUN, MID_RUN, WITH_THE_RUN = 'begun', 'mid-run', 'with the run'
"""The key under which a bag says when it was begun, and what it says."""

VERSIONS = ('linkage_ros', 'python', 'machine')


class Taken(NamedTuple):
    """A crank message that a tick took, by its clock and by that of the source, in [ns]."""

    log_time: int
    publish_time: int
    data: bytes


class Turned(NamedTuple):
    """A message that a fault has begun or ended, and when, in [ns]."""

    log_time: int
    publish_time: int
    data: bytes


class Made(NamedTuple):
    """
    What a tick made.

    Attributes
    ----------
    log_time, time
        When it was, and for when it solved, in [ns].
    messages
        The joint state and the extras, each empty where there is none; all are where the bag says
        that the tick had a pose and withheld it.

    """

    log_time: int
    time: int
    messages: tuple[bytes, ...]


Event = Taken | Turned | Made


class RunAccount(NamedTuple):
    """
    What a run's account of itself says; of topics that there are not, ''.

    Attributes
    ----------
    scene, scene_folder
        The scene's name, and to what the paths in it are relative.
    crank_topic, joint_states_topic, faults_topic, withheld_topic, extras
        Names of the topics.
    begun
        When the bag was begun, as `MID_RUN`; '' where it does not say.
    versions
        Of what made it, by what they are of.

    """

    scene: str = ''
    scene_folder: str = ''
    crank_topic: str = ''
    joint_states_topic: str = ''
    faults_topic: str = ''
    withheld_topic: str = ''
    extras: tuple[str, ...] = ()
    begun: str = ''
    versions: Mapping[str, str] = {}


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
    try:
        run = json.loads(bag.attachments[RUN_FILE])
        return RunAccount(
            scene=str(run['scene']),
            scene_folder=str(run.get('scene_folder', '')),
            crank_topic=str(run.get('crank_topic', '')),
            joint_states_topic=str(run['joint_states_topic']),
            faults_topic=str(run.get('faults_topic', '')),
            withheld_topic=str(run.get('withheld_topic', '')),
            extras=tuple(map(str, run.get('extra_topics', ()))),
            begun=str(run.get(BEGUN, '')),
            versions={key: str(run[key]) for key in VERSIONS if key in run},
        )
    except (ValueError, KeyError, TypeError, AttributeError):
        raise BagError(bag.path, f'its {RUN_FILE} is damaged', 'name another bag') from None


def recorded_events(
    run: RunAccount,
    own: bytes,
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
        What the run's joint states have from byte 12 on: it tells them from the crank's samples
        where both share a topic.
    messages
        The bag's.
    crank_topic
        Where the crank's samples are; absent, where the run has taken them.

    """
    crank = run.crank_topic if crank_topic is None else crank_topic
    shared = run.crank_topic == run.joint_states_topic
    topics = (run.joint_states_topic, *run.extras) if run.joint_states_topic else ()
    outputs = {topic: number for number, topic in enumerate(topics)}
    open_tick: tuple[int, int, list[bytes]] | None = None  # more of its messages may follow
    withheld: tuple[int, int] | None = None
    for topic, log_time, publish_time, data in messages:
        output = outputs.get(topic)
        if shared and output == 0 and not data.startswith(own, 12):
            output = None
        taken = topic == crank and (output is None or crank != run.crank_topic)
        if output is None and not taken and topic not in (run.faults_topic, run.withheld_topic):
            continue
        if output is not None and open_tick is not None:
            _, time, made = open_tick
            if time == publish_time and not any(made[output:]):
                made[output] = data
                continue
        if open_tick is not None:
            log, time, made = open_tick
            yield Made(log, time, tuple(made))
            open_tick = None
        # Two linkages that withhold at one tick say so twice.
        again, withheld = withheld == (log_time, publish_time), None
        if taken:
            yield Taken(log_time, publish_time, data)
        if output is not None:
            open_tick = log_time, publish_time, [b''] * len(outputs)
            open_tick[2][output] = data
        elif topic == run.faults_topic:
            yield Turned(log_time, publish_time, data)
        elif topic == run.withheld_topic:
            withheld = log_time, publish_time
            if not again:
                yield Made(log_time, publish_time, (b'',) * len(outputs))
    if open_tick is not None:
        log, time, made = open_tick
        yield Made(log, time, tuple(made))
