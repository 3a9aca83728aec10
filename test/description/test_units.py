# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A file names the units of its lengths and angles; they are converted once, exactly."""

from fractions import Fraction
from math import pi

from hypothesis import given, strategies as st
from linkage_ros.cli.main import main
from linkage_ros.description import LENGTHS, load, load_scene, parse_scene, Units
from linkage_ros.errors import FileError
from linkage_ros.tick import Pipeline
import pytest

IN_SI = """
links:
  ground:  {O2: [0, 0], O4: [0.1007, 0]}
  crank:   {O2: [0, 0], A: [0.040, 0]}
  coupler: {A: [0, 0], B: [0.1203, 0], P: [0.06, 0.0301]}
  rocker:  {O4: [0, 0], B: [0.08, 0]}
input: {joint: crank_joint, parent: ground, child: crank, limits: [0, 1.5707963267948966]}
assembly: {B: left}
pose: {inputs: [0.5235987755982989]}
joints: {rocker_joint: {parent: ground, child: rocker, velocity: 3.141592653589793}}
masses:
  crank:   {mass: 1, center: [0.01, 0], inertia: 0.1}
  coupler: {mass: 1, center: [0.01, 0], inertia: 0.1}
  rocker:  {mass: 1, center: [0.01, 0], inertia: 0.1}
"""

IN_MM = """
units: mm
angles: degrees
links:
  ground:  {O2: [0, 0], O4: [100.7, 0]}
  crank:   {O2: [0, 0], A: [40, 0]}
  coupler: {A: [0, 0], B: [120.3, 0], P: [60, 30.1]}
  rocker:  {O4: [0, 0], B: [80, 0]}
input: {joint: crank_joint, parent: ground, child: crank, limits: [0, 90]}
assembly: {B: left}
pose: {inputs: [30]}
joints: {rocker_joint: {parent: ground, child: rocker, velocity: 180}}
masses:
  crank:   {mass: 1, center: [10, 0], inertia: 0.1}
  coupler: {mass: 1, center: [10, 0], inertia: 0.1}
  rocker:  {mass: 1, center: [10, 0], inertia: 0.1}
"""


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a file and returns its path."""

    def write(text, name='file.yaml'):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def test_linkage_in_millimetres_equals_the_si_one(write):
    assert load(write(IN_MM)).linkage == load(write(IN_SI, 'si.yaml')).linkage


@pytest.mark.parametrize('unit', LENGTHS)
@given(digits=st.integers(-(10**12), 10**12), places=st.integers(0, 9))
def test_converted_length_is_the_nearest_double(unit, digits, places):
    exact = Fraction(digits, 10**places)
    metres = Units(unit).to_si(float(exact), 'm')
    assert metres == float(exact * Fraction(LENGTHS[unit]))


def test_right_angles_convert_exactly():
    turns = {90: 0.5 * pi, 180: pi, 360: 2.0 * pi, -180: -pi}
    read = Units(angle='degrees').to_si
    assert {degrees: read(degrees, 'rad') for degrees in turns} == turns


SHORTHANDS = {
    'four-bar': (
        (
            'units: cm\nangles: degrees\nfour_bar: {a: 4, b: 12, c: 8, d: 10, '
            'input: {limits: [0, 90]}}'
        ),
        'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1, input: {limits: [0, 1.5707963267948966]}}',
    ),
    'a slide is a length': (
        (
            'units: mm\nangles: degrees\ninverted_slider_crank: '
            '{a: 100, swivel: [250, 0], joints: {rod_slide: {velocity: 500}}}'
        ),
        'inverted_slider_crank: {a: 0.1, swivel: [0.25, 0], joints: {rod_slide: {velocity: 0.5}}}',
    ),
    'inches': (
        'units: in\nfour_bar: {a: 1, b: 3, c: 2, d: 2.5}',
        'four_bar: {a: 0.0254, b: 0.0762, c: 0.0508, d: 0.0635}',
    ),
}


@pytest.mark.parametrize('kind', SHORTHANDS)
def test_shorthand_linkages_accept_units(write, kind):
    with_units, in_si = (load(write(text)).linkage for text in SHORTHANDS[kind])
    assert with_units == in_si


SCENE = """
linkage: linkage.yaml
units: mm
angles: [wrapped, degrees]
rate: 100
drive: {sine: {amplitude: 45, frequency: 1, mean: 45, phase: 90}}
effects:
  velocity: {}
  bias: {joints: {rocker_joint: 0.5}}
  tolerance: {standard_deviation: 0.02, given: {crank.A: [0.1, 0]}}
  friction: {joints: {O2: {viscous: 0.1}}}
  pin_forces: {}
