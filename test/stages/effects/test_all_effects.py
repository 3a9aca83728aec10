# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What holds for every effect: its bytes, draws, silence and recovery, alone and beside others."""

from itertools import combinations
from math import cos, sin

from linkage_ros.kinematics import Status
from linkage_ros.messages import JointStateWriter
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects import (
    effect_class,
    EFFECTS,
    ForceEffect,
    MechanismEffect,
    SensorEffect,
)
import pytest

from .loaded import context, moved, SINGULAR
from .sensors import BEGIN, context as sensor_context, MS, reading
from ...support.scenes import linkage_of, LINKAGES, pipeline_of, scene_of, shipped

FOUR_BAR = (LINKAGES / 'four_bar.yaml').read_bytes()
MOVES = 'drive: {sine: {mean: 1.5, amplitude: 1.2, frequency: 3}}\npublish_input: true\n'
RANDOM = {'tolerance', 'jitter', 'noise', 'dropout'}
"""Effects whose sample draws random numbers."""
NEW_FIELDS = {
    'velocity': {'velocity'},
    'acceleration': {'acceleration'},
    'effort': {'efforts'},
    'pin_forces': {'reactions'},
    'compliance': {'deflection'},
    'clearance': {'deflection'},
}
READ_FIELDS = {
    'jitter': {'joints', 'rates', 'accelerations', 'efforts'},
    'bias': {'joints'},
    'noise': {'joints', 'rates'},
    'measuring_range': {'joints', 'rates', 'efforts'},
    'encoder': {'joints', 'rates'},
}
"""Fields of a state, or of a reading, that an effect changes; it passes all others on."""


def scene_text(*effects, seed=1):
    """Return a scene with the samples of effects; friction acts where there are forces."""
    types = {name: effect_class(name) for name in effects}
    if any(issubclass(each, ForceEffect) for each in types.values()):
        types['effort'] = effect_class('effort')
    forced = any(each.needs_forces for each in types.values())
    entries = ', '.join(f'{name}: {each.sample}' for name, each in types.items())
    loads = 'loads: {gravity: [0, -9.81]}\n' if forced else ''
    return f'{MOVES}seed: {seed}\n{loads}effects: {{{entries}}}\n'


def run(text, ticks=200, first=0):
    """Return what is published at ticks; the pipeline begins with the first of them."""
    pipeline = pipeline_of(text, FOUR_BAR)
    times = [BEGIN + index * MS for index in range(first, ticks)]
    return [(tick.message, *tick.extras) for tick in map(pipeline.tick, times)]


@pytest.mark.parametrize('effect', EFFECTS)
def test_seed_determines_the_bytes_of_every_effect(effect):
    found = run(scene_text(effect))
    assert run(scene_text(effect)) == found
    assert (run(scene_text(effect, seed=2)) == found) == (effect not in RANDOM)


@pytest.mark.parametrize('effect', sorted(RANDOM - {'tolerance'}))
def test_effects_draw_equally_often_for_any_reading(effect, monkeypatch):
    def states(rates):
        drawn = {}
        plain = Context.generator
        monkeypatch.setattr(
            Context,
            'generator',
            staticmethod(lambda seed, name: drawn.setdefault(name, plain(seed, name))),
        )
        given = scene_of(scene_text(effect), FOUR_BAR).linkages[0].effects[effect]
        sensor = given.sensor(sensor_context())
        for index in range(100):
            now = BEGIN + index * MS
            sensor(now, reading(now, 0.1, 0.2, rates=(1.0, 2.0) if rates(index) else ()))
        monkeypatch.undo()
        return {name: generator.getstate() for name, generator in drawn.items()}

    always = states(lambda _: True)
    assert always
    assert states(lambda index: index % 3) == always


