# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The usual tick, written as one function, does to the last bit what the plain steps do."""

from dataclasses import replace
from pathlib import Path
import re

from linkage_ros.description import linkage_text, parse_scene, parse_yaml, read_linkage
from linkage_ros.kinematics import assur_groups, GROUND, Mass
from linkage_ros.messages import JointStateWriter
from linkage_ros.tick import InterpretedTick, LinkagePipeline, Pipeline
import pytest

from ..support.messages import wrench_stamped
from ..support.scenes import pipeline_of

ROOT = Path(__file__).parents[2]
GALLERY = sorted((ROOT / 'config' / 'linkages').glob('*.yaml'))
BEGIN, MS = 1_700_000_000_000_000_000, 1_000_000
TICKS = 400
EFFECTS = {
    'positions': '{}',
    'rates': '{velocity: {}}',
    'accelerations': '{acceleration: {}}',
    'play': '{velocity: {}, backlash: {play: 0.01}}',
    'sensors': '{jitter: {seconds: 0.003}, dropout: {probability: 0.1}, delay: {seconds: 0.002}}',
}
DRIVES = {
    'carried': 'drive: {topic: {max_age: 0.01}}',
    'held': 'drive: {topic: {carry_forward: false}}',
    'turning': 'drive: {constant_rate: {rate: 40.0}}',
}
FORCES = ('{velocity: {}, effort: {}, backlash: {play: 0.01}}', '{pin_forces: {}}')


def pipeline(linkage, scene):
    return pipeline_of(scene, linkage)


def ticks(work):
    """Yield ticks of a crank that turns, and of one that falls silent for a while."""
    names = work.linkages[0].scene_linkage.input_names
    write = JointStateWriter(names).write
    for index in range(TICKS):
        now = BEGIN + index * MS
        if work.topic and index % 3 == 0 and not 200 < index < 230:
            angles = [0.04 * index + 0.3 * i for i in range(len(names))]
            message = write(now, angles, [40.0] * len(names), [0.01 * index] * len(names))
            assert work.offer(message, now) is None
        for topic in work.wrenches if index % 7 == 5 else ():
            assert topic.offer_wrench(wrench_stamped(index, 3 - index, 0.1 * index), now) is None
        yield work.tick(now)


def with_masses(file):
    """Return a linkage whose links all have masses, and its file."""
    linkage = read_linkage(parse_yaml(file.read_bytes(), file.name))
    masses = {
        link: Mass(0.1 * index, (0.01, 0.001 * index), 1.0e-5 * index)
        for index, link in enumerate(linkage.links)
        if link != GROUND
    }
    linkage = replace(linkage, masses=linkage.masses or masses)
    return linkage, linkage_text(linkage).encode()


def with_forces(linkage):
    """Yield scenes of a linkage with all that works with forces."""
    joints = assur_groups(linkage).joints
    pins = {joint.name for joint in joints if joint.kind == 'R'}
    held = {
        link: [joint for joint in joints if link in (joint.link, joint.to)]
        for link in [*linkage.links][1:]
    }
    bars = [
        link
        for link, ends in held.items()
        if len({joint.name for joint in ends}) == 2 and all(joint.kind == 'R' for joint in ends)
    ]
    (one, *_), (*_, other) = linkage.links['ground'], linkage.links[[*linkage.links][-1]]
    spring = f'{{from: ground.{one}, to: {[*linkage.links][-1]}.{other}, stiffness: 40.0}}'
    loads = f'loads: {{gravity: [0, -9.81], springs: {{x: {spring}}}, drive_inertia: 0.01}}'
    rubbing = sorted(pins ^ set(linkage.sliders))
    friction = f'{{{", ".join(f"{name}: {{viscous: 0.01, coulomb: 0.02}}" for name in rubbing)}}}'
    yields = f'clearance: {{pins: {{{min(pins)}: 1.0e-5}}}}'
    if bars:
        yields += f', compliance: {{links: {{{bars[0]}: 1.0e+6}}}}'
    for effects in (
        *FORCES,
        f'{{velocity: {{}}, pin_forces: {{}}, {yields}, delay: {{seconds: 0.002}}}}',
        f'{{acceleration: {{}}, effort: {{}}, friction: {{joints: {friction}}}, {yields}}}',
    ):
        yield f'publish_input: true\n{loads}\neffects: {effects}'


