# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What cannot be measured is one line; what can has knobs whose own settings are the scene's."""

from importlib import import_module
from math import cos, inf, sin
import re

from docs.make_accuracy import compare_hard_cases
from linkage_ros.bag import BagWriter, Topic
from linkage_ros.description import load_scene
from linkage_ros.errors import LinkageError
from linkage_ros.messages import JOINT_STATE_TYPE, JointStateWriter
from linkage_ros.tools.study import (
    drive_step,
    ERRORS,
    errors_in_use,
    IN_USE,
    measure_age_in_use,
    measure_age_of_command,
    measure_budget,
    measure_drive_step,
    measure_solving,
    motions_of,
    NAME as STEP,
    OF_COMMAND,
)
import pytest

from ...support.scenes import PENDULUM

NEVER = """
linkage: double_rocker
drive: {sine: {mean: 3.0, amplitude: 0.1, frequency: 1}}
"""
RUNAWAY = """
linkage: four_bar
drive: {torque: {start: 0.5}}
loads: {efforts: {crank_joint: {constant: 5.0}}}
"""
TOPIC = 'linkage: four_bar'


@pytest.mark.parametrize(
    ('text', 'like', 'words'),
    [
        (NEVER, None, 'drive: moves the linkage nowhere where its loops close'),
        (RUNAWAY, None, 's the input runs away and passes'),
        (TOPIC, None, 'topic has no own motion; choose a motion of its crank: --like sine'),
        (TOPIC, 'nowhere', 'nowhere: does not exist'),
    ],
)  # fmt: skip
def test_budget_refuses_bad_input_in_one_line(tmp_path, text, like, words):
    (tmp_path / 'scene.yaml').write_text(text)
    scene = load_scene(tmp_path / 'scene.yaml')
    with pytest.raises(LinkageError) as raised:
        measure_budget(scene, like=like, quick=True, parts=[ERRORS])
    assert words in str(raised.value)
    assert '\n' not in str(raised.value)


def test_runaway_remedy_gives_a_measurable_horizon(tmp_path):
    (tmp_path / 'scene.yaml').write_text(RUNAWAY)
    scene = load_scene(tmp_path / 'scene.yaml')
    (motion,) = motions_of(scene, None, 10.0)
    with pytest.raises(LinkageError) as raised:
        measure_drive_step(motion, scene.rate, 10.0, quick=True)
    horizon = float(str(raised.value).rpartition('--horizon ')[2])
    knob, _ = measure_drive_step(motion, scene.rate, horizon, quick=True)
    assert 0.0 < knob.own_setting.error.worst < 0.1


def test_topic_scene_budget_has_sorted_knobs(tmp_path):
    (tmp_path / 'scene.yaml').write_text('linkage: four_bar\nrate: 100\neffects: {velocity: {}}')
    scene = load_scene(tmp_path / 'scene.yaml')
    shares = []
    budget = measure_budget(
        scene, like='sine', quick=True, parts=[ERRORS], horizon=0.5, progress=shares.append
    )
    assert [knob.name for knob in budget.knobs] == [IN_USE, OF_COMMAND, 'solving']
    assert [each.partition(':')[0] for each in budget.left_out] == ['--quick']
    assert all(not (knob.own_setting.changes or knob.own_setting.advice) for knob in budget.knobs)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    for knob in budget.knobs[:2]:
        for setting in knob.settings:
            assert setting is knob.own_setting or setting.instruction
            assert setting.price is not None or not setting.changes
    assert budget.knobs[2].own_setting.error.worst < 1e-14


def test_doubled_rate_halves_the_held_error():
    motions = motions_of(load_scene('demo'), 'sine', 4.0)
    (held, carried), (held_then, carried_then) = errors_in_use(motions, [500.0, 1000.0], 4.0)
    assert held.rms / held_then.rms == pytest.approx(2.0, rel=0.02)
    assert carried.rms / carried_then.rms == pytest.approx(4.0, rel=0.02)


def test_carry_forward_advice_adds_the_velocity_effect(tmp_path):
    (tmp_path / 'scene.yaml').write_text(TOPIC)
    scene = load_scene(tmp_path / 'scene.yaml')
    knob = measure_age_in_use(scene, motions_of(scene, 'sine', 1.0), 1.0, quick=True)
    carried = [each for each in knob.settings if 'carried' in each.label]
    assert carried
    assert all(('effects.velocity', {}) in each.changes for each in carried)


def test_two_linkages_are_measured_together():
    scene = load_scene('two_fingers')
    motions = motions_of(scene, None, 2.0)
    both = errors_in_use(motions, [scene.rate], 2.0)[0][0]
    each = [errors_in_use([motion], [scene.rate], 2.0)[0][0] for motion in motions]
    assert both.worst == pytest.approx(max(one.worst for one in each))
    assert both.rms >= max(one.rms for one in each) * (1.0 - 1e-12)


