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


"""Another scene over the samples of a bag: compared with the recorded run, written anew."""

from __future__ import annotations

from pathlib import Path
import sys
from typing import Any

from linkage_ros.bag.reader import Bag
from linkage_ros.bag.run_events import recorded_events, run_account, RunAccount
from linkage_ros.cli.bag_reading import BagReading
from linkage_ros.cli.crank_topic import find_crank_topic
from linkage_ros.cli.new_bag import Names, names_for, NewBag, Source
from linkage_ros.cli.replay import bag_account, joints_account, topic_account
from linkage_ros.errors import LinkageError, listed
from linkage_ros.messages.joint_values import JOINT_STATE
from linkage_ros.replay.compare import At, Comparison
from linkage_ros.replay.counterfactual import check_drives, Remade, WhatIf
from linkage_ros.replay.replay import own_joint_states, recorded_scene
from linkage_ros.replay.verify import turning_joints
from linkage_ros.scene.scene import Scene


def replayed_with(
    bag: Bag, reading: BagReading, scene: Scene, crank_topic: str | None, output: Path | None
) -> dict[str, Any]:
    """
    Run another scene over a bag's samples; return what came of it.

    Parameters
    ----------
    bag, reading
        The bag.
    scene
        The scene.
    crank_topic
        As typed.
    output
        Where a new bag goes; nothing for none.

    Raises
    ------
    LinkageError
        Where the scene cannot be run over the bag, there is nothing to compare and none to write,
        or the new bag cannot be written.

    """
    check_drives(scene, scene.members[0].content.file)
    run, recorded = _own_account(bag)
    topic = find_crank_topic(bag, reading.glance(), scene, run, recorded, crank_topic)
    source = Source(bag, run, recorded, topic)
    what_if = WhatIf(scene, recorded)
    names = names_for(source, scene, what_if)
    _check_joints(bag, scene, recorded, output)
    kinds = {run.joint_states_topic: JOINT_STATE}
    kinds |= dict(zip(names.extras, (extra.message for extra in what_if.extras), strict=True))
    shared = [name for name in (run.joint_states_topic, *run.extras) if name and name in kinds]
    comparison = Comparison([(name, kinds[name]) for name in shared])
    new_bag = NewBag(output, source, scene, what_if, names) if output is not None else None
    own = own_joint_states(recorded) if recorded is not None else bool
    begin: list[int] = []
    published = 0
    try:
        with reading.told() as messages:
            for event in what_if.run(recorded_events(run, own, messages, topic)):
                if new_bag is not None:
                    new_bag.add(event)
                if isinstance(event, Remade):
                    if event.tick is not None and event.tick.message:
                        published += 1
                    then, now = _side_by_side(event, run, names, shared)
                    if any(then) or any(now):
                        begin = begin or [event.time]
                        comparison.add(At(comparison.ticks + 1, event.time), then, now)
    finally:
        if new_bag is not None:
            new_bag.close()
    comparison.settle()
    turning = turning_joints(scene) | (turning_joints(recorded) if recorded else {})
    recorded_joints = recorded.joints if recorded is not None else ()
    return bag_account(bag, scene, reading, begin) | {
        'crank_topic': topic,
        'joint_states': published,
        'topics': [topic_account(each) for each in comparison.topics],
        'joints': joints_account(comparison, turning),
        'joints_only_recorded': [name for name in recorded_joints if name not in scene.joints],
        'joints_only_now': [name for name in scene.joints if name not in recorded_joints],
        'new_bag': str(output) if new_bag is not None else None,
        'written': new_bag.counts if new_bag is not None else {},
    }


def _own_account(bag: Bag) -> tuple[RunAccount, Scene | None]:
    """Return what a bag says of its run; blank and nothing where it does not."""
    try:
        return run_account(bag), recorded_scene(bag)
    except LinkageError as error:
        print(
            f'linkage replay: nothing to compare with: {error.where}: {error.reason}',
            file=sys.stderr,
        )
        return RunAccount(), None


def _check_joints(bag: Bag, scene: Scene, recorded: Scene | None, output: Path | None) -> None:
    """Refuse where nothing would come of it."""
    if output is not None or recorded is None or set(recorded.joints) & set(scene.joints):
        return
    raise LinkageError(
        scene.members[0].content.file,
        f'publishes {listed(scene.joints)}, and {bag.path} holds {listed(recorded.joints)}: '
        'nothing to compare',
        'write a new bag with -o',
    )


def _side_by_side(
    event: Remade, run: RunAccount, names: Names, shared: list[str]
) -> tuple[list[bytes], list[bytes]]:
    """Return what a tick has made on each topic that both runs have, then and now."""
    then = dict(zip((run.joint_states_topic, *run.extras), event.recorded, strict=False))
    now: dict[str, bytes] = {}
    if event.tick is not None:
        now = dict(zip(names.extras, event.tick.extras, strict=False))
        now[run.joint_states_topic] = event.tick.message
    return [then.get(name, b'') for name in shared], [now.get(name, b'') for name in shared]
