# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What effects and faults make different, against closed forms of each."""

from __future__ import annotations

from itertools import islice
from math import sqrt, tau

from linkage_ros.description import parse_scene, Scene
from linkage_ros.errors import FileError
from linkage_ros.resources import shipped_path
from linkage_ros.tools.study import (
    ALL_TOGETHER,
    compare_runs,
    measure_deliberate,
    published_states,
    turn_crank,
)
import numpy as np
import pytest

from ...support.four_bar import four_bar_angles, GALLERY

RATE, TICKS = 1000.0, 2000
FILE = shipped_path('linkages/four_bar.yaml').read_bytes()
CRANK, _, ROCKER, GROUND = GALLERY


def scene_of(rest: str, drive: str = 'constant_rate: {rate: 6.283185307179586}') -> Scene:
    text = f'linkage: x.yaml\nrate: {RATE:g}\ndrive: {{{drive}}}\n{rest}'
    return parse_scene('x', 'x', {'scene.yaml': text.encode(), 'linkage.yaml': FILE})


def rocker_of(crank: float) -> float:
    """Return the angle of the rocker, B on the left of A→O4."""
    return four_bar_angles(crank)[1]


def rockers(times: object) -> np.ndarray:
    return np.unwrap([rocker_of(tau * time) for time in np.asarray(times)])


TIMES = np.arange(TICKS) / RATE


def test_reference_rocker_angles_equal_the_published_states() -> None:
    states = [
        state['rocker_joint'] for _, state in published_states(scene_of(''), turn_crank, 100)
    ]
    assert states == pytest.approx(list(rockers(TIMES[:100])), abs=1e-12)


def moments(apart: object) -> tuple[float, float]:
    apart = np.abs(np.asarray(apart))
    return float(np.sqrt(np.mean(apart**2))), float(np.max(apart))


def couplers(times: np.ndarray) -> np.ndarray:
    """Return the angle of the coupler against the crank, from A to B."""
    cranks, angles = tau * times, rockers(times)
    b = GROUND + ROCKER * np.exp(1j * angles)
    return np.unwrap(np.angle((b - CRANK * np.exp(1j * cranks)) * np.exp(-1j * cranks)))


def shown(ticks: object) -> tuple[float, float]:
    """Return the error of a listener to whom each tick shows the state of another, the worst."""
    seen = TIMES[np.asarray(ticks)]
    apart = [tau * (TIMES - seen), *(of(TIMES) - of(seen) for of in (rockers, couplers))]
    return moments(np.max(np.abs(apart), axis=0))


QUANTUM = tau / 1000.0
EXPECTED: dict[str, tuple[float, float]] = {
    'bias: {joints: {rocker_joint: 0.01}}': (0.01, 0.01),
    # It counts the steps that it has passed: an error between 0 and a step.
    'encoder: {joints: {rocker_joint: {counts: 1000}}}': (QUANTUM / sqrt(3.0), QUANTUM),
    'velocity: {}': (0.0, 0.0),
    'acceleration: {}': (0.0, 0.0),
}


@pytest.mark.parametrize('effect', EXPECTED)
def test_single_effect_error_equals_its_closed_form(effect: str) -> None:
    (found,) = compare_runs(scene_of(f'effects: {{{effect}}}'), [scene_of('')], turn_crank, TICKS)
    rms, worst = EXPECTED[effect]
    assert found.error.rms == pytest.approx(rms, rel=0.1)
    assert found.error.worst == pytest.approx(worst, rel=0.02)
    assert found.silent == 0.0


