# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Many states of each shipped linkage: `solve`, beside its emitted C as fast as a compiler makes it.

Both are written from the same tape; what differs is who runs it.
"""

from __future__ import annotations

from collections.abc import Callable
import ctypes
from pathlib import Path
import shutil
import subprocess

from bench.compiled_steps import ACCELERATION, input_bounds, RATE
from bench.in_turn import in_turn
from bench.processes import BenchError, ROOT
from bench.report import say, Table
from bench.spread import ratios, spread
from linkage_ros.kinematics.batch import Array
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.compiled.c import C
from linkage_ros.kinematics.compiled.source import source, Subject
from linkage_ros.kinematics.ranges import iterated
from linkage_ros.scene.linkage_file import read_linkage
from linkage_ros.scene.yaml_file import read_yaml
import numpy as np

# Without errno a square root is one instruction. Nothing here may change a result by more than
# the last digit.
_FLAGS = ('-O3', '-march=native', '-fno-math-errno', '-shared', '-fPIC')

_AGREEMENT = 1e-9
"""What results of both may differ by; else they did not do the same."""

_LOOP = """\
#include "{name}.h"

long solve_all(long n, const double *given, const double *rates, const double *accelerations,
               double *values)
{{
  long odd = 0;
  double *rates_of = values + {joints} * n, *accelerations_of = values + 2 * {joints} * n;
  for (long i = 0; i < n; ++i) {{
    double inputs[{inputs}], found[3][{joints}];
    for (int k = 0; k < {inputs}; ++k) inputs[k] = given[k * n + i];
    odd += {name}_motion(inputs, rates, accelerations, found[0], found[1], found[2]) != 0;
    for (int k = 0; k < {joints}; ++k) {{
      values[k * n + i] = found[0][k];
      rates_of[k * n + i] = found[1][k];
      accelerations_of[k * n + i] = found[2][k];
    }}
  }}
  return odd;
}}
"""

_Solve = Callable[[Array, Array], int]
"""Takes the inputs, (inputs, N), and where values, rates and accelerations go, (3, joints, N)."""


def measure_arrays(folder: Path, rounds: int, states: int) -> Table:
    """
    Return how many closed states a second both solve with rates and accelerations.

    Parameters
    ----------
    folder
        Where what is compiled goes.
    rounds
        How often each is measured, in turn.
    states
        In a round.

    """
    table = Table(
        f'{states:,} states at once, with rates and accelerations, million a second; one run, '
        'in turn',
        ('', 'solve', 'emitted C, -O3', 'ratio', 'target'),
    )
    if shutil.which('cc') is None:
        say('  no C compiler (cc): left out')
        return table
    for file in sorted((ROOT / 'config' / 'linkages').glob('*.yaml')):
        closure = Closure(read_linkage(read_yaml(file)[0]))
        if not iterated(closure):
            target = '≥ 0.9' if file.stem == 'four_bar' else '≥ 0.5'
            cells = _measured(folder, closure, file, rounds, states)
            table.rows.append((file.stem, *cells, target))
    return table


def _measured(
    folder: Path, closure: Closure, file: Path, rounds: int, states: int
) -> tuple[str, str, str]:
    """Return the states a second of both, and the ratio."""
    inputs = _closed(closure, states)
    values = np.empty((3, len(closure.linkage.joints), states))
    rates, accelerations = [RATE] * len(inputs), [ACCELERATION] * len(inputs)
    out = closure.solve(*inputs, rates=rates, accelerations=accelerations)
    in_c = _compiled(folder, closure, file)
    if in_c(inputs, values) or out.status.any():
        raise BenchError(f'{file.stem}: not all states are closed')
    for one, other in zip(out[1:], values, strict=True):
        _agree(file.stem, one, other)
    found = in_turn(
        {
            'solve': lambda: closure.solve(
                *inputs, rates=rates, accelerations=accelerations, out=out
            ),
            'C': lambda: in_c(inputs, values),
        },
        rounds,
    )
    ours, theirs = ([1e-6 * states / s for s in found[name]] for name in ('solve', 'C'))
    return spread(ours, 1), spread(theirs, 1), spread(ratios(ours, theirs), 2)


def _closed(closure: Closure, count: int) -> Array:
    """Return inputs, (inputs, count), at which a linkage is closed, in no order."""
    rng = np.random.default_rng(5)
    low, high = input_bounds(closure)
    found = np.empty((len(closure.linkage.inputs), 0))
    while found.shape[1] < count:
        drawn = rng.uniform(low, high, (len(found), count))
        closed = closure.solve(*drawn, derivatives=0).status == 0
        found = np.concatenate((found, drawn[:, closed]), axis=1)
    return np.ascontiguousarray(found[:, :count])


def _compiled(folder: Path, closure: Closure, file: Path) -> _Solve:
    """Return the emitted C of a linkage, in a loop over states."""
    name, joints = file.stem, tuple(closure.linkage.joints)
    driven = len(closure.linkage.inputs)
    header = source(Subject(closure, name, file.name, 2, joints), C(name, header=True))
    (folder / f'{name}.h').write_text(header, encoding='utf-8')
    loop, library = folder / f'{name}.c', folder / f'{name}.so'
    loop.write_text(_LOOP.format(name=name, inputs=driven, joints=len(joints)), encoding='utf-8')
    done = subprocess.run(
        ['cc', *_FLAGS, '-o', str(library), str(loop), '-lm'],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise BenchError(f'cc: {done.stderr.strip().splitlines()[-1]}')
    function = ctypes.CDLL(str(library)).solve_all
    array = np.ctypeslib.ndpointer(np.float64, flags='C_CONTIGUOUS')
    function.argtypes = [ctypes.c_long, array, array, array, array]
    function.restype = ctypes.c_long
    rates, accelerations = np.full(driven, RATE), np.full(driven, ACCELERATION)

    def solve(inputs: Array, values: Array) -> int:
        odd: int = function(inputs.shape[1], inputs, rates, accelerations, values)
        return odd

    return solve


def _agree(name: str, one: Array, other: Array) -> None:
    """Refuse results that differ by more than rounding and whole turns."""
    off = np.abs(np.remainder(one - other + 1.0, 2.0 * np.pi) - 1.0) / (1.0 + np.abs(other))
    if not off.max() < _AGREEMENT:
        raise BenchError(f'{name}: solve and C differ by {off.max():.2g}')