def test_step_errors_follow_the_method_order(tmp_path):
    (tmp_path / 'scene.yaml').write_text(
        'linkage: four_bar\nrate: 500\nloads: {gravity: [0, -9.81], drive_inertia: 0.001}\n'
        'drive: {torque: {start: 0.5, step: 0.008, timeout: 10}}\n'
    )
    (motion,) = motions_of(load_scene(tmp_path / 'scene.yaml'), None, 2.0)
    knob, _ = measure_drive_step(motion, 500.0, 2.0, quick=True)
    assert knob.name == STEP
    errors = {each.label: each.error.worst for each in knob.settings}
    assert errors['rk4, 16 ms'] / errors['rk4, 8 ms'] == pytest.approx(16.0, rel=0.25)
    assert errors['rk4, 8 ms'] / errors['rk4, 4 ms'] == pytest.approx(16.0, rel=0.25)


EVALUATIONS = {'semi_implicit_euler': 1, 'rk4': 4, 'gauss_legendre': 14}


@pytest.mark.parametrize('seconds', [0.0, 2.5, 5.0, inf])
def test_slow_settings_are_left_out_and_listed(tmp_path, monkeypatch, seconds):
    """A run of a clock of our own takes a second at the scene's own setting."""
    pytest.importorskip('scipy')  # else a run stands in for the exact motion, and takes time too
    (tmp_path / 'scene.yaml').write_text(
        'linkage: four_bar\nrate: 100\nloads: {gravity: [0, -9.81], drive_inertia: 0.001}\n'
        'drive: {torque: {start: 0.5, step: 0.008, timeout: 10}}\n'
    )
    (motion,) = motions_of(load_scene(tmp_path / 'scene.yaml'), None, 0.2)
    now = 0.0
    run = drive_step.cranks_at

    def cost(method, step):
        return EVALUATIONS[method] / EVALUATIONS['rk4'] * 0.008 / step

    def timed_run(*arguments, method='rk4', step=0.008):
        nonlocal now
        now += cost(method, step)
        return run(*arguments, method=method, step=step)

    monkeypatch.setattr(drive_step, 'process_time', lambda: now)
    monkeypatch.setattr(drive_step, 'cranks_at', timed_run)
    monkeypatch.setattr(drive_step, '_measure_price', lambda *_: None)  # by a clock of its own
    knob, left_out = measure_drive_step(motion, 100.0, 0.2, quick=True, seconds=seconds)
    left, measured = seconds - 1.0, ['rk4, 8 ms']
    wanted = [
        ('rk4', 0.004),
        ('rk4', 0.016),
        ('semi_implicit_euler', 0.008),
        ('gauss_legendre', 0.008),
    ]
    without = []
    for method, step in wanted:
        fits = cost(method, step) <= left
        (measured if fits else without).append(f'{method}, {1e3 * step:g} ms')
        left -= cost(method, step) * fits
    assert {each.label for each in knob.settings} == {*measured}
    told = '; '.join(without)
    assert left_out == ([f'for lack of time: {told}'] if without else [])


def test_quick_measurement_says_what_it_had_no_time_for(monkeypatch):
    """The bounds of processor time are passed before anything is compared or priced."""
    monkeypatch.setattr(import_module('linkage_ros.tools.study.solving'), '_QUICK_COMPARED', -1.0)
    monkeypatch.setattr(import_module('linkage_ros.tools.study.measure'), '_QUICK_PRICES', 0.0)
    budget = measure_budget(
        load_scene('demo'), horizon=0.2, like='sine', quick=True, parts=[ERRORS]
    )
    (solving,) = (knob for knob in budget.knobs if knob.name == 'solving')
    assert [each.label for each in solving.settings] == ['closed form']
    assert solving.note == 'other methods are left out for lack of time'
    counted = [
        re.fullmatch(r'for lack of time: (\d+) settings farther .*', said)
        for said in budget.left_out
    ]
    assert sum(int(found[1]) for found in counted if found) > 0


def test_solver_comparison_orders_errors_as_expected():
    motions = motions_of(load_scene('demo'), 'sine', 10.0)
    knob = measure_solving(motions, 1000.0, 10.0, quick=True, seconds=0.1)
    errors = {each.label: each.error.worst for each in knob.settings}
    assert errors['30 digits'] < 1e-28 < errors['closed form'] < 1e-14 < errors['float32'] < 1e-5
    assert errors['spline, 64 knots'] > errors['spline, 1,024 knots'] > errors['closed form']
    assert all(each.changes is None for each in knob.settings if each is not knob.own_setting)