def check(linkage, scene, looked=1):
    """Hold the straight ticks of a scene against the plain ones; every so many in full."""
    straight, plain = pipeline(linkage, scene), pipeline(linkage, scene)
    plain.tick = InterpretedTick(plain.linkages).run
    for index, (one, other) in enumerate(zip(ticks(straight), ticks(plain), strict=True)):
        assert (one.message, one.extras) == (other.message, other.extras)
        if index % looked:
            continue
        for look, beside in zip(one.states, other.states, strict=True):
            assert (look.crank, look.reading) == (beside.crank, beside.reading)
            assert not beside.is_compiled
            if look.motion is not None:
                assert look.motion.efforts == beside.motion.efforts
                assert look.motion.given == beside.motion.given


@pytest.mark.sample(8)
@pytest.mark.parametrize('drive', DRIVES)
@pytest.mark.parametrize('effects', EFFECTS)
@pytest.mark.parametrize('file', GALLERY, ids=lambda file: file.stem)
def test_compiled_tick_publishes_the_bytes_of_plain_steps(file, effects, drive):
    text = file.read_bytes()
    if b'limits:' in text:  # else a motor that turns on would be refused
        text = re.sub(rb', limits: [^}]*', b'', text)
    check(text, f'{DRIVES[drive]}\neffects: {EFFECTS[effects]}')


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    'file',
    [file for file in GALLERY if file.stem != 'gripper'],  # forces are not known with ratios
    ids=lambda file: file.stem,
)
def test_compiled_tick_publishes_equal_pin_forces(file):
    linkage, text = with_masses(file)
    for scene in with_forces(linkage):
        check(text, f'{DRIVES["carried"]}\n{scene}', looked=20)


@pytest.mark.parametrize('name', ['four_bar', 'five_bar'])
def test_compiled_tick_carries_an_estimated_acceleration(name):
    file = ROOT / 'config' / 'linkages' / f'{name}.yaml'
    drive = 'rate: 100\ndrive: {topic: {acceleration: differenced, cutoff: 20}}'
    check(file.read_bytes(), f'{drive}\neffects: {{velocity: {{}}, acceleration: {{}}}}')


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('name', 'effects', 'loads'),
    [
        ('four_bar', 'effort: {measured: true, joints: [rocker_joint]}', ''),
        ('four_bar', 'effort: {measured: true}', ''),
        (
            'four_bar',
            'effort: {measured: true, joints: [coupler_joint]}, pin_forces: {}',
            'loads: {efforts: {rocker_joint: {over_time: [[0, 0], [1, 2]]}}}\n',
        ),
        ('five_bar', 'effort: {measured: true, joints: [left_elbow, right_elbow]}', ''),
        ('space/ankle_motors', 'effort: {measured: true, joints: [pitch, roll]}', ''),
    ],
)
def test_compiled_tick_carries_the_same_measured_efforts(name, effects, loads):
    linkage = (ROOT / 'config' / 'linkages' / f'{name}.yaml').read_bytes()
    linkage = re.sub(rb', limits: [^}]*', b'', linkage)
    check(linkage, f'{DRIVES["carried"]}\n{loads}effects: {{{effects}}}', looked=20)


@pytest.mark.parametrize('effects', FORCES)
def test_compiled_tick_bears_equal_loads_on_joints_and_points(effects):
    linkage = (ROOT / 'config' / 'linkages' / 'four_bar.yaml').read_bytes()
    friction = '{B: {coulomb: 0.1, breakaway: 0.2, stribeck: 1}}, holds: true'
    effects = f'{effects[:-1]}, friction: {{joints: {friction}}}}}'
    loads = """
publish_input: true
loads:
  joint_springs: {rocker_joint: {stiffness: 0.3, free: 1.5, damping: 0.01}}
  efforts:
    rocker_joint: {over_position: [[1, 0], [1.5, 0.2], [2, 0]], over_rate: [[-9, 1], [9, 2]]}
  forces: {coupler.P: {direction: [1, -1], frame: link, constant: 2}}
"""
    check(linkage, f'{DRIVES["carried"]}\n{loads}effects: {effects}')


CHANGING = {
    'over time': 'forces: {coupler.P: {direction: [1, -1], over_time: [[0, 0], [0.1, 9]]}}',
    'wrenches': 'wrenches: {coupler: {frame: link, point: P, max_age: 0.02}, rocker: {}}',
    'both': 'efforts: {rocker_joint: {over_time: [[0.05, 1], [0.2, -3]]}}, wrenches: {crank: {}}',
}


