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
Which samples of a run were good, and which refused, and why.

A sample is offered to the scene's own pipeline, as in the run, so that it is refused for the same
reason.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from linkage_ros.bag.reader import Bag
from linkage_ros.errors import BagError
from linkage_ros.messages.joint_state import Rejection
from linkage_ros.pipeline import Pipeline
from linkage_ros.replay import read_change, turn
from linkage_ros.report.arrays import Flags
from linkage_ros.report.own_rows import Rows
from linkage_ros.report.spans import Lane
from linkage_ros.report.words import short
from linkage_ros.scene.scene import Scene
import numpy as np


class Judge:
    """
    Tells good samples from those that are refused.

    Parameters
    ----------
    bag
        The bag.
    scene
        Its scene.
    from_beginning
        Whether the bag holds the run from its beginning: where not, faults may be on already.

    Attributes
    ----------
    listens
        Whether the scene takes samples at all.
    rejected
        How many were refused, by reason.

    """

    def __init__(self, bag: Bag, scene: Scene, from_beginning: bool) -> None:
        self._bag, self._scene = bag, scene
        # Of the others it is not known yet whether they were on as the bag began.
        self._known = {*(scene.faults if from_beginning else ())}
        self._pipeline = Pipeline(scene)
        self._last = 0
        self.listens = bool(self._pipeline.topic)
        self.rejected: Counter[str] = Counter()
        self._faults: dict[str, int] = {}

    @property
    def pipeline(self) -> Pipeline:
        """Return the scene at work, as it was built last."""
        return self._pipeline

    def take(self, rows: Mapping[str, Rows], lanes: Mapping[str, Lane]) -> Flags:
        """
        Return which samples of a block were good; in between, faults turn and all is forgotten.

        Parameters
        ----------
        rows
            The messages of the block, by kind.
        lanes
            Where what happens is put: fault, reset and rejected.

        """
        samples = rows['samples']
        good = np.zeros(len(samples.data), bool)
        events = sorted(
            (number, kind, place)
            for kind in ('faults', 'resets', 'samples')
            if kind != 'samples' or self.listens
            for place, number in enumerate(rows[kind].numbers.tolist())
        )
        for _, kind, place in events:
            message, time = rows[kind].data[place], int(rows[kind].passed[place])
            if kind == 'faults':
                self._turn(message, time, lanes['fault'])
            elif kind == 'resets':
                self._reset()
                lanes['reset'].add(time, time)
            else:
                rejection = self._offer(message, int(samples.logged[place]))
                good[place] = rejection is None
                if rejection is not None:
                    lanes['rejected'].add(time, time, rejection.value)
        return good

    def hear(self, said: Mapping[tuple[str, str], str]) -> None:
        """Take from what the diagnostics say, by task and key, which faults were on before."""
        for name in [name for name in self._scene.faults if name not in self._known]:
            state = said.get(('faults', short(self._fault(name))))
            if state:
                self._known.add(name)
            if state == 'injected':
                self._faults[name] = 0

    def end(self, time: int, lane: Lane) -> None:
        """Put the faults that are still on onto their lane, to the end of the run."""
        for name, begun in self._faults.items():
            lane.add(begun, time, self._fault(name))

    def _offer(self, message: bytes, logged: int) -> Rejection | None:
        """Offer a sample; return why it is refused."""
        if logged < self._last:
            self._reset()
        self._last = logged
        rejection = self._pipeline.offer(message, logged)
        if rejection is not None:
            self.rejected[rejection.value] += 1
        return rejection

    def _reset(self) -> None:
        """Forget all, as the run has."""
        self._pipeline = Pipeline(self._scene, self._pipeline.closures, self._pipeline.injection)

    def _turn(self, message: bytes, time: int, lane: Lane) -> None:
        """Turn a fault on or off, at a time of the run in [ns]; one that ends goes on its lane."""
        injection = self._pipeline.injection
        try:
            if injection is None:
                return
            turn(self._bag, injection, message)
            name, on = read_change(message)
        except (BagError, ValueError):
            return
        if on:
            self._faults.setdefault(name, time)
        elif name in self._faults:
            lane.add(self._faults.pop(name), time, self._fault(name))
        elif name not in self._known:
            lane.add(0, time, self._fault(name))
        self._known.add(name)

    def _fault(self, name: str) -> str:
        return f'{name} ({self._scene.faults[name].kind})'
