# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What a tick of a scene costs, and what a changed setting adds to it.

Scenes take turns in one process, a block of ticks each, in an order that changes. All rounds begin
at the start of the scenes and pass the same simulated time, so each block is measured once a
round. A price is the mean of the blocks, each the median of the rounds; a difference is taken from
block to block. Its spread are the quartiles of the rounds. Times are processor time of the thread,
with garbage collection off as in the node. Nothing is published: what the middleware takes for a
message is the same for every setting.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import gc
from itertools import islice
import json
from math import cos, inf, pi, sin, tau
from random import Random
from statistics import fmean, median
from time import perf_counter, process_time

from linkage_ros.description import parse_scene, Scene
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import Closure, InputSweep, Status, usual_inputs
from linkage_ros.messages import JointStateWriter
from linkage_ros.stages.drives import ExchangedInputs
from linkage_ros.tick import LinkagePipeline, Pipeline
from linkage_ros.tools.study.budget import Knob, Price
from linkage_ros.tools.study.measuring import Progress, Spread, spread_of, thread_clock

USUAL_RATE = 1000.0
"""Ticks per second of a scene that ticks with its samples."""

_BEGIN = 1_000_000_000
_CRANK_RATE = 1.0
"""Turns, or oscillations, of the crank per second."""

_PART = 0.4
"""
Amplitude of a crank that does not turn fully, as a fraction of its range; of several inputs the
greatest one, in [rad] or sizes of the linkage.
"""

_LEAST_PART, _PLACES = 0.01, 32
"""The least amplitude of several inputs, and the places where it is tried that they close."""

_BLOCK = 100
"""Ticks of a block: enough to warm the caches, few compared with a drift of the machine."""

_SLOW_BLOCK = 20
"""Fewest ticks of a block, of a scene that ticks more slowly than those it is compared with."""

_ROUNDS = 12
_FEWEST_ROUNDS = 3
"""Rounds of a measurement whose time is up."""

_LAP = 10.0
"""Longest simulated time of a round, in [s]."""

Feed = Callable[[Scene, Pipeline], Iterator[tuple[int, bytes]]]
"""Yields times in [ns], each with a crank message, or b'' if no drive listens to a topic."""

Change = tuple[str, object]
"""A dotted key of the scene with its value."""

Path = Callable[[float], tuple[float, float]]

Rounds = list[list[float]]


def settings_of(changes: Sequence[Change]) -> list[str]:
    """Return changes as ``--set`` takes them."""
    return [f'{key}={json.dumps(value)}' for key, value in changes]


def change_scene(scene: Scene, changes: Sequence[Change]) -> Scene:
    """Return a scene with changed keys, as ``--set`` sets them; FileError where it refuses."""
    if not changes:
        return scene
    return parse_scene(
        scene.name,
        scene.name,
        scene.files,
        scene.folder,
        seed=scene.seed,
        trust_effects=True,
        settings=settings_of(changes),
    )


def turn_crank(scene: Scene, pipeline: Pipeline) -> Iterator[tuple[int, bytes]]:
    """Yield times and messages: each input turns, or oscillates within the range it closes in."""
    period = 1e9 / (scene.rate or USUAL_RATE)
    names = [name for scene_linkage in scene.linkages for name in scene_linkage.sampled_joints]
    write = JointStateWriter(names).write
    paths = (
        [path for linkage in pipeline.linkages for path in _input_paths(linkage)]
        if pipeline.topic
        else []
    )
    count = 0
    while True:
        now = _BEGIN + round(count * period)
        message = b''
        if pipeline.topic:
            seconds = (now - _BEGIN) * 1e-9
            values, rates = zip(*[path(seconds) for path in paths], strict=True)
            message = write(now, values, rates, (0.0,) * len(names))
        yield now, message
        count += 1


def _input_paths(linkage: LinkagePipeline) -> list[Path]:
    """Return for each input its value and rate at a time in [s]: a rotation or an oscillation."""
    closure, scene_linkage = linkage.closure, linkage.scene_linkage
    joints = scene_linkage.instead_of_inputs
    if not joints:
        if len(closure.linkage.inputs) == 1:
            widest = InputSweep(closure).widest_range
            if widest is None or widest.is_whole:
                speed = tau * _CRANK_RATE
                return [lambda seconds: (speed * seconds, speed)]
        return swinging_inputs(closure, _CRANK_RATE)
    exchange = ExchangedInputs(closure, joints, scene_linkage.drive[1].branch)
    if (branch := exchange.branch) is None:
        return swinging_inputs(exchange.inverse, _CRANK_RATE)
    middle, width = 0.5 * (branch.low + branch.high), branch.high - branch.low
    return [_oscillation_path(middle, _PART * width, tau * _CRANK_RATE)]