loads: {gravity: [0, -9810], springs: {s: {from: ground.O4, to: coupler.B, stiffness: 5}}}
"""

SCENE_IN_SI = """
linkage: linkage.yaml
angles: wrapped
rate: 100
drive:
  sine: {amplitude: 0.7853981633974483, frequency: 1, mean: 0.7853981633974483,
         phase: 1.5707963267948966}
effects:
  velocity: {}
  bias: {joints: {rocker_joint: 0.008726646259971648}}
  tolerance: {standard_deviation: 0.00002, given: {crank.A: [0.0001, 0]}}
  friction: {joints: {O2: {viscous: 0.1}}}
  pin_forces: {}
loads: {gravity: [0, -9.81], springs: {s: {from: ground.O4, to: coupler.B, stiffness: 5}}}
"""


def test_scene_units_convert_only_lengths_and_angles(write):
    write(IN_SI, 'linkage.yaml')
    scene, in_si = load_scene(write(SCENE)), load_scene(write(SCENE_IN_SI, 'si.yaml'))
    assert scene.wrapped
    assert scene.linkages == in_si.linkages


def test_scene_in_units_is_rebuilt_from_its_files(write):
    write(IN_MM, 'linkage.yaml')
    scene = load_scene(write(SCENE))
    assert parse_scene('file', 'bag', scene.files).linkages == scene.linkages


def test_scene_in_units_runs_as_in_si(write):
    write(IN_MM, 'linkage.yaml')
    seconds = [0, 10**7, 2 * 10**7]
    runs = []
    for text in (SCENE, SCENE_IN_SI):
        scene = load_scene(write(f'{text}seed: 1\n'))
        pipeline = Pipeline(scene)
        runs.append([pipeline.tick(10**9 + at).message for at in seconds])
    assert runs[0] == runs[1]
    assert all(runs[0])


SLIDE = """
units: mm
angles: degrees
links:
  ground: {O: [0, 0], C: [0, 300]}
  crank: {O: [0, 0], P: [100, 0]}
  rod: {P: [0, 0], Q: [500, 0]}
sliders: {s: {point: Q, along: ground, through: O, direction: [1, 0]}}
input: {joint: push, slider: s, limits: [450, 550]}
assembly: {P: left}
joints: {crank_joint: {parent: ground, child: crank}}
"""


SLIDE_WITH_MASSES = f"""{SLIDE}
masses:
  crank: {{mass: 1, center: [10, 0], inertia: 0.1}}
  rod: {{mass: 1, center: [10, 0], inertia: 0.1}}
