# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Effects that a scene names by the module that holds them, outside of this package."""

from hashlib import sha256
from itertools import count
import json
from pathlib import Path
import subprocess
import sys

from linkage_ros.bag import BagWriter, RUN_FILE, Topic
from linkage_ros.description import load_scene, read_yaml, scene_schema
from linkage_ros.errors import FileError
from linkage_ros.messages import JointStateWriter, time_message
from linkage_ros.replay import scene_files, user_effects_here
from linkage_ros.stages.effects import EFFECTS
from linkage_ros.tick import Pipeline
import pytest

from ...support.commands import linkage

ROOT = Path(__file__).parents[3]
SECOND = 10**9
RATE = 3.0

HEAD = """
from dataclasses import dataclass

from linkage_ros.description import number
from linkage_ros.stages import effects


@dataclass(frozen=True, slots=True)
class Mine(effects.BASE):
    'What is mine.'

    by: float = number('how much', 1.0, unit='rad', least=-10.0, most=10.0)
"""
ADD = (
    HEAD.replace('BASE', 'SensorEffect')
    + """
    after = 'bias'

    def sensor(self, context):
        def mine(now, reading):
            return reading._replace(joints=tuple(joint + self.by for joint in reading.joints))

        return mine
"""
)
DOUBLE = ADD.replace('joint + self.by', 'joint * 2.0')
YIELD = (
    HEAD.replace('BASE', 'MechanismEffect')
    + """
    needs = ('pin_forces',)
    after = 'pin_forces'

    def stage(self, context):
        from linkage_ros.stages.effects.stage import with_deflection

        def mine(motion):
            force = motion.reactions[0].fx
            return with_deflection(motion, (self.by * force,) * len(context.joints))

        return mine
"""
)
LATE_CRANK = (
    HEAD.replace('BASE', 'DriveEffect')
    + """
    after = 'backlash'

    def drive_stage(self, context):
        def mine(crank):
            return crank._replace(angles=tuple(angle - self.by for angle in crank.angles))

        return mine
"""
)
LONGER = (
    HEAD.replace('BASE', 'LinkageEffect')
    + """
    after = 'tolerance'

    def alter(self, linkage, random):
        from dataclasses import replace

        crank = {**linkage.links['crank'], 'A': (0.04 + self.by, 0.0)}
        return replace(linkage, links={**linkage.links, 'crank': crank})
"""
)
TOPIC = "    topic, message = '~/mine', 'builtin_interfaces/msg/Time'\n"
TELL = (
    HEAD.replace('BASE', 'MessageEffect')
    + f"""
    after = 'delay'
{TOPIC}
    def writer(self, context):
        from linkage_ros.messages import time_message

        def mine(now, motion, reading):
            return time_message(reading.stamp)

        return mine
"""
)

