# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Speed of compiled linkages: shipped linkages against plain steps, chains of dyads, and arrays.

Many states of each shipped linkage are solved by `solve` and by the generated C code with full
optimisation. Both come from the same tape.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import ctypes
from itertools import islice
from pathlib import Path
import random
import shutil
import subprocess
import time

from bench import ROOT
from bench.processes import MeasurementError
from bench.report import in_turn, ratios, say, spread, Table
from linkage_ros.description import load, parse_yaml, read_linkage
from linkage_ros.kinematics import Array, Closure, is_iterated
from linkage_ros.kinematics.compiling import Compiled
from linkage_ros.tools.models.source_code import C, Subject, write_source
import numpy as np

RATE, ACCELERATION = 3.0, 0.5
_DYADS = (1, 2, 4, 8, 16, 32)
_ITERATED_STATES = 50
"""An iterated state takes a hundred times as long."""

Numbers = tuple[float, ...]


def measure_gallery(rounds: int, states: int) -> Table:
    """Return the time of a state for each shipped linkage, compiled and in plain steps."""
    table = Table(
        'shipped linkages with rates and accelerations, µs a state; one run, in turn',
        ('', 'compiled', 'plain steps', 'ratio', 'target', 'compiling, ms', 'target'),
    )
    for file in sorted((ROOT / 'config' / 'linkages').glob('*.yaml')):
        closure = load(file)
        slow = is_iterated(closure)
        count = min(states, _ITERATED_STATES) if slow else states
        inputs = list(islice(_closed_states(closure), count))
        begun = time.perf_counter()
        compiled = Compiled(closure, 2)
        took = 1e3 * (time.perf_counter() - begun)
        found = in_turn(
            {
                'compiled': _over(compiled.fast, inputs),
                'plain': _over(compiled.run_interpreted, inputs),
            },
            rounds,
        )
        fast, plain = ([1e6 * s / count for s in found[name]] for name in ('compiled', 'plain'))
        table.rows.append(
            (
                file.stem,
                spread(fast, 2),
                spread(plain, 1),
                spread(ratios(fast, plain), 2),
                '≤ 0.6' if slow else '≤ 0.3',
                f'{took:.1f}',
                '≤ 50',
            )
        )
    return table


