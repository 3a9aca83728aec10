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
Cost of each effect of a scene: the tick of the scene's own pipeline, with and without the effect.

A stage is not timed alone: its cost includes what it changes in the message and the stages that it
requires. Variants of the scene take turns, a block of ticks each, over the same simulated times
and crank messages, so that a disturbance of the machine affects all of them alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import cos, sin, tau
from random import Random
from statistics import median
from time import perf_counter_ns
from typing import NamedTuple

from linkage_ros.drives.dependent_samples import sampled_inverse
from linkage_ros.effects.dispatch import bringing, dependencies, in_order, module_of
from linkage_ros.effects.stage import EFFECTS, FORCE_EFFECTS
from linkage_ros.errors import FileError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.sweep_analysis import InputSweep, usual_inputs
from linkage_ros.measuring import spread_of
from linkage_ros.messages.joint_state import JointStateWriter
from linkage_ros.pipeline.pipeline import LinkagePipeline, Pipeline
from linkage_ros.scene.scene import Scene, SceneLinkage

_BEGIN = 1_000_000_000
_USUAL_RATE = 1000.0
_CRANK_RATE = 1.0
"""Turns, or oscillations, of the crank per second."""


def feed(scene: Scene, pipeline: Pipeline) -> Iterator[tuple[int, bytes]]:
    """Yield times in [ns], each with a crank message, or b'' if the drives listen to no topic."""
    period = 1e9 / (scene.rate or _USUAL_RATE)
    names = [name for member in scene.members for name in member.sampled]
    write = JointStateWriter(names).write
    paths = [path for line in pipeline.lines for path in _paths(line)]
    count = 0
    while True:
        now = _BEGIN + round(count * period)
        message = b''
        if pipeline.topic:
            seconds = (now - _BEGIN) * 1e-9
            angles, rates = zip(*[path(seconds) for path in paths], strict=True)
            message = write(now, angles, rates, (0.0,) * len(names))
        yield now, message
        count += 1


Path = Callable[[float], tuple[float, float]]


def _paths(line: LinkagePipeline) -> list[Path]:
    """Return for each input its value and rate at a time in [s]: a rotation or an oscillation."""
    closure, joint = line.closure, line.member.dependent
    speed = tau * _CRANK_RATE
    if joint:
        branch = sampled_inverse(closure, joint, line.member.drive[1].branch).branch
        return [_swing(0.5 * (branch.low + branch.high), 0.4 * (branch.high - branch.low), speed)]
    centers = usual_inputs(closure)
    if len(centers) > 1:
        sizes = [0.01 * closure.scale if i.slider else 0.01 for i in closure.linkage.inputs]
        return [_swing(c, size, speed) for c, size in zip(centers, sizes, strict=True)]
    widest = InputSweep(closure).widest_range
    if widest is None or widest.whole:
        return [lambda seconds: (speed * seconds, speed)]
    middle, width = 0.5 * (widest.lowest + widest.highest), widest.highest - widest.lowest
    return [_swing(middle, 0.4 * width, speed)]


def _swing(center: float, amplitude: float, speed: float) -> Path:
    return lambda seconds: (
        center + amplitude * sin(speed * seconds),
        amplitude * speed * cos(speed * seconds),
    )


_FAULT = 'fault '
"""Prefix of a fault's name among the names of effects; the fault is not injected."""

Names = frozenset[str]


def faults_of(scene: Scene) -> Names:
    """Return the faults of a scene under their names among the effects."""
    return Names(f'{_FAULT}{name}' for name in scene.faults)


class Variant:
    """A running variant of the scene, and the durations of its ticks, in [ns]."""

    def __init__(self, pipeline: Pipeline) -> None:
        self.pipeline = pipeline
        self.ticks: list[int] = []
        self.offers: list[int] = []
        self.published = 0

    def run(self, nows: Sequence[int], messages: Sequence[bytes]) -> None:
        """Tick at these times, in [ns], each after its message, in the same order as the node."""
        offer, tick, clock = self.pipeline.offer, self.pipeline.tick, perf_counter_ns
        injection = self.pipeline.injection
        for now, message in zip(nows, messages, strict=True):
            begin = clock()
            if injection is not None:
                injection.advance(now)
                now = injection.clock(now)  # noqa: PLW2901 (a clock fault changes the tick's time)
            if message:
                offer(message, now)
                self.offers.append(clock() - begin)
            done = tick(now)
            self.ticks.append(clock() - begin)
            self.published += bool(done.message)

    def forget(self) -> None:
        """Discard the durations measured so far."""
        self.ticks.clear()
        self.offers.clear()
        self.published = 0


