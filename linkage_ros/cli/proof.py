# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The proof at the end of a recorded run: its bag, replayed, makes the same bytes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from time import monotonic

from linkage_ros.bag import BagMessage, read_bag
from linkage_ros.cli.arguments import DEGREES
from linkage_ros.cli.bag_reading import describe_gaps
from linkage_ros.cli.terminal import show_progress
from linkage_ros.errors import LinkageError
from linkage_ros.replay import (
    beginning_text,
    DIFFERENT,
    recorded_scene,
    ReplayedTick,
    UNDECIDED,
    verify_replay,
)
from linkage_ros.signals import raise_on_signals, StoppedError
from linkage_ros.tick import Pipeline

LONGEST_PROOF = 2.0
"""Time that the replay of the bag takes at the end of a run, in [s]."""

_TOLD = 1000
"""Ticks between two reports of the progress."""


def proof_of(folder: Path, ticks: int, longest: float) -> str:
    """
    Replay a bag: check that it gives the same bytes, and how well its loop closed.

    After a time in [s] the rest is left out, and the text says so.
    """
    worst, done = 0.0, 0

    def observe_tick(replayed: ReplayedTick) -> None:
        nonlocal worst, done
        done += 1
        if done % _TOLD == 0:
            advance(done, max(done, ticks))
        for closure, seen in zip(closures, replayed.tick.states, strict=True):
            if seen.position is not None and seen.position.joints:
                worst = max(worst, closure.residual(seen.position))

    try:
        bag = read_bag(folder)
        # The run was the user's, and has imported these modules already.
        scene = recorded_scene(bag, trust_effects=True)
        pipeline = Pipeline(scene)
        closures = pipeline.closures
        sample = Beginning(bag.messages(), longest)
        with raise_on_signals(), show_progress('ticks replayed') as advance:
            proof = verify_replay(bag, scene, sample, observe_tick)
    except LinkageError as error:
        return str(error)
    except StoppedError:
        return f'stopped; linkage replay {folder} proves it'
    if proof.verdict == UNDECIDED:
        return f'{UNDECIDED}: {beginning_text(proof)}'
    names = ['joint states', *(extra.topic.removeprefix('~/') for extra in pipeline.extras)]
    same = ' and '.join(
        f'{topic.same} of {topic.recorded} {name}'
        for name, topic in zip(names, proof.comparison.topics, strict=True)
    )
    notes = [beginning_text(proof)] if proof.missing_start else []
    if proof.verdict == DIFFERENT:
        notes += describe_gaps(bag)
    worst_text = DEGREES.of_file(scene.units).format_length(worst, '.1e')
    notes.append(f'worst loop residual {worst_text}')
    part = (
        f'a sample, its first {sample.seconds:.1f} s: --prove proves all' if sample.cut else 'all'
    )
    notes.append(f'of the run {part}')
    return f'{same} replay to the same bytes; {"; ".join(notes)}'


class Beginning:
    """The first messages of a bag: whole ticks, as many as are taken within a time in [s]."""

    def __init__(self, messages: Iterable[BagMessage], longest: float) -> None:
        self.cut = False
        """Whether there are more."""
        self.seconds = 0.0
        """How much of the run they are, in [s]."""
        self._messages, self._longest = messages, longest

    def __iter__(self) -> Iterator[BagMessage]:
        end = monotonic() + self._longest
        begin = last = None
        for message in self._messages:
            # The messages of one tick have one log time.
            if message.log_time != last and monotonic() > end:
                self.cut = True
                return
            last = message.log_time
            begin = last if begin is None else begin
            self.seconds = (last - begin) * 1e-9
            yield message