def swinging_inputs(closure: Closure, frequency: float) -> list[Path]:
    """
    Return sines of all inputs within the range where they close.

    The first has a frequency in [Hz]; those of others are lower, so that they meet all the others.
    """
    centers = usual_inputs(closure)
    if len(centers) > 1:
        sizes = _closing_sizes(closure, centers)
    else:
        widest = InputSweep(closure).widest_range
        assert widest is not None, 'reading the file has proved that it closes somewhere'
        sizes = [pi]
        if not widest.is_whole:
            centers = (0.5 * (widest.lowest + widest.highest),)
            sizes = [min(pi, _PART * (widest.highest - widest.lowest))]
    return [
        _oscillation_path(center, size, tau * frequency / (1.0 + 0.25 * k))
        for k, (center, size) in enumerate(zip(centers, sizes, strict=True))
    ]


def _closing_sizes(closure: Closure, centers: Sequence[float]) -> list[float]:
    """Return how far several inputs may go together from where they are, to both sides."""
    units = [closure.scale if driven.slider else 1.0 for driven in closure.linkage.inputs]
    random = Random(0)
    parts = [[random.uniform(-1.0, 1.0) for _ in units] for _ in range(_PLACES)]
    size = _PART
    while size > _LEAST_PART:
        places = (
            [
                c + size * unit * part
                for c, unit, part in zip(centers, units, parts_of_way, strict=True)
            ]
            for parts_of_way in parts
        )
        if all(closure.position(*place).status is Status.CLOSED for place in places):
            break
        size *= 0.5
    # Between the places may be others that do not close.
    return [0.8 * size * unit for unit in units]


def _oscillation_path(center: float, amplitude: float, speed: float) -> Path:
    return lambda seconds: (
        center + amplitude * sin(speed * seconds),
        amplitude * speed * cos(speed * seconds),
    )


class TimedScene:
    """A scene that ticks block by block, and can begin again."""

    def __init__(self, scene: Scene, feed: Feed) -> None:
        self.scene, self.rate = scene, scene.rate or USUAL_RATE
        self.block = _BLOCK
        self.published = 0
        self._feed = feed
        self._closures: Sequence[Closure] | None = None
        self.begin()

    def begin(self) -> None:
        """Go to the start of the scene."""
        self._pipeline = Pipeline(self.scene, self._closures)
        # The first solution of an iterated linkage may take a second.
        self._closures = self._pipeline.closures
        self._fed = self._feed(self.scene, self._pipeline)

    def time_block(self, clock: Callable[[], float]) -> float:
        """Tick a block, each tick after its message; return the mean time of a tick, in [µs]."""
        block = list(islice(self._fed, self.block))
        pipeline = self._pipeline
        offer, tick, injection = pipeline.offer, pipeline.tick, pipeline.injection
        published = 0
        begun = clock()
        for now, message in block:
            if injection is not None:
                injection.advance(now)
                now = injection.tick_time(now)  # noqa: PLW2901 (a clock fault changes the time)
            if message:
                offer(message, now)
            if tick(now).message:
                published += 1
        taken = clock() - begun
        self.published += published
        return taken * 1e6 / len(block)


def time_ticks(
    scenes: Sequence[Scene],
    seconds: float,
    feed: Feed = turn_crank,
    progress: Progress = lambda _: None,
    most: float = inf,
) -> list[Rounds]:
    """
    Return for each scene the times of a tick in [µs], of each block in each round.

    It takes some seconds for all of them together, or more if twelve rounds do; three rounds do
    after ``most`` seconds of processor time. A FileError says that parts of a scene cannot
    be combined, a LinkageError that a scene publishes nothing.
    """
    started = process_time()
    timed = [TimedScene(scene, feed) for scene in scenes]
    # Blocks of the same simulated time, so that motions that differ are compared where they are
    # the same.
    rates = [scene.rate for scene in timed]
    span = max(_BLOCK / max(rates), _SLOW_BLOCK / min(rates))
    for timed_scene in timed:
        timed_scene.block = round(span * timed_scene.rate)
    clock, shuffle = thread_clock(), Random(0).shuffle
    order = list(range(len(timed)))
    rounds: list[Rounds] = [[] for _ in timed]
    collecting = gc.isenabled()
    gc.disable()
    try:
        durations = []
        for _ in range(3):  # The first block warms the caches
            begun = perf_counter()
            for timed_scene in timed:
                timed_scene.time_block(clock)
            durations.append(perf_counter() - begun)
        wanted = seconds / min(durations)
        blocks = max(1, round(min(wanted / _ROUNDS, _LAP / span)))
        count = max(_ROUNDS, round(wanted / blocks))
        for done in range(count):
            times: list[list[float]] = [[] for _ in timed]
            for timed_scene in timed:
                timed_scene.begin()
            for _ in range(blocks):
                # A scene behind a slow one finds cold caches: the order changes.
                shuffle(order)
                for index in order:
                    times[index].append(timed[index].time_block(clock))
                progress((done + len(times[0]) / blocks) / count)
                if not done and process_time() - started > 0.5 * most:
                    blocks = len(times[0])
                    break
            for of_scene, blocks_of_scene in zip(rounds, times, strict=True):
                of_scene.append(blocks_of_scene)
            gc.collect(0)
            if done + 1 >= _FEWEST_ROUNDS and process_time() - started > most:
                break
    finally:
        if collecting:
            gc.enable()
    for timed_scene in timed:
        if not timed_scene.published:
            raise LinkageError(
                timed_scene.scene.name,
                'publishes nothing: there is nothing to measure',
                'see that the linkage closes where the drive brings it',
            )
    return rounds