"""
TORQUE = 'drive: {torque: {start: 30}}\n'
PUSHED = 'drive: {torque: {start: 500}}\n'


def test_slide_drive_parameters_are_lengths(write):
    write(SLIDE, 'linkage.yaml')
    drive = 'drive: {sine: {amplitude: 40, frequency: 1, mean: 500, phase: 90}}'
    scene = load_scene(write(f'linkage: linkage.yaml\nunits: mm\nangles: degrees\n{drive}'))
    (_, sine) = scene.linkages[0].drive
    assert (sine.amplitude, sine.mean, sine.phase) == (0.04, 0.5, 0.5 * pi)


def test_set_option_uses_the_units_of_the_scene(write):
    write(IN_SI, 'linkage.yaml')
    settings = ['drive.sine.amplitude=30', 'effects.tolerance.given={crank.A: [0.2, 0]}']
    (scene_linkage,) = load_scene(write(SCENE), settings).linkages
    assert scene_linkage.drive[1].amplitude == 0.5235987755982989
    assert scene_linkage.effects['tolerance'].given == {'crank.A': (0.0002, 0.0)}
    in_metres = [*settings, 'units=m', 'loads.gravity=[0, -9.81]']
    (metres,) = load_scene(write(SCENE), in_metres).linkages
    assert metres.drive[1].amplitude == 0.5235987755982989
    assert metres.effects['tolerance'].given == {'crank.A': (0.2, 0.0)}


def test_set_option_error_uses_the_scene_units(write):
    write(IN_SI, 'linkage.yaml')
    with pytest.raises(FileError) as caught:
        load_scene(write(SCENE), ['loads.gravity=[0, -1.0e+9]'])
    assert str(caught.value) == (
        '--set loads.gravity=[0, -1.0e+9]: loads.gravity: [0, -1000000000.0] is out of bounds; '
        'write numbers of at most 1e+06 [mm/s²]'
    )


def test_urdf_round_trip_returns_si_units(write, tmp_path):
    tree = IN_MM.replace('joints: {', 'joints: {coupler_joint: {parent: crank, child: coupler}, ')
    linkage, urdf, back = write(tree), tmp_path / 'x.urdf', tmp_path / 'back.yaml'
    assert main(['urdf', str(linkage), '-o', str(urdf)]) == 0
    assert main(['import', str(urdf), '-o', str(back)]) == 0
    assert 'units' not in back.read_text()
    there, here = load(linkage).linkage, load(back).linkage
    assert here.inputs[0].limits == there.inputs[0].limits
    assert here.joints['rocker_joint'].limits.velocity == pi
    closures = load(linkage), load(back)
    one, other = (closure.position(0.5) for closure in closures)
    assert other.joints == pytest.approx(one.joints, abs=1e-12)
    assert other.gap == one.gap == 0.0


def test_synthesized_design_in_millimetres_needs_a_units_line(write, tmp_path):
    pairs = ['--pair', '50', '100', '--pair', '80', '110', '--pair', '110', '125']
    files = {ground: tmp_path / f'{ground}.yaml' for ground in ('0.1', '100')}
    for ground, file in files.items():
        assert main(['synthesize', *pairs, '--ground', ground, '-o', str(file)]) == 0
    in_mm = write('units: mm\n' + files['100'].read_text(), 'in_mm.yaml')
    one, other = (load(file).position(1.0) for file in (files['0.1'], in_mm))
    assert other.joints == pytest.approx(one.joints, abs=1e-12)
    assert abs(other.points['B'] - one.points['B']) < 1e-12


FORCES = """
linkage: linkage.yaml
drive: {{torque: {{start: {start}}}}}
loads: {{forces: {{rod.P: {{direction: [1, 0], over_rate: [[0, 1], [{rate}, 2]]}}}}}}
effects:
  friction: {{joints: {{s: {{coulomb: 1, stribeck: {stribeck}}}, O: {{stribeck: {turn}}}}}}}
"""


def test_force_tables_use_the_unit_of_their_joint(write):
    write(SLIDE_WITH_MASSES, 'linkage.yaml')
    in_si = load_scene(
        write(FORCES.format(start=0.5, rate=0.045, stribeck=0.005, turn=0.5 * pi), 'si.yaml')
    )
    in_mm = FORCES.format(start=500, rate=45, stribeck=5, turn=90)
    assert load_scene(write(f'{in_mm}units: mm\nangles: degrees\n')).linkages == in_si.linkages


WORDS = {
    'wrapped': (True, 'radians'),
    'degrees': (False, 'degrees'),
    '[degrees, wrapped]': (True, 'degrees'),
    '[continuous, radians]': (False, 'radians'),
}


@pytest.mark.parametrize('words', WORDS)
def test_angles_key_sets_publishing_and_unit(write, words):
    write(IN_SI, 'linkage.yaml')
    scene = load_scene(write(f'linkage: linkage.yaml\nangles: {words}'))
    assert (scene.wrapped, scene.linkages[0].content.units.angle) == WORDS[words]
