# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Arrays of states: the module for arrays beside `solve`, C, and what users write themselves.

That is Newton's method on the equations of the loops, batched by JAX, with derivatives by JAX. It
starts 0.1 rad beside the solution and ends when no equation is off by more than 1e-12. JAX runs
the module as a whole, and in blocks that stay in the caches, without fusion of operations.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
import shutil
from typing import Any

from bench import ROOT
from bench.compiled import ACCELERATION, in_c, RATE
from bench.processes import MeasurementError
from bench.report import in_turn, ratios, say, spread, Table
from linkage_ros.description import load
from linkage_ros.kinematics import Array, is_iterated
from linkage_ros.tools.models import make_array_functions
import numpy as np

_LINKAGES = {'four_bar': '', 'space/ankle': '', 'space/ankle_motors': '≥ 20'}
"""The linkages, and how many times as fast as Newton's method they have to be."""
_REACH = 0.2
_BESIDE = 0.1
_ACCURATE = 1e-12
_BLOCK = 1000
_SLOW = 100
"""What `solve` solves state by state takes so many times as long: it gets fewer states."""


def measure_modules(folder: Path, rounds: int, states: int) -> Table:
    """Return the states per second, of all contenders in turn."""
    table = Table(
        f'{states:,} states at once in double precision, million a second; one run, in turn',
        ('', 'with rates and accelerations', 'positions', "of Newton's method", 'target'),
    )
    if not all(map(find_spec, ('array_api_compat', 'jax'))):
        say('  jax or array_api_compat is not installed: left out')
        return table
    import jax  # local import: an extra

    jax.config.update('jax_enable_x64', True)
    for name, target in _LINKAGES.items():
        _add_rows(table, folder, name, target, (rounds, states))
    return table


def _add_rows(table: Table, folder: Path, name: str, target: str, amount: tuple[int, int]) -> None:
    """Measure a linkage, and add a row for each contender."""
    import jax  # local import: an extra

    rounds, states = amount
    file = ROOT / 'config' / 'linkages' / f'{name}.yaml'
    closure: Any = load(file)
    start = np.array(closure.linkage.pose.inputs if closure.linkage.pose else (1.0,))
    inputs = start + np.random.default_rng(5).uniform(-_REACH, _REACH, (states, len(start)))
    given = (inputs, np.full_like(inputs, RATE), np.full_like(inputs, ACCELERATION))
    contenders: dict[str, Callable[[], Any]] = {}
    for library in ('numpy', 'torch', 'jax'):
        if find_spec(library) is None:
            continue
        functions = make_array_functions(closure, library)
        arrays, motion, position = given, functions.motion, functions.position
        if library == 'torch':
            import torch  # local import: an extra

            arrays = tuple(map(torch.tensor, given))
        elif library == 'jax':
            arrays = tuple(map(jax.numpy.asarray, given))
            blocks = tuple(each.reshape(-1, _BLOCK, each.shape[1]) for each in arrays)
            contenders['jax in blocks'] = _call(_in_blocks(motion), *blocks)
            contenders['jax in blocks, positions'] = _call(_in_blocks(position), blocks[0])
            motion, position = jax.jit(motion), jax.jit(position)
        contenders[library] = _call(motion, *arrays)
        contenders[f'{library}, positions'] = _call(position, arrays[0])
    found = contenders['jax, positions']()
    if np.asarray(found[0]).any():
        raise MeasurementError(f'{name}: not all states are closed')
    newton = _newton(file.stem, np.asarray(found[1]), arrays[0])
    contenders['Newton, positions'] = newton
    if not np.abs(np.asarray(newton()[1]) - np.asarray(found[1])).max() < 1e-9:
        raise MeasurementError(f"{name}: Newton's method leads elsewhere")
    counts = dict.fromkeys(contenders, states)
    _add_others(contenders, counts, folder, file, inputs)
    speeds = {
        one: [1e-6 * counts[one] / seconds for seconds in times]
        for one, times in in_turn(contenders, rounds).items()
    }
    theirs = speeds['Newton, positions']
    for one in dict.fromkeys(each.removesuffix(', positions') for each in speeds):
        both = [speeds.get(one), speeds.get(f'{one}, positions')]
        cells = [spread(speed, 2) if speed else '–' for speed in both]
        over = spread(ratios(both[1], theirs), 1) if both[1] else '–'
        table.rows.append((f'{file.stem}: {one}', *cells, over, target if one == 'jax' else ''))


