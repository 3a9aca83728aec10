# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Prices: found in spite of drift and disturbances, and called noise where nothing is found."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice
from random import Random

from linkage_ros.description import load_scene, parse_scene, Scene
from linkage_ros.errors import FileError, LinkageError
from linkage_ros.tick import Pipeline
from linkage_ros.tools.study import (
    add_prices,
    change_scene,
    JointError,
    Knob,
    price_scenes,
    prices,
    Setting,
    tick_price,
    time_ticks,
    TimedScene,
    turn_crank,
)
import pytest

DEMO = load_scene('demo')


class FalseClock:
    """A clock in [s] that ticks of scenes advance: by their cost, a common drift and noise."""

    def __init__(self, costs: dict[str, float], drift: float, noise: float, seed: int) -> None:
        self.now, self.costs = 0.0, costs
        self.drift, self.noise, self.random = drift, noise, Random(seed)
        self.blocks = 0

    def take(self, name: str, ticks: int) -> None:
        self.blocks += 1
        cost = self.costs[name] + self.drift * self.blocks
        cost += self.random.gauss(0.0, self.noise)
        if self.random.random() < 0.02:  # the machine does something else
            cost *= 20.0
        self.now += cost * 1e-6 * ticks


@pytest.fixture
def false_clock(monkeypatch: pytest.MonkeyPatch) -> Callable[..., FalseClock]:
    """Give a function that lets scenes cost what it is told, by the solver's clock."""

    def install(costs: dict[str, float], drift: float, noise: float, seed: int) -> FalseClock:
        clock = FalseClock(costs, drift, noise, seed)
        monkeypatch.setattr(TimedScene, 'begin', lambda _scene: None)

        def time_block(scene: TimedScene, read: Callable[[], float]) -> float:
            begun = read()
            clock.take(scene.scene.name, scene.block)
            scene.published += 1
            return (read() - begun) * 1e6 / scene.block

        monkeypatch.setattr(TimedScene, 'time_block', time_block)
        monkeypatch.setattr(prices, 'thread_clock', lambda: lambda: clock.now)
        monkeypatch.setattr(prices, 'perf_counter', lambda: clock.now)
        return clock

    return install


def named(name: str) -> Scene:
    text = b'linkage: four_bar.yaml\nrate: 1000\n'
    return parse_scene(
        name, name, {'scene.yaml': text, 'linkage.yaml': DEMO.files['linkage.yaml']}
    )


@pytest.mark.parametrize('seed', range(20))
def test_price_difference_is_found_despite_clock_drift(
    false_clock: Callable[..., FalseClock], seed: int
) -> None:
    random = Random(seed)
    own = random.uniform(5.0, 80.0)
    more = random.choice([-0.4, 0.1, 1.0, 30.0]) * own
    # The clock goes up by a half on the way; noise is a twentieth of a tick.
    false_clock({'own': own, 'other': own + more}, own * 1e-3, 0.05 * own, seed)
    (price,) = price_scenes(named('own'), [named('other')], 2.0)
    assert price.tick.middle == pytest.approx(more, abs=0.02 * (2.0 * own + more))
    assert price.tick.low <= price.tick.middle <= price.tick.high
    assert not price.is_noise


def test_equal_costs_are_reported_as_noise(false_clock: Callable[..., FalseClock]) -> None:
    noisy = 0
    for seed in range(40):
        false_clock({'own': 10.0, 'other': 10.0}, 0.01, 0.5, seed)
        (price,) = price_scenes(named('own'), [named('other')], 1.0)
        noisy += price.is_noise
    assert noisy >= 38


def test_price_blocks_cover_the_same_simulated_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    blocks: list[tuple[float, int]] = []
    real = TimedScene.time_block

    def time_block(scene: TimedScene, clock: Callable[[], float]) -> float:
        blocks.append((scene.rate, scene.block))
        return real(scene, clock)

    monkeypatch.setattr(TimedScene, 'time_block', time_block)
    others = [change_scene(DEMO, [('rate', rate)]) for rate in (50.0, 300.0, 2000.0)]
    price_scenes(DEMO, others, 0.01)
    assert len({round(block / rate, 6) for rate, block in blocks}) == 1
    assert min(block for _, block in blocks) >= 20


