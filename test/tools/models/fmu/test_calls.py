# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Calls to an FMU in every state, and in any order: each is answered, and no importer dies."""

from collections.abc import Callable, Iterator
import json
from pathlib import Path
import subprocess
import sys
from typing import Any

from fmpy import extract, read_model_description
from hypothesis import given, settings, strategies as st
from linkage_ros.description import load_scene
from linkage_ros.tools.models.fmu import scene_fmu
import pytest

Call = Callable[[list[str]], list[tuple[int, list[Any]]]]

STATES = ('instantiated', 'initializing', 'initialized', 'terminated', 'failed')

# What FMI 3 makes of a call in each state: '' where it is refused, else the state that follows.
TABLE = {
    'enter': ('initializing', '', '', '', ''),
    'exit': ('', 'initialized', '', '', ''),
    'step': ('', '', 'initialized', '', ''),
    'half a tick': ('', '', 'initialized', '', ''),
    'terminate': ('terminated', 'terminated', 'terminated', 'terminated', 'terminated'),
    'reset': ('instantiated',) * 5,
    'get output': STATES,
    'set input': ('instantiated', 'initializing', 'initialized', '', ''),
    'set seed': ('instantiated', 'initializing', '', '', ''),
    'set output': ('',) * 5,
    'set time': ('',) * 5,
    'set two of one': ('',) * 5,
    'get unknown': ('',) * 5,
    'get one of them unknown': ('',) * 5,
    'get a number as a flag': ('',) * 5,
    'get a number as a text': ('',) * 5,
    'get a number as an integer': ('',) * 5,
    'set unknown': ('',) * 5,
    'set an input as a flag': ('',) * 5,
    'set a text': ('',) * 5,
    'save': ('',) * 5,
    'event': ('',) * 5,
}
REACHED = {
    'instantiated': (),
    'initializing': ('enter',),
    'initialized': ('enter', 'exit', 'step'),
    'terminated': ('enter', 'exit', 'step', 'terminate'),
    'failed': ('enter', 'exit', 'step', 'get unknown'),
}
OK, DISCARD, ERROR = 0, 2, 3


@pytest.fixture(scope='module')
def call(tmp_path_factory) -> Iterator[Call]:
    """Return a function that makes calls in another process; fails if that one dies."""
    folder = tmp_path_factory.mktemp('fmu')
    fmu = folder / 'bare.fmu'
    fmu.write_bytes(scene_fmu(load_scene('bare')))
    extract(fmu, folder / 'extracted')
    of = {v.name: v.valueReference for v in read_model_description(fmu).modelVariables}
    angle, rocker = (
        of['crank_states.crank_joint.position'],
        of['joint_states.rocker_joint.position'],
    )
    meaning: dict[str, list[Any]] = {
        'enter': ['enterInitializationMode'],
        'exit': ['exitInitializationMode'],
        'half a tick': ['doStep', 0.0, 0.0005],
        'terminate': ['terminate'],
        'reset': ['reset'],
        'get output': ['getFloat64', [rocker]],
        'set input': ['setFloat64', [angle], [1.0]],
        'set seed': ['setInt64', [of['seed']], [7]],
        'set output': ['setFloat64', [rocker], [1.0]],
        'set time': ['setFloat64', [of['time']], [1.0]],
        'set two of one': ['setFloat64', [angle], [1.0, 2.0]],
        'get unknown': ['getFloat64', [99999]],
        'get one of them unknown': ['getInt64', [of['rejected'], 2**32 - 1]],
        'get a number as a flag': ['getBoolean', [rocker]],
        'get a number as a text': ['getString', [rocker]],
        'get a number as an integer': ['getUInt64', [rocker]],
        'set unknown': ['setFloat64', [99999], [1.0]],
        'set an input as a flag': ['setBoolean', [angle], [True]],
        'set a text': ['setString', [angle], ['x']],
        'save': ['getFMUState'],
        'event': ['updateDiscreteStates'],
    }
    program = Path(__file__).with_name('caller.py')
    running: list[subprocess.Popen[str]] = []

    def ask(names: list[str]) -> list[tuple[int, list[Any]]]:
        time, calls = 0.0, []
        for name in names:
            if name == 'reset':
                time = 0.0
            if name == 'step':
                calls.append(['doStep', time, 0.001])
                time = round(time + 0.001, 3)
            else:
                calls.append(meaning[name])
        if not running:
            running.append(
                subprocess.Popen(
                    [sys.executable, program, fmu, folder / 'extracted'],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                    text=True,
                )
            )
        print(json.dumps(calls), file=running[0].stdin, flush=True)
        answer = running[0].stdout.readline()
        if not answer:
            pytest.fail(f'the importer died: {running.pop().wait()}')
        return json.loads(answer)

    yield ask
    for caller in running:
        caller.communicate(timeout=30)


@pytest.mark.parametrize('state', STATES)
@pytest.mark.parametrize('name', TABLE)
def test_fmi_call_in_each_state_has_its_status(state, name, call):
    after = TABLE[name][STATES.index(state)]
    *_, (status, logged), (then, _) = call([*REACHED[state], name, 'step'])
    if after:
        assert (status, logged) == (OK, []) or name == 'half a tick'
    elif state == 'failed':
        assert logged == []  # The first reason is logged, and no other.
    else:
        ((severity, text),) = logged
        assert severity == ERROR
        assert text.startswith('fmi3')
    # The wrapper passes on the status of a step; that of another call comes with the next step.
    if name == 'half a tick' and after:
        assert status == DISCARD
    elif name in ('step', 'half a tick'):
        assert status == (OK if after else ERROR)
    assert then == (OK if after == 'initialized' else ERROR)


@settings(max_examples=60, deadline=None)
@given(names=st.lists(st.sampled_from([*TABLE, 'enter', 'exit', 'step', 'reset']), max_size=30))
def test_random_fmi_calls_do_not_crash_the_importer(names, call):
    state, ticks_fit = 'instantiated', True
    for name, (status, logged) in zip(names, call(names), strict=True):
        after = TABLE[name][STATES.index(state)]
        if name == 'reset':
            ticks_fit = True
        if name == 'step':
            # `ask` counts refused steps too, behind which a step does not fit on the last one.
            expected = ERROR if not after else OK if ticks_fit else DISCARD
            assert status == expected
            ticks_fit = ticks_fit and bool(after)
        elif name == 'half a tick':
            assert status == (DISCARD if after else ERROR)
        else:
            assert status == OK
        assert all(severity in (DISCARD, ERROR) for severity, _ in logged)
        state = after or ('failed' if state != 'failed' else state)


def test_reset_without_extracted_files_fails_each_step(tmp_path):
    fmu = tmp_path / 'bare.fmu'
    fmu.write_bytes(scene_fmu(load_scene('bare')))
    extracted = tmp_path / 'extracted'
    extract(fmu, extracted)
    program = (
        'import json, shutil, sys\n'
        'from fmpy.fmi3 import FMU3Slave\n'
        f'sys.path.insert(0, {str(Path(__file__).parent)!r})\n'
        'from caller import call_all\n'
        'FMU3Slave.lose = lambda self, folder: shutil.rmtree(folder)\n'
        'print(json.dumps(call_all(*sys.argv[1:], [["lose", sys.argv[2]], ["reset"], '
        '["enterInitializationMode"], ["doStep", 0.0, 0.001], ["getFloat64", [0]], ["reset"], '
        '["doStep", 0.0, 0.001], ["terminate"]])))\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', program, str(fmu), str(extracted)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert [status for status, _ in json.loads(done.stdout)] == [0, 0, 0, ERROR, 0, 0, ERROR, 0]
