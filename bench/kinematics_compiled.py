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

"""Linkages in C as `linkage compile` writes them: what numpy in blocks is measured against."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import ctypes
from pathlib import Path
import shutil
import subprocess

from bench.processes import BenchError
from linkage_ros.kinematics.batch import Batch
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.compiled.c import C
from linkage_ros.kinematics.compiled.source import source, Subject
import numpy as np
from numpy.typing import NDArray

# Without errno a square root is one instruction. Nothing here may change a result by more than
# the last digit.
FLAGS = ('-O3', '-march=native', '-fno-math-errno', '-shared', '-fPIC')

Array = NDArray[np.float64]
Solve = Callable[[Sequence[Array], float, float, Batch], None]
"""Takes arrays of inputs, and the rate and the acceleration of all; fills a batch."""

_LOOP = """
#define N {inputs}
#define JOINTS {joints}

void solve(long count, const double *inputs, double rate, double acceleration,
           unsigned char *status, double *position, double *velocity, double *accelerations)
{{
    double rates[N], changes[N];
    for (int k = 0; k < N; ++k) {{
        rates[k] = rate;
        changes[k] = acceleration;
    }}
    for (long i = 0; i < count; ++i) {{
        double at[N], joints[JOINTS] = {{0}}, speeds[JOINTS] = {{0}}, bends[JOINTS] = {{0}};
        for (int k = 0; k < N; ++k) {{
            at[k] = inputs[k * count + i];
        }}
        status[i] = linkage_motion(at, rates, changes, joints, speeds, bends);
        for (int k = 0; k < JOINTS; ++k) {{
            position[k * count + i] = joints[k];
            velocity[k * count + i] = speeds[k];
            accelerations[k * count + i] = bends[k];
        }}
    }}
}}
"""


def compiler() -> str | None:
    """Return the path of the C compiler, if there is one."""
    return shutil.which('cc')


def compiled(folder: Path, name: str, closure: Closure) -> Solve:
    """
    Write, compile and load a linkage.

    Parameters
    ----------
    folder
        Where the source and the library go.
    name
        What they are called.
    closure
        The linkage.

    """
    joints = tuple(closure.linkage.joints)
    subject = Subject(closure, name, f'{name}.yaml', 2, joints)
    loop = _LOOP.format(inputs=len(closure.linkage.inputs), joints=len(joints))
    file, library = folder / f'{name}.c', folder / f'{name}.so'
    file.write_text(source(subject, C('linkage', header=True)) + loop)
    done = subprocess.run(
        [compiler() or 'cc', *FLAGS, '-o', str(library), str(file), '-lm'],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise BenchError(f'cc: {done.stderr.strip().splitlines()[-1]}')
    function = ctypes.CDLL(str(library)).solve
    vector = np.ctypeslib.ndpointer(np.float64, flags='C_CONTIGUOUS')
    statuses = np.ctypeslib.ndpointer(np.uint8, flags='C_CONTIGUOUS')
    real = ctypes.c_double
    function.argtypes = [ctypes.c_long, vector, real, real, statuses, vector, vector, vector]
    function.restype = None

    def solve(inputs: Sequence[Array], rate: float, acceleration: float, out: Batch) -> None:
        given = np.stack(inputs)
        function(given.shape[1], given, rate, acceleration, *out)

    return solve
