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
from linkage_ros.stages.drives import LARGEST
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


def test_a_linkage_in_millimetres_and_degrees_is_that_in_si_to_the_last_bit(write):
    assert load(write(IN_MM)).linkage == load(write(IN_SI, 'si.yaml')).linkage


@pytest.mark.parametrize('unit', LENGTHS)
@given(digits=st.integers(-(10**12), 10**12), places=st.integers(0, 9))
def test_a_length_is_the_nearest_double_to_the_decimal_in_the_file(unit, digits, places):
    exact = Fraction(digits, 10**places)
    metres = Units(unit).to_si(float(exact), 'm')
    assert metres == float(exact * Fraction(LENGTHS[unit]))


def test_right_angles_are_those_of_the_library():
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
def test_a_shorthand_has_units_too(write, kind):
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


def test_a_scene_has_its_own_units_and_other_quantities_stay_in_si(write):
    write(IN_SI, 'linkage.yaml')
    scene, in_si = load_scene(write(SCENE)), load_scene(write(SCENE_IN_SI, 'si.yaml'))
    assert scene.wrapped
    assert scene.linkages == in_si.linkages


def test_a_bag_holds_the_file_as_written_and_is_read_the_same(write):
    write(IN_MM, 'linkage.yaml')
    scene = load_scene(write(SCENE))
    assert parse_scene('file', 'bag', scene.files).linkages == scene.linkages


def test_a_scene_in_units_runs_as_that_in_si(write):
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


def test_a_driven_slide_is_given_as_a_length(write):
    write(SLIDE, 'linkage.yaml')
    drive = 'drive: {sine: {amplitude: 40, frequency: 1, mean: 500, phase: 90}}'
    scene = load_scene(write(f'linkage: linkage.yaml\nunits: mm\nangles: degrees\n{drive}'))
    (_, sine) = scene.linkages[0].drive
    assert (sine.amplitude, sine.mean, sine.phase) == (0.04, 0.5, 0.5 * pi)


MESSAGES = {
    'a length out of bounds': (
        'units: mm\nfour_bar: {a: -40, b: 120, c: 80, d: 100}',
        (
            'file.yaml:2: four_bar.a: -40 is out of bounds; '
            'write a finite number, more than 0 and at most 1e+12 [mm]'
        ),
    ),
    'a length that is missing': (
        'units: in\nfour_bar: {a: 1}',
        "file.yaml:2: four_bar: the key 'b' is missing; add b: a number in [in]",
    ),
    'a unit that is not one': (
        'units: ft\nfour_bar: {a: 1}',
        "file.yaml:1: units: 'ft' is not a choice; write m or cm or mm or in",
    ),
    'a limit that is never met': (
        IN_MM.replace('pose: {inputs: [30]}\n', '').replace('velocity: 180', 'limits: [0, 10]'),
        (
            "file.yaml:11: joints.rocker_joint.limits: [0, 10] deg of 'rocker_joint' are never "
            'met: it goes from 55.372 to 80.552 deg; widen them'
        ),
    ),
    'a limit that is none': (
        IN_MM.replace('limits: [0, 90]', 'limits: [.inf, 90]'),
        (
            "file.yaml:9: input.limits: [inf, 90] deg of 'crank_joint' are not valid limits; "
            'write [low, high]; -.inf or .inf for none on a side'
        ),
    ),
    'a pose beyond its limits': (
        IN_MM.replace('inputs: [30]', 'inputs: [135]'),
        (
            'file.yaml:11: pose.inputs: 135 deg is beyond the limits [0, 90] deg of '
            "'crank_joint'; start within the limits, or widen them"
        ),
    ),
}


@pytest.mark.parametrize('kind', MESSAGES)
def test_an_error_is_told_in_the_units_of_the_file(write, kind):
    text, line = MESSAGES[kind]
    with pytest.raises(FileError) as caught:
        load(write(text))
    assert str(caught.value).endswith(f'/{line}')


