# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The pipeline of a scene: messages in, ticks out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from linkage_ros.description import Scene
from linkage_ros.errors import quote
from linkage_ros.kinematics import Closure
from linkage_ros.messages import Rejection, SampleRouter
from linkage_ros.tick.compiled_tick import compile_tick
from linkage_ros.tick.interpreted_tick import InterpretedTick, Tick
from linkage_ros.tick.linkage_pipeline import LinkagePipeline

if TYPE_CHECKING:
    from linkage_ros.stages.faults import Injection
    from linkage_ros.tick.wrench_topics import WrenchTopic


class Pipeline:
    """
    The pipeline of a scene. To reset it, build it again.

    Parameters
    ----------
    scene
        The scene.
    closures
        Closures of its linkages, if there are any already. They have no state; resets reuse them.
    injection
        Its faults, if they exist already; they outlive a reset.

    Raises
    ------
    FileError
        Parts of the scene do not fit together.
    TypeError
        The argument is not a scene.

    """

    def __init__(
        self,
        scene: Scene,
        closures: Sequence[Closure] | None = None,
        injection: Injection | None = None,
    ) -> None:
        if not isinstance(scene, Scene):
            raise TypeError(f'scene: {quote(scene)} is not a Scene; load_scene() reads files')
        if injection is None and scene.faults:
            from linkage_ros.stages.faults import Injection

            injection = Injection(scene.faults)
        self.injection = injection
        """The faults; None if the scene has none."""
        self.linkages = [
            LinkagePipeline(scene, scene_linkage, closures[index] if closures else None, injection)
            for index, scene_linkage in enumerate(scene.linkages)
        ]
        self.extras = [extra for linkage in self.linkages for extra in linkage.extras]
        """The topics other than that of the joint states."""
        topics = sorted({linkage.topic for linkage in self.linkages} - {''})
        if len(topics) > 1:
            raise scene.linkages[0].content.error(
                'drive',
                f'has the topics {" and ".join(topics)}',
                'write the same kind of drive for all',
            )
        _refuse_beside(scene)
        self.topic = topics[0] if topics else ''
        """The topic of the drives; '' for none."""
        self.wrenches: tuple[WrenchTopic, ...] = ()
        """The topics of wrenches on links."""
        if any(linkage.wrenches for linkage in self.linkages):
            from linkage_ros.tick.wrench_topics import make_wrench_topics

            linkages = [
                (linkage.scene_linkage, linkage.drive, linkage.wrenches)
                for linkage in self.linkages
            ]
            self.wrenches = make_wrench_topics(linkages, self.topic)
        self._has_state = any(
            linkage.scene_linkage.drive[1].keeps_state
            or any(effect.runs_in_gaps for effect in linkage.wanted.effects.values())
            for linkage in self.linkages
        )
        self.suppresses_ticks = (
            self._has_state
            or injection is not None
            or any(
                effect.suppresses_ticks
                for linkage in self.linkages
                for effect in linkage.wanted.effects.values()
            )
        )
        """Whether ticks without a message may matter to a replay."""
        self._router = SampleRouter(
            {linkage: linkage.scene_linkage.sampled_joints for linkage in self.linkages}
        )
        first = self.linkages[0]
        alone = len(self.linkages) == len(first.drive.stamps) == 1
        self._only = first if alone else None
        """The linkage, if there is one, and its inputs come together."""
        self.moved_inputs: tuple[tuple[LinkagePipeline, int], ...] = ()
        """Inputs with samples of their own that took the last message; () if all inputs do."""
        self._offer_count = 0
        self._newest_offers: dict[tuple[LinkagePipeline, int], int] = {}
        interpreted = InterpretedTick(self.linkages)
        self.tick = compile_tick(interpreted) or interpreted.run
        """Computes the tick at a time, in [ns]."""

    def offer(self, message: bytes, now: int) -> Rejection | None:
        """
        Take a serialized crank message, or return why it is rejected.

        Parameters
        ----------
        message
            A ``sensor_msgs/msg/JointState`` in CDR.
        now
            The time, in [ns].

        """
        if self._only is not None:
            return self._only.offer(message, now)
        # A message may concern one input or several: it is good if one of them accepts it.
        self._offer_count += 1
        rejections = []
        moved: list[tuple[LinkagePipeline, int]] = []
        for linkage in self._router.find_receivers(message):
            rejections.append(linkage.offer(message, now))
            if rejections[-1] is None:
                moved += [(linkage, number) for number in linkage.drive.newest_inputs]
        self.moved_inputs = tuple(moved)
        self._newest_offers |= dict.fromkeys(moved, self._offer_count)
        return None if None in rejections else next(iter(rejections), Rejection.MISSING)

    def count_fresh_and_stale(self, now: int) -> tuple[int, int]:
        """
        Tell the good messages since the last call that are still the newest for an input.

        Return how many of them give a crank at a time, in [ns], and how many are too old.
        """
        if self._only is not None:
            return (0, 1) if self._only.is_stale(now) else (1, 0)
        newest = self._newest_offers.items()
        fresh = {offer for (linkage, number), offer in newest if not linkage.is_stale(now, number)}
        stale = {*self._newest_offers.values()} - fresh
        self._newest_offers.clear()
        return len(fresh), len(stale)

    def silent_inputs(self, now: int) -> dict[str, int]:
        """Return the inputs without a sample at a time, in [ns], with their newest stamps."""
        return {
            name: stamp
            for linkage in self.linkages
            if linkage.topic
            for name, stamp in linkage.silent_inputs(now)
        }

    def changes_state(self, tick: Tick) -> bool:
        """Return whether a tick without a message changes the state of the pipeline."""
        return any(
            state.has_pose or linkage.gap_begins or (self._has_state and state.crank is not None)
            for linkage, state in zip(self.linkages, tick.states, strict=True)
        )

    def is_idle(self, now: int) -> bool:
        """
        Return whether a tick at a time, in [ns], would give no message and change no state.

        The pipeline is not changed. False also where only a tick can tell.
        """
        return all(linkage.is_idle(now) for linkage in self.linkages)

    @property
    def closures(self) -> list[Closure]:
        """Closures of the linkages."""
        return [linkage.closure for linkage in self.linkages]

    @property
    def newest_stamp(self) -> int:
        """Stamp of the newest good sample, in [ns]; 0 before the first."""
        return max(linkage.drive.stamp for linkage in self.linkages)

    @property
    def max_age(self) -> int:
        """Age of the newest sample beyond which something is amiss, in [ns]; 0 for never."""
        return max(linkage.drive.max_age for linkage in self.linkages)


def _refuse_beside(scene: Scene) -> None:
    """Refuse effects that do not fit to those of the other linkages."""
    for scene_linkage in scene.linkages:
        for name, effect in scene_linkage.effects.items():
            beside = [linkage.effects.get(name) for linkage in scene.linkages]
            if (error := effect.refusal_beside(beside)) is not None:
                raise scene_linkage.content.locate_error(error)
