# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A linkage as a module of Python, and of JavaScript, says what the plain steps say."""

from array import array
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
import json
import math
from math import inf, nan, ulp
from pathlib import Path
from random import Random
import subprocess
from typing import Any

from campaigns.topologies.families import FAMILIES
import linkage_ros as lr
from linkage_ros.description import parse_yaml, read_any_closure
from linkage_ros.kinematics import Closure, Limits, turn_to_pose
from linkage_ros.resources import named_file
from linkage_ros.tools.models.source_code import (
    C,
    FUNCTIONS,
    JavaScript,
    PythonModule,
    Subject,
    write_source,
)
import pytest

from .emitted import COUNT, needs, NUMBERS, parts, plain, run_c, State, states, subject, Told
from .test_c import GALLERY, limited
from ..test_gallery import closure_of
from ...support.scenes import iterated_with_two_inputs

_ULPS = 4
"""So many units in the last place may a function of JavaScript be off."""

_MANY = 1024
_DIGITS = 1e-9
CURVED = ('sin', 'cos', 'atan2')
"""Functions of which a language has its own last digits."""

Solve = Callable[..., tuple[Any, ...]]


def python_of(what: Subject) -> dict[str, Any]:
    """Return the names of the module that a linkage makes."""
    namespace: dict[str, Any] = {}
    exec(write_source(what, PythonModule(what.derivatives)), namespace)
    return namespace


