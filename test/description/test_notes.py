# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Values that look like those of another unit get a note, and nothing is refused."""

from linkage_ros.cli.main import main
from linkage_ros.description import load_scene, scene_notes
import pytest

from .conftest import CONFIG
from ..support.scenes import LONG_COUPLER

FOUR_BAR = 'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n'
LIMITED = """links: {{ground: {{A: [0, 0], D: [0.1, 0]}}, a: {{A: [0, 0], B: [0.04, 0]}},
  b: {{B: [0, 0], C: [0.1, 0]}}, c: {{D: [0, 0], C: [0.09, 0]}}}}
input: {{joint: crank_joint, parent: ground, child: a, limits: {}}}
assembly: {{C: left}}
joints: {{rocker_joint: {{parent: ground, child: c}}}}
"""
SINE = 'drive: {sine: {amplitude: 45, frequency: 1}}\n'

# Linkage, rest of the scene, and the notes without the folder.
NOTES = {
    'degrees': (
        FOUR_BAR,
        SINE,
        [
            (
                'scene.yaml:2: drive.sine.amplitude: 45 rad is more than a turn; '
                'if it is in degrees, write angles: degrees'
            )
        ],
    ),
    'degrees that are named': (FOUR_BAR, f'{SINE}angles: degrees', []),
    'limits in degrees': (
        LIMITED.format('[10, 170]'),
        '',
        [
            (
                'linkage.yaml:3: input.limits: 170 rad is more than a turn; '
                'if it is in degrees, write angles: degrees'
            )
        ],
    ),
    'limits in degrees that are named': (
        LIMITED.format('[-500, 500]') + 'angles: degrees\n',
        '',
        [],
    ),
    'limits in radians': (
        LIMITED.format('[-3.2, 6.2]'),
        '',
        [],
    ),
    'lengths in millimetres': (
        'four_bar: {a: 40, b: 120, c: 80, d: 100}\n',
        'rate: 1000\n',
        [
            (
                'linkage.yaml: links.coupler: is 120 m long; '
                'if it is in millimetres, write units: mm; if in metres, units: m'
            )
        ],
    ),
    'lengths in millimetres that are named': (
        'units: mm\nfour_bar: {a: 40, b: 12000, c: 12000, d: 100}\n',
        'rate: 1000\n',
        [],
    ),
    'lengths in metres that are named': (
        'units: m\nfour_bar: {a: 40, b: 120, c: 80, d: 100}\n',
        'rate: 1000\n',
        [],
    ),
    'limits in radians where degrees are named': (
        LIMITED.format('[-1.57, 0.5]') + 'angles: degrees\n',
        '',
        [
            (
                'linkage.yaml:6: angles: no limit is wider than 1.57 deg; '
                'if limits are in radians, leave out angles: degrees'
            )
        ],
    ),
    'noise in degrees': (
        FOUR_BAR,
        'effects: {noise: {joints: {rocker_joint: {white: 4}, coupler_joint: {white: 5}}}}',
        [
            (
                'scene.yaml:2: effects.noise.joints.rocker_joint.white: 4 rad is more than half a '
                'turn; if it is in degrees, write angles: degrees'
            )
        ],
    ),
    'noise in degrees that are named': (
        FOUR_BAR,
        'angles: degrees\neffects: {noise: {joints: {rocker_joint: {white: 4}}}}',
        [],
    ),
    'noise of a slide': (
        (CONFIG / 'linkages' / 'slider_crank.yaml').read_text(),
        'effects: {noise: {joints: {piston_slide: {white: 4}}}}',
        [],
    ),
    'a slide of many metres': (
        (CONFIG / 'linkages' / 'scotch_yoke.yaml').read_text(),
        'drive: {sine: {amplitude: 0.5, frequency: 1}}',
        [],
    ),
    'gravity in metres': (
        FOUR_BAR,
        'units: mm\nloads: {gravity: [0, -9.81]}',
        [
            (
                'scene.yaml:3: loads.gravity: [0, -9.81] mm/s² is very small; '
                'write it in the unit of the file: 9.81 [m/s²] is 9810 [mm/s²]'
            )
        ],
    ),
}