def tick_price(
    scene: Scene, seconds: float = 0.5, feed: Feed = turn_crank, most: float = inf
) -> Price:
    """Return what a whole tick of a scene costs, with its crank message; see `time_ticks`."""
    (rounds,) = time_ticks([scene], seconds, feed, most=most)
    return Price(_spread_of_rounds(rounds), scene.rate or USUAL_RATE)


def price_scenes(
    scene: Scene,
    others: Sequence[Scene],
    seconds: float,
    feed: Feed = turn_crank,
    progress: Progress = lambda _: None,
    most: float = inf,
) -> list[Price]:
    """Return what ticks of other scenes cost more than those of a scene; see `time_ticks`."""
    own, *changed = time_ticks([scene, *others], seconds, feed, progress, most)
    return [
        Price(subtract_times(times, own), scene_with.rate or USUAL_RATE)
        for times, scene_with in zip(changed, others, strict=True)
    ]


def subtract_times(rounds: Rounds, others: Rounds) -> Spread:
    """Return how much longer one takes than the other; both were measured in turns."""
    return _spread_of_rounds(
        [
            [longer - shorter for longer, shorter in zip(*blocks, strict=True)]
            for blocks in zip(rounds, others, strict=True)
        ]
    )


def _spread_of_rounds(rounds: Rounds) -> Spread:
    """Return the mean of the blocks, each the median of the rounds, with the rounds' quartiles."""
    # A block that the machine has disturbed in one round does not count; one that is dear in every
    # round does.
    usual = [median(times) for times in zip(*rounds, strict=True)]
    middle = fmean(usual)
    low, _, high = spread_of(
        [
            middle + _mean_of_most([time - own for time, own in zip(blocks, usual, strict=True)])
            for blocks in rounds
        ]
    )
    return Spread(min(low, middle), middle, max(high, middle))


def _mean_of_most(values: Sequence[float]) -> float:
    """Return the mean without the lowest and the highest tenth."""
    beyond = len(values) // 10
    end = len(values) - beyond
    return fmean(sorted(values)[beyond:end])


def add_prices(
    scene: Scene,
    knobs: Sequence[Knob],
    seconds: float,
    feed: Feed = turn_crank,
    progress: Progress = lambda _: None,
    most: float = inf,
) -> list[Knob]:
    """
    Return the knobs with what each setting that a scene can ask for adds to its tick.

    The scene's own setting, those without keys and those that have a price stay as they are. Those
    whose prices would take more than ``most`` seconds are left out, the farthest ones first.
    """
    asked = {
        (row, column): setting.changes
        for row, knob in enumerate(knobs)
        for column, setting in enumerate(knob.settings)
        if setting.changes and setting.price is None and column != knob.chosen
    }
    # Two knobs may ask for the same keys, such as a rate.
    nearest = sorted(asked, key=lambda at: abs(at[1] - knobs[at[0]].chosen))
    different = {tuple(settings_of(asked[at])): asked[at] for at in nearest}
    if most < inf:
        begun = process_time()
        TimedScene(scene, feed).time_block(process_time)
        seconds_each = (1.0 + _FEWEST_ROUNDS) * (process_time() - begun)
        different = dict(islice(different.items(), max(1, int(most / seconds_each) - 1)))
    changed = [change_scene(scene, changes) for changes in different.values()]
    prices_found = price_scenes(scene, changed, seconds, feed, progress, most)
    prices = dict(zip(different, prices_found, strict=True))
    priced = []
    for row, knob in enumerate(knobs):
        settings = []
        for column, setting in enumerate(knob.settings):
            if (row, column) not in asked:
                settings.append(setting)
            elif price := prices.get(tuple(settings_of(asked[row, column]))):
                settings.append(setting._replace(price=price))
        priced.append(
            knob._replace(settings=tuple(settings), chosen=settings.index(knob.own_setting))
        )
    return priced