@pytest.mark.parametrize('effect', EFFECTS)
def test_only_declared_effects_suppress_messages(effect):
    silent = [tick for tick, (message, *_) in enumerate(run(scene_text(effect))) if not message]
    assert not silent or effect_class(effect).suppresses_ticks
    pipeline = pipeline_of(scene_text(effect).replace(MOVES, 'publish_input: true\n'), FOUR_BAR)
    its = effect_class(effect)
    assert pipeline.suppresses_ticks == (its.suppresses_ticks or its.runs_in_gaps)


@pytest.mark.parametrize('effect', EFFECTS)
def test_recoverable_effects_converge_after_a_late_start(effect):
    text = scene_text(effect).replace(MOVES, 'publish_input: true\n')
    write = JointStateWriter(['crank_joint']).write

    def follow(first):
        pipeline, found = pipeline_of(text, FOUR_BAR), []
        for index in range(first, 1000):
            now, angle = BEGIN + index * MS, 1.5 + 1.2 * sin(0.02 * index)
            pipeline.offer(write(now, (angle,), (24.0 * cos(0.02 * index),)), now)
            tick = pipeline.tick(now)
            found.append((tick.message, *tick.extras))
        return found[-100:]

    given = scene_of(text, FOUR_BAR).linkages[0].effects[effect]
    # What a message drops at random may come to the same by chance.
    assert follow(0) == follow(333) or not given.is_recoverable


@pytest.mark.sample(50)
@pytest.mark.parametrize('effects', [*combinations(EFFECTS, 2)], ids='-'.join)
def test_effects_work_in_pairs(effects):
    assert any(message for message, *_ in run(scene_text(*effects), 5))


@pytest.mark.parametrize('effect', NEW_FIELDS)
def test_mechanism_effects_change_only_their_own_fields(effect):
    assert issubclass(effect_class(effect), MechanismEffect)
    within = context(shipped('four_bar'))
    needs = dict.fromkeys(effect_class(effect).needs, ())
    before = moved(within, (1.0, 2.0, 3.0), needs)._replace(deflection=(0.5, 0.5))
    given = scene_of(scene_text(effect), FOUR_BAR).linkages[0].effects[effect]
    found = given.stage(within)(before)
    changed = {name for name in found._fields if getattr(found, name) != getattr(before, name)}
    assert changed <= NEW_FIELDS[effect]
    # What links and pins yield adds up.
    alone = given.stage(within)(before._replace(deflection=()))
    total = [0.5 + part for part in alone.deflection] or [0.5, 0.5]
    assert found.deflection == pytest.approx(total, abs=1e-15)


@pytest.mark.parametrize('effect', READ_FIELDS)
def test_sensor_effects_change_only_their_own_fields(effect):
    assert issubclass(effect_class(effect), SensorEffect)
    given = scene_of(scene_text(effect), FOUR_BAR).linkages[0].effects[effect]
    sensor = given.sensor(sensor_context())
    rest = {'rates': (1.0, 2.0), 'accelerations': (3.0, 4.0), 'efforts': (5.0, 6.0)}
    for before in (reading(BEGIN + 5, 1.0, 2.0, **rest), reading(BEGIN + 5, 1.0, 2.0)):
        found = sensor(BEGIN, before)
        changed = {n for n in found._fields if getattr(found, n) != getattr(before, n)}
        assert changed <= READ_FIELDS[effect]
        assert all(len(getattr(found, n)) == len(getattr(before, n)) for n in rest)


def test_mechanism_effects_add_nothing_at_a_toggle():
    within = context(linkage_of(SINGULAR))
    yielding = {'clearance': ({'A': 1e-5},), 'compliance': ({'coupler': 1e4},)}
    motion = moved(within, (0.0, 1.0, 0.0), {'effort': (), 'pin_forces': (), **yielding})
    assert motion.position.status is Status.TOGGLE
    assert motion.position.joints
    assert motion.velocity is motion.acceleration is None
    assert motion.efforts == motion.reactions == motion.deflection == ()
    read = reading(7, *motion.position.joints)
    assert effect_class('pin_forces')().writer(within)(9, motion, read) == b''
