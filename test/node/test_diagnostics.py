# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What diagnostics say of a run, by a clock that a test sets, and without a graph."""

from linkage_ros.description import parse_scene
from linkage_ros.messages import JointStateWriter
from linkage_ros.tick import Pipeline, TickLoop
import pytest

from .observed import BEGIN, observe, status_of
from ..support.scenes import FOUR_BAR

CRANKS = JointStateWriter(['left_crank_joint', 'right_crank_joint'])


@pytest.mark.parametrize(
    ('residuals', 'said'),
    [((2e-9, 3e-12), '2e-09 (left)'), ((3e-12, 2e-9), '2e-09 (right)')],
)
def test_diagnostics_name_the_linkage_of_the_worst_residual(residuals, said, monkeypatch):
    text = 'linkages: [{name: left, linkage: l.yaml}, {name: right, linkage: r.yaml}]\n'
    files = {'scene.yaml': text, 'l.yaml': FOUR_BAR, 'r.yaml': FOUR_BAR}
    scene = parse_scene('s', 's', {name: content.encode() for name, content in files.items()})
    messages = [(CRANKS.write(BEGIN, [0.5, 0.7], [1.0, 1.0]), {'source_timestamp': 0})]
    loop = TickLoop(
        lambda: Pipeline(scene), lambda: messages.pop() if messages else None, lambda _: None
    )
    loop.tick_at(BEGIN)
    for closure, residual in zip(loop.pipeline.closures, residuals, strict=True):
        monkeypatch.setattr(closure, 'residual', lambda _, found=residual: found, raising=False)
    _, values = status_of(observe(loop), 'loop closure')
    assert values['Residual (m)'] == said
