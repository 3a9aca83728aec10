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

"""A library that only some kinds of synthesis need is named, with what installs it."""

from __future__ import annotations

from collections.abc import Callable
import sys

from linkage_ros.errors import LinkageError
from linkage_ros.synthesis.extras import distributed, scipy_optimize
import pytest


@pytest.mark.parametrize(
    ('library', 'asked', 'extra'),
    [('scipy', scipy_optimize, 'design'), ('distributed', distributed, 'dask')],
)
def test_what_is_missing_is_told_with_what_installs_it(
    library: str, asked: Callable[[], object], extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # None stands for a module that is not there.
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.delitem(sys.modules, 'scipy.optimize', raising=False)
    with pytest.raises(LinkageError) as caught:
        asked()
    assert str(caught.value) == f"{library}: is not installed; pip install 'linkage_ros[{extra}]'"


def test_what_is_there_is_returned() -> None:
    optimize = pytest.importorskip('scipy.optimize')
    assert scipy_optimize() is optimize