def test_price_rounds_begin_at_the_scene_start() -> None:
    begun: list[int] = []

    def feed(scene: Scene, pipeline: Pipeline) -> Iterator[tuple[int, bytes]]:
        for index, (now, message) in enumerate(turn_crank(scene, pipeline)):
            if not index:
                begun.append(now)
            yield now, message

    (rounds,) = time_ticks([DEMO], 0.05, feed)
    assert len(rounds) >= 12
    assert len({len(blocks) for blocks in rounds}) == 1
    assert len(begun) == len(rounds) + 1
    assert len(set(begun)) == 1


def test_price_weights_expensive_parts_by_their_share(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = 0.0
    places = {'own': 0, 'other': 0}

    def begin(scene: TimedScene) -> None:
        places[scene.scene.name] = 0

    def time_block(scene: TimedScene, _clock: Callable[[], float]) -> float:
        nonlocal now
        # A fifth of the motion costs six times as much, as where friction holds and lets go.
        name = scene.scene.name
        places[name] += 1
        cost = 60.0 if name == 'other' and places[name] % 5 == 0 else 10.0
        now += cost * 1e-6 * scene.block
        scene.published += 1
        return cost

    monkeypatch.setattr(TimedScene, 'begin', begin)
    monkeypatch.setattr(TimedScene, 'time_block', time_block)
    monkeypatch.setattr(prices, 'perf_counter', lambda: now)
    (price,) = price_scenes(named('own'), [named('other')], 10.0)
    assert price.tick.middle == pytest.approx(10.0, rel=0.05)
    assert not price.is_noise


def test_changed_scene_equals_the_set_option() -> None:
    changes = [
        ('rate', 250.0),
        ('effects', {'noise': {'joints': {'rocker_joint': {'white': 1e-3}}}}),
    ]
    changed = change_scene(DEMO, changes)
    typed = ['rate=250', 'effects={noise: {joints: {rocker_joint: {white: 0.001}}}}']
    expected = load_scene('demo', typed)
    assert (changed.rate, changed.seed) == (expected.rate, expected.seed)
    assert changed.linkages[0].effects == expected.linkages[0].effects
    with pytest.raises(FileError, match='rate: -1 is out of bounds'):
        change_scene(DEMO, [('rate', -1)])


def test_prices_are_added_only_to_requestable_settings() -> None:
    error = JointError(0.0, 0.0)
    knob = Knob(
        'age in use',
        [
            Setting('500 Hz', error, None, [('rate', 500.0), ('effects.velocity', {})]),
            Setting('own', error, None),
            Setting('float32', error, None, None),
            Setting('carried', error, None, (), 'carry it forward'),
        ],
        1,
    )
    (filled,) = add_prices(DEMO, [knob], 0.05)
    half, own, single, carried = filled.settings
    assert half.price is not None
    assert half.price.rate == 500.0
    assert (own.price, single.price, carried.price) == (None, None, None)
    assert filled._replace(settings=knob.settings) == knob


def test_price_whose_time_is_up_takes_three_rounds() -> None:
    (rounds,) = time_ticks([DEMO], 1.0, most=0.0)
    assert len(rounds) == 3


def test_prices_whose_time_is_up_leave_out_the_farthest() -> None:
    error = JointError(0.0, 0.0)
    others = [Setting(f'{rate} Hz', error, None, [('rate', rate)]) for rate in (100, 200, 300)]
    knob = Knob('age in use', [*others, Setting('own', error, None)], 3)
    (filled,) = add_prices(DEMO, [knob], 0.05, most=0.0)
    assert [each.label for each in filled.settings] == ['300 Hz', 'own']
    assert filled.own_setting.label == 'own'


def test_silent_scene_has_no_price() -> None:
    late = change_scene(DEMO, [('drive.topic.max_age', 0.05)])

    def feed(_scene: Scene, _pipeline: Pipeline) -> Iterator[tuple[int, bytes]]:
        for count in range(10**9):
            yield 10**9 + count * 10**6, b''

    with pytest.raises(LinkageError, match='demo: publishes nothing: there is nothing to measure'):
        tick_price(late, 0.01, feed)


@pytest.mark.parametrize('name', ['demo', 'two_fingers', 'torque_crank', 'jansen_leg'])
def test_price_crank_moves_only_where_loops_close(name: str) -> None:
    scene = load_scene(name)
    pipeline = Pipeline(scene)
    published = 0
    for now, message in islice(turn_crank(scene, pipeline), 2000):
        assert bool(message) == bool(pipeline.topic)
        if message:
            assert pipeline.offer(message, now) is None
        published += bool(pipeline.tick(now).message)
    assert published == 2000
