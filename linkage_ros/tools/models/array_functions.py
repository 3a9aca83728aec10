# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A linkage as functions of arrays, from the text that `linkage compile --arrays` writes."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from importlib import import_module
from typing import Any, NamedTuple

from linkage_ros.errors import check_installed
from linkage_ros.kinematics import Closure
from linkage_ros.tools.models.source_code import FUNCTIONS, STATUSES, Subject, write_arrays
import numpy as np

_NAMESPACES = {
    'numpy': 'array_api_compat.numpy',
    'torch': 'array_api_compat.torch',
    'jax': 'jax.numpy',
}
"""The module with the functions of the array API, by package."""


class ArrayFunctions(NamedTuple):
    """
    A linkage as pure functions of arrays of PyTorch or JAX.

    Arrays have the numbers of a state along their last axis, and any axes of states before it. All
    functions are differentiable in PyTorch and JAX, and work under ``torch.compile``, ``jax.jit``
    and ``jax.vmap``. Where a state has no values, results are NaN and gradients 0.

    Attributes
    ----------
    position
        From inputs (..., inputs), in [rad] or [m], to status (...) and joints (..., joints).
    velocity
        From inputs and rates to status, joints and their rates.
    motion
        From inputs, rates and accelerations to status, joints, their rates and accelerations.
    jacobian
        From inputs to the derivatives of the joints by them (..., joints, inputs).
    statuses
        Names of the statuses, by their numbers; the first three have values.
    source
        The functions as text: the module that ``linkage compile --arrays`` writes.

    """

    position: Callable[..., Any]
    velocity: Callable[..., Any]
    motion: Callable[..., Any]
    jacobian: Callable[..., Any]
    statuses: tuple[str, ...]
    source: str


def make_array_functions(closure: Closure, package: str) -> ArrayFunctions:
    """
    Return a linkage as functions of arrays of ``numpy``, ``torch`` or ``jax``.

    Raises
    ------
    DefinitionError
        If the linkage cannot be compiled.
    LinkageError
        If a package is not installed.

    """
    for needed in ('array_api_compat', package):
        check_installed(needed, "pip install 'linkage_ros[arrays]'")
    name = closure.name or 'linkage'
    subject: Any = closure
    source = write_arrays(Subject(subject, name, name, 2, closure.joint_names))
    made: dict[str, Any] = {}
    exec(compile(source, f'<{name} for arrays>', 'exec'), made)
    # A compiler follows calls: the library is known here, and tables need not be lists.
    xp = import_module(_NAMESPACES[package])
    made['array_namespace'] = lambda _: xp
    if package == 'torch':
        made['device'] = lambda array: array.device
    for table in [key for key in made if key.endswith(('_columns', '_ends'))]:
        numbers = np.array(made[table])
        made[table] = xp.asarray(numbers) if package == 'torch' else numbers
    functions = [made[function] for function in (*FUNCTIONS, 'jacobian')]
    if package == 'jax':
        # It takes arrays of NumPy too, but may compute in another precision than theirs, and the
        # precision decides what is exact enough.
        functions = [_converting(function, xp.asarray) for function in functions]
    position, velocity, motion, jacobian = functions
    return ArrayFunctions(position, velocity, motion, jacobian, tuple(STATUSES), source)


def _converting(function: Callable[..., Any], convert: Callable[[Any], Any]) -> Callable[..., Any]:
    """Return a function that converts its arrays first."""

    @wraps(function)
    def convert_first(*arrays: Any) -> Any:
        return function(*map(convert, arrays))

    return convert_first