def test_rate_limit_error_equals_a_held_state() -> None:
    one = scene_of('effects: {rate_limit: {rate: 100}}')
    (found,) = compare_runs(one, [scene_of('')], turn_crank, TICKS)
    assert found.error == pytest.approx(shown(np.arange(TICKS) // 10 * 10), rel=1e-6)


def test_dropout_error_reports_the_silent_share() -> None:
    one = scene_of('effects: {dropout: {probability: 0.3}}')
    (found,) = compare_runs(one, [scene_of('')], turn_crank, TICKS)
    news = [is_new for is_new, _ in published_states(one, turn_crank, TICKS)]
    assert news.count(False) == pytest.approx(0.3 * TICKS, abs=0.05 * TICKS)
    assert found.silent == news.count(False) / TICKS
    first = news.index(True)
    last = np.maximum.accumulate(np.where(news, np.arange(TICKS), first))
    last[:first] = np.arange(first)  # nothing to hold yet
    assert found.error == pytest.approx(shown(last), rel=1e-6)


def test_delay_error_equals_the_motion_within_it() -> None:
    one = scene_of('effects: {delay: {seconds: 0.02}}')
    (found,) = compare_runs(one, [scene_of('')], turn_crank, TICKS)
    ticks = np.arange(TICKS)
    late = np.where(ticks < 20, ticks, ticks - 20)  # nothing to see yet
    assert found.error == pytest.approx(shown(late), rel=1e-6)


def test_freeze_fault_error_appears_at_its_times() -> None:
    one = scene_of('faults: {f: {freeze: {}, at: [0.5], seconds: 0.25}}')
    bare = scene_of('')
    (found,) = compare_runs(one, [bare], turn_crank, TICKS)
    states = [state for _, state in published_states(bare, turn_crank, TICKS)]
    frozen = [
        max(abs(states[tick][name] - states[499][name]) for name in states[tick])
        if 500 <= tick < 750
        else 0.0
        for tick in range(TICKS)
    ]
    rms, worst = moments(frozen)
    assert found.error.worst == pytest.approx(worst, rel=0.02)
    assert found.error.rms == pytest.approx(rms, rel=0.02)


def test_clock_jump_back_does_not_end_the_run() -> None:
    one = scene_of('faults: {f: {time_jump: {by: -0.3}, at: [0.5], seconds: 0.2}}')
    ticks = list(islice(published_states(one, turn_crank, TICKS), TICKS))
    assert len(ticks) == TICKS
    assert all(is_new for is_new, _ in ticks)


def test_budget_lists_every_effect_and_fault() -> None:
    scene = scene_of(
        'effects: {encoder: {joints: {rocker_joint: {counts: 1000}}}, velocity: {}, effort: {}}\n'
        'loads: {gravity: [0, -9.81]}\n'
        'faults: {f: {silence: {}}}\npublish_input: true\n'
    )
    knobs = measure_deliberate(scene, quick=True, horizon=0.2)
    names = {knob.name for knob in knobs}
    assert names == {'encoder', 'velocity', 'effort', 'fault f', ALL_TOGETHER}
    assert knobs[0].name == 'encoder'
    assert all(knob.is_deliberate and knob.own_setting.price is not None for knob in knobs)
    assert knobs[-1].name == ALL_TOGETHER
    by_name = {knob.name: knob for knob in knobs}
    assert by_name['effort'].own_setting.error.worst == 0.0
    assert 'only when it is called for' in by_name['fault f'].note
    assert 'computed for effort' in by_name['velocity'].note
    assert by_name['encoder'].after is None


def test_rare_silence_is_reported_in_the_note() -> None:
    # One of 1,000 ticks publishes nothing.
    knobs = measure_deliberate(
        scene_of('faults: {f: {silence: {}, at: [0.5], seconds: 0.001}}'), quick=True, horizon=1.0
    )
    (note,) = [knob.note for knob in knobs if knob.name == 'fault f']
    assert note == 'nothing is published at 0.1 % of the ticks'


def test_torque_scene_error_names_its_duration() -> None:
    scene = scene_of(
        'effects: {friction: {joints: {O2: {viscous: 1.0e-4}}}}\nloads: {gravity: [0, -9.81]}\n',
        'torque: {start: 0.5}',
    )
    (friction,) = measure_deliberate(scene, quick=True, horizon=0.3)
    assert friction.after == pytest.approx(0.3)
    assert friction.own_setting.error.worst > 0.0


def test_scene_without_effects_has_no_rows() -> None:
    assert measure_deliberate(scene_of('')) == []


def test_friction_without_forces_is_refused_in_one_line() -> None:
    with pytest.raises(FileError):
        measure_deliberate(scene_of('effects: {friction: {joints: {O2: {coulomb: 1.0e-3}}}}\n'))
