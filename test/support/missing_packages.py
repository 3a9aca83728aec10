# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Packages that `colcon test` on a robot runs without: tests that need one skip themselves."""

from importlib.util import find_spec
import re

WITHOUT_KEY = {
    'aiohttp', 'argcomplete', 'casadi', 'dask', 'distributed', 'ezdxf', 'flint', 'fmpy', 'jax',
    'matplotlib', 'mpmath', 'mujoco', 'numba', 'PIL', 'plotly', 'pyarrow', 'pylinkage',
    'pythonfmu3', 'rich', 'rosbags', 'ruamel', 'scipy', 'torch', 'yourdfpy', 'zstandard',
}  # fmt: skip
"""Packages without a rosdep key, or too large for a robot, by the names of their imports."""

_SAID = re.compile(r"No module named '(\w+)|\b(\w+): is not installed; pip install")


def missing_package(text: str) -> str:
    """Return a package that is not installed here and for that missed in a text; '' for none."""
    for said in _SAID.finditer(text):
        package = said[1] or said[2]
        if package in WITHOUT_KEY and find_spec(package) is None:
            return package
    return ''
