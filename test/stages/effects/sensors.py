# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Set-up of the tests of sensors: two linkages, readings by hand, scenes, and statistics."""

from linkage_ros.messages import JointStateWriter
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects import SensorReading
from mpmath import gammainc

from ...support.scenes import closure_of, FOUR_BAR, pipeline_of, SLIDER_CRANK

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
ANGLES = closure_of(FOUR_BAR)
"""Publishes coupler_joint and rocker_joint, both angles."""
SLIDE = closure_of(SLIDER_CRANK)
"""Publishes rod_joint, an angle, and rod_slide, a slide."""


def context(loop=ANGLES, seed='seed'):
    return Context(loop, 1000.0, True, seed, None, None)


def reading(now, *joints, rates=(), accelerations=(), efforts=()):
    return SensorReading(now, joints, rates, accelerations, efforts)


def published(effects, ticks=100, seed=0, rate=10.0):
    """Return what is read in a four-bar's scene, at each ms; the crank turns, in [rad/s]."""
    pipeline = pipeline_of(f'seed: {seed}\neffects: {{velocity: {{}}, {effects}}}')
    crank = JointStateWriter(['crank_joint']).write(BEGIN, [0.5], [rate], [])
    assert pipeline.offer(crank, BEGIN) is None
    return [pipeline.tick(BEGIN + i * MS).states[0].reading for i in range(ticks)]


def chi_square(total, n):
    """Return the chance that n squares of standard normal numbers have a sum below a total."""
    return float(gammainc(n / 2, 0, total / 2, regularized=True))


UNLIKELY = 1e-4
"""
Chance, on either side, beyond which a statistic is not what it should be: of true claims one in
5000 fails with the seed that was written down first, and then every time.
"""


def likely(total, n):
    """Whether a sum of n squares of what should be standard normal numbers is as it should be."""
    return UNLIKELY < chi_square(total, n) < 1.0 - UNLIKELY
