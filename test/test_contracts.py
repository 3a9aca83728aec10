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

from importlib import import_module
import re

from linkage_ros.description import declared_fields
from linkage_ros.dynamics import JointFriction
from linkage_ros.errors import FileError
from linkage_ros.stages.drives import DRIVES
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

from .support.scenes import LINKAGES, pipeline_of, scene_of

READ = [
    ('tolerance', 'four_bar', '{}', ToleranceEffect()),
    (
        'tolerance',
        'four_bar',
        '{standard_deviation: 2.0e-5, links: [ground, coupler], given: {coupler.B: [0.0001, 0]}}',
        ToleranceEffect(2e-5, ('ground', 'coupler'), {'coupler.B': (1e-4, 0.0)}),
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

REFUSED_EFFECTS = {
    'tolerance': [
        ('{standard_deviation: -1}', 'standard_deviation: -1 is out of bounds; …at least 0'),
        ('{links: [couplr]}', "links: there is no body 'couplr'; did you mean 'coupler'?"),
        ('{given: {coupler.C: [0, 0]}}', "given.coupler.C: there is no point 'coupler.C'; did"),
        ('{given: {coupler.B: 0.1}}', 'given.coupler.B: 0.1 is not a point; write two finite'),
        ('{given: {coupler.B: [0, 2e9]}}', 'given.coupler.B: [0, 2000000000.0] is out of'),
        ('{sigma: 1}', 'sigma: unknown key; known: given, links, standard_deviation'),
    ],
    'backlash': [
        ('{}', "the key 'play' is missing; add play: a number in [rad or m]"),
        ('{play: -0.1}', 'play: -0.1 is out of bounds; …at least 0 and at most 6'),
        ('{play: 0.1, inputs: {x: 0.1}}', "inputs.x: there is no input 'x'; there"),
    ],
    'friction': [
        ('{}', "the key 'joints' is missing"),
        ('{joints: {O22: {}}}', "there is no pin 'O22'; did you mean 'O2'?"),
        ('{joints: {A: {viscous: -1}}}', 'joints.A.viscous: -1 is out of bounds; …at least 0'),
        ('{joints: {A: 0.1}}', 'joints.A: 0.1 is not a mapping'),
        ('{joints: {A: {coulmb: 1}}}', "joints.A.coulmb: unknown key; did you mean 'coulomb'?"),
    ],
    'compliance': [
        ('{}', "the key 'links' is missing"),
        ('{links: {coupler: 0}}', 'links.coupler: 0 is out of bounds; …more than 0'),
        ('{links: {ground: 1}}', "links.ground: there is no link 'ground'; there are: crank, "),
        ('{links: {copler: 1}}', "there is no link 'copler'; did you mean 'coupler'"),
    ],
    'clearance': [
        ('{}', "the key 'pins' is missing"),
        ('{pins: {A: -1}}', 'pins.A: -1 is out of bounds; …at least 0'),
        ('{pins: {G: 1}}', "pins.G: there is no pin 'G'; there are: "),
    ],
    'jitter': [
        ('{}', 'seconds'),
        ('{seconds: -1}', 'at least 0'),
        ('{seconds: 2}', 'at most 1'),
        ('{seconds: 0.1, distribution: normal}', 'uniform or half_normal'),
    ],
    'bias': [
        ('{}', 'joints'),
        ('{joints: {rocker: 0.1}}', "there is no joint 'rocker'; did you mean 'rocker_joint'"),
        ('{joints: {rocker_joint: .nan}}', 'finite'),
        ('{joints: {rocker_joint: 1.0e+7}}', 'at most 1e+06'),
        ('{joints: {rocker_joint: much}}', 'not a number'),
    ],
    'noise': [
        ('{}', 'joints'),
        ('{joints: {rocker_joint: {white: -1}}}', 'at least 0'),
        ('{joints: {rocker_joint: {walk: .inf}}}', 'finite'),
        ('{joints: {rocker_joint: {whte: 1}}}', 'whte: unknown key'),
        ('{joints: {crank: {white: 1}}}', "there is no joint 'crank'"),
        ('{joints: {rocker_joint: 0.1}}', 'joints.rocker_joint'),
    ],
    'measuring_range': [
        ('{}', 'joints'),
        ('{joints: {rocker: {low: 0}}}', "there is no joint 'rocker'"),
        ('{joints: {rocker_joint: {low: 2, high: 1}}}', 'low 2 rad is not below high 1 rad'),
        ('{joints: {rocker_joint: {rate: -1}}}', 'at least 0'),
    ],
    'encoder': [
        ('{}', 'joints'),
        ('{joints: {rocker_joint: {}}}', 'counts'),
        ('{joints: {rocker_joint: 4096}}', 'joints.rocker_joint'),
        ('{joints: {rocker_joint: {counts: 0}}}', 'at least 1'),
        ('{joints: {rocker_joint: {counts: 10.5}}}', '10.5 is not whole'),
        ('{joints: {rocker_joint: {counts: 8, offset: .nan}}}', 'finite'),
        ('{joints: {rocker_joint: {counts: 8, incremental: 1}}}', 'true or false'),
        ('{joints: {elbow_joint: {counts: 8}}}', "no joint 'elbow_joint'"),
        ('{joints: {rocker_joint: {counts: 8}}, rates: true}', 'differenced or exact'),
    ],
    'rate_limit': [
        ('{}', 'rate'),
        ('{rate: 0}', 'at least 0.001'),
        ('{rate: 30000}', 'at most 20000'),
        ('{rate: 10, hold: forget}', 'repeat or silent'),
        ('{rate: 10, joints: {rocker_joint: {}}}', "the key 'rate' is missing"),
        ('{rate: 10, joints: {rocker: {rate: 1}}}', "joint 'rocker'; did you mean 'rocker_joint'"),
        ('{rate: 10, joints: {}}', 'joints: names no joint; write {JOINT'),
        ('{rate: 10, rocker_joint: {rate: 1}}', 'write it under joints'),
        ('{rate: 10, joints: {rocker_joint: {rate: 1, hold: silent}}}', 'hold: unknown key'),
    ],
    'dropout': [
        ('{}', 'probability'),
        ('{probability: 1.1}', 'at most 1'),
        ('{probability: -0.1}', 'at least 0'),
        ('{probability: 0.1, burst: -1}', 'at least 0'),
        ('{probability: 0.1, hold: last}', 'silent or repeat'),
        ('{probability: 0.1, joints: {}}', 'joints: names no joint'),
        (
            '{probability: 0, joints: {rocker_joint: {probability: 0.75, burst: 2}}}',
            'joints.rocker_joint.burst: bursts of 2 …; write 3 or more',
        ),
        (
            '{probability: 0.75, burst: 2, joints: {rocker_joint: {probability: 0}}}',
            '.burst: bursts of 2',
        ),
    ],
    'delay': [
        ('{}', 'seconds'),
        ('{seconds: -0.001}', 'at least 0'),
        ('{seconds: 11}', 'at most 10'),
        ('{seconds: .inf}', 'finite'),
        ('{seconds: 1, between: extrapolated}', 'interpolated or sampled or automatic'),
        ('{seconds: 1, stamp: late}', 'arrival or measured'),
        ('{seconds: 1, second: 2}', 'unknown key'),
        ('{seconds: 1, joints: {}}', 'joints: names no joint'),
        ('{seconds: 1, joints: {rocker_joint: 2}}', 'joints.rocker_joint: 2 is not a mapping'),
        (
            '{seconds: 1, joints: {rocker_joint: {seconds: 1, reorder: true}}}',
            'joints.rocker_joint.reorder: nothing overtakes without a spread',
        ),
        (
            '{seconds: 1, stamp: measured, joints: {rocker_joint: {seconds: 2}}}',
            'stamp: measured is one time, …; write arrival',
        ),
    ],
}

CHIRP = 'amplitude: 1, start_frequency: 1'
REFUSED_DRIVES = {
    'constant_rate': [
        ('{}', "the key 'rate' is missing; add rate: a number in [rad/s or m/s]"),
        ('{rate: .inf}', 'rate: inf is out of bounds'),
        ('{rate: 2e10}', 'rate: 20000000000.0 is out of bounds'),
        ('{rate: 1, begin: 2}', 'begin: unknown key; known: inputs, rate, start'),
        (
            '{rate: 1, inputs: {crank: {rate: 2}}}',
            "there is no input 'crank'; did you mean 'crank_joint'?",
        ),
        ('{rate: 1, inputs: {crank_joint: {rate: 2}}}', 'inputs: names every input'),
    ],
    'profile': [
        ('{}', "the key 'table' is missing"),
        ('{table: [[0, 1], [1]]}', 'table: row 2, [1], is not [time [s], value [rad or m]]'),
        ('{table: [[0, 1], [1, .nan]]}', 'table: row 2, [1, nan], is not'),
        ('{table: [[0, 1], [0, 2]]}', 'table: row 2 is at 0.0 s, not after row 1'),
        ('{table: [[0, 1]]}', 'table: has one row'),
        (
            '{table: [[0, 1], [1, 2]], interpolation: quintic}',
            "interpolation: 'quintic' is not a choice; write linear or cubic or min",
        ),
    ],
    'sine': [
        ('{frequency: 1}', "the key 'amplitude' is missing"),
        (
            '{amplitude: -1, frequency: 1}',
            'amplitude: -1 is out of bounds; write a finite number, at least 0',
        ),
        (
            '{amplitude: 1, frequency: 0}',
            'frequency: 0 is out of bounds; write a finite number, more than 0',
        ),
        ('{amplitude: 1, frequency: 1, phase: 90}', 'phase: 90 is out of bounds'),
    ],
    'chirp': [
        ('{amplitude: 1}', "the key 'start_frequency' is missing"),
        (f'{{{CHIRP}, end_frequency: 0, seconds: 1}}', 'end_frequency: 0 is out of bounds'),
        (f'{{{CHIRP}, end_frequency: 2, seconds: 0}}', 'seconds: 0 is out of bounds'),
        (
            f'{{{CHIRP}, end_frequency: 2, seconds: 1, sweep: log}}',
            "sweep: 'log' is not a choice; write linear or logarithmic",
        ),
    ],
    'bag': [
        ('{}', "the key 'file' is missing"),
        ('{file: 3}', 'file: 3 is not a string'),
        ('{file: b, topc: x}', "topc: unknown key; did you mean 'topic'?"),
        ('{file: b, pace: slow}', "pace: 'slow' is not a choice; write recorded or fast"),
        ('{file: b, max_age: 0}', 'max_age: 0 is out of bounds'),
    ],
}

REFUSED_FAULTS = [
    ('mine', '{silense: {}}', "faults.mine.silense: unknown key; did you mean 'silence'?"),
    ('mine', '{}', 'faults.mine: names no kind of fault; write mine: {freeze: '),
    ('my own', '{silence: {}}', "faults.my own: 'my own' is not a ROS name; use letters"),
    ('1st', '{silence: {}}', "faults.1st: '1st' is not a ROS name; use letters"),
    (
        'mine',
        '{silence: {}, freeze: {}}',
        'faults.mine: names 2 kinds of fault; leave all but one of ',
    ),
    ('mine', '{stuck: {joint: rokker_joint}}', "faults.mine…did you mean 'rocker_joint'?"),
    ('mine', '{stuck: {}}', "faults.mine.stuck: the key 'joint' is missing"),
    ('mine', '{broken_link: {link: ground}}', "faults.mine…there is no link 'ground'"),
    ('mine', '{silence: {}, at: [-1], seconds: 1}', 'faults.mine…has a negative time'),
    ('mine', '{silence: {}, at: [1]}', "faults.mine…the key 'seconds' is missing"),
    ('mine', '{silence: {}, at: [1], seconds: 0}', 'faults.mine…out of bounds'),
    ('mine', '{time_jump: {by: 1e9}}', 'faults.mine…out of bounds'),
    (
        'mine',
        '{not_a_number: {}}',
        'faults: not_a_number corrupts messages, and constant_rate has none',
    ),
]

REFUSED = [
    *(
        (f'effects: {{{effect}: {text}}}', f'effects.{effect}…{said}')
        for effect, rows in REFUSED_EFFECTS.items()
        for text, said in rows
    ),
    *(
        (f'drive: {{{drive}: {text}}}', f'drive.{drive}…{said}')
        for drive, rows in REFUSED_DRIVES.items()
        for text, said in rows
    ),
    *(
        (f'drive: {{constant_rate: {{rate: 1.0}}}}\nfaults: {{{name}: {text}}}', said)
        for name, text, said in REFUSED_FAULTS
    ),
]


@pytest.mark.parametrize(('effect', 'linkage', 'text', 'parameters'), READ)
def test_an_effect_gets_what_the_scene_says_and_the_defaults(effect, linkage, text, parameters):
    scene = scene_of(
        f'effects: {{effort: {{}}, {effect}: {text}}}',
        (LINKAGES / f'{linkage}.yaml').read_bytes(),
    )
    assert scene.linkages[0].effects[effect] == parameters


@pytest.mark.parametrize(('text', 'said'), REFUSED)
def test_what_a_scene_cannot_say_is_refused_in_one_line(text, said):
    with pytest.raises(FileError) as caught:
        pipeline_of(text)
    assert re.search('.*'.join(map(re.escape, said.split('…'))), str(caught.value))
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('effect', [name for name in EFFECTS if name not in REFUSED_EFFECTS])
def test_an_effect_without_rows_needs_no_key(effect):
    scene = scene_of(f'effects: {{{effect}: {{}}}}', (LINKAGES / 'four_bar.yaml').read_bytes())
    assert effect in scene.linkages[0].effects


def test_each_drive_has_its_module_and_its_parameters():
    for name, module in DRIVES.items():
        assert module.rpartition('.')[2] == name
        assert declared_fields(import_module(module).PARAMETERS) is not None


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
def test_rates_and_accelerations_have_no_parameters(effect):
    assert declared_fields(effect_class(effect)) == []


def test_in_the_order_of_the_effects_each_stands_behind_what_it_needs():
    order = list(EFFECTS)
    assert order[:2] == ['tolerance', 'backlash'], 'before the crank moves anything'
    assert order.index('clearance') > order.index('compliance')
    for effect in order:
        assert all(order.index(need) < order.index(effect) for need in needed_effects(effect))