class Variants:
    """Variants of a scene, keyed by the effects that they have."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.built: dict[Names, Variant] = {}
        self._closures: dict[bool, list[Closure]] = {}

    def build(self, named: Names) -> Variant:
        """Return the variant with these effects and without recording; built once."""
        if named not in self.built:
            self.built[named] = Variant(self.pipeline(named))
        return self.built[named]

    def pipeline(self, named: Names) -> Pipeline:
        """Return a new pipeline of the scene with these effects, at its start."""
        scene = replace(
            self.scene,
            members=tuple(_with(member, named) for member in self.scene.members),
            faults={
                # The fault is present but never injected, by nobody and no timeline.
                name: replace(fault, at=(), seconds=0.0)
                for name, fault in self.scene.faults.items()
                if f'{_FAULT}{name}' in named
            },
            record=None,
        )
        # The first solution of an iterated linkage may take a second.
        altered = 'tolerance' in named
        pipeline = Pipeline(scene, self._closures.get(altered))
        self._closures.setdefault(altered, pipeline.closures)
        return pipeline

    def attempt(self, named: Names) -> Variant | None:
        """Return the variant with these effects; None if they cannot be combined."""
        try:
            return self.build(named)
        except FileError:
            return None


def _with(member: SceneLinkage, named: Names) -> SceneLinkage:
    """Return a linkage with only these of its effects and of those that they require."""
    own = member.effects
    brought = {need for effect in own for need in dependencies(effect)}
    effects = {
        name: own[name] if name in own else module_of(name).PARAMETERS()
        for name in in_order({*own, *brought})
        if name in named
    }
    forced = member.drive[0] == 'torque' or not named.isdisjoint(FORCE_EFFECTS)
    return replace(member, effects=effects, loads=member.loads if forced else None)


Progress = Callable[[int, int], None]
"""Takes the amount done and the total."""

_BLOCK = 100
"""Ticks of a variant per block: long enough to warm the caches, short compared with a drift."""

_WARM_UP = 200
_THOUSAND = 1000


class Times(NamedTuple):
    """Durations of ticks."""

    median: float  # Median of all ticks, in [µs]
    # The 99th percentile of 1000 consecutive ticks, in [µs]; of all thousands the median, so that
    # a short disturbance of the machine does not count.
    p99: float
    # Quartiles of the medians of 100 consecutive ticks, in [µs].
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class EffectCost:
    """The cost of an effect."""

    name: str  # Name of the effect; for a fault, which is not injected, one of `faults_of`
    # What the effect, with the effects it requires, adds to the scene without effects; None if it
    # cannot be measured alone.
    adds: Times | None
    # The effect beside which ``adds`` was measured, since alone it acts on nothing; '' if none.
    beside: str
    # By how much the median tick of the whole scene is shorter without it, in [µs]; None if it
    # cannot be left out.
    saves: float | None
    left_out_with: str  # The effect that would then act on nothing and is left out too; '' if none
    needed_by: tuple[str, ...]  # The effects that require it


@dataclass(frozen=True, slots=True)
class SceneCost:
    """The cost of a scene."""

    # Reading and accepting a crank message; None if the drives listen to no topic.
    offer: Times | None
    bare: Times  # A tick of the scene without effects, including its crank message
    whole: Times  # A tick of the scene, including its crank message
    effects: tuple[EffectCost, ...]  # Costs of the effects, in physical order
    published: float  # The fraction of all ticks that published something


def measure(
    scene: Scene,
    ticks: int,
    *,
    leave_out: bool = True,
    stopped: Callable[[], bool] = lambda: False,
    progress: Progress = lambda _done, _of: None,
) -> SceneCost | None:
    """
    Measure a scene on this machine.

    Parameters
    ----------
    scene
        The scene.
    ticks
        Ticks of each variant.
    leave_out
        Whether to measure also how much leaving each effect out saves.
    stopped
        Called now and then; if it returns True, the measurement ends and returns None.
    progress
        Called now and then with the ticks of each variant that are done, and all of them.

    Raises
    ------
    FileError
        If parts of the scene cannot be combined.

    """
    named = Names(name for member in scene.members for name in member.effects)
    faults = faults_of(scene)
    named |= faults
    variants = Variants(scene)
    bare, whole = variants.build(Names()), variants.build(named)
    effects_of = in_order({*EFFECTS, *named} - faults)
    computed = [n for n in effects_of if n in named or bringing(n, named)]
    computed += sorted(faults)
    added = {name: _added(name, named, variants) for name in computed}
    without = {
        name: _left_out(name, named, variants)
        for name in computed
        if leave_out and not bringing(name, named)
    }
    built = list(variants.built.values())
    if not _run([(feed(scene, built[0].pipeline), built)], ticks, stopped, progress):
        return None

    effects = []
    for name in computed:
        base, one, beside = added[name]
        less, left_out_with = without.get(name, (None, ''))
        effects.append(
            EffectCost(
                name,
                _difference(one.ticks, base.ticks) if base and one else None,
                beside,
                _times(whole.ticks).median - _times(less.ticks).median if less else None,
                left_out_with,
                bringing(name, named),
            )
        )
    offers = bare.offers
    return SceneCost(
        offer=_times(offers) if offers else None,
        bare=_times(bare.ticks),
        whole=_times(whole.ticks),
        effects=tuple(effects),
        published=whole.published / len(whole.ticks),
    )


def _added(
    name: str, named: Names, variants: Variants
) -> tuple[Variant | None, Variant | None, str]:
    """Return the variants without and with an effect, and the effect beside it, if any."""
    for beside in (
        '',
        *(loaded for loaded in FORCE_EFFECTS if loaded in named and loaded != name),
    ):
        base = Names({beside} - {''})
        one = variants.attempt(base | {name})
        if one is not None:
            return variants.build(base), one, beside
    return None, None, ''


def _left_out(name: str, named: Names, variants: Variants) -> tuple[Variant | None, str]:
    """Return the variant without an effect, and the effect that has to go with it."""
    for other in ('', 'friction'):
        less = variants.attempt(named - {name, other})
        if less is not None:
            return less, other
    return None, ''


def compare(
    bare: Scene,
    others: Mapping[str, Scene],
    ticks: int,
    *,
    stopped: Callable[[], bool] = lambda: False,
    progress: Progress = lambda _done, _of: None,
) -> dict[str, Times] | None:
    """
    Measure by how much the ticks of other scenes differ from those of a bare one.

    Parameters
    ----------
    bare
        The scene to compare with.
    others
        Scenes that differ from it in one thing each, by name; all at the same rate.
    ticks, stopped, progress
        See `measure`.

    Returns
    -------
    differences
        Differences by name; None if stopped.

    """
    variants = {name: Variant(Pipeline(scene)) for name, scene in others.items()}
    first = Variant(Pipeline(bare))
    each = [(feed(bare, first.pipeline), [first])]
    each += [(feed(others[name], one.pipeline), [one]) for name, one in variants.items()]
    if not _run(each, ticks, stopped, progress):
        return None
    return {name: _difference(one.ticks, first.ticks) for name, one in variants.items()}


def _run(
    fed: Sequence[tuple[Iterator[tuple[int, bytes]], Sequence[Variant]]],
    ticks: int,
    stopped: Callable[[], bool],
    progress: Progress,
) -> bool:
    """Let variants tick in turn, each by its times and messages; return False if stopped."""
    contenders = [(number, one) for number, (_, ones) in enumerate(fed) for one in ones]
    shuffle = Random(0).shuffle
    for number, size in enumerate((_WARM_UP, *_blocks(ticks))):
        if stopped():
            return False
        blocks = [tuple(zip(*[next(times) for _ in range(size)], strict=True)) for times, _ in fed]
        # The first variant, or one behind a slow one, finds cold caches: the order changes.
        shuffle(contenders)
        for by, contender in contenders:
            contender.run(*blocks[by])
            if number == 0:
                contender.forget()
        progress(min(number * _BLOCK, ticks), ticks)
    return True


def _blocks(ticks: int) -> Iterator[int]:
    for begin in range(0, ticks, _BLOCK):
        yield min(_BLOCK, ticks - begin)


def _times(nanoseconds: Sequence[int]) -> Times:
    return Times(*_middle(nanoseconds), *_quartiles(_medians(nanoseconds)))


def _middle(nanoseconds: Sequence[int]) -> tuple[float, float]:
    """Return the median and the p99, in [µs]."""
    count = len(nanoseconds)
    parts = max(1, count // _THOUSAND)
    ends = [count * i // parts for i in range(parts + 1)]
    p99s = [_p99(nanoseconds[begin:end]) for begin, end in pairwise(ends)]
    return median(nanoseconds) * 1e-3, median(p99s) * 1e-3


def _medians(nanoseconds: Sequence[int]) -> list[float]:
    """Return the median of each block of ticks, in [µs]."""
    ends = [*range(0, len(nanoseconds), _BLOCK), len(nanoseconds)]
    return [median(nanoseconds[begin:end]) * 1e-3 for begin, end in pairwise(ends)]


def _quartiles(values: Sequence[float]) -> tuple[float, float]:
    low, _, high = spread_of(values)
    return low, high


def _p99(nanoseconds: Sequence[int]) -> int:
    return sorted(nanoseconds)[int(0.99 * (len(nanoseconds) - 1))]


def _difference(one: Sequence[int], other: Sequence[int]) -> Times:
    """Return how much longer one takes than the other; both ticked in turn, block by block."""
    middle = [a - b for a, b in zip(_middle(one), _middle(other), strict=True)]
    blocks = [a - b for a, b in zip(_medians(one), _medians(other), strict=True)]
    return Times(middle[0], middle[1], *_quartiles(blocks))
