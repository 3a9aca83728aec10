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


"""Variants of a scene, which differ in the effects that they have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter_ns

from linkage_ros.effects.stage import brings, in_order, LOADED, module_of
from linkage_ros.errors import FileError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.pipeline import Pipeline
from linkage_ros.scene.scene import Member, Scene

_FAULT = 'fault '
"""With the name of a fault, what stands in the place of an effect for it: it is not injected."""

Names = frozenset[str]


def faults_of(scene: Scene) -> Names:
    """Return the faults of a scene, as they stand among the names of effects."""
    return Names(f'{_FAULT}{name}' for name in scene.faults)


class Variant:
    """A variant of the scene at work, and how long its ticks took, in [ns]."""

    def __init__(self, pipeline: Pipeline) -> None:
        self.pipeline = pipeline
        self.ticks: list[int] = []
        self.offers: list[int] = []
        self.published = 0

    def run(self, nows: Sequence[int], messages: Sequence[bytes]) -> None:
        """Tick at these times, in [ns], each after its message, as the node does."""
        offer, tick, clock = self.pipeline.offer, self.pipeline.tick, perf_counter_ns
        injection = self.pipeline.injection
        for now, message in zip(nows, messages, strict=True):
            begin = clock()
            if injection is not None:
                injection.advance(now)
                now = injection.clock(now)  # noqa: PLW2901 (the time by which the tick goes)
            if message:
                offer(message, now)
                self.offers.append(clock() - begin)
            done = tick(now)
            self.ticks.append(clock() - begin)
            self.published += bool(done.message)

    def forget(self) -> None:
        """Begin to count."""
        self.ticks.clear()
        self.offers.clear()
        self.published = 0


class Variants:
    """Variants of a scene, by the effects that they have."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.built: dict[Names, Variant] = {}
        self._closures: dict[bool, list[Closure]] = {}

    def build(self, named: Names) -> Variant:
        """Return the scene with these of its effects, and without its recording; one of each."""
        if named not in self.built:
            self.built[named] = Variant(self.pipeline(named))
        return self.built[named]

    def pipeline(self, named: Names) -> Pipeline:
        """Return the scene with these of its effects at its start; another one each time."""
        scene = replace(
            self.scene,
            members=tuple(_with(member, named) for member in self.scene.members),
            faults={
                # Nobody injects it, nor does a timeline.
                name: replace(fault, at=(), seconds=0.0)
                for name, fault in self.scene.faults.items()
                if f'{_FAULT}{name}' in named
            },
            record=None,
        )
        # To solve a linkage for the first time may take a second where it is iterated.
        altered = 'tolerance' in named
        pipeline = Pipeline(scene, self._closures.get(altered))
        self._closures.setdefault(altered, pipeline.closures)
        return pipeline

    def attempt(self, named: Names) -> Variant | None:
        """Return the scene with these effects; nothing where they do not go together."""
        try:
            return self.build(named)
        except FileError:
            return None


def _with(member: Member, named: Names) -> Member:
    """Return a linkage with these effects, of those that it has or that they bring in."""
    own = member.effects
    brought = {need for effect in own for need in brings(effect)}
    effects = {
        name: own[name] if name in own else module_of(name).PARAMETERS()
        for name in in_order({*own, *brought})
        if name in named
    }
    forced = member.drive[0] == 'torque' or not named.isdisjoint(LOADED)
    return replace(member, effects=effects, loads=member.loads if forced else None)
