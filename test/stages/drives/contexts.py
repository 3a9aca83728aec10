# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Contexts for drives in tests: linkages of one input and of two, and a scene."""

from linkage_ros.stages.drives import Context
from linkage_ros.tick import Pipeline

from ...support.scenes import closure_of, FIVE_BAR, FOUR_BAR, pipeline_of


def _context(linkage: str, *, needs_rate: bool) -> Context:
    return Context(closure_of(linkage), 1000.0, needs_rate, 'seed', None, None)


def one_input(*, needs_rate: bool = True) -> Context:
    """Return a four-bar's: its input is ``crank_joint``."""
    return _context(FOUR_BAR, needs_rate=needs_rate)


def two_inputs(*, needs_rate: bool = True) -> Context:
    """Return a five-bar's: its inputs are ``left_crank`` and ``right_crank``."""
    return _context(FIVE_BAR, needs_rate=needs_rate)


def pipeline(drive: str) -> Pipeline:
    """Return a four-bar's, of a scene with rates and this drive, as a scene file says it."""
    return pipeline_of(f'effects: {{velocity: {{}}}}\ndrive: {{{drive}}}\n')


def readings(built: Pipeline, *times: int) -> list[tuple[float, float]]:
    """Return value and rate of the input, which is published first, at times in [ns]."""
    found = []
    for time in times:
        reading = built.tick(time).states[0].reading
        assert reading is not None
        found.append((reading.joints[0], reading.rates[0]))
    return found