def test_narrower_cells_take_the_place_of_newton_steps(tmp_path):
    (tmp_path / 'scene.yaml').write_text('linkage: class_3\n')
    motions = motions_of(load_scene(tmp_path / 'scene.yaml'), 'sine', 10.0)
    knob = measure_solving(motions, 1000.0, 10.0, quick=True, seconds=0.1)
    errors = {each.label: each.error.worst for each in knob.settings}
    step, narrow = errors['iterated, 1 step'], errors['iterated, 1 step from cells 1/4 as wide']
    assert errors['iterated'] < 1e-14
    assert 1e-14 < step < 1e-6
    assert narrow < 1e-2 * step


def test_closed_form_solves_hard_cases_the_textbook_fails():
    cases = list(compare_hard_cases())
    failed = {(case.place, case.solver): case.failed for case in cases}
    places = {place for place, _ in failed}
    assert len(places) == 2
    assert not any(failed[place, 'closed form'] for place in places)
    assert failed['change point of parallelogram', 'textbook form']
    assert all(case.worst < inf for case in cases if case.solver == 'closed form')


def bag_of(folder, delay, count=400, rate=200.0):
    """Write a bag of samples of a sine, each recorded a delay after its stamp, in [s]."""
    write = JointStateWriter(['drive_joint']).write
    topics = [Topic('/crank_states', JOINT_STATE_TYPE, '', '')]
    writer = BagWriter(folder, topics, {})
    for index in range(count):
        time = index / rate
        stamp = 10**18 + round(time * 1e9)
        data = write(stamp, (1.5 * sin(3.0 * time),), (4.5 * cos(3.0 * time),), (0.0,))
        writer.write(0, stamp + round(delay * 1e9), stamp + round(delay * 1e9), data)
    writer.close()
    return folder


def test_a_bag_gives_motion_rate_and_delay(tmp_path):
    """A sine that is carried over 20 ms and up to 4 ms more is off by w²·A·t²/2."""
    bag = bag_of(tmp_path / 'bag', 0.02)
    (tmp_path / 'scene.yaml').write_text(PENDULUM_SCENE)
    (tmp_path / 'pendulum.yaml').write_text(PENDULUM)
    scene = load_scene(tmp_path / 'scene.yaml')
    (motion,) = motions_of(scene, str(bag), 1.9)
    assert motion.sample_rate == pytest.approx(200.0)
    assert motion.length == pytest.approx(399 / 200.0)
    for time in (0.1, 0.7123, 1.5):
        values, rates = motion.path(round(time * 1e9))
        assert values[0] == pytest.approx(1.5 * sin(3.0 * time), abs=1e-7)
        assert rates[0] == pytest.approx(4.5 * cos(3.0 * time), abs=1e-4)
    knob = measure_age_of_command(motion, scene, 1.9)
    assert knob.own_setting.error.worst == pytest.approx(0.5 * 9.0 * 1.5 * 0.024**2, rel=0.03)
    (least,) = (each for each in knob.settings if each.label == 'without delay')
    assert least.error.worst == pytest.approx(0.5 * 9.0 * 1.5 * 0.004**2, rel=0.03)
    (held,) = (each for each in knob.settings if 'held' in each.label)
    assert held.error.worst == pytest.approx(4.5 * 0.024, rel=0.02)
    assert held.changes == [('drive.topic.carry_forward', False)]


PENDULUM_SCENE = 'linkage: pendulum.yaml\nrate: 1000\n'


@pytest.mark.parametrize(('seconds', 'finest'), [(1e9, 16), (0.0, 4)])
def test_winding_reference_step_matches_the_note(tmp_path, monkeypatch, seconds, finest):
    # A winding has no exact motion, and the time decides how short a step stands in for it.
    (tmp_path / 'scene.yaml').write_text(
        'linkage: four_bar\nrate: 200\nloads: {gravity: [0, -9.81], drive_inertia: 1.0e-3}\n'
        'drive: {torque: {start: 1.0, step: 0.002, motor: {torque_constant: 0.02, '
        'resistance: 1.5, ratio: 10, inductance: 0.02, command: voltage, voltage: 12}}}\n'
    )
    scene = load_scene(tmp_path / 'scene.yaml')
    (motion,) = motions_of(scene, None, 0.5)
    steps, module = [], import_module('linkage_ros.tools.study.drive_step')
    cranks_at = module.cranks_at

    def spied(motion, times, **changes):
        steps.append(changes.get('step', 0.002))
        return cranks_at(motion, times, **changes)

    monkeypatch.setattr(module, 'cranks_at', spied)
    knob, _ = measure_drive_step(motion, scene.rate, 0.5, quick=True, seconds=seconds)
    assert f'the drive at 1/{finest} of its step' in knob.note
    assert min(steps) == pytest.approx(0.002 / finest)
    assert steps.count(min(steps)) == 1
    assert steps.count(2.0 * min(steps)) == 1