MOST = LARGEST * 180.0 / pi
SCENE_MESSAGES = {
    'a value beyond its bound': (
        'drive: {constant_rate: {rate: 1.0e+30}}',
        (
            'file.yaml:3: drive.constant_rate.rate: 1e+30 is out of bounds; write a finite '
            f'number, at least -{MOST:g} and at most {MOST:g} [deg/s]'
        ),
    ),
    'a row without its value': (
        'drive: {profile: {table: [[0, 1], [1]]}}',
        (
            'file.yaml:3: drive.profile.table: row 2, [1], is not [time [s], value [deg]]; '
            'write finite numbers'
        ),
    ),
    'a drive beyond limits': (
        'drive: {sine: {amplitude: 60, frequency: 1, mean: 45}}',
        (
            "file.yaml:3: drive.sine: takes 'crank_joint' from -15 deg to 105 deg, beyond its "
            'limits [0, 90] deg; stay within them, or widen them in the linkage file'
        ),
    ),
}


@pytest.mark.parametrize('kind', SCENE_MESSAGES)
def test_an_error_in_a_scene_is_told_in_its_units(write, kind):
    text, line = SCENE_MESSAGES[kind]
    write(IN_SI, 'linkage.yaml')
    with pytest.raises(FileError) as caught:
        Pipeline(load_scene(write(f'linkage: linkage.yaml\nangles: degrees\n{text}')))
    assert str(caught.value).endswith(f'/{line}')


def test_what_is_set_has_the_units_of_the_scene(write):
    write(IN_SI, 'linkage.yaml')
    settings = ['drive.sine.amplitude=30', 'effects.tolerance.given={crank.A: [0.2, 0]}']
    (scene_linkage,) = load_scene(write(SCENE), settings).linkages
    assert scene_linkage.drive[1].amplitude == 0.5235987755982989
    assert scene_linkage.effects['tolerance'].given == {'crank.A': (0.0002, 0.0)}
    in_metres = [*settings, 'units=m', 'loads.gravity=[0, -9.81]']
    (metres,) = load_scene(write(SCENE), in_metres).linkages
    assert metres.drive[1].amplitude == 0.5235987755982989
    assert metres.effects['tolerance'].given == {'crank.A': (0.2, 0.0)}


def test_an_error_in_what_is_set_is_told_in_the_units_of_the_scene(write):
    write(IN_SI, 'linkage.yaml')
    with pytest.raises(FileError) as caught:
        load_scene(write(SCENE), ['loads.gravity=[0, -1.0e+9]'])
    assert str(caught.value) == (
        '--set loads.gravity=[0, -1.0e+9]: loads.gravity: [0, -1000000000.0] is out of bounds; '
        'write numbers of at most 1e+06 [mm/s²]'
    )


def test_a_linkage_in_units_comes_back_from_its_urdf_in_si(write, tmp_path):
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


def test_a_design_in_millimetres_needs_one_line_more(write, tmp_path):
    pairs = ['--pair', '50', '100', '--pair', '80', '110', '--pair', '110', '125']
    files = {ground: tmp_path / f'{ground}.yaml' for ground in ('0.1', '100')}
    for ground, file in files.items():
        assert main(['synthesize', *pairs, '--ground', ground, '-o', str(file)]) == 0
    in_mm = write('units: mm\n' + files['100'].read_text(), 'in_mm.yaml')
    one, other = (load(file).position(1.0) for file in (files['0.1'], in_mm))
    assert other.joints == pytest.approx(one.joints, abs=1e-12)
    assert abs(other.points['B'] - one.points['B']) < 1e-12


