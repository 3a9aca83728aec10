# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A linkage as a module for arrays says what the plain steps say, and its gradients are right."""

from collections.abc import Sequence
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from random import Random
import subprocess
import sys
from typing import Any, NamedTuple

import linkage_ros as lr
from linkage_ros.description import parse_yaml, read_any_closure
from linkage_ros.kinematics import Closure
from linkage_ros.kinematics.compiling import Compiled
from linkage_ros.resources import named_file
from linkage_ros.tools.models.source_code import Subject, write_arrays
import numpy as np
import pytest

from .emitted import COUNT, NUMBERS, parts, plain, State, states, subject, Told
from .test_c import GALLERY, limited
from .test_modules import off
from ..test_gallery import closure_of

pytest.importorskip('array_api_compat')

needs_torch = pytest.mark.skipif(find_spec('torch') is None, reason='needs torch: make arrays')
LIBRARIES = ['jax', pytest.param('torch', marks=needs_torch)]
ALL = [*GALLERY, 'ankle_motors']

ULPS = 4
"""So many units of what a last place carries may a value be off."""
FUSED_ULPS = 16
"""The same under jax.jit, which fuses products with sums, and gathers constants."""
EXACT = 1e-9
"""Largest error of a gradient, of the largest of its state or of 1."""
BESIDE = 1e-6
"""Distance from a toggle at which gradients are right as well."""


def module_of(what: Subject) -> dict[str, Any]:
    """Return the names of the module that a linkage makes."""
    namespace: dict[str, Any] = {}
    exec(write_arrays(what), namespace)
    return namespace


def given_to(closure: Closure, count: int = COUNT) -> list[State]:
    """Return states, some of them open, at a toggle, or not finite; of cells within limits."""
    name = closure.name
    if name != 'ankle_motors':
        return states(closure, count, name)
    random = Random(name)
    spans = ((0.61, 0.61), (3.0, 3.0), (2.0, 2.0))
    return [
        tuple(random.uniform(-each, each) for span in spans for each in span) for _ in range(count)
    ]


def told_by(results: Sequence[Any]) -> list[Told]:
    """Return what arrays of statuses and values say."""
    status, *groups = (np.asarray(each) for each in results)
    values = np.concatenate(groups, axis=-1, dtype=float)
    has_values = ~np.isnan(values)
    assert (has_values == (status <= NUMBERS.index('LIMITED'))[..., None]).all()
    return [
        Told(NUMBERS[number], tuple(row[known].tolist()))
        for number, row, known in zip(status, values, has_values, strict=True)
    ]


def grouped(given: Sequence[State], inputs: int) -> Any:
    """Return inputs, rates and accelerations, (3, states, inputs)."""
    return np.array([parts(state, inputs) for state in given]).swapaxes(0, 1)


@pytest.mark.sample(3)
@pytest.mark.parametrize('name', ALL)
def test_numpy_module_returns_the_values_of_the_steps(name):
    closure = closure_of(name)
    given = given_to(closure)
    arrays = grouped(given, len(closure.input_names))
    module = module_of(subject(closure))
    told = told_by(module['motion'](*arrays))
    assert off(subject(closure), told, given) <= ULPS
    # Position and velocity are the first parts of the motion.
    *_, joint_rates, _ = motion = module['motion'](*arrays)
    for part in (module['position'](arrays[0]), module['velocity'](*arrays[:2])):
        for one, other in zip(part, motion, strict=False):
            np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)
    products = module['jacobian'](arrays[0]) @ arrays[1][..., None]
    known = ~np.isnan(joint_rates)
    size = np.abs(module['jacobian'](arrays[0])[known[:, 0]]).max(initial=1.0)
    assert np.abs(products[..., 0] - joint_rates)[known].max() < 1e-14 * 9.0 * size


def test_numpy_module_returns_the_status_of_joint_limits():
    closure = limited(rocker_joint=(1.5, 1.9), crank_joint=(-2.0, 5.0))
    given = states(closure, 300, 'limited')
    told = told_by(module_of(subject(closure))['motion'](*grouped(given, 1)))
    assert [one.status for one in told] == [plain(closure, state).status for state in given]
    assert {one.status for one in told} == {'CLOSED', 'LIMITED', 'INDETERMINATE'}


