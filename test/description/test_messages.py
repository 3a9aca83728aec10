# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Errors that a newcomer meets: the whole line, with what to write instead."""

from linkage_ros.description import load, load_scene
from linkage_ros.errors import FileError
from linkage_ros.tick import Pipeline
import pytest

LINKAGE = """
links:
  ground:  {O2: [0, 0], O4: [0.100, 0], E: [0.150, 0]}
  crank:   {O2: [0, 0], A: [0.040, 0]}
  coupler: {A: [0, 0], B: [0.120, 0]}
  rocker:  {O4: [0, 0], B: [0.080, 0]}
  rod:     {B: [0, 0], D: [0.060, 0]}
  lever:   {E: [0, 0], D: [0.060, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: left, D: left}
joints: {rocker_joint: {parent: ground, child: rocker}}
"""

SLIDER = """
links:
  ground: {O: [0, 0]}
  crank:  {O: [0, 0], A: [0.1, 0]}
  rod:    {A: [0, 0], B: [0.3, 0]}
sliders: {piston: {point: B, along: ground, through: O, direction: [1, 0]}}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {piston: ahead}
joints: {stroke: {slider: piston}}
"""

# A file, the text to replace in it, and the line of the error after the name of the file.
LINKAGES = {
    'no input': (
        LINKAGE,
        ('input: {joint: crank_joint, parent: ground, child: crank}', ''),
        (
            ": the key 'input' is missing; "
            'add input: {joint: crank_joint, parent: ground, child: crank}'
        ),
    ),
    'a slider without a line': (
        SLIDER,
        ('along: ground, ', ''),
        (
            ":6: sliders.piston: the key 'along' is missing; "
            'add along: the link that carries the line'
        ),
    ),
    'a pin is left or right': (
        LINKAGE,
        ('{B: left', '{B: up'),
        ":10: assembly.B: 'up' is not a choice; write left or right",
    ),
    'a slider is ahead or behind': (
        SLIDER,
        ('ahead', 'up'),
        ":8: assembly.piston: 'up' is not a choice; write ahead or behind",
    ),
    'a decimal comma': (
        LINKAGE,
        ('A: [0.040, 0]', 'A: [0,040, 0]'),
        (
            ':4: links.crank.A: [0, 40, 0] is not a point; write two finite numbers: [x, y]; '
            'a decimal has a point, not a comma: [0.040, 0]'
        ),
    ),
    'three numbers': (
        LINKAGE,
        ('A: [0.040, 0]', 'A: [40, 0, 0]'),
        (
            ':4: links.crank.A: [40, 0, 0] is not a point; write two finite numbers: [x, y]; '
            'a planar linkage has no z'
        ),
    ),
    'a slip in the name of a pin': (
        LINKAGE,
        ('lever:   {E: [0, 0], D:', 'lever:   {E: [0, 0], C:'),
        (
            ':7: links.rod: is free: its pins and sliders do not hold it, 2 degree(s) of '
            'freedom too '
            'many; D (rod) and C (lever) each stand on one link only; the same pin? then '
            'give it one '
            'name'
        ),
    ),
    'a slip in the name of a pivot': (
        LINKAGE,
        ('O2: [0, 0], O4: [0.100, 0], E:', 'O2: [0, 0], O4: [0.100, 0], F:'),
        (
            ':8: links.lever: is free: its pins and sliders do not hold it, 2 degree(s) of '
            'freedom too '
            'many; F (ground) and E (lever) each stand on one link only; the same pin? then '
            'give it '
            'one name'
        ),
    ),
    'no sides': (
        LINKAGE,
        ('assembly: {B: left, D: left}', ''),
        (
            ": assembly: 'B', 'D' are missing; write B: left or right (the side of A→O4), "
            'D: left or right (the side of B→E); linkage draw FILE --assemblies draws the choices'
        ),
    ),
}


@pytest.mark.parametrize('kind', LINKAGES)
def test_linkage_error_names_the_remedy(tmp_path, kind):
    text, (right, wrong), line = LINKAGES[kind]
    file = tmp_path / 'linkage.yaml'
    file.write_text(text)
    load(file)
    file.write_text(text.replace(right, wrong))
    with pytest.raises(FileError) as caught:
        load(file)
    assert str(caught.value) == f'{file}{line.replace("FILE", str(file))}'