def measure_chains(rounds: int, states: int, picture: Path | None = None) -> Table:
    """Return the time of chains of four-bars over their number of dyads, and draw it."""
    table = Table(
        'chains of crank-rockers with rates and accelerations; one run, in turn',
        ('dyads', 'µs a state', 'µs a state and dyad', 'compiling, ms'),
    )
    contenders: dict[str, Callable[[], object]] = {}
    compiling = {}
    for dyads in _DYADS:
        closure = Closure(read_linkage(parse_yaml(chain_of(dyads).encode(), 'chain')))
        begun = time.perf_counter()
        compiled = Compiled(closure, 2)
        compiling[str(dyads)] = 1e3 * (time.perf_counter() - begun)
        inputs = list(islice(_closed_states(closure), max(1, states // dyads)))
        contenders[str(dyads)] = _over(compiled.fast, inputs)
    found = {}
    for name, seconds in in_turn(contenders, rounds).items():
        states_of = max(1, states // int(name))
        found[int(name)] = [1e6 * s / states_of for s in seconds]
        each = [value / int(name) for value in found[int(name)]]
        cells = spread(found[int(name)], 2), spread(each, 2), f'{compiling[name]:.1f}'
        table.rows.append((name, *cells))
    if picture is not None:
        _draw(found, picture)
    return table


def chain_of(dyads: int) -> str:
    """Return the linkage file of a chain of crank-rockers; each drives the next by its rocker."""
    ground = ', '.join(f'O{i}: [{0.1 * i:g}, 0]' for i in range(dyads + 1))
    cranks = ['{O0: [0, 0], A0: [0.04, 0]}']
    for i in range(1, dyads + 1):
        following = f', A{i}: [0.04, 0.01]' if i < dyads else ''
        cranks.append(f'{{O{i}: [0, 0], B{i - 1}: [0.08, 0]{following}}}')
    return '\n'.join(
        [
            f'links:\n  ground: {{{ground}}}',
            *(f'  crank{i}: {crank}' for i, crank in enumerate(cranks)),
            *(f'  coupler{i}: {{A{i}: [0, 0], B{i}: [0.12, 0]}}' for i in range(dyads)),
            'input: {joint: crank_joint, parent: ground, child: crank0}',
            f'assembly: {{{", ".join(f"B{i}: left" for i in range(dyads))}}}',
            'joints:',
            *(f'  joint{i}: {{parent: ground, child: crank{i + 1}}}' for i in range(dyads)),
            '',
        ]
    )


def _closed_states(closure: Closure) -> Iterator[Numbers]:
    """Yield closed states over the whole range, with rates and accelerations."""
    rng = random.Random(5)
    driven = len(closure.linkage.inputs)
    low, high = input_bounds(closure)
    while True:
        inputs = tuple(rng.uniform(low, high) for _ in range(driven))
        if closure.position(*inputs).joints:
            yield (*inputs, *[RATE] * driven, *[ACCELERATION] * driven)


def input_bounds(closure: Closure) -> tuple[float, float]:
    """Return the range of each input of a linkage, in [rad] or [m]."""
    ranges = closure.input_ranges if len(closure.linkage.inputs) == 1 else ()
    low = min((each.lowest for each in ranges), default=-3.0)
    return low, max((each.highest for each in ranges), default=3.0)


def _over(call: Callable[..., object], states: Sequence[Numbers]) -> Callable[[], None]:
    def run() -> None:
        for numbers in states:
            call(*numbers)

    return run


def _draw(found: dict[int, list[float]], picture: Path) -> None:
    try:
        from matplotlib.figure import Figure
    except ImportError:
        say('  matplotlib is not installed: no picture')
        return
    dyads = list(found)
    least = [min(times) for times in found.values()]
    figure = Figure(figsize=(6.0, 3.6), layout='constrained')
    axes = figure.subplots()
    axes.plot(dyads, least, 'o-', color='#1f4e79')
    axes.set(xlim=(0, None), ylim=(0, None), xlabel='dyads', ylabel='µs a state')
    axes.set_title('Chains of crank-rockers, compiled, with rates and accelerations', loc='left')
    axes.grid(alpha=0.3)
    figure.savefig(picture, metadata={'Date': None, 'Creator': 'linkage_ros'})


# Without errno a square root is one instruction. No flag may change more than the last digit.
_FLAGS = ('-O3', '-march=native', '-fno-math-errno', '-shared', '-fPIC')

_AGREEMENT = 1e-9
"""Maximum difference between the results of both; more means that one is wrong."""

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
"""Takes inputs, (inputs, N), and fills values, rates and accelerations, (3, joints, N)."""


def measure_arrays(folder: Path, rounds: int, states: int) -> Table:
    """Return the closed states per second, with rates and accelerations, for `solve` and C."""
    table = Table(
        f'{states:,} states at once, with rates and accelerations, million a second; one run, '
        'in turn',
        ('', 'solve', 'generated C, -O3', 'ratio', 'target'),
    )
    if shutil.which('cc') is None:
        say('  no C compiler (cc): left out')
        return table
    for file in sorted((ROOT / 'config' / 'linkages').glob('*.yaml')):
        closure = load(file)
        if not is_iterated(closure):
            target = '≥ 0.9' if file.stem == 'four_bar' else '≥ 0.5'
            cells = _measured(folder, closure, file, rounds, states)
            table.rows.append((file.stem, *cells, target))
    return table


def _measured(
    folder: Path, closure: Closure, file: Path, rounds: int, states: int
) -> tuple[str, str, str]:
    """Return the states per second of both, and the ratio."""
    inputs = _closed(closure, states)
    values = np.empty((3, len(closure.linkage.joints), states))
    rates, accelerations = [RATE] * len(inputs), [ACCELERATION] * len(inputs)
    out = closure.solve(*inputs, rates=rates, accelerations=accelerations)
    c_code = in_c(folder, closure, file)
    if c_code(inputs, values) or out.status.any():
        raise MeasurementError(f'{file.stem}: not all states are closed')
    for one, other in zip(out[1:], values, strict=True):
        _agree(file.stem, one, other)
    found = in_turn(
        {
            'solve': lambda: closure.solve(
                *inputs, rates=rates, accelerations=accelerations, out=out
            ),
            'C': lambda: c_code(inputs, values),
        },
        rounds,
    )
    ours, theirs = ([1e-6 * states / s for s in found[name]] for name in ('solve', 'C'))
    return spread(ours, 1), spread(theirs, 1), spread(ratios(ours, theirs), 2)


def _closed(closure: Closure, count: int) -> Array:
    """Return inputs, (inputs, count), at which a linkage closes, in random order."""
    rng = np.random.default_rng(5)
    low, high = input_bounds(closure)
    found = np.empty((len(closure.linkage.inputs), 0))
    while found.shape[1] < count:
        drawn = rng.uniform(low, high, (len(found), count))
        closed = closure.solve(*drawn, derivatives=0).status == 0
        found = np.concatenate((found, drawn[:, closed]), axis=1)
    return np.ascontiguousarray(found[:, :count])


def in_c(folder: Path, closure: Closure, file: Path) -> _Solve:
    """Return the generated C code of a linkage, in a loop over states."""
    name, joints = file.stem, tuple(closure.linkage.joints)
    driven = len(closure.linkage.inputs)
    header = write_source(Subject(closure, name, file.name, 2, joints), C(name, header=True))
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
        raise MeasurementError(f'cc: {done.stderr.strip().splitlines()[-1]}')
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
    """Raise if results differ by more than rounding and full turns."""
    off = np.abs(np.remainder(one - other + 1.0, 2.0 * np.pi) - 1.0) / (1.0 + np.abs(other))
    if not off.max() < _AGREEMENT:
        raise MeasurementError(f'{name}: solve and C differ by {off.max():.2g}')
