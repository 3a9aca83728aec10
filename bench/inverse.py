# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Speed of the inverse: the crank for a value of a joint, against the compiled position."""

from __future__ import annotations

from collections.abc import Callable
import time

from bench.report import in_turn, ratios, spread, Table
from linkage_ros.description import load
from linkage_ros.resources import named_file

INVERTED = (
    ('four_bar', 'rocker_joint'),
    ('four_bar', 'coupler_joint'),
    ('jansen_leg', 'leg_joint'),
    ('slider_crank', 'piston_slide'),
    ('double_rocker', 'right_rocker_joint'),
)


def measure_inverse(rounds: int, states: int) -> Table:
    """Return the time of a crank, and that of making the branches, for some joints."""
    table = Table(
        "cranks of a joint's value, µs; one run, in turn",
        ('', 'a crank', 'compiled, with rates', 'ratio', 'target', 'branches, ms', 'target'),
    )
    for name, joint in INVERTED:
        closure = load(named_file(name, 'linkages'))
        fast = closure.compile_linkage(1).fast
        begun = time.perf_counter()
        branch = closure.branches(joint)[0]
        took = 1e3 * (time.perf_counter() - begun)
        height = branch.high - branch.low
        values = [branch.low + height * (i + 0.5) / states for i in range(states)]
        cranks = [branch.find_crank(value)[0] for value in values]

        def find(
            find: Callable[..., object] = branch.find_crank, values: list[float] = values
        ) -> None:
            for value in values:
                find(value)

        def solve(fast: Callable[..., object] = fast, cranks: list[float] = cranks) -> None:
            for crank in cranks:
                fast(crank, 1.0)

        found = in_turn({'crank': find, 'compiled': solve}, rounds)
        inverse, forward = ([1e6 * s / states for s in found[one]] for one in found)
        table.rows.append(
            (
                f'{name} {joint}',
                spread(inverse, 2),
                spread(forward, 2),
                spread(ratios(inverse, forward), 2),
                '≤ 4',
                f'{took:.0f}',
                '≤ 100',
            )
        )
    return table