IN_MM_AND_DEGREES = {
    'the start of a torque drive': (
        IN_MM,
        'drive: {torque: {start: 120}}',
        'drive.torque.start: 120 deg is not between the stops; reachable: 0 to 90 deg; start',
    ),
    'the start of a driven slide': (
        SLIDE_WITH_MASSES,
        'drive: {torque: {start: 600}}',
        'drive.torque.start: 600 mm is not between the stops; reachable: 450 to 550 mm; start',
    ),
    'a table over the position of a joint': (
        IN_MM,
        f'{TORQUE}loads: {{efforts: {{rocker_joint: {{over_position: [[90, 1], [45, 2]]}}}}}}',
        (
            'loads.efforts.rocker_joint.over_position: row 2 begins with 45 deg, '
            'not after 90 deg of row 1; write rows'
        ),
    ),
    'a table over the rate of a slide': (
        SLIDE_WITH_MASSES,
        f'{PUSHED}loads: {{efforts: {{push: {{over_rate: [[90, 1], [45, 2]]}}}}}}',
        (
            'loads.efforts.push.over_rate: row 2 begins with 45 mm/s, '
            'not after 90 mm/s of row 1; write rows'
        ),
    ),
    'a table over time': (
        IN_MM,
        f'{TORQUE}loads: {{efforts: {{rocker_joint: {{over_time: [[9, 1], [4, 2]]}}}}}}',
        'loads.efforts.rocker_joint.over_time: row 2 begins with 4 s, not after 9 s of row 1',
    ),
    'a force over the position of a driven slide': (
        SLIDE_WITH_MASSES,
        (
            f'{PUSHED}loads: {{forces: {{rod.P: {{direction: [1, 0], '
            'over_position: [[550, 1], [500, 2]]}}}'
        ),
        (
            'loads.forces.rod.P.over_position: row 2 begins with 500 mm, '
            'not after 550 mm of row 1; write rows'
        ),
    ),
    'a row beyond its bound': (
        IN_MM,
        f'{TORQUE}loads: {{efforts: {{rocker_joint: {{over_rate: [[0, 1], [1.0e+30, 2]]}}}}}}',
        (
            'loads.efforts.rocker_joint.over_rate: [1e+30, 2] is out of bounds; '
            'write numbers of at most 5.72958e+10 [deg/s]'
        ),
    ),
    'gravity beyond its bound': (
        IN_MM,
        f'{TORQUE}loads: {{gravity: [0, -1.0e+9]}}',
        (
            'loads.gravity: [0, -1000000000.0] is out of bounds; '
            'write numbers of at most 1e+06 [mm/s²]'
        ),
    ),
    'the length of a spring': (
        IN_MM,
        (
            f'{TORQUE}loads: {{springs: {{s: {{from: ground.O4, to: coupler.B, stiffness: 5, '
            'free_length: -10}}}'
        ),
        (
            'loads.springs.s.free_length: -10 is out of bounds; '
            'write a finite number, at least 0 and at most 1e+12 [mm]'
        ),
    ),
    'the range of a sensor': (
        IN_MM,
        'effects: {measuring_range: {joints: {rocker_joint: {low: 90, high: 45}}}}',
        'effects.measuring_range.joints.rocker_joint: low 90 deg is not below high 45 deg; write',
    ),
}


@pytest.mark.parametrize('kind', IN_MM_AND_DEGREES)
def test_an_error_in_a_scene_is_told_in_millimetres_and_degrees(write, kind):
    linkage, text, beginning = IN_MM_AND_DEGREES[kind]
    write(linkage, 'linkage.yaml')
    with pytest.raises(FileError) as caught:
        Pipeline(load_scene(write(f'linkage: linkage.yaml\nunits: mm\nangles: degrees\n{text}')))
    assert str(caught.value).partition('.yaml:')[2].partition(': ')[2].startswith(beginning)


FORCES = """
linkage: linkage.yaml
drive: {{torque: {{start: {start}}}}}
loads: {{forces: {{rod.P: {{direction: [1, 0], over_rate: [[0, 1], [{rate}, 2]]}}}}}}
effects:
  friction: {{joints: {{s: {{coulomb: 1, stribeck: {stribeck}}}, O: {{stribeck: {turn}}}}}}}
"""


def test_tables_over_an_input_and_rates_of_pins_have_the_unit_of_what_moves(write):
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
def test_angles_of_a_scene_name_how_they_are_published_and_their_unit(write, words):
    write(IN_SI, 'linkage.yaml')
    scene = load_scene(write(f'linkage: linkage.yaml\nangles: {words}'))
    assert (scene.wrapped, scene.linkages[0].content.units.angle) == WORDS[words]


def test_two_words_for_one_thing_are_refused(write):
    write(IN_SI, 'linkage.yaml')
    with pytest.raises(
        FileError, match=r"angles: \['wrapped', 'continuous'\] is not a choice; write cont"
    ):
        load_scene(write('linkage: linkage.yaml\nangles: [wrapped, continuous]'))
