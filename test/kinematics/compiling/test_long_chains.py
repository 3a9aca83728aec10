# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The work of the first solution of many states grows like the number of dyads."""

from __future__ import annotations

from linkage_ros.kinematics import Closure, Input, Linkage, RevoluteJoint
from linkage_ros.kinematics.compiling import Tape
import numpy as np
import pytest


def chain(count):
    """Return four-bars in a row; each rocker is the crank of the next."""
    links = {'ground': {'O': (0.0, 0.0)}, 'crank': {'O': (0.0, 0.0), 'A0': (1.0, 0.0)}}
    for i in range(count):
        links['ground'][f'D{i}'] = (4.0 * (i + 1), 0.0)
        links[f'coupler_{i}'] = {f'A{i}': (0.0, 0.0), f'B{i}': (4.0, 0.0)}
        links[f'rocker_{i}'] = {f'D{i}': (0.0, 0.0), f'B{i}': (2.0, 0.0), f'A{i + 1}': (0.0, 1.0)}
    return Closure(
        Linkage(
            links,
            (Input('crank_joint', 'ground', 'crank'),),
            {f'B{i}': 'left' for i in range(count)},
            {f'rocker_{i}_joint': RevoluteJoint('ground', f'rocker_{i}') for i in range(count)},
            {},
        )
    )


def operations(count, monkeypatch):
    """Return how many operations are put on tapes before the first solution."""
    written, write = [0], Tape.write

    def counted(tape, *arguments):
        written[0] += 1
        return write(tape, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(Tape, 'write', counted)
        chain(count).solve([1.0])
    return written[0]


def test_compile_time_grows_linearly_with_the_dyads(monkeypatch):
    few, more, many = (operations(count, monkeypatch) for count in (8, 16, 32))
    assert many - more == pytest.approx(2 * (more - few), rel=0.05)


def test_batch_of_a_long_chain_equals_single_states():
    closure = chain(12)
    inputs = np.linspace(0.0, 6.0, 40)
    many = closure.solve(inputs)
    for k, x in enumerate(inputs.tolist()):
        position = closure.position(x)
        velocity = closure.velocity(position, 1.0)
        np.testing.assert_allclose(many.positions[:, k], position.joints, atol=1e-12)
        np.testing.assert_allclose(many.velocities[:, k], velocity.joints, rtol=1e-9, atol=1e-12)