@pytest.mark.parametrize('loads', CHANGING)
@pytest.mark.parametrize('effects', FORCES)
def test_compiled_tick_bears_equal_changing_loads(effects, loads):
    linkage = (ROOT / 'config' / 'linkages' / 'four_bar.yaml').read_bytes()
    scene = f'{DRIVES["carried"]}\npublish_input: true\nloads: {{{CHANGING[loads]}}}\n'
    check(linkage, f'{scene}effects: {effects}')
    work = pipeline(linkage, f'{scene}effects: {effects}')
    plain = [not tick.states[0].is_compiled for tick in ticks(work)]
    # Beside the first one: a crank that is silent, and angles that pass half a turn.
    assert sum(plain) < 60


@pytest.mark.parametrize('drive', ['carried', 'torque'])
def test_compiled_tick_has_equal_friction_in_joints(drive):
    linkage = (ROOT / 'config' / 'linkages' / 'four_bar.yaml').read_bytes()
    driven = {**DRIVES, 'torque': 'drive: {torque: {start: 1.0, rate: 30}}'}[drive]
    friction = (
        '{joints: {A: {coefficient: 0.1, radius: 0.01}, O4: {coefficient: 0.2, radius: 0.02}}}'
    )
    effects = f'{{effort: {{}}, pin_forces: {{}}, friction: {friction}}}'
    loads = 'loads: {gravity: [0, -9.81], efforts: {rocker_joint: {over_time: [[0, 0], [1, 2]]}}}'
    check(linkage, f'{driven}\npublish_input: true\n{loads}\neffects: {effects}', looked=20)


def test_spring_of_zero_length_uses_the_plain_steps():
    linkage, _ = with_masses(ROOT / 'config' / 'linkages' / 'four_bar.yaml')
    # Where the crank is along the ground, as it is at the first tick.
    ground = {**linkage.links[GROUND], 'S': linkage.links['crank']['A']}
    linkage = replace(linkage, links={**linkage.links, GROUND: ground})
    spring = '{from: ground.S, to: crank.A, stiffness: 40.0, damping: 1.0}'
    scene = f'{DRIVES["carried"]}\nloads: {{springs: {{x: {spring}}}}}\npublish_input: true'
    for effects in FORCES:
        check(linkage_text(linkage).encode(), f'{scene}\neffects: {effects}')


@pytest.mark.parametrize('effects', [*EFFECTS.values(), *FORCES])
def test_usual_ticks_are_compiled(effects):
    work = pipeline(
        (ROOT / 'config' / 'linkages' / 'four_bar.yaml').read_bytes(),
        f'{DRIVES["turning"]}\neffects: {effects}',
    )
    plain = [index for index, tick in enumerate(ticks(work)) if not tick.states[0].is_compiled]
    # The first, and those at which an angle passes half a turn.
    assert plain[0] == 0
    assert len(plain) <= 1 + 2 * TICKS * 0.04 / 6.28


@pytest.mark.parametrize('effects', ['{}', '{effort: {}, clearance: {pins: {B: 1.0e-4}}}'])
def test_pipeline_reset_compiles_nothing(effects, monkeypatch):
    files = {
        'scene.yaml': f'linkage: l\n{DRIVES["turning"]}\neffects: {effects}'.encode(),
        'linkage.yaml': (ROOT / 'config' / 'linkages' / 'four_bar.yaml').read_bytes(),
    }
    scene = parse_scene('s', 's', files)
    first = Pipeline(scene)
    message = first.tick(BEGIN).message
    monkeypatch.setattr('linkage_ros.kinematics.compiling.linkage.trace_path', None)
    monkeypatch.setattr('linkage_ros.kinematics.compiling.linkage.python_body', None)
    monkeypatch.setattr('builtins.exec', None)
    assert Pipeline(scene, first.closures).tick(BEGIN).message == message


def test_pose_is_computed_only_for_a_due_marker_message(monkeypatch):
    file = ROOT / 'config' / 'linkages' / 'four_bar.yaml'
    solve, worked_out = LinkagePipeline.solve_mechanism, []

    def count(*state):
        worked_out.append(state)
        return solve(*state)

    monkeypatch.setattr(LinkagePipeline, 'solve_mechanism', count)
    work = pipeline(file.read_bytes(), f'{DRIVES["turning"]}\neffects: {{markers: {{rate: 50}}}}')
    drawn = sum(any(tick.extras) for tick in ticks(work))
    # The first tick is interpreted, which works it out anyway.
    assert drawn == len(worked_out) + 1 == TICKS * 50 // 1000