@pytest.mark.parametrize(
    ('name', 'joint'), [('four_bar', 'rocker_joint'), ('slider_crank', 'piston_slide')]
)
def test_numpy_module_solves_for_a_driven_dependent_joint(name, joint):
    closure = closure_of(name).driven_by(joint, branch=1)
    branch = closure_of(name).branches(joint)[0]
    beyond = 0.1 * (branch.high - branch.low)
    inputs = np.linspace(branch.low - beyond, branch.high + beyond, 500)[:, None]
    module = module_of(subject(closure))
    status, joints = module['position'](inputs)
    slopes = module['jacobian'](inputs)
    for index, value in enumerate(inputs[:, 0].tolist()):
        position = closure.position(value)
        assert NUMBERS[status[index]] == position.status.name
        if position.status.has_rates:
            assert joints[index] == pytest.approx(position.joints, abs=1e-13)
            right = closure.jacobian(position)
            assert slopes[index] == pytest.approx(right, rel=1e-9, abs=1e-9)
    assert set(status.tolist()) == {NUMBERS.index('CLOSED'), NUMBERS.index('OPEN')}


def test_array_module_accepts_states_along_any_axes():
    closure = closure_of('ankle')
    module = module_of(subject(closure))
    given = grouped(states(closure, 24, 'axes'), 2)
    flat = module['motion'](*given)
    cube = module['motion'](*given.reshape(3, 2, 3, 4, 2))
    one = module['motion'](*given[:, 5])
    for a, b, c in zip(flat, cube, one, strict=True):
        np.testing.assert_array_equal(b.reshape(a.shape), a)
        np.testing.assert_array_equal(c, a[5])
    assert module['jacobian'](given[0].reshape(2, 3, 4, 2)).shape == (2, 3, 4, 2, 2)
    assert module['jacobian'](given[0][5]).shape == (2, 2)


@pytest.mark.parametrize('name', ['four_bar', 'gripper', 'class_3', 'ankle', 'ankle_motors'])
def test_array_module_keeps_single_precision(name):
    closure = closure_of(name)
    module = module_of(subject(closure))
    count = len(closure.input_names)
    start = closure.linkage.pose.inputs if closure.linkage.pose else (0.4,) * count
    random = np.random.default_rng(1)
    given = np.array(start) + random.uniform(0.01, 0.2, (3, 100, count))
    single = module['motion'](*given.astype(np.float32))
    double = module['motion'](*given.astype(np.float32).astype(float))
    np.testing.assert_array_equal(single[0], double[0])
    for one, other in zip(single[1:], double[1:], strict=True):
        assert one.dtype == np.float32
        np.testing.assert_allclose(one, other, atol=2e-4)


@pytest.mark.parametrize('derivatives', [0, 1, 2])
def test_array_module_holds_only_requested_derivatives_and_joints(derivatives):
    closure = closure_of('four_bar')
    what = subject(closure, derivatives, ['rocker_joint'])
    module = module_of(what)
    functions = ('position', 'velocity', 'motion')
    assert [name for name in functions if name in module] == [*functions[: 1 + derivatives]]
    assert ('jacobian' in module) == (derivatives > 0)
    given = np.array([[[0.3]], [[2.0]], [[0.5]]])[: 1 + derivatives]
    status, *groups = module[functions[derivatives]](*given)
    steps = plain(closure, (0.3, 2.0, 0.5)).values[1::2]
    assert (NUMBERS[status[0]], [group.shape for group in groups]) == (
        'CLOSED',
        [(1, 1)] * (1 + derivatives),
    )
    assert np.ravel(groups) == pytest.approx(steps[: 1 + derivatives], rel=1e-14)


@pytest.mark.sample(1)
@pytest.mark.parametrize('limits', [(-0.1, 0.9), (-0.9, 0.1)])
def test_array_module_solves_in_narrow_cells_near_a_limit(limits):
    """Next to the end of an ankle's motion only narrow cells are proven, and then none."""
    text = named_file('ankle_motors', 'linkages').read_text('utf-8')
    text = text.replace('[-0.6, 0.6]', f'[{limits[0]}, {limits[1]}]')
    closure = read_any_closure(parse_yaml(text.encode(), 'ankle.yaml'))
    (grid,), random = closure.grids, Random(str(limits))
    cells, width = grid.fill(4096), grid.widths[0]
    places = {key[1:] for key in cells if key[0] == 0}
    box = product(*(range(min(axis), max(axis) + 1) for axis in zip(*places, strict=True)))
    given = [
        tuple(
            random.uniform(max(limits[0], x - 0.5 * width), min(limits[1], x + 0.5 * width))
            for x in (home + width * k for home, k in zip(grid.home, place, strict=True))
        )
        for place in box
        if place not in places
        for _ in range(100)
    ]
    status, joints = module_of(subject(closure, 0))['position'](np.array(given))
    decided = [Compiled(closure, 0).fast(*inputs) for inputs in given]
    assert [NUMBERS[number] == 'CLOSED' for number in status] == [*map(bool, decided)]
    assert sum(map(bool, decided)) > 0.9 * len(given)
    for found, values in zip(joints, decided, strict=True):
        assert not values or found == pytest.approx(values[0], rel=1e-14)