KINDS = 'time_jump, not_a_number, broken_link, stuck, freeze, silence'

# A scene's second line, and the line of the error after the name of the file.
SCENES = {
    'a fault without a kind': (
        'faults: {stuck: {joint: rocker_joint}}',
        (
            ':2: faults.stuck: names no kind of fault; '
            f'write stuck: {{stuck: {{joint: …}}, at: [1], seconds: 2}}; kinds: {KINDS}'
        ),
    ),
    'a fault with two kinds': (
        'faults: {slip: {freeze: {}, silence: {}}}',
        ':2: faults.slip: names 2 kinds of fault; leave all but one of freeze, silence out',
    ),
    'counts beside the joints': (
        'effects: {encoder: {counts: 4096}}',
        (
            ':2: effects.encoder.counts: is for each published joint; '
            'write it under joints, as joints: {rocker_joint: {counts: …}}'
        ),
    ),
    'a joint beside the joints': (
        'effects: {bias: {rocker_joint: 0.1}}',
        (
            ':2: effects.bias.rocker_joint: is for each published joint; '
            'write it under joints, as joints: {rocker_joint: …}'
        ),
    ),
    'a rate in words': (
        'rate: fast',
        ":2: rate: 'fast' is not a number; write a number in [Hz]",
    ),
}


def scene_of(tmp_path, text):
    (tmp_path / 'linkage.yaml').write_text(LINKAGE)
    file = tmp_path / 'scene.yaml'
    file.write_text(f'linkage: linkage.yaml\n{text}')
    return file


@pytest.mark.parametrize('kind', SCENES)
def test_scene_error_names_the_remedy(tmp_path, kind):
    text, line = SCENES[kind]
    file = scene_of(tmp_path, text)
    with pytest.raises(FileError) as caught:
        Pipeline(load_scene(file))
    assert str(caught.value) == f'{file}{line}'


# All errors at once, by line; the reader goes on after the first.
SEVERAL = {
    'the whole scene': (
        """\
rate: fast
drive: {topic: {max_age: 0, latest: true}}
effects: {delay: 3, velocty: {}}
record: {split_byts: 2}
x: 1
""",
        [
            ':2: rate: ',
            ':3: drive.topic.latest: unknown key',
            ':3: drive.topic.max_age: 0 is out of bounds',
            ':4: effects.delay: 3 is not a mapping; write delay: {seconds: 1}',
            ":4: effects.velocty: unknown key; did you mean 'velocity'?",
            ":5: record.split_byts: unknown key; did you mean 'split_bytes'?",
            ':6: x: unknown key',
        ],
    ),
    'values by name': (
        'loads: {forces: {coupler.B: {constant: few}, rocker.B: {direction: [1, 0], at: 2}}}',
        [
            ":2: loads.forces.coupler.B.constant: 'few' is not a number",
            ":2: loads.forces.coupler.B: the key 'direction' is missing; add direction: ",
            ':2: loads.forces.rocker.B.at: unknown key',
        ],
    ),
    'a missing key, and what was written instead': (
        'effects: {delay: {second: 1}}',
        [
            ":2: effects.delay.second: unknown key; did you mean 'seconds'?",
            ":2: effects.delay: the key 'seconds' is missing; add seconds: ",
        ],
    ),
}


@pytest.mark.parametrize('kind', SEVERAL)
def test_all_errors_of_a_scene_are_listed(tmp_path, kind):
    text, expected = SEVERAL[kind]
    file = scene_of(tmp_path, text)
    with pytest.raises(FileError) as caught:
        load_scene(file)
    lines = sorted(str(error).removeprefix(str(file)) for error in caught.value.in_file)
    assert len(lines) == len(expected)
    assert all(map(str.startswith, lines, expected)), lines


def test_all_errors_of_a_linkage_are_listed(tmp_path):
    file = tmp_path / 'wrong.yaml'
    text = LINKAGE.replace('assembly: {B: left,', 'mases: {}\nassembly: {B: lef,')
    file.write_text(text.replace('rocker_joint: {parent:', 'rocker_joint: {parnt:'))
    with pytest.raises(FileError) as caught:
        load(file)
    assert {error.key for error in caught.value.in_file} == {
        'assembly.B', 'mases', 'joints.rocker_joint', 'joints.rocker_joint.parnt',
    }  # fmt: skip
