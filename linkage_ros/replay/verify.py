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


"""
Verify a bag: run its scene again on its samples, and compare with the recorded messages.

A bag may lack the start of its run (recording began later, or its first files made way for newer
ones). Then the state of the node at that time is missing: the newest sample, whole turns, delay
lines, random generators. The ticks before the first one that is reproduced do not count, and whole
turns are no difference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from linkage_ros.bag.reader import Bag, BagMessage
from linkage_ros.bag.run_events import lost_beginning, run_account
from linkage_ros.kinematics.linkage import RevoluteJoint
from linkage_ros.messages.joint_values import JOINT_STATE
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.replay.compare import At, Comparison, First
from linkage_ros.replay.replay import replay_all, ReplayedTick
from linkage_ros.scene.scene import Scene

IDENTICAL, DIFFERENT, UNTOLD = 'identical', 'different', 'cannot be told'

_NEVER_FOUND_AGAIN = ('rate_limit', 'noise', 'jitter', 'dropout')
"""
Effects whose state is not recovered: random generators, and the time of the first tick. So for an
incremental encoder, which counts from power-on, and for markers with a trail.
"""


class ReplayVerification(NamedTuple):
    """
    Result of running the scene of a bag again.

    Attributes
    ----------
    comparison
        Comparison of the ticks that could be compared.
    untold
        Number of ticks at the start that cannot be judged, since the bag lacks the start of the
        run.
    first_untold
        First difference of the first such tick.
    beginning
        Reason why the start of the run is missing; '' if it is there.
    lost
        Drives and effects that then never reproduce the run.

    """

    comparison: Comparison
    untold: int
    first_untold: First | None
    beginning: str
    lost: tuple[str, ...]

    @property
    def ticks(self) -> int:
        """Return the number of ticks in the bag."""
        return self.comparison.ticks + self.untold

    @property
    def verdict(self) -> str:
        """Return `IDENTICAL`, `DIFFERENT` or `UNTOLD`."""
        comparison = self.comparison
        if self.untold and not comparison.ticks:
            return UNTOLD
        if comparison.differing:
            return UNTOLD if self.lost else DIFFERENT
        return IDENTICAL


def verify_replay(
    bag: Bag,
    scene: Scene,
    messages: Iterable[BagMessage],
    look: Callable[[ReplayedTick], None] = lambda _: None,
) -> ReplayVerification:
    """
    Run a bag's scene once more and compare; memory does not grow with the bag.

    Parameters
    ----------
    bag, scene, messages
        As for `replay_all`.
    look
        Callback that receives every tick.

    Raises
    ------
    LinkageError
        The scene cannot be run.

    """
    run = run_account(bag)
    types = [extra.message for extra in Pipeline(scene).extras]
    types += [JOINT_STATE] * len(run.extras)  # for topics that the scene does not know
    topics = [(run.joint_states_topic, JOINT_STATE), *zip(run.extras, types, strict=False)]
    silent = (b'',) * len(topics)
    beginning = lost_beginning(bag, run)
    turning = turning_joints(scene) if beginning and not scene.wrapped else {}
    comparison, probe = Comparison(topics, turning), Comparison(topics, turning)
    untold, in_step = 0, not beginning
    for number, replayed in enumerate(replay_all(bag, scene, messages), 1):
        time, joint_states, extras, tick = replayed
        look(replayed)
        recorded = (joint_states, *extras)
        now = (tick.message, *tick.extras, *silent)[: len(topics)]
        at = At(number, time)
        if not in_step:
            probe.add(at, recorded, now)
            in_step = probe.last != at and any(recorded)
            if not in_step:
                untold += 1
                continue
        comparison.add(at, recorded, now)
    comparison.settle()
    lost = _lost(scene) if beginning else ()
    return ReplayVerification(comparison, untold, probe.first if untold else None, beginning, lost)


def beginning_text(proof: ReplayVerification) -> str:
    """Return text on the ticks that cannot be judged in a bag without the start of its run."""
    text = f'{proof.beginning}: what the node remembered then is not in it, so {proof.untold} '
    text += f'of {proof.ticks} ticks, at the start, could not be told'
    if proof.verdict == UNTOLD and proof.lost:
        text += f'; {" and ".join(proof.lost)} cannot come to the same again'
    return text


def turning_joints(scene: Scene) -> dict[str, bool]:
    """Return for each joint of a scene, published or driven, whether it is a revolute joint."""
    revolute: dict[str, bool] = {}
    for member in scene.members:
        driven = [not given.slider for given in member.linkage.inputs]
        revolute |= dict(zip(member.inputs, driven, strict=True))
        kinds = [isinstance(joint, RevoluteJoint) for joint in member.linkage.joints.values()]
        revolute |= dict(zip(member.joints, kinds, strict=True))
    return revolute


def _lost(scene: Scene) -> tuple[str, ...]:
    named = [member.drive[0] for member in scene.members if member.drive[0] != 'topic']
    for member in scene.members:
        named += [effect for effect in member.effects if effect in _NEVER_FOUND_AGAIN]
        encoder = member.effects.get('encoder')
        if encoder and any(each.incremental for each in encoder.joints.values()):
            named.append('encoder')
        markers = member.effects.get('markers')
        if markers and markers.trace:
            named.append('markers')
    return tuple(dict.fromkeys(named))