def test_array_module_imports_only_math_and_array_api_compat():
    lines = write_arrays(subject(closure_of('ankle_motors'))).splitlines()
    assert [line for line in lines if 'import ' in line] == [
        'from math import inf, nan',
        'from array_api_compat import array_namespace, device',
    ]
    assert max(map(len, lines)) <= 99


def test_array_writer_refuses_a_hexapod_with_too_many_cells():
    with pytest.raises(lr.DefinitionError, match=r'6 inputs .* than .* cells; give the inputs'):
        write_arrays(subject(closure_of('hexapod')))


RUN = """
import sys
import numpy as np
import linkage as module

library, given = sys.argv[1], np.load('given.npy')
if library == 'jax':
    import jax
    jax.config.update('jax_enable_x64', True)
    arrays = [jax.numpy.asarray(each) for each in given]
    results = module.motion(*arrays)
    fused = jax.jit(module.motion)(*arrays)
    slopes = jax.jacrev(lambda inputs: module.position(inputs)[1])
    gradients = jax.jit(jax.vmap(slopes))(arrays[0])
    jacobian = jax.vmap(module.jacobian)(arrays[0])
else:
    import torch
    arrays = [torch.tensor(each) for each in given]
    inputs = arrays[0].clone().requires_grad_()
    joints = module.position(inputs)[1]
    gradients = np.stack([
        torch.autograd.grad(joints[:, k].sum(), inputs, retain_graph=True)[0].numpy()
        for k in range(joints.shape[1])
    ], axis=1)
    results = fused = module.motion(*arrays)
    jacobian = module.jacobian(arrays[0])
names = ('status', 'joints', 'rates', 'accelerations')
np.savez('told.npz', gradients=gradients, jacobian=jacobian,
         **{name: np.asarray(each) for name, each in zip(names, results)},
         **{f'fused_{name}': np.asarray(each) for name, each in zip(names, fused)})
"""


class Arrays(NamedTuple):
    """What a library gives for states."""

    told: list[Told]
    fused: list[Told]
    gradients: Any
    jacobian: Any


def run_in(library: str, what: Subject, given: Sequence[State], folder: Path) -> Arrays:
    """Return what a module gives in a process of its own, as both libraries are large."""
    (folder / 'linkage.py').write_text(write_arrays(what))
    np.save(folder / 'given.npy', grouped(given, len(what.closure.linkage.inputs)))
    command = [sys.executable, '-c', RUN, library]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    names = ('status', 'joints', 'rates', 'accelerations')
    with np.load(folder / 'told.npz') as saved:
        told = told_by([saved[name] for name in names])
        fused = told_by([saved[f'fused_{name}'] for name in names])
        return Arrays(told, fused, saved['gradients'], saved['jacobian'])


def beside_toggles(closure: Closure) -> list[State]:
    """Return closed states of one input near its toggles."""
    toggles = closure.singular_inputs if len(closure.input_names) == 1 else ()
    values = [each.value + side for each in toggles for side in (-BESIDE, BESIDE)]
    return [(value, 1.0, 0.0) for value in values if closure.position(value).status.has_rates]


@pytest.mark.sample(1)
@pytest.mark.timeout(600)
@pytest.mark.parametrize('name', ALL)
@pytest.mark.parametrize('library', LIBRARIES)
def test_array_libraries_return_the_values_and_gradients_of_steps(library, name, tmp_path):
    closure = closure_of(name)
    what, count = subject(closure), len(closure.input_names)
    given = [*given_to(closure, 250), *beside_toggles(closure)]
    found = run_in(library, what, given, tmp_path)
    assert off(what, found.told, given) <= ULPS
    # A compiler may not tell a toggle from what is some floats beside it.
    usual = [index for index in range(len(given)) if index % 16 != 1]
    fused = [found.fused[index] for index in usual]
    assert off(what, fused, [given[index] for index in usual]) <= FUSED_ULPS
    for index in usual:
        gradient = found.gradients[index]
        if found.told[index].values:
            slopes = closure.jacobian(closure.position(*given[index][:count]))
            size = max(1.0, np.abs(slopes).max())
            assert np.abs(gradient - slopes).max() <= EXACT * size, given[index]
            assert np.abs(found.jacobian[index] - slopes).max() <= EXACT * size, given[index]
        else:
            assert np.isnan(found.jacobian[index]).all()
    # Whatever has no values has the gradient 0: a sum over states stays a number.
    without = [index for index, one in enumerate(found.told) if not one.values]
    assert (found.gradients[without] == 0.0).all()


