# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Sources of linkages, built and run over many states, beside what the plain steps say."""

from array import array
from collections.abc import Sequence
import ctypes
from math import inf, isnan, nan, nextafter, pi, tau
import os
from pathlib import Path
import random
import shutil
import subprocess
from tempfile import mkdtemp
from typing import NamedTuple

from linkage_ros.kinematics import Closure
from linkage_ros.kinematics.compiling import motion_at
from linkage_ros.tools.models.source_code import C, FUNCTIONS, STATUSES, Subject, write_source
import pytest

from ...support.sampling import sample_count

COMPILERS = {'C99': ('cc', '-x', 'c', '-std=c99'), 'C++': ('c++', '-x', 'c++', '-std=c++11')}

needs = {
    name: pytest.mark.skipif(shutil.which(command) is None, reason=f'needs {command}')
    for name, (command, *_) in {**COMPILERS, 'JavaScript': ('node',)}.items()
}
STRICT = ('-Wall', '-Wextra', '-Wpedantic', '-Werror', '-ffp-contract=off')
NUMBERS = list(STATUSES)
COUNT = int(os.environ.get('LINKAGE_STATES') or sample_count(400, 150))
"""States of each linkage; `make compiled` takes 100,000."""

State = tuple[float, ...]
"""The inputs, their rates and their accelerations, one after the other."""


class Told(NamedTuple):
    """What is said of a state: the name of a status, and all values; none where there are none."""

    status: str
    values: tuple[float, ...]

    def __eq__(self, other: object) -> bool:
        """Compare bit by bit: 0.0 and −0.0 differ."""
        return repr(self) == repr(other)

    __hash__ = None  # type: ignore[assignment]


def subject(closure: Closure, derivatives: int = 2, joints: Sequence[str] = ()) -> Subject:
    """Return a linkage with all its joints, if none are named."""
    names = tuple(joints or closure.linkage.joints)
    return Subject(closure, 'linkage', 'linkage.yaml', derivatives, names)


def states(closure: Closure, count: int, seed: str, start: State = ()) -> list[State]:
    """Return states over a range and beyond, at its limits, and near the start."""
    rng = random.Random(seed)
    near = start or (closure.linkage.pose.inputs if closure.linkage.pose else ())
    spans, special = [], []
    for given in closure.linkage.inputs:
        low, high = (-4.0 * closure.scale, 4.0 * closure.scale) if given.slider else (-pi, tau)
        spans.append((max(low, given.limits.low - 0.1), min(high, given.limits.high + 0.1)))
    if len(spans) == 1:
        for each in closure.closing_ranges:
            special += [each.lowest, each.highest]
        special += [critical.value for critical in closure.singular_inputs]
        special += [0.0, -0.0, pi, -pi, 1e5, -1e9, nan, inf, -inf]
        ranges = [(each.lowest, each.highest) for each in closure.closing_ranges]
        spans += ranges * 3
    found = []
    for index in range(count):
        if near and index % 3 == 0:
            at = [value + rng.gauss(0.0, 0.2) * (rng.random() < 0.9) for value in near]
        elif special and index % 16 == 1:
            value = rng.choice(special)
            at = [value + rng.randrange(-20, 21) * (nextafter(value, inf) - value)]
        elif len(closure.linkage.inputs) == 1:
            at = [rng.uniform(*rng.choice(spans))]
        else:
            at = [rng.uniform(*span) for span in spans]
        rates = [rng.uniform(-3.0, 3.0) for _ in range(2 * len(at))]
        if index % 8 == 5:
            # At rest and in steady motion the sign of a zero shows.
            rates = [rng.choice((0.0, -0.0, 1.0)) for _ in rates]
        found.append((*at, *rates))
    return found


def parts(numbers: Sequence[float], size: int) -> list[tuple[float, ...]]:
    """Return numbers in groups of a size."""
    return list(zip(*[iter(numbers)] * size, strict=True))


def plain(closure: Closure, state: State) -> Told:
    """Return what the plain steps say."""
    motion = motion_at(closure, parts(state, len(closure.linkage.inputs)))
    status = motion.position.status
    if not status.has_rates:
        return Told(status.name, ())
    groups = [part.joints for part in motion if part is not None]
    return Told(status.name, tuple(value for group in groups for value in group))


def run_c(what: Subject, given: Sequence[State], folder: Path, kind: str = 'C99') -> list[Told]:
    """Return what a linkage in C says of states, compiled as strictly as can be."""
    text = write_source(what, C(what.name, header=False))
    n, joints = len(what.closure.linkage.inputs), len(what.joints)
    groups = 1 + what.derivatives
    arguments = [f'given + {n * i}' for i in range(groups)]
    arguments += [f'values + {joints * i}' for i in range(groups)]
    loop = f"""
#ifdef __cplusplus
extern "C"
#endif
void run(long count, const double *given, int *statuses, double *values);
void run(long count, const double *given, int *statuses, double *values)
{{
    for (long i = 0; i < count; ++i) {{
        statuses[i] = {what.name}_{FUNCTIONS[what.derivatives]}({', '.join(arguments)});
        given += {n * groups};
        values += {joints * groups};
    }}
}}
"""
    # A library that is loaded must not be written over.
    own = Path(mkdtemp(dir=folder))
    file, library = own / 'linkage.c', own / 'linkage.so'
    file.write_text(text + loop)
    build([*COMPILERS[kind], '-O2', '-shared', '-fPIC'], file, library)
    taken = array('d', (number for state in given for number in state[: n * groups]))
    statuses = array('i', [-1]) * len(given)
    values = array('d', [nan]) * (len(given) * joints * groups)
    places = (ctypes.c_void_p(each.buffer_info()[0]) for each in (taken, statuses, values))
    ctypes.CDLL(str(library)).run(ctypes.c_long(len(given)), *places)
    return [
        # What was not written is still NaN.
        Told(NUMBERS[status], tuple(value for value in found if not isnan(value)))
        for status, found in zip(statuses, parts(values, joints * groups), strict=True)
    ]


def build(command: Sequence[str], file: Path, output: Path) -> None:
    """Compile a file; no warning is let pass."""
    typed = [*command, *STRICT, str(file), '-o', str(output), '-lm']
    done = subprocess.run(typed, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
