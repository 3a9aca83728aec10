# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
policy.xml against the graph that a node really has, for every scene that comes with the package.

What it leaves to the user stands in its comment: crank_commands in the place of crank_states, and
a service for each fault.
"""

from contextlib import ExitStack
from fnmatch import fnmatchcase
from pathlib import Path
import re
from xml.etree import ElementTree as ET

from linkage_ros.domains import held_domain
from linkage_ros.node import LinkageNode
import pytest
import rclpy
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter

ROOT = Path(__file__).parents[2]
SCENES = sorted((ROOT / 'config' / 'scenes').glob('*.yaml'))
NODE = 'linkage_node'
KINDS = {
    'publish': ('topics', 'get_publisher_names_and_types_by_node'),
    'subscribe': ('topics', 'get_subscriber_names_and_types_by_node'),
    'reply': ('services', 'get_service_names_and_types_by_node'),
    'request': ('services', 'get_client_names_and_types_by_node'),
}


def granted():
    """Return what the policy allows, in full names, by kind."""
    (profile,) = ET.parse(ROOT / 'policy.xml').getroot().iter('profile')
    assert (profile.get('ns'), profile.get('node')) == ('/', NODE)
    return {
        kind: {
            re.sub('^(?=[^/])', '/', name.text.replace('~', f'/{NODE}'))
            for group in profile.iter(element)
            if group.get(kind) == 'ALLOW'
            for name in group
        }
        for kind, (element, _) in KINDS.items()
    }


@pytest.fixture(scope='module')
def graph_of():
    """Return a function that returns what a configured node has, in full names, by kind."""
    with ExitStack() as domains:

        def graph_of(scene):
            # One domain for each: a namesake that has just ended stays in the graph for a while.
            domain = domains.enter_context(held_domain())
            context = rclpy.Context()
            rclpy.init(context=context, domain_id=domain)
            overrides = [Parameter('scene', value=str(scene))]
            node = LinkageNode(context=context, parameter_overrides=overrides)
            try:
                assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
                return {
                    kind: {name for name, _ in getattr(node, ask)(NODE, '/')}
                    for kind, (_, ask) in KINDS.items()
                }
            finally:
                node.destroy_node()
                rclpy.try_shutdown(context=context)

        yield graph_of


def matched(names, patterns):
    """Return the names that a pattern matches."""
    return {name for name in names if any(fnmatchcase(name, each) for each in patterns)}


@pytest.mark.parametrize('scene', SCENES, ids=[scene.stem for scene in SCENES])
def test_node_has_exactly_the_topics_of_the_policy(graph_of, scene):
    has, may = graph_of(scene), granted()
    if '/crank_commands' in has['subscribe']:
        may['subscribe'] = may['subscribe'] - {'/crank_states'} | {'/crank_commands'}
    may['reply'] |= {name for name in has['reply'] if name.startswith(f'/{NODE}/inject/')}
    assert {kind: matched(has[kind], may[kind]) for kind in KINDS} == has


# Together they have every topic of a node.
WHOLE = (
    (
        'robot_description: true\npublish_input: true\nfaults: {mute: {silence: {}}}\n'
        'effects: {acceleration: {}, pin_forces: {}, markers: {}}\n'
        'loads: {wrenches: {coupler: {}, rocker: {}}}\n'
    ),
    'drive: {torque: {motor: {torque_constant: 0.1}, motor_encoder: {}}}\n',
)


def test_policy_grants_only_topics_of_some_node(graph_of, tmp_path):
    has = {kind: set() for kind in KINDS}
    for index, text in enumerate(WHOLE):
        scene = tmp_path / f'whole_{index}.yaml'
        scene.write_text(f'linkage: {ROOT}/config/linkages/four_bar.yaml\n{text}')
        for kind, names in graph_of(scene).items():
            has[kind] |= {name for name in names if '/inject/' not in name}
    has['subscribe'] -= {'/crank_commands'}
    may = granted()
    assert {kind: matched(has[kind], may[kind]) for kind in KINDS} == has
    for kind in KINDS:
        assert {each for each in may[kind] if not matched(has[kind], [each])} == set()