KITE = 'four_bar: {a: 1, b: 2, c: 2, d: 1, assembly: left}'
GRADIENTS = """
import sys
import numpy as np
import linkage as module

library, given = sys.argv[1], np.load('given.npy')
if library == 'jax':
    import jax
    jax.config.update('jax_enable_x64', True)
    slopes = jax.vmap(jax.jacrev(lambda inputs: module.velocity(inputs, 1.0 + 0.0 * inputs)[1:]))
    gradients = slopes(jax.numpy.asarray(given))
else:
    import torch
    inputs = torch.tensor(given, requires_grad=True)
    gradients = [
        np.stack([
            torch.autograd.grad(each[:, k].sum(), inputs, retain_graph=True)[0].numpy()
            for k in range(each.shape[1])
        ], axis=1)
        for each in module.velocity(inputs, torch.ones_like(inputs))[1:]
    ]
np.save('gradients.npy', np.concatenate(gradients, axis=1))
"""


@pytest.mark.sample(1)
@pytest.mark.timeout(300)
@pytest.mark.parametrize('library', LIBRARIES)
@pytest.mark.parametrize(
    ('make', 'given'),
    [
        # No direction leads from pin to pin where they meet, at 0: quotients and an angle fail.
        (
            lambda: read_any_closure(parse_yaml(KITE.encode(), 'kite.yaml')),
            [(x,) for x in (0.0, 1e-200, 0.3, 2.0, -3.0)],
        ),
        # No motor turns the foot as far: there a root fails.
        (lambda: closure_of('ankle'), [(5.05, -2.5), (5.3, 1.4), (0.1, 0.2), (-0.3, 0.1)]),
    ],
    ids=['kite', 'ankle'],
)
def test_failing_states_do_not_spoil_gradients_of_others(library, make, given, tmp_path):
    closure = make()
    assert [closure.position(*state).status.has_pose for state in given].count(False) == 2
    (tmp_path / 'linkage.py').write_text(write_arrays(subject(closure, 1)))
    np.save(tmp_path / 'given.npy', given)
    command = [sys.executable, '-c', GRADIENTS, library]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = np.load(tmp_path / 'gradients.npy')
    assert (found[:2] == 0.0).all()
    still = [1.0] * len(closure.input_names) + [0.0] * len(closure.input_names)
    for state, gradient in zip(given[2:], found[2:], strict=True):
        for k, step in enumerate(BESIDE * np.eye(len(state))):
            after, before = (plain(closure, (*(state + side), *still)) for side in (step, -step))
            slopes = np.subtract(after.values, before.values)[: gradient.shape[0]] / (2.0 * BESIDE)
            assert gradient[:, k] == pytest.approx(slopes, abs=1e-7)


COMPILED = """
import sys
import numpy as np
import linkage_ros as lr

closure, given = lr.load('four_bar'), np.linspace(-3.0, 3.0, 7)[:, None]
if sys.argv[1] == 'torch':
    import torch
    functions, given = closure.as_torch(), torch.tensor(given)
    compiled = torch.compile(functions.velocity, fullgraph=True)
else:
    import jax
    jax.config.update('jax_enable_x64', True)
    functions, given = closure.as_jax(), jax.numpy.asarray(given)
    compiled = jax.jit(jax.vmap(functions.velocity))
for one, other in zip(functions.velocity(given, given), compiled(given, given)):
    assert abs(np.asarray(one) - np.asarray(other)).max() < 1e-14
assert functions is (closure.as_torch() if sys.argv[1] == 'torch' else closure.as_jax())
assert functions.statuses[int(functions.position(given)[0][0])] == 'CLOSED'
"""


@pytest.mark.timeout(300)
@pytest.mark.parametrize('library', LIBRARIES)
def test_array_libraries_compile_the_functions_of_a_closure(library):
    command = [sys.executable, '-c', COMPILED, library]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


SINGLE = """
import linkage_ros as lr
import numpy as np

closure = lr.load('class_3')
given = np.array(closure.linkage.pose.inputs) + np.linspace(0.01, 0.1, 20)[:, None]
functions = closure.as_jax()
(wide, joints), narrow = (functions.position(each) for each in (given, given.astype(np.float32)))
assert (np.asarray(wide) == functions.statuses.index('CLOSED')).all()
np.testing.assert_array_equal(joints, narrow[1])
assert joints.dtype == np.float32
"""


@pytest.mark.timeout(300)
def test_jax_computes_numpy_arrays_in_its_own_precision():
    """Double ones are single there, unless it is told otherwise."""
    command = [sys.executable, '-c', SINGLE]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_missing_array_library_raises_the_install_command(monkeypatch):
    monkeypatch.setattr('linkage_ros.errors.find_spec', lambda _: None)
    with pytest.raises(
        lr.LinkageError, match=r"not installed; pip install 'linkage_ros\[arrays\]'"
    ):
        closure_of('four_bar').as_torch()
