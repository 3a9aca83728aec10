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


"""On which topic of a bag the samples are that a scene needs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from linkage_ros.bag.reader import Bag, BagMessage
from linkage_ros.bag.run_events import RunAccount
from linkage_ros.errors import BagError, did_you_mean, listed
from linkage_ros.messages.joint_state import head_of, JointStateReader, Rejection
from linkage_ros.messages.joint_values import JOINT_STATE
from linkage_ros.scene.scene import Scene

DEFAULT = '/crank_states'


def find_crank_topic(
    bag: Bag,
    messages: Iterable[BagMessage],
    scene: Scene,
    run: RunAccount,
    recorded: Scene | None,
    typed: str | None,
) -> str:
    """
    Return the topic of the samples that all linkages of a scene can be driven with.

    Parameters
    ----------
    bag
        The bag.
    messages
        Its messages; they are looked at as far as needed.
    scene
        The scene.
    run, recorded
        What the bag says of its run, and its scene; blank and nothing where it does not.
    typed
        The topic that was asked for. Absent, it is that of the run, `DEFAULT`, or the only one
        that has such samples, whichever the bag has first.

    Raises
    ------
    BagError
        Where there is none, or more than one.

    """
    readers = {
        topic: [JointStateReader(member.inputs) for member in scene.members]
        for topic in _candidates(bag, run, recorded, typed)
    }
    wanting = {topic: set(range(len(scene.members))) for topic in readers}
    names: dict[str, None] = {}
    for topic, _, _, data in messages if readers else ():
        if not wanting.get(topic):
            continue
        found = [
            number for number in wanting[topic]
            if not isinstance(readers[topic][number].read(data), Rejection)
        ]  # fmt: skip
        wanting[topic].difference_update(found)
        if not found:
            head = head_of(data)
            names |= dict.fromkeys(
                name.decode('utf-8', 'backslashreplace')
                for name in sorted(head[0] if head else ())
            )
        elif sum(not left for left in wanting.values()) == min(2, len(wanting)):
            break
    good = [topic for topic, left in wanting.items() if not left]
    if len(good) == 1:
        return good[0]
    inputs = list(dict.fromkeys(name for member in scene.members for name in member.inputs))
    if good:
        raise BagError(
            bag.path,
            f'holds samples of {listed(inputs)} on {listed(good, " and ")}',
            'name one with --crank-topic',
        )
    raise _none(bag, inputs, list(readers), list(names))


def _candidates(
    bag: Bag, run: RunAccount, recorded: Scene | None, typed: str | None
) -> Sequence[str]:
    held = [topic.name for topic in bag.topics if topic.type == JOINT_STATE]
    if typed is not None:
        if typed not in held:
            raise BagError(
                bag.path,
                f'holds no topic {typed} of {JOINT_STATE}',
                did_you_mean(typed, held, f'it holds {listed(held) or "none"}'),
            )
        return [typed]
    commanded = recorded is not None and any(
        member.drive[0] != 'topic' for member in recorded.members
    )
    if run.crank_topic in held and not commanded:
        return [run.crank_topic]
    if DEFAULT in held and not commanded:
        return [DEFAULT]
    return held


def _none(
    bag: Bag, inputs: Sequence[str], topics: Sequence[str], names: Sequence[str]
) -> BagError:
    """Return what is missing, and what is there."""
    missing = [name for name in inputs if name not in names] or inputs
    where = f' on {listed(topics)}' if topics else f'; it has no topic of {JOINT_STATE}'
    there = f', which has {listed(names)}' if names else ''
    return BagError(
        bag.path,
        f'holds no samples of {listed(missing)}{where}{there}',
        'name a scene whose inputs it holds, or another topic with --crank-topic',
    )
