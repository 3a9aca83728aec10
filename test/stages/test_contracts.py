# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Parameters of each effect, drive and fault: how they are read from a scene, and refused.

A row is what stands behind the name in a scene file; in a message, … stands for any text.
"""

from linkage_ros.description import declared_fields, is_required
from linkage_ros.dynamics import JointFriction
from linkage_ros.stages.drives import Drive, drive_class, DRIVES
from linkage_ros.stages.effects import (
    BacklashEffect,
    BASES,
    BiasEffect,
    ClearanceEffect,
    ComplianceEffect,
    DelayEffect,
    DropoutEffect,
    effect_class,
    EFFECTS,
    EncoderEffect,
    FrictionEffect,
    JitterEffect,
    JointDelay,
    JointDropout,
    JointEncoder,
    JointNoise,
    JointRange,
    JointRateLimit,
    MeasuringRangeEffect,
    needed_effects,
    NoiseEffect,
    RateLimitEffect,
    ToleranceEffect,
)
from linkage_ros.stages.faults import FAULTS
import pytest

from ..support.scenes import LINKAGES, scene_of

READ = [
    ('tolerance', 'four_bar', '{}', ToleranceEffect()),
    (
        'tolerance',
        'four_bar',
        '{standard_deviation: 2.0e-5, links: [ground, coupler], given: {coupler.B: [0.0001, 0]}}',
        ToleranceEffect(2e-5, links=('ground', 'coupler'), given={'coupler.B': (1e-4, 0.0)}),
    ),
    (
        'backlash',
        'five_bar',
        '{play: 0.01, inputs: {right_crank_joint: 0.02}}',
        BacklashEffect(0.01, {'right_crank_joint': 0.02}),
    ),
    (
        'friction',
        'slider_crank',
        # B is a pin too: of the rod and the block that the slot in the cylinder stands for.
        '{joints: {A: {viscous: 0.002}, B: {coulomb: 0.1}, cylinder: {viscous: 3, coulomb: 4}}}',
        FrictionEffect(
            {
                'A': JointFriction(0.002),
                'B': JointFriction(0.0, 0.1),
                'cylinder': JointFriction(3.0, 4.0),
            }
        ),
    ),
    (
        'compliance',
        'four_bar',
        '{links: {coupler: 2.0e6}}',
        ComplianceEffect({'coupler': 2e6}),
    ),
    (
        'clearance',
        'slider_crank',
        '{pins: {A: 2.0e-5, B: 0}}',
        ClearanceEffect({'A': 2e-5, 'B': 0.0}),
    ),
    (
        'bias',
        'four_bar',
        '{joints: {rocker_joint: -1}}',
        BiasEffect({'rocker_joint': -1.0}),
    ),
    (
        'noise',
        'four_bar',
        '{joints: {rocker_joint: {white: 0.1}, coupler_joint: {walk: 2}}}',
        NoiseEffect(
            {'rocker_joint': JointNoise(0.1, 0.0, 0.0), 'coupler_joint': JointNoise(0.0, 2.0, 0.0)}
        ),
    ),
    (
        'measuring_range',
        'four_bar',
        '{joints: {rocker_joint: {low: -1, high: 2, rate: 3, effort: 4}}}',
        MeasuringRangeEffect({'rocker_joint': JointRange(-1.0, 2.0, 3.0, 4.0)}),
    ),
    (
        'encoder',
        'four_bar',
        '{joints: {rocker_joint: {counts: 4096}}}',
        EncoderEffect({'rocker_joint': JointEncoder(4096, 0.0, False, True)}, 'differenced'),
    ),
    ('jitter', 'four_bar', '{seconds: 0.002}', JitterEffect(0.002, 'uniform')),
    ('rate_limit', 'four_bar', '{rate: 100}', RateLimitEffect(100.0)),
    (
        'rate_limit',
        'four_bar',
        '{rate: 100, joints: {rocker_joint: {rate: 20, phase: 0.01}}}',
        RateLimitEffect(100.0, joints={'rocker_joint': JointRateLimit(20.0, 0.01)}),
    ),
    ('dropout', 'four_bar', '{probability: 0.1}', DropoutEffect(0.1)),
    (
        'dropout',
        'four_bar',
        '{probability: 0, joints: {rocker_joint: {probability: 0.1, burst: 5}}}',
        DropoutEffect(0.0, joints={'rocker_joint': JointDropout(0.1, 5.0)}),
    ),
    ('delay', 'four_bar', '{seconds: 0.002}', DelayEffect(0.002)),
    (
        'delay',
        'four_bar',
        '{seconds: 0.004, joints: {rocker_joint: {seconds: 0.02}}}',
        DelayEffect(0.004, joints={'rocker_joint': JointDelay(0.02)}),
    ),
]


@pytest.mark.parametrize(('effect', 'linkage', 'text', 'parameters'), READ)
def test_effect_parameters_equal_the_scene_and_the_defaults(effect, linkage, text, parameters):
    scene = scene_of(
        f'effects: {{effort: {{}}, {effect}: {text}}}',
        (LINKAGES / f'{linkage}.yaml').read_bytes(),
    )
    assert scene.linkages[0].effects[effect] == parameters


WITHOUT_KEYS = [
    name
    for name in EFFECTS
    if not any(is_required(entry) for entry, _ in declared_fields(effect_class(name)))
]


@pytest.mark.parametrize('effect', WITHOUT_KEYS)
def test_effect_with_defaults_needs_no_key(effect):
    scene = scene_of(f'effects: {{{effect}: {{}}}}', (LINKAGES / 'four_bar.yaml').read_bytes())
    assert effect in scene.linkages[0].effects


def test_each_drive_has_its_class():
    for name in DRIVES:
        drive = drive_class(name)
        assert issubclass(drive, Drive)
        assert drive.__name__ == f'{name.title().replace("_", "")}Drive'
        assert declared_fields(drive)


def test_each_effect_has_its_class_and_its_place():
    for name in EFFECTS:
        effect = effect_class(name)
        assert effect.__name__.lower() == name.replace('_', '') + 'effect'
        assert declared_fields(effect) is not None
        assert effect.place in {base.place for base in BASES if issubclass(effect, base)}


def test_each_fault_has_its_type_and_one_place():
    places = {'clock', 'message', 'mechanism', 'sensor'}
    for name, kind in FAULTS.items():
        assert kind.__name__.lower() == name.replace('_', '')
        assert declared_fields(kind) is not None
        assert len(places.intersection(vars(kind))) == 1


@pytest.mark.parametrize('effect', ['velocity', 'acceleration'])
def test_velocity_and_acceleration_effects_have_no_parameters(effect):
    assert declared_fields(effect_class(effect)) == []


def test_effects_are_ordered_after_those_they_need():
    order = list(EFFECTS)
    assert order[:2] == ['tolerance', 'backlash'], 'before the crank moves anything'
    assert order.index('clearance') > order.index('compliance')
    for effect in order:
        assert all(order.index(need) < order.index(effect) for need in needed_effects(effect))