_numbers = count()


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Return a function that writes modules into a package that nobody has imported before."""
    monkeypatch.syspath_prepend(tmp_path)

    def write(**modules):
        name = f'mine_{next(_numbers)}'
        (tmp_path / name).mkdir()
        for module, code in modules.items():
            (tmp_path / name / f'{module}.py').write_text(code)
        return name

    return write


def scene_file(folder, effects):
    linkage = ROOT / 'config' / 'linkages' / 'four_bar.yaml'
    (folder / 'linkage.yaml').write_text(linkage.read_text())
    file = folder / 'scene.yaml'
    lines = [
        'linkage: linkage.yaml',
        f'drive: {{constant_rate: {{rate: {RATE}}}}}',
        'effects:',
        *(f'  {line}' for line in effects or ['{}']),
    ]
    file.write_text('\n'.join(lines))
    return file


def joints(file, second=0):
    pipeline = Pipeline(load_scene(file))
    for now in range(second + 1):
        (look,) = pipeline.tick(now * SECOND).states
    return look.reading.joints


def refusal(file):
    with pytest.raises(FileError) as caught:
        Pipeline(load_scene(file))
    return str(caught.value)


def test_user_module_works_as_an_effect(tmp_path, package):
    ideal = joints(scene_file(tmp_path, ['velocity: {}']))
    mine = package(add=ADD)
    file = scene_file(tmp_path, [f'{mine}.add: {{by: 0.25}}'])
    assert joints(file) == tuple(joint + 0.25 for joint in ideal)


@pytest.mark.parametrize(
    ('behind', 'expected'),
    [
        # (x + 0.5 + 1)·2: the bias first; of two behind it the first of the alphabet.
        ({'a': ADD, 'b': DOUBLE}, lambda x: (x + 1.5) * 2.0),
        ({'c': ADD, 'b': DOUBLE}, lambda x: (x + 0.5) * 2.0 + 1.0),
        # It stands where its file says, whether a scene names what stands there or not.
        ({'a': ADD, 'b': DOUBLE.replace('bias', 'tolerance')}, lambda x: x * 2.0 + 1.5),
    ],
)
def test_user_effect_acts_behind_its_declared_effect(tmp_path, package, behind, expected):
    mine = package(**behind)
    ideal = joints(scene_file(tmp_path, ['velocity: {}']))
    own = [f'{mine}.{name}: {{}}' for name in behind]
    file = scene_file(tmp_path, ['bias: {joints: {rocker_joint: 0.5}}', *own])
    assert joints(file)[2] == pytest.approx(expected(ideal[2]), rel=1e-15)


def test_file_order_does_not_change_the_effect_order(tmp_path, package):
    mine = package(add=ADD, double=DOUBLE)
    lines = [f'{mine}.add: {{}}', f'{mine}.double: {{}}', 'velocity: {}']
    stages = [
        tuple(Pipeline(load_scene(scene_file(tmp_path, order))).linkages[0].wanted.effects)
        for order in (lines, lines[::-1])
    ]
    assert stages == [('velocity', f'{mine}.add', f'{mine}.double')] * 2


def test_user_effect_may_change_the_crank(tmp_path, package):
    mine = package(late=LATE_CRANK)
    file = scene_file(tmp_path, [f'{mine}.late: {{by: 0.5}}'])
    assert joints(file, 2)[0] == pytest.approx(2 * RATE - 0.5, rel=1e-15)


def test_user_effect_may_alter_the_linkage(tmp_path, package):
    mine = package(longer=LONGER)
    file = scene_file(tmp_path, [f'{mine}.longer: {{by: 0.02}}'])
    altered = Pipeline(load_scene(file)).closures[0].linkage
    assert altered.links['crank']['A'] == (0.06, 0.0)


def test_user_effect_inputs_are_computed_but_not_published(tmp_path, package):
    mine = package(soft=YIELD)
    rigid = joints(scene_file(tmp_path, ['velocity: {}']))
    pipeline = Pipeline(load_scene(scene_file(tmp_path, [f'{mine}.soft: {{}}'])))
    (linkage,) = pipeline.linkages
    assert tuple(linkage.wanted.effects) == (
        'velocity',
        'acceleration',
        'pin_forces',
        f'{mine}.soft',
    )
    (look,) = pipeline.tick(0).states
    assert look.reading.rates == ()
    assert pipeline.extras == []
    force = look.motion.reactions[0].fx
    assert force != 0.0
    assert look.reading.joints == pytest.approx([joint + force for joint in rigid], rel=1e-12)


def test_user_effect_may_publish_its_own_message(tmp_path, package):
    mine = package(tell=TELL)
    pipeline = Pipeline(load_scene(scene_file(tmp_path, [f'{mine}.tell: {{}}'])))
    assert [extra.topic for extra in pipeline.extras] == ['~/mine']
    assert pipeline.tick(3 * SECOND + 7).extras == (time_message(3 * SECOND + 7),)


REFUSED = {
    'syntax': ('def', 'cannot be imported: SyntaxError: '),
    'what it imports is not there': (
        'import no_such_thing_at_all',
        (
            'cannot be imported: ModuleNotFoundError: "No module named '
            '\'no_such_thing_at_all\'"; correct it; `python3 -c "import MINE.effect"` says where'
        ),
    ),
    'it ends the interpreter': ('raise SystemExit(3)', "cannot be imported: SystemExit: '3'"),
    'no effect': (HEAD.partition('@')[0], 'defines no effect; derive a class from one of Linkage'),
    'two effects': (
        ADD + ADD.replace('Mine', 'Other'),
        'defines the effects Mine and Other; leave one, and give each of the others a module',
    ),
    'no dataclass': (
        ADD.replace('@dataclass(frozen=True, slots=True)', ''),
        'Mine is not a dataclass of parameters; write @dataclass(frozen=True, slots=True) before',
    ),
    'parameters of another kind': (
        ADD.replace("number('how much', 1.0, unit='rad', least=-10.0, most=10.0)", '1.0'),
        'Mine is not a dataclass of parameters',
    ),
    'no method': (HEAD.replace('BASE', 'SensorEffect') + "    after = 'bias'\n",
                  'Mine does nothing; define sensor'),
    'no place in the tick': (
        HEAD.replace('BASE', 'Effect') + "    after = 'bias'\n",
        'Mine does nothing; derive it from one of LinkageEffect, DriveEffect, MechanismEffect',
    ),
    'a place that is none': (ADD.replace("'bias'", "'bais'"),
                             "after is 'bais': that is not an effect; did you mean 'bias'?"),
    'no place': (ADD.replace('after', 'behind'), 'does not say after which'),
    'behind the last': (ADD.replace("'bias'", "'delay'"),
                        "after is 'delay', and delay is the last sensor; set after = 'dropout'"),
    'before what it starts from': (
        YIELD.replace("after = 'pin_forces'", "after = 'velocity'"),
        "starts from pin_forces and acts before it; set after = 'pin_forces'",
    ),
    'a need that is none': (
        YIELD.replace("('pin_forces',)", "('noise',)"),
        "needs 'noise'; name some of velocity, acceleration, effort, pin_forces",
    ),
    'a message without a topic': (
        TELL.replace(TOPIC, ''),
        "Mine publishes a message without topic or type; write topic = '~/name' and message = 'pa",
    ),
    'a topic that is not its own': (
        TELL.replace('~/mine', '/joint_states'),
        "has the topic '/joint_states'; write one of the node's own: '~/name'",
    ),
}  # fmt: skip


@pytest.mark.parametrize('case', REFUSED)
def test_invalid_user_effect_is_refused_in_one_line(tmp_path, package, case):
    code, said = REFUSED[case]
    mine = package(effect=code)
    file = scene_file(tmp_path, ['velocity: {}', f'{mine}.effect: {{}}'])
    text = refusal(file)
    assert text.startswith(f'{file}:5: effects.{mine}.effect: {said.replace("MINE", mine)}')
    assert text.isprintable()
    assert '; ' in text


@pytest.mark.parametrize(('line', 'said'), [
    ('nobody_has_this.effect: {}',
     ('effects.nobody_has_this.effect: there is no module nobody_has_this; add its '
      'folder to PYTHONPATH, or source its workspace')),
    ('linkage_ros.no_effect: {}',
     'effects.linkage_ros.no_effect: there is no module linkage_ros.no_effect; add'),
    ('.effect: {}', 'effects..effect: is not a dotted module name; write package.module'),
    ('MINE.add: {buy: 1}', "effects.MINE.add.buy: unknown key; did you mean 'by'?"),
    ('MINE.add: {by: 11}', 'effects.MINE.add.by: 11 is out of bounds; write a finite number'),
    ('MINE.add: 3', 'effects.MINE.add: 3 is not a mapping; write MINE.add: {}'),
    ('biass: {}', "effects.biass: unknown key; did you mean 'bias'?"),
])  # fmt: skip
def test_wrong_user_effect_name_is_refused_in_one_line(tmp_path, package, line, said):
    mine = package(add=ADD)
    file = scene_file(tmp_path, ['velocity: {}', line.replace('MINE', mine)])
    assert refusal(file).startswith(f'{file}:5: {said.replace("MINE", mine)}')


def test_schema_accepts_user_effects_and_refuses_misspelt_keys(tmp_path, package):
    mine = package(add=ADD)
    file = scene_file(tmp_path, [f'{mine}.add: {{by: 0.25}}', 'biass: {}', f'{mine}.other: 3'])
    validator = pytest.importorskip('jsonschema').Draft202012Validator(scene_schema())
    wrong = validator.iter_errors(read_yaml(file)[0].mapping)
    assert {tuple(error.absolute_path) for error in wrong} == {
        ('effects',), ('effects', f'{mine}.other'),
    }  # fmt: skip


def test_scene_without_user_effects_imports_no_loader():
    code = (
        'import sys\nfrom linkage_ros.tick.pipeline import Pipeline\n'
        'from linkage_ros.description.scene_file import load_scene\n'
        "Pipeline(load_scene('config/scenes/worn_press.yaml'))\n"
        "assert 'linkage_ros.stages.effects.user_effects' not in sys.modules\n"
    )
    subprocess.run([sys.executable, '-c', code], cwd=ROOT, check=True)


@pytest.mark.parametrize(
    ('where', 'line', 'expected'),
    [
        ('', '', 'sha256 {}'),
        ('effect', '__version__ = "2.1"\n', '2.1, sha256 {}'),
        ('__init__', '__version__ = "3.2"\n', '3.2, sha256 {}'),
    ],
)
def test_run_records_the_hash_of_user_effects(tmp_path, package, where, line, expected):
    code = {'effect': ADD, '__init__': ''}
    mine = package(**{name: text + line * (name == where) for name, text in code.items()})
    file = scene_file(tmp_path, [f'{mine}.effect: {{}}', 'bias: {joints: {rocker_joint: 1}}'])
    digest = sha256((tmp_path / mine / 'effect.py').read_bytes()).hexdigest()[:16]
    assert user_effects_here(load_scene(file)) == {f'{mine}.effect': expected.format(digest)}
    assert user_effects_here(load_scene(scene_file(tmp_path, list(EFFECTS)[:0]))) == {}


def crank_bag(folder):
    """Record a crank that turns."""
    topic = Topic('/crank_states', 'sensor_msgs/msg/JointState', '', '')
    bag = BagWriter(folder, [topic], {})
    write = JointStateWriter(['crank_joint']).write
    for index in range(20):
        stamp = SECOND + index * 1_000_000
        bag.write(0, stamp, stamp, write(stamp, (0.1 * index,), (100.0,)))
    bag.close({})


def test_bag_with_a_user_effect_replays_with_its_module(tmp_path, package):
    mine, folder = package(add=ADD), tmp_path / 'elsewhere'
    folder.mkdir()
    scene_file(folder, []).write_text(f'linkage: linkage.yaml\neffects: {{{mine}.add: {{}}}}\n')
    crank_bag(folder / 'crank')
    typed = ('replay', 'crank', '--scene', 'scene.yaml', '-o', 'bag')
    assert linkage(folder, *typed, PYTHONPATH=str(tmp_path)).returncode == 0
    file = tmp_path / mine / 'add.py'
    then = sha256(file.read_bytes()).hexdigest()[:16]
    trusting = ('replay', 'bag', '--trust-effects')
    same = linkage(folder, *trusting, PYTHONPATH=str(tmp_path))
    assert same.returncode == 0
    assert f', {mine}.add (sha256 {then})\n' in same.stdout
    gone = linkage(folder, *trusting)
    assert gone.returncode == 2
    assert gone.stderr == (
        f'linkage: bag is trusted: imports {mine}.add, and the name leads to no module\n'
        f'linkage replay: bag: scene.yaml:2: effects.{mine}.add: there is no module {mine}; '
        'add its folder to PYTHONPATH, or source its workspace\n'
    )
    # Of another size too: what Python has compiled it takes again within the same second.
    file.write_text(file.read_text().replace('+ self', '- 1.0 * self'))
    now = sha256(file.read_bytes()).hexdigest()[:16]
    changed = linkage(folder, *trusting, '--json', PYTHONPATH=str(tmp_path))
    account = json.loads(changed.stdout)
    assert (changed.returncode, account['verdict']) == (3, 'different')
    versions = account['versions']
    assert versions['bag'][f'{mine}.add'] == f'sha256 {then}'
    assert versions['here'][f'{mine}.add'] == f'sha256 {now}'


def test_bag_records_the_hash_of_user_effects(tmp_path, package):
    mine = package(add=ADD)
    scene = load_scene(scene_file(tmp_path, [f'{mine}.add: {{}}']))
    files = scene_files(scene, [], 'with the run', tmp_path)
    assert json.loads(files[RUN_FILE])['effects'] == user_effects_here(scene)
