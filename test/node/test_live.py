# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
`linkage view --node`: the bridge between pages and a node that runs as a process.

What the bridge publishes is heard, and what the node does is seen, by the tests' own end of the
graph. The browser's test drives the whole chain, from a slider to DDS.
"""

from collections.abc import Iterator
from contextlib import contextmanager
import json
import os
import signal
import subprocess
import sys
import time
from urllib.error import URLError
from urllib.request import urlopen

from linkage_ros import load
from linkage_ros.bag import read_bag
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import frames_of_links
from linkage_ros.tools.view import add_live, live_page, LiveBridge
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from .conftest import LINKAGES
from .graph import PATIENCE, stamp_of, wait_for
from .turning import turning
from ..browser import chromium
from ..tools.view.served import served

SCENE = """
rate: 200
effects: {velocity: {}}
drive: {topic: {max_age: 0.2}}
faults: {frozen: {freeze: {}}, gone: {silence: {}}}
"""
ANGLE = 0.7


@pytest.fixture(autouse=True)
def transports(monkeypatch):
    # The bridge sets it for its process and the children.
    monkeypatch.setenv('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')


@pytest.fixture(scope='module')
def scene(write_scene):
    return write_scene('live', SCENE)


@contextmanager
def bridged(graph, name='', **options) -> Iterator['Followed']:
    bridge = LiveBridge(name, domain=graph.domain, **options)
    try:
        yield Followed(bridge)
    finally:
        bridge.end()


class Followed:
    """A bridge, and what pages would have got of it."""

    def __init__(self, bridge):
        self.bridge = bridge

    def newest(self, kind):
        _, text = self.bridge.newest_message(kind)
        return json.loads(text)[kind] if text else {}

    def ask(self, do, **content):
        return self.bridge.send_request({'do': do, **content}).result(20.0)

    def wait_for_node(self, condition, what):
        return wait_for(lambda: (node := self.newest('node')) and condition(node), what)


def test_view_turns_the_crank_of_a_running_node(graph, start, scene):
    cranks = graph.listen(JointState, '/crank_states')
    states = graph.listen(JointState, '/joint_states')
    start(scene)
    closure = load(LINKAGES / 'four_bar.yaml')
    with bridged(graph) as followed:
        assert followed.bridge.name == '/linkage_node'
        model = followed.newest('model')
        assert model['links'] == ['crank', 'coupler', 'rocker']
        assert model['live']['inputs'] == ['crank_joint']
        assert model['live']['cranks'] == [[0.0, 0.0, pytest.approx(0.04)]]

        assert graph.node.count_publishers('/crank_states') == 0  # none before it is needed
        wanted = closure.position(ANGLE)

        def turned():
            followed.ask('crank', angle=ANGLE)
            at_rest = states and states[-1].position[:] == pytest.approx(wanted.joints, abs=1e-9)
            return cranks and at_rest and followed.newest('state')

        state = wait_for(turned, 'the pose of that angle')
        assert cranks[-1].name == ['crank_joint']
        assert list(cranks[-1].position) == pytest.approx([ANGLE], abs=1e-9)
        assert list(cranks[-1].velocity) == pytest.approx([0.0], abs=1e-6)
        assert state['inputs'] == pytest.approx([ANGLE], abs=1e-6)
        frames = frames_of_links(closure, wanted)
        expected = [
            number
            for link in model['links']
            for number in (frames[link].place.real, frames[link].place.imag, frames[link].angle)
        ]
        assert state['frames'] == pytest.approx(expected, abs=1e-6)

        # Let go, the crank is gone, and the node says so.
        followed.wait_for_node(
            lambda node: any(
                words.startswith('crank: No crank for') for _, words in node['diagnostics']
            ),
            'a node without a crank',
        )
        assert stamp_of(cranks[-1]) - stamp_of(cranks[0]) > 0


def test_view_turns_the_crank_by_rocker_samples(graph, start, write_scene):
    closure = load(LINKAGES / 'four_bar.yaml')
    wanted = closure.position(ANGLE)
    ((branch, _),) = (
        each for each in closure.cranks('rocker_joint', wanted['rocker_joint'])
        if abs(each[1] - ANGLE) < 1e-9
    )  # fmt: skip
    drive = f'drive: {{topic: {{joint: rocker_joint, branch: {branch}, max_age: 0.2}}}}'
    start(write_scene('both_ways', f'rate: 200\neffects: {{velocity: {{}}}}\n{drive}\n'))
    samples = graph.listen(JointState, '/crank_states')
    states = graph.listen(JointState, '/joint_states')
    with bridged(graph) as followed:

        def turned():
            followed.ask('crank', angle=ANGLE)
            at_rest = states and states[-1].position[:] == pytest.approx(wanted.joints, abs=1e-6)
            return samples and at_rest and followed.newest('state')

        state = wait_for(turned, 'the pose of that angle')
        assert samples[-1].name == ['rocker_joint']
        assert state['inputs'] == pytest.approx([ANGLE], abs=1e-5)


def test_view_shows_a_spatial_node_and_turns_its_inputs(graph, start, write_scene):
    start(
        write_scene(
            'delta_live', 'rate: 200\ndrive: {topic: {max_age: 0.2}}\n', linkage='space/delta'
        )
    )
    closure, states = load('delta'), graph.listen(JointState, '/joint_states')
    inputs = [0.1, -0.05, 0.2]
    wanted = closure.position(*inputs)
    with bridged(graph) as followed:
        model = followed.newest('model')
        assert model['live']['cranks'] == [None, None, None]
        assert len(model['drawn']['camera']) == 2

        def turned():
            for number, angle in enumerate(inputs):
                followed.ask('crank', angle=angle, input=number)
            at_rest = states and states[-1].position[:] == pytest.approx(wanted.joints, abs=1e-9)
            return at_rest and followed.newest('state')

        state = wait_for(turned, 'the pose of these angles')
        assert state['inputs'] == pytest.approx(inputs, abs=1e-6)
        places = list(zip(*[iter(state['frames'])] * 3, strict=True))
        assert {pin['name'] for pin in model['pins']} == {*closure.linkage.points}
        for pin in model['pins']:
            place = closure.named_points(wanted)[pin['name']]
            assert places[pin['link']] == pytest.approx(place, abs=1e-6)


def test_view_applies_an_effort_to_each_of_two_motors(graph, start, write_scene):
    commands = graph.listen(JointState, '/crank_commands')
    scene = 'rate: 200\ndrive: {torque: {timeout: 0.2}}\npublish_input: true\n'
    start(write_scene('ankle_live', scene, linkage='space/ankle_motors'))
    with bridged(graph) as followed:
        assert len(followed.newest('model')['live']['efforts']) == 2

        def both():
            followed.ask('effort', value=0.1, input=0)
            followed.ask('effort', value=-0.2, input=1)
            return commands and dict(zip(commands[-1].name, commands[-1].effort, strict=True))

        assert wait_for(lambda: both() == {'m1': 0.1, 'm2': -0.2}, 'efforts of both motors')
        assert 'is not the index of an input' in followed.ask('effort', value=1.0, input=2)


def test_view_switches_a_fault_and_a_recording(graph, start, scene):
    states = graph.listen(JointState, '/joint_states')
    start(scene)
    with (
        bridged(graph, 'linkage_node') as followed,
        turning(graph.publisher(JointState, '/crank_states')),
    ):
        wait_for(lambda: states, 'joint states')
        said = followed.ask('record', on=True)
        assert said.startswith('recording to '), said
        followed.wait_for_node(lambda node: node['recording'], 'a recording')
        assert followed.newest('node')['faults'] == {'frozen': False, 'gone': False}

        asked = time.time_ns()
        assert followed.ask('fault', name='frozen', on=True) == 'frozen begins at the next tick'
        followed.wait_for_node(lambda node: node['faults']['frozen'], 'the fault')
        states.clear()
        wait_for(lambda: len(states) > 20, 'joint states')
        assert len({tuple(state.position) for state in states[1:]}) == 1
        assert stamp_of(states[0]) > asked
        assert followed.newest('state')['joints']['rocker_joint'][0] == states[-1].position[1]
        followed.ask('fault', name='frozen', on=False)
        followed.wait_for_node(lambda node: not node['faults']['frozen'], 'the end of the fault')

        said = followed.ask('record', on=False)
        bag = read_bag(said.removeprefix('recorded ').split(': ')[0])
        assert sum(message.topic == '/linkage_node/faults' for message in bag.messages()) == 2

        assert 'is not in the scene; there are: frozen, gone' in followed.ask(
            'fault', name='melted', on=True
        )
        for do, content in (
            ('fault', {'name': 'frozen', 'on': 1}),
            ('fault', {'name': ['frozen'], 'on': True}),
            ('crank', {'angle': 1e300}),
            ('crank', {'angle': None}),
            ('crank', {'angle': 1.0, 'input': 3}),
            ('effort', {'value': 1.0}),
            ('format', {}),
        ):
            assert ';' in followed.ask(do, **content)


def test_view_reports_a_killed_node_and_its_restart(graph, start, scene):
    node = start(scene)
    with bridged(graph, 'linkage_node') as followed:
        followed.wait_for_node(lambda node: node['there'], 'the node')
        first, _ = followed.bridge.newest_message('model')
        node.end(signal.SIGKILL)
        followed.wait_for_node(lambda node: not node['there'], 'the end of the node')
        assert 'does not answer' in followed.ask('reset')
        start(scene)
        followed.wait_for_node(lambda node: node['there'], 'the node again')
        wait_for(lambda: followed.bridge.newest_message('model')[0] > first, 'its linkage')
        assert followed.newest('model')['name'] == 'live'


def test_view_asks_for_one_of_two_nodes(graph, start, scene):
    start(scene)
    start(scene, '-r', '__node:=other')
    scenes = '/linkage_node/scene', '/other/scene'
    wait_for(lambda: all(map(graph.node.count_publishers, scenes)), 'both nodes')
    with pytest.raises(LinkageError) as told:
        LiveBridge(domain=graph.domain)
    assert 'there are 2 linkage nodes' in str(told.value)
    assert str(told.value).endswith('name one of /linkage_node, /other')
    with pytest.raises(LinkageError, match=r"did you mean '/other'\?"):
        LiveBridge('othr', domain=graph.domain, patience=3.0)
    with bridged(graph, 'other') as followed:
        assert followed.bridge.name == '/other'


def test_malformed_scene_topic_is_refused_in_one_line(graph):
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = graph.node.create_publisher(String, '~/scene', latched)
    try:
        for text in ('', '[1]', '{"run.json": "{}", "scene.yaml": "a: ["}', '[' * 100_000):
            publisher.publish(String(data=text))
            with pytest.raises(LinkageError, match='scene that cannot be read') as told:
                LiveBridge('tester', domain=graph.domain)
            assert len(str(told.value).splitlines()) == 1
    finally:
        graph.node.destroy_publisher(publisher)


def test_run_serves_its_page_until_it_ends(graph, scene, folder):
    """Without --view, it says the command that opens the page."""
    environment = os.environ | {'ROS_DOMAIN_ID': str(graph.domain)}
    command = [sys.executable, '-m', 'linkage_ros', 'run', scene, '--plain']

    def pages(lines):
        return (line.removeprefix('page      ') for line in lines if line.startswith('page '))

    with subprocess.Popen(
        [*command, '--view'], cwd=folder, env=environment, stdout=subprocess.PIPE, text=True
    ) as run:
        name, address = next(pages(run.stdout)).split(': ')
        assert name == '/linkage_node'
        with urlopen(address.strip(), timeout=PATIENCE) as page:
            assert b'linkage view' in page.read()
        run.send_signal(signal.SIGINT)
        assert 'Traceback' not in run.stdout.read()
    assert run.returncode == 0
    with pytest.raises(URLError):
        urlopen(address.strip(), timeout=PATIENCE)

    run = subprocess.run(  # noqa: PLW1510 (its output is judged)
        [*command, '--seconds', '0.1'], cwd=folder, env=environment, capture_output=True, text=True
    )
    (told,) = pages(run.stdout.splitlines())
    assert f'ROS_DOMAIN_ID={graph.domain} linkage view --node ' in told


def test_browser_slider_turns_the_crank_of_the_node(graph, start, scene):
    cranks = graph.listen(JointState, '/crank_states')
    node = start(scene)
    errors = []
    with (
        bridged(graph, 'linkage_node') as followed,
        served(
            [lambda app: add_live(app, followed.bridge)], lambda: live_page(followed.bridge)
        ) as server,
        chromium.browser() as browser,
    ):
        page = browser.new_page(viewport={'width': 400, 'height': 800})
        page.on('console', lambda message: errors.append(message.text))
        page.on('pageerror', lambda error: errors.append(str(error)))
        page.goto(server.address)
        wait_for(lambda: page.evaluate('Live.state().node?.there'), 'the node')
        page.locator('#hands input[type=range]').focus()
        for _ in range(20):
            page.keyboard.press('ArrowRight')
        page.get_by_label('hold').focus()
        page.keyboard.press('Space')
        wait_for(lambda: page.evaluate('Live.state().state?.frames'), 'a pose')
        assert page.evaluate('Live.state().state.inputs[0]') > 0.0
        wait_for(lambda: cranks and cranks[-1].position[0] > 0.0, 'a crank')
        assert {name for each in cranks for name in each.name} == {'crank_joint'}

        switch = page.get_by_role('switch', name='gone')
        switch.focus()
        page.keyboard.press('Enter')
        page.wait_for_selector('[role=switch][aria-checked=true]')
        assert followed.newest('node')['faults'] == {'frozen': False, 'gone': True}
        assert page.evaluate('document.documentElement.scrollWidth') == 400

        node.end(signal.SIGKILL)
        wait_for(lambda: 'does not answer' in page.inner_text('#banner'), 'the end of the node')
        assert switch.is_disabled()
        start(scene)
        wait_for(lambda: page.locator('#banner').is_hidden(), 'the node again')
        assert not errors