def told_by(solve: Solve, state: State) -> Told:
    """Return what a function of Python says."""
    status, *groups = solve(*parts(state, len(state) // 3))
    return Told(NUMBERS[status], tuple(value for group in groups for value in group))


@pytest.mark.sample(3)
@pytest.mark.timeout(600)
@pytest.mark.parametrize('name', GALLERY)
def test_python_module_equals_the_steps_bit_for_bit(name):
    closure = closure_of(name)
    solve = python_of(subject(closure))['motion']
    for state in states(closure, COUNT, name):
        assert told_by(solve, state) == plain(closure, state), state


def planar_group_of_two_inputs():
    """Return links that only two inputs close together, with limits about their pose."""
    linkage = FAMILIES['class III two inputs'].make(Random(2)).linkage
    inputs = [
        replace(given, limits=Limits(value - 0.2, value + 0.2))
        for given, value in zip(linkage.inputs, linkage.pose.inputs, strict=True)
    ]
    return Closure(replace(linkage, inputs=tuple(inputs)))


@pytest.mark.sample(1)
@pytest.mark.parametrize('language', [JavaScript(), C('hexapod', header=False), PythonModule(2)])
def test_source_writers_refuse_a_hexapod_with_too_many_cells(language):
    told = '6 inputs .* more than .* cells; give the inputs of the file limits'
    with pytest.raises(lr.DefinitionError, match=told):
        write_source(subject(closure_of('hexapod')), language)


def test_python_module_imports_only_math():
    text = write_source(subject(closure_of('jansen_leg')), PythonModule(2))
    imports = [line for line in text.splitlines() if 'import ' in line]
    assert imports == ['from math import atan2, copysign, cos, inf, isfinite, sin, sqrt']


@pytest.mark.parametrize('derivatives', [0, 1, 2])
def test_python_module_returns_only_requested_derivatives_and_joints(derivatives):
    closure = closure_of('four_bar')
    solve = python_of(subject(closure, derivatives, ['rocker_joint']))[FUNCTIONS[derivatives]]
    given = ((0.3,), (2.0,), (0.5,))
    status, *groups = solve(*given[: 1 + derivatives])
    steps = plain(closure, (0.3, 2.0, 0.5)).values[1::2]
    assert (NUMBERS[status], *groups) == ('CLOSED', *((v,) for v in steps[: 1 + derivatives]))


def test_python_module_returns_the_status_of_joint_limits():
    closure = limited(rocker_joint=(1.5, 1.9))
    solve = python_of(subject(closure))['motion']
    told = [told_by(solve, state) for state in states(closure, 300, 'limited')]
    assert told == [plain(closure, state) for state in states(closure, 300, 'limited')]
    assert {one.status for one in told} == {'CLOSED', 'LIMITED', 'INDETERMINATE'}


RUN = """
import { readFileSync, writeFileSync } from 'node:fs';
import { motion, Status } from './linkage.js';
const names = Object.keys(Status);
const n = Number(process.argv[2]);
const bytes = readFileSync('given');
const given = new Float64Array(bytes.buffer, bytes.byteOffset, bytes.length / 8);
const told = [];
for (let i = 0; i < given.length; i += 3 * n) {
    const part = (k) => given.slice(i + k * n, i + (k + 1) * n);
    const found = motion(part(0), part(1), part(2));
    const values = [...found.joints, ...found.joint_rates, ...found.joint_accelerations];
    told.push([names[found.status], values.map(String)]);
}
writeFileSync('told', JSON.stringify(told));
"""


def run_javascript(what: Subject, given: Sequence[State], folder: Path) -> list[Told]:
    """Return what a linkage in JavaScript says of states."""
    (folder / 'package.json').write_text('{"type": "module"}')
    (folder / 'linkage.js').write_text(write_source(what, JavaScript()))
    (folder / 'run.js').write_text(RUN)
    (folder / 'given').write_bytes(array('d', (v for state in given for v in state)).tobytes())
    typed = ['node', 'run.js', str(len(what.closure.linkage.inputs))]
    subprocess.run(typed, cwd=folder, check=True, timeout=60)
    return [
        Told(name, tuple(map(float, values)))
        for name, values in json.loads((folder / 'told').read_text())
    ]


def run_python(what, given, _folder):
    """Return what a linkage in Python says of states."""
    solve = python_of(what)['motion']
    return [told_by(solve, state) for state in given]


RUN_IN = {
    'Python': run_python,
    'C': pytest.param(run_c, marks=needs['C99']),
    'JavaScript': pytest.param(run_javascript, marks=needs['JavaScript']),
}


def carried(what: Subject, given: Sequence[State]) -> list[list[float]]:
    """
    Return for each value of each state what one unit in the last place of all before it makes.

    Each input and each sine, cosine and arc tangent is changed, one after the other, by so many
    units that rounding is small beside them. To the sum one unit of the value itself is added, or
    of a half turn: angles are sums of angles.
    """
    namespace = python_of(what)
    exact = {name: getattr(math, name) for name in CURVED}
    calls, changed = 0, -1

    def changing(name: str) -> Callable[..., float]:
        def call(*arguments: float) -> float:
            nonlocal calls
            calls += 1
            value: float = exact[name](*arguments)
            return value + _MANY * ulp(value) if calls - 1 == changed else value

        return call

    namespace |= {name: changing(name) for name in CURVED}
    found = []
    for state in given:
        calls, changed = 0, -1
        values = told_by(namespace['motion'], state).values
        sums = [ulp(max(abs(value), math.pi)) for value in values]
        count = calls
        for one in range(count + len(state) if values else 0):
            calls, changed = 0, one
            near = list(state)
            if one >= count:
                near[one - count] += _MANY * ulp(near[one - count])
            others = told_by(namespace['motion'], tuple(near)).values
            # A change may reach a limit, where there are no values.
            others = others or [math.inf] * len(values)
            sums = [
                total + abs(other - value) / _MANY
                for total, value, other in zip(sums, values, others, strict=True)
            ]
        found.append(sums)
    return found


def off(what: Subject, told: Sequence[Told], given: Sequence[State]) -> float:
    """Return what values differ by from the steps', in units of what a last place carries."""
    worst, left_out = 0.0, 0
    for state, one, units in zip(given, told, carried(what, given), strict=True):
        steps = plain(what.closure, state)
        assert one.status == steps.status, state
        for value, right, unit in zip(one.values, steps.values, units, strict=True):
            # Within some floats of a singular state a rate has no digits that could be compared.
            if unit < _DIGITS * max(abs(right), 1.0):
                worst = max(worst, abs(value - right) / unit)
            else:
                left_out += 1
    assert left_out < 0.05 * len(given) * len(what.joints)
    return worst


@pytest.mark.sample(3)
@needs['JavaScript']
@pytest.mark.timeout(600)
# Not the ankle: states next to its toggles magnify the last bits of sine and cosine.
@pytest.mark.parametrize('name', [name for name in GALLERY if name != 'ankle'])
def test_javascript_module_equals_the_steps_within_rounding(name, tmp_path):
    what = subject(closure_of(name))
    given = states(what.closure, max(COUNT // 5, 100), name)
    assert off(what, run_javascript(what, given, tmp_path), given) <= _ULPS


@needs['JavaScript']
def test_javascript_module_returns_the_status_of_joint_limits(tmp_path):
    what = subject(limited(rocker_joint=(1.5 + 4.0 * math.pi, 1.9 + 4.0 * math.pi)))
    given = states(what.closure, 300, 'limited')
    told = run_javascript(what, given, tmp_path)
    assert {one.status for one in told} == {'CLOSED', 'LIMITED', 'INDETERMINATE'}
    assert off(what, told, given) <= _ULPS


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ('make', 'reach'),
    [(partial(closure_of, 'ankle_motors'), 0.6), (planar_group_of_two_inputs, 0.2)],
)
@pytest.mark.parametrize('run', RUN_IN.values(), ids=RUN_IN)
def test_source_code_holds_the_cells_of_two_input_linkages(run, make, reach, tmp_path):
    closure, random = make(), Random(1)
    pose = closure.linkage.pose.inputs
    given = []
    for index in range(300):
        inputs = [value + random.uniform(-reach, reach) for value in pose]
        inputs[0] = pose[0] + {298: 0.65, 299: 3.0}.get(index, inputs[0] - pose[0])
        given.append((*inputs, *(random.uniform(-9.0, 9.0) for _ in range(4))))
    told = run(subject(closure), given, tmp_path)
    assert sum(one.status == 'CLOSED' for one in told) > 290
    assert {one.status for one in told[-2:]} <= {'LIMITED', 'UNDECIDED'}
    assert_decided_states_equal_the_steps(run, closure, given, told)


def assert_decided_states_equal_the_steps(run, closure, given, told):
    for state, one in zip(given, told, strict=True):
        if one.status != 'UNDECIDED':
            expected = plain(closure, state)
            assert one.status == expected.status
            if run is run_javascript:  # whose sines have other last digits
                assert one.values == pytest.approx(expected.values, rel=1e-12, abs=1e-12)
            else:
                assert one == expected, state


def ankle_of_free_motors() -> Closure:
    """Return the ankle driven by its motors, which have no limits."""
    text = named_file('ankle', 'linkages').read_text('utf-8').replace('limits: [-0.6, 0.6]', '')
    return read_any_closure(parse_yaml(text.encode(), 'ankle.yaml')).driven_by('m1', 'm2')


def platform_of_two_cranks() -> Closure:
    return read_any_closure(parse_yaml(iterated_with_two_inputs().encode(), 'two.yaml'))


@pytest.mark.sample(2)
@pytest.mark.parametrize('make', [ankle_of_free_motors, platform_of_two_cranks])
@pytest.mark.parametrize('run', RUN_IN.values(), ids=RUN_IN)
def test_source_code_holds_the_cells_of_inputs_that_turn_fully(run, make, tmp_path):
    """A turn about the pose is all that code needs."""
    closure, random = make(), Random(1)
    given = [
        tuple(random.uniform(-reach, reach) for reach in (9.0, 9.0, 3.0, 3.0, 3.0, 3.0))
        for _ in range(300)
    ]
    told = run(subject(closure), given, tmp_path)
    closed = [plain(closure, state).status == 'CLOSED' for state in given]
    decided = [one.status != 'UNDECIDED' for one in told]
    assert 0.6 * len(given) < sum(decided) <= sum(closed) < 1.02 * sum(decided)
    assert_decided_states_equal_the_steps(run, closure, given, told)


DRIVEN = {
    'gripper': ('left_finger_joint', 'left_inner_knuckle_joint'),
    'four_bar': ('rocker_joint', 'coupler_joint'),
    'slider_crank': ('piston_slide', 'rod_joint'),
    'drag_link': ('rocker_joint',),
    'inverted_slider_crank': ('rod_joint', 'rod_slide'),
    'excavator_bucket': ('bucket_joint',),
    'klann_leg': ('knee_joint', 'lower_rocker_joint'),
    'class_3': ('platform_joint',),
}
"""For each linkage the joints that drive it instead of its crank."""


@pytest.mark.sample(6)
@pytest.mark.parametrize('run', [run_python, pytest.param(run_c, marks=needs['C99'])])
@pytest.mark.parametrize(
    ('name', 'joint'), [(name, joint) for name, joints in DRIVEN.items() for joint in joints]
)
def test_source_code_solves_linkages_driven_by_a_dependent_joint(run, name, joint, tmp_path):
    """The crank of each state is found by the branch itself, a route without compiled code."""
    crank_driven = closure_of(name)
    for branch in crank_driven._joint_inverse(joint).branches[:2]:
        closure, random = crank_driven.driven_by(joint, branch=branch.number), Random(joint)
        width = branch.high - branch.low
        inputs = [branch.low + width * random.uniform(-0.1, 1.1) for _ in range(150)]
        inputs += [branch.low, branch.high, branch.low + 1e-9 * width, 1e6, inf, nan]
        given = [(y, random.uniform(-9.0, 9.0), random.uniform(-9.0, 9.0)) for y in inputs]
        told = run(subject(closure), given, tmp_path)
        undecided = 0
        for state, one in zip(given, told, strict=True):
            expected = plain(closure, state)
            if one.status == 'UNDECIDED':
                undecided += 1
            elif any(branch.steep) or state[0] in (branch.low, branch.high):
                # The branch finds the crank of an end, and next to a toggle, without a table.
                assert one.status == expected.status, state
                assert one.values == pytest.approx(expected.values, rel=1e-10, abs=1e-10), state
            else:
                assert one == expected, state
        assert undecided < 5
        assert sum(one.status == 'CLOSED' for one in told) > 100


EXCHANGED = {
    'five_bar': (
        ('A-B', 'P.y'),
        ('left_forearm.angle', 'P.x'),
        ('left_crank_joint', 'left_elbow'),
    ),
    'ankle_motors': (('pitch', 'roll'), ('c1.z', 'roll')),
    'ankle': (('m1', 'c2.z'),),
    'delta': (('x', 'y', 'z'),),
    'wishbone': (('upper_joint', 'rack'),),
    'rssr': (('B.x',), ('rocker_joint',)),
    'gripper': (('left_pad-right_pad',),),
}
"""For each linkage what is given instead of its inputs: joints, coordinates, distances, angles."""


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    'run',
    [
        run_python,
        pytest.param(run_c, marks=needs['C99']),
        pytest.param(run_javascript, marks=needs['JavaScript']),
    ],
)
@pytest.mark.parametrize(
    ('name', 'joints'), [(name, joints) for name, sets in EXCHANGED.items() for joints in sets]
)
def test_source_code_inverts_joints_coordinates_distances_and_angles(run, name, joints, tmp_path):
    """There and back: the linkage itself has the joints that were asked for, and their rates."""
    random, closure = Random(name), closure_of(name)
    pose = closure.linkage.pose.inputs if closure.linkage.pose else (1.1, 1.2)
    inputs = tuple(
        replace(given, limits=Limits(at - 0.2, at + 0.2)) if name == 'five_bar' else given
        for given, at in zip(closure.linkage.inputs, pose, strict=True)
    )
    if name == 'five_bar':
        closure = Closure(replace(closure.linkage, inputs=inputs))
    measured = closure.measuring(*joints)
    given, starts = [], []
    for _ in range(20):
        starts.append([at + random.uniform(0.02, 0.12) for at in pose])
        rates = [random.uniform(-1.0, 1.0) for _ in pose]
        position = measured.position(*starts[-1])
        velocity = measured.velocity(position, *rates)
        acceleration = measured.acceleration(position, velocity, *rates)
        motion = (position, velocity, acceleration)
        given.append(tuple(part[joint] for part in motion for joint in joints))
        starts[-1] = [*starts[-1], *rates, *rates]
    inverse = closure.driven_by(*joints, near=[at + 0.07 for at in pose])
    count = len(pose)
    given = [(*turn_to_pose(inverse, state[:count]), *state[count:]) for state in given]
    former = [one for one in closure.input_names if one not in joints]
    found = run(subject(inverse, joints=former), given, tmp_path)
    places = [closure.input_names.index(one) + len(pose) * k for k in range(3) for one in former]
    for one, start in zip(found, starts, strict=True):
        assert one.status == 'CLOSED'
        for value, place in zip(one.values, places, strict=True):
            off = value - start[place]
            turns = place < len(pose) and not closure.linkage.inputs[place].slider
            off = math.remainder(off, math.tau) if turns else off
            assert off == pytest.approx(0.0, abs=1e-11 if place < len(pose) else 1e-8)


def test_any_joints_drive_a_spatial_ankle():
    """There and back: the joints of the motors of joints."""
    motors, random = closure_of('ankle_motors'), Random(3)
    joints = motors.driven_by('pitch', 'roll')
    assert joints.input_names == ('pitch', 'roll')
    assert joints.joint_names == ('m1', 'm2')
    for _ in range(100):
        given = [random.uniform(-0.3, 0.3) for _ in range(2)]
        back = motors.position(*joints.position(*given).joints)
        assert back.joints == pytest.approx(given, abs=1e-14)
    with pytest.raises(lr.DefinitionError, match='1 for 2 inputs; name 2 different joints'):
        motors.driven_by('pitch')
    with pytest.raises(lr.DefinitionError, match=r"rol: is not a joint.* did you mean 'roll'"):
        motors.driven_by('pitch', 'rol')
