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


"""A four-bar in C, as fast as a compiler makes it: what the batch in numpy is measured against."""

from __future__ import annotations

from collections.abc import Callable
import ctypes
from pathlib import Path
import shutil
import subprocess

from bench.processes import BenchError
import numpy as np
from numpy.typing import NDArray

SOURCE = Path(__file__).with_name('kinematics_four_bar.c')

# Without errno a square root is one instruction. Nothing here may change a result by more than
# the last digit.
FLAGS = ('-O3', '-march=native', '-fno-math-errno', '-shared', '-fPIC')

Array = NDArray[np.float64]
Solve = Callable[[Array, float, float, Array, Array, Array], int]
"""Takes φ, rate and acceleration of the crank, and where the results go."""


def compiler() -> str | None:
    """Return the path of the C compiler, if there is one."""
    return shutil.which('cc')


def compiled(folder: Path, constants: tuple[float, ...]) -> Solve:
    """
    Compile and load it.

    Parameters
    ----------
    folder
        Where the library goes.
    constants
        As the source says.

    """
    library = folder / 'kinematics_four_bar.so'
    done = subprocess.run(
        [compiler() or 'cc', *FLAGS, '-o', str(library), str(SOURCE), '-lm'],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise BenchError(f'cc: {done.stderr.strip().splitlines()[-1]}')
    function = ctypes.CDLL(str(library)).four_bar
    vector = np.ctypeslib.ndpointer(np.float64, flags='C_CONTIGUOUS')
    real = ctypes.c_double
    function.argtypes = [vector, ctypes.c_long, vector, real, real, vector, vector, vector]
    function.restype = ctypes.c_long
    numbers = np.array(constants)

    def solve(
        phi: Array,
        rate: float,
        acceleration: float,
        position: Array,
        velocity: Array,
        accelerations: Array,
    ) -> int:
        odd: int = function(
            numbers, phi.size, phi, rate, acceleration, position, velocity, accelerations
        )
        return odd

    return solve
