# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Crank samples of a run: the accepted ones, the rejected ones with reasons, and the crank angle.

Each sample is offered to the scene's own pipeline, as in the run, so that it is rejected for the
same reason. The crank angle is the last accepted sample's, extrapolated by its rate.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from linkage_ros.bag import Bag
from linkage_ros.description import Scene
from linkage_ros.errors import BagError
from linkage_ros.messages import Rejection
from linkage_ros.replay import read_change, turn_fault
from linkage_ros.stages.drives import ExchangedInputs
from linkage_ros.tick import LinkagePipeline, Pipeline
from linkage_ros.tools.view.report.blocks import MessageRows
from linkage_ros.tools.view.report.decimation import Flags, Numbers, Times
from linkage_ros.tools.view.report.labels import shorten_text
from linkage_ros.tools.view.report.run import EventTrack
import numpy as np


class CrankHistory:
    """
    Driven joints of a linkage, by the last accepted sample.

    A topic drives the linkage; ``columns`` are the columns of the joints that its samples name,
    among the columns of all samples.
    """

    def __init__(self, linkage: LinkagePipeline, columns: Sequence[int]) -> None:
        self._columns = list(columns)
        of = linkage.scene_linkage.drive[1]
        self._carried = bool(of.carry_forward)
        self._exchange = None
        if of.joint:
            self._exchange = ExchangedInputs(linkage.closure, of.joint, of.branch)
        width = len(columns)
        self._number = np.array([-1])
        self._stamp = np.zeros(1, np.int64)
        self._angles, self._rates = np.full((1, width), np.nan), np.zeros((1, width))

    def add_samples(self, numbers: Times, stamps: Times, good: Flags, values: Numbers) -> Flags:
        """
        Add samples; return which were for this linkage.

        Message numbers increase, stamps are in [ns], ``good`` tells the accepted samples.
        """
        angles, rates = values[:, 0, self._columns], values[:, 1, self._columns]
        own: Flags = good & ~np.isnan(angles).any(axis=1)
        if self._exchange is not None:
            pairs = zip(angles[own].tolist(), rates[own].tolist(), strict=True)
            for row, (values, of) in zip(np.flatnonzero(own).tolist(), pairs, strict=True):
                motion = self._exchange.motion_at(self._exchange.inverse.position(*values), of)
                angles[row], rates[row] = motion.inputs, motion.rates
        # The last sample of the block before precedes the first message of this one.
        self._number = np.concatenate([[-1], numbers[own]])
        self._stamp = np.concatenate([self._stamp[-1:], stamps[own]])
        self._angles = np.concatenate([self._angles[-1:], angles[own]])
        self._rates = np.concatenate([self._rates[-1:], np.nan_to_num(rates[own])])
        return own

    def position_at(self, numbers: Times, times: Times) -> tuple[Numbers, Times]:
        """
        Return the crank's position in [rad] or [m], and its stamp, at messages of the block.

        The times are those that were solved for, in [ns].
        """
        places = np.searchsorted(self._number, numbers) - 1
        stamps, angles = self._stamp[places], self._angles[places]
        if self._carried:
            ages = (times - stamps) * 1e-9
            angles = angles + self._rates[places] * ages[:, None]
        return angles, stamps


class SampleClassifier:
    """
    Separates accepted samples from rejected ones, which it counts by reason.

    If the bag lacks the beginning of the run, faults may be on already.
    """

    def __init__(self, bag: Bag, scene: Scene, from_beginning: bool) -> None:
        self._bag, self._scene = bag, scene
        # For other faults it is not yet known whether they were on at the beginning.
        self._known = {*(scene.faults if from_beginning else ())}
        self._pipeline = Pipeline(scene)
        self._last = 0
        self.listens = bool(self._pipeline.topic)
        self.rejected: Counter[str] = Counter()
        self.ignored = 0
        self._faults: dict[str, int] = {}

    @property
    def pipeline(self) -> Pipeline:
        """Return the pipeline of the scene, as it was built last."""
        return self._pipeline

    def classify_block(
        self, rows: Mapping[str, MessageRows], event_tracks: Mapping[str, EventTrack]
    ) -> Flags:
        """
        Return which samples of a block were accepted; apply faults and resets between them.

        The events get into the lanes fault, reset and rejected.
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
                self._switch_fault(message, time, event_tracks['fault'])
            elif kind == 'resets':
                self._reset()
                event_tracks['reset'].add(time, time)
            else:
                rejection = self._offer_sample(message, int(samples.logged[place]))
                good[place] = rejection is None
                if rejection not in (None, Rejection.MISSING):
                    event_tracks['rejected'].add(time, time, rejection.value)
        return good

    def learn_faults(self, last_values: Mapping[tuple[str, str], str]) -> None:
        """Learn from the diagnostics, by task and key, which faults were on before."""
        for name in [name for name in self._scene.faults if name not in self._known]:
            state = last_values.get(('faults', shorten_text(self._fault_text(name))))
            if state:
                self._known.add(name)
            if state == 'injected':
                self._faults[name] = 0

    def finish_faults(self, time: int, track: EventTrack) -> None:
        """Add the faults that are still on to their lane, to the end of the run."""
        for name, begun in self._faults.items():
            track.add(begun, time, self._fault_text(name))

    def _offer_sample(self, message: bytes, logged: int) -> Rejection | None:
        """Offer a sample to the pipeline; return why it is rejected, or None."""
        if logged < self._last:
            self._reset()
        self._last = logged
        rejection = self._pipeline.offer(message, logged)
        if rejection is Rejection.MISSING:
            self.ignored += 1
        elif rejection is not None:
            self.rejected[rejection.value] += 1
        return rejection

    def _reset(self) -> None:
        """Reset all state, as the run did."""
        self._pipeline = Pipeline(self._scene, self._pipeline.closures, self._pipeline.injection)

    def _switch_fault(self, message: bytes, time: int, track: EventTrack) -> None:
        """Switch a fault at a run time in [ns]; a fault that ends is added to its lane."""
        injection = self._pipeline.injection
        try:
            if injection is None:
                return
            turn_fault(self._bag, injection, message)
            name, on = read_change(message)
        except (BagError, ValueError):
            return
        if on:
            self._faults.setdefault(name, time)
        elif name in self._faults:
            track.add(self._faults.pop(name), time, self._fault_text(name))
        elif name not in self._known:
            track.add(0, time, self._fault_text(name))
        self._known.add(name)

    def _fault_text(self, name: str) -> str:
        return f'{name} ({self._scene.faults[name].kind})'