def folder_with(tmp_path, linkage, scene):
    (tmp_path / 'linkage.yaml').write_text(linkage)
    (tmp_path / 'scene.yaml').write_text(f'linkage: linkage.yaml\n{scene}')
    return tmp_path


@pytest.mark.parametrize('kind', NOTES)
def test_suspicious_scene_values_get_notes(tmp_path, kind):
    linkage, scene, notes = NOTES[kind]
    file = folder_with(tmp_path, linkage, scene) / 'scene.yaml'
    assert [str(note) for note in scene_notes(load_scene(file))] == [
        f'{tmp_path}/{note}' for note in notes
    ]


def test_check_and_scene_note_a_suspicious_link_length(tmp_path, capsys):
    folder = folder_with(tmp_path, LONG_COUPLER, SINE.replace('45', '0.5'))
    for command, name in (('check', 'linkage'), ('scene', 'scene')):
        assert main([command, str(folder / f'{name}.yaml')]) == 0
        place = f'{folder}/linkage.yaml:5'
        assert capsys.readouterr().err == (
            f"linkage {command}: note: {place}: links.coupler: is 3000 times as long as 'crank'; "
            'write all lengths in metres, or all in millimetres with units: mm\n'
        )


def test_simulate_notes_suspicious_scene_values(tmp_path, capsys):
    scene = folder_with(tmp_path, FOUR_BAR, SINE) / 'scene.yaml'
    typed = ['simulate', str(scene), '--seconds', '0.01', '-o', str(tmp_path / 'x.csv')]
    note = 'drive.sine.amplitude: 45 rad is more than a turn'
    for more, count in (([], 1), (['--set', 'angles=degrees'], 0)):
        assert main([*typed, *more, '--force']) == 0
        assert capsys.readouterr().err.count(note) == count


@pytest.mark.parametrize('kind', ['linkages', 'scenes'])
def test_shipped_files_get_no_notes(kind):
    files = sorted((CONFIG / kind).glob('*.yaml'))
    assert files
    for file in files:
        assert not list(scene_notes(load_scene(file)))


SPATIAL = """
points: {{A: [{0}, 0, 0], B: [{1}, {2}, {3}]}}
links: {{crank: [A], rod: [A, B], rocker: [B]}}
hinges:
  crank_joint: {{parent: ground, child: crank, at: [0, 0, 0], axis: [0, 0, 1]}}
  rocker_joint: {{parent: ground, child: rocker, at: [{4}, {5}, {6}], axis: [0, 1, 0.3]}}
input: crank_joint
"""
FINGER = """
links: {ground: {A: [0, 0], D: [9, 0]}, a: {A: [0, 0], B: [4, 0]},
  b: {B: [0, 0], C: [9, 0]}, c: {D: [0, 0], C: [8, 0]}}
input: {joint: crank_joint, parent: ground, child: a}
assembly: {C: left}
joints: {rocker_joint: {parent: ground, child: c}}
masses: {b: {mass: 0.003, center: [4, 0], inertia: 0}}
"""


@pytest.mark.parametrize(
    ('text', 'note'),
    [
        (SPATIAL.format(40, 100, 20, 120, 150, 50, 30), 'links.ground: is 150 m long; '),
        (SPATIAL.format(0.04, 0.1, 0.02, 0.12, 0.15, 0.05, 0.03), ''),
        (FINGER, 'links.ground: is 9 m long; '),  # Nine metres of three grams
        (FINGER.replace('0.003', '3'), ''),
        (FINGER + 'units: mm', ''),
    ],
)
def test_check_notes_suspiciously_long_links(tmp_path, capsys, text, note):
    file = tmp_path / 'linkage.yaml'
    file.write_text(text)
    assert main(['check', str(file)]) == 0
    said = capsys.readouterr().err
    assert said.count('note: ') == bool(note)
    assert note in said


@pytest.mark.parametrize(('ground', 'count'), [('100', 1), ('0.1', 0), ('5', 0)])
def test_synthesize_notes_a_ground_in_millimetres(ground, count, capsys):
    pairs = ['--pair', '30', '60', '--pair', '60', '70', '--pair', '90', '85']
    assert main(['synthesize', *pairs, '--ground', ground]) == 0
    note = f'note: --ground: {ground} m is long; if it is in millimetres, divide by 1000\n'
    assert capsys.readouterr().err.count(note) == count