def _add_others(
    contenders: dict[str, Callable[[], Any]],
    counts: dict[str, int],
    folder: Path,
    file: Path,
    inputs: Array,
) -> None:
    """Add `solve`, and the C code where there is some."""
    closure: Any = load(file)
    count = len(inputs) // _SLOW if is_iterated(closure) else len(inputs)
    columns = np.ascontiguousarray(inputs[:count].T)
    rates, accelerations = [RATE] * len(columns), [ACCELERATION] * len(columns)
    contenders['solve'] = lambda: closure.solve(*columns, rates=rates, accelerations=accelerations)
    contenders['solve, positions'] = lambda: closure.solve(*columns, derivatives=0)
    counts |= {'solve': count, 'solve, positions': count}
    if shutil.which('cc') and not is_iterated(closure):
        solve = in_c(folder, closure, file)
        values = np.empty((3, len(closure.joint_names), count))
        contenders['C'] = lambda: solve(columns, values)
        counts['C'] = count


def _call(function: Callable[..., Any], *arrays: Any) -> Callable[[], Any]:
    """Return a call that lasts until the results are there."""

    def run() -> Any:
        results = function(*arrays)
        return [getattr(each, 'block_until_ready', lambda each=each: each)() for each in results]

    return run


def _in_blocks(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that takes blocks in turn, each operation by itself."""
    import jax  # local import: an extra

    return jax.jit(
        lambda *blocks: jax.lax.map(lambda block: function(*block), blocks),
        compiler_options={'xla_disable_hlo_passes': 'fusion'},
    )


def _newton(name: str, solution: Array, inputs: Any) -> Callable[[], Any]:
    """Return Newton's method on the equations of the loops, as plain JAX."""
    import jax  # local import: an extra

    numpy, residual = jax.numpy, _RESIDUALS[name]

    def step(unknowns: Any, given: Any) -> Any:
        slopes = jax.jacfwd(residual)(unknowns, given)
        return unknowns - numpy.linalg.solve(slopes, residual(unknowns, given))

    @jax.jit
    def solve(unknowns: Any, given: Any) -> Any:
        def is_off(unknowns: Any) -> Any:
            return abs(jax.vmap(residual)(unknowns, given)).max() > _ACCURATE

        found = jax.lax.while_loop(is_off, lambda x: jax.vmap(step)(x, given), unknowns)
        return given, found

    return _call(solve, numpy.asarray(solution) + _BESIDE, inputs)


def _four_bar(joints: Any, inputs: Any) -> Any:
    """Return what is open between crank, coupler and rocker, in [m]."""
    import jax.numpy as jnp  # local import: an extra

    (crank,), coupler, rocker = inputs, inputs[0] + joints[0], joints[1]
    along = 0.04 * jnp.cos(crank) + 0.12 * jnp.cos(coupler) - 0.08 * jnp.cos(rocker) - 0.1
    across = 0.04 * jnp.sin(crank) + 0.12 * jnp.sin(coupler) - 0.08 * jnp.sin(rocker)
    return jnp.stack([along, across])


def _ankle(motors: Any, foot: Any) -> Any:
    """Return by how much half the squares of both rods are off, in [m²]."""
    import jax.numpy as jnp  # local import: an extra

    (pitch, roll), found = foot, []
    points = ((0.035, 0.0165, 0.146, 0.150), (0.040, -0.0165, 0.211, 0.215))
    for motor, (x, y, z, axis), side in zip(motors, points, (0.015, -0.015), strict=True):
        c, s = jnp.cos(motor), jnp.sin(motor)
        bar = jnp.stack([x + 0.0 * c, c * y - s * (z - axis), axis + s * y + c * (z - axis)])
        c, s = jnp.cos(roll), jnp.sin(roll)
        across, below = c * side - s * 0.008, -0.018 + s * side + c * 0.008
        c, s = jnp.cos(pitch), jnp.sin(pitch)
        on_foot = jnp.stack([c * 0.022 + s * below, across, c * below - s * 0.022])
        length = (x - 0.022) ** 2 + (y - side) ** 2 + (z + 0.010) ** 2
        found.append(0.5 * (((bar - on_foot) ** 2).sum() - length))
    return jnp.stack(found)


_RESIDUALS: dict[str, Callable[[Any, Any], Any]] = {
    'four_bar': _four_bar,
    'ankle': _ankle,
    'ankle_motors': lambda foot, motors: _ankle(motors, foot),
}
