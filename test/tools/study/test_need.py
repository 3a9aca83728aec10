# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A need is answered by the cheapest settings; the answers differ as the needs do."""

from itertools import pairwise, product
import random

from linkage_ros.description import load_scene
from linkage_ros.tools.study import (
    answer_need,
    answers_of,
    Budget,
    CARRY,
    change_scene,
    IN_USE,
    JointError,
    Knob,
    measure_age_in_use,
    measure_drive_step,
    motions_of,
    Price,
    Setting,
    Spread,
)
import pytest

RATE, HORIZON = 1000.0, 1.0


def price(micros, rate=RATE):
    return Price(Spread(micros - 0.01, micros, micros + 0.01), rate)


def random_budget(rng):
    """Return a budget of up to four knobs, whose better settings are mostly dearer."""
    knobs = []
    for index in range(rng.randint(1, 4)):
        settings = []
        for k in range(rng.randint(1, 6)):
            error = 10.0 ** rng.uniform(-9.0, -1.0)
            adds = rng.choice([None, price(rng.uniform(-5.0, 20.0))])
            settings.append(
                Setting(
                    f'setting {k}', JointError(0.5 * error, error), adds, [(f'key.{index}', k)]
                )
            )
        settings[0] = settings[0]._replace(changes=())
        settings.append(Setting('comparison', JointError(0.0, 0.0), price(-9.0), None))
        knobs.append(Knob(f'knob {index}', settings, 0))
    knobs.append(
        Knob('noise', [Setting('', JointError(1.0, 1.0), price(3.0))], 0, is_deliberate=True)
    )
    return Budget('random', RATE, price(50.0), knobs, [], [])


def choices_of(budget):
    """Yield cost and error of every choice, by brute force."""
    knobs = [knob for knob in budget.knobs if not knob.is_deliberate]
    allowed = [[s for s in knob.settings if s is knob.own_setting or s.changes] for knob in knobs]
    for settings in product(*allowed):
        adds = [
            s.price.tick.middle if s is not knob.own_setting and s.price else 0.0
            for knob, s in zip(knobs, settings, strict=True)
        ]
        yield sum(adds), sum(s.error.worst for s in settings), settings


@pytest.mark.parametrize('seed', range(100))
def test_answer_is_the_cheapest_choice_meeting_the_need(seed):
    rng = random.Random(seed)
    budget = random_budget(rng)
    need = 10.0 ** rng.uniform(-8.0, 0.0)
    answer = answer_need(budget, need)
    good = [(cost, error) for cost, error, _ in choices_of(budget) if error <= need]
    assert answer.is_met is bool(good)
    if not good:
        assert answer.error == pytest.approx(min(error for _, error, _ in choices_of(budget)))
        assert 'prevents it' in answer.text
        return
    assert answer.error <= need * (1.0 + 1e-9)
    wanted = dict(answer.changes)
    costs = []
    for cost, error, settings in choices_of(budget):
        if wanted == dict(change for s in settings for change in s.changes):
            assert error == pytest.approx(answer.error)
            costs.append(cost)
    assert min(costs) == pytest.approx(min(good)[0], abs=1e-9)


@pytest.mark.parametrize('seed', range(20))
def test_answers_are_ordered_by_falling_error(seed):
    budget = random_budget(random.Random(seed))
    *met, unmet = answers_of(budget)
    assert met
    assert not unmet.is_met
    assert all(one.error > other.error for one, other in pairwise(met))
    assert len({tuple(answer.changes) for answer in met}) == len(met)
    for answer in met:
        assert answer_need(budget, answer.error)[1:3] == answer[1:3]


SWINGS = """
linkage: four_bar
rate: 500
drive: {torque: {start: 0.5, method: semi_implicit_euler, step: 0.002, timeout: 3600}}
loads: {gravity: [0, -9.81], drive_inertia: 0.001}
effects: {velocity: {}, friction: {joints: {O2: {viscous: 1.0e-4}}}}
"""

FOLLOWS = """
linkage: four_bar
rate: 100
drive: {sine: {mean: 1.2, amplitude: 0.9, frequency: 1.0}}
effects: {velocity: {}}
"""


def errors_of(scene):
    """Return the knobs of age and step, whose prices grow with the rate and the steps."""
    motions = motions_of(scene, None, HORIZON)
    knobs = [measure_age_in_use(scene, motions, HORIZON, quick=True)]
    if motions[0].path is None:
        knobs.append(measure_drive_step(motions[0], scene.rate, HORIZON, quick=True)[0])
    return [
        knob._replace(
            settings=[each._replace(price=price_of(scene, each)) for each in knob.settings]
        )
        for knob in knobs
    ]


def price_of(scene, setting):
    changes = dict(setting.changes or ())
    step = changes.get('drive.torque.step')
    dearer = 0.0 if step is None else 10.0 * (scene.linkages[0].drive[1].step / step - 1.0)
    return price(dearer, changes.get('rate', scene.rate))


@pytest.mark.sample(1)
@pytest.mark.parametrize('text', [SWINGS, FOLLOWS], ids=['torque', 'sine'])
def test_answered_need_is_met_by_a_run(tmp_path, text):
    """What was written for a need is measured anew, with its advice followed."""
    (tmp_path / 'scene.yaml').write_text(text)
    scene = load_scene(tmp_path / 'scene.yaml')
    budget = Budget('scene', scene.rate, price(50.0, scene.rate), errors_of(scene), [], [])
    texts = []
    for need in (0.1, 5e-3, 5e-4):
        answer = answer_need(budget, need)
        assert answer.is_met, answer.text
        texts.append(answer.text.partition(': ')[2])
        total = 0.0
        for knob in errors_of(change_scene(scene, answer.changes)):
            error = knob.own_setting.error.worst
            if CARRY in answer.text and knob.name == IN_USE:
                label = knob.own_setting.label.replace('held', 'carried forward')
                (error,) = (s.error.worst for s in knob.settings if s.label == label)
            total += error
        assert total <= 1.05 * need, answer.text
    assert len(set(texts)) > 1
