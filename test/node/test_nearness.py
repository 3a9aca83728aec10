# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How near the linkage is to trouble: told in the diagnostics, and warned of below a limit."""

from types import SimpleNamespace

from linkage_ros.kinematics import Input, Status
from linkage_ros.tick import Counts
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import JointState

from .graph import crank, wait_for
from .loops import transmission_angle
from .observed import fake_loop, observe, status_of

OK, WARN, ERROR = b'\0', b'\1', b'\2'
KEYS = 'Transmission angle (rad)', 'Conditioning', 'Input to the nearest toggle (rad)'
LIMITS = {'transmission_angle': 0.5, 'conditioning': 1e-6, 'toggle_distance': 1e-3}
CRANK = Input('crank_joint', 'ground', 'crank')
CYLINDER = Input('boom_cylinder', slider='bore')


def status(nearness=(1.0, 0.5, 0.5), inputs=(CRANK,), limits=LIMITS, is_open=False):
    """Return the status of the loop closure of a linkage that is so near to trouble."""
    counts = Counts()
    position = SimpleNamespace(gap=0.1, joints=(1.0,))
    crank = SimpleNamespace(angles=(0.25,) * len(inputs), rates=(1.0,) * len(inputs))
    look = SimpleNamespace(crank=crank, position=position, reading=None)
    counts.last_unclosed[Status.OPEN] = 0, position
    counts.unclosed[Status.OPEN] = int(is_open)
    closure = SimpleNamespace(
        input_ranges=(),
        limit_exceeded=lambda _: '',
        residual=lambda _: 0.0,
        singularity_margin=lambda asked: (
            asked is position and SimpleNamespace(**dict(zip(LIMITS, nearness, strict=True)))
        ),
    )
    scene_linkage = SimpleNamespace(
        name='',
        drive=('topic', SimpleNamespace(gives_torque=False)),
        linkage=SimpleNamespace(inputs=inputs, joints={}, limits={}),
    )
    linkages = [SimpleNamespace(scene_linkage=scene_linkage, closure=closure, drive=None)]
    counts.last_tick = SimpleNamespace(linkages=linkages, states=(look,))
    counts.chatter = [0]
    pipeline = SimpleNamespace(linkages=linkages, max_age=1, wrenches=[])
    return status_of(observe(fake_loop(pipeline=pipeline), counts, limits=limits), 'loop closure')


def test_loop_closure_diagnostics_list_distances_to_toggles():
    found, values = status((1.25, 0.0625, 3.5))
    assert (found.level, found.message) == (OK, 'Closed')
    assert [values[key] for key in KEYS] == ['1.25', '0.0625', '3.5']
    assert values['Input crank_joint (rad)'] == '0.250000'


@pytest.mark.parametrize(
    ('nearness', 'message'),
    [
        ((0.49, 1.0, 1.0), f'{KEYS[0]} is 0.49, below warn.transmission_angle of 0.5'),
        ((1.0, 9e-7, 1.0), f'{KEYS[1]} is 9e-07, below warn.conditioning of 1e-06'),
        ((1.0, 1.0, 9e-4), f'{KEYS[2]} is 0.0009, below warn.toggle_distance of 0.001'),
    ],
)
def test_diagnostics_warn_with_value_and_limit(nearness, message):
    found, _ = status(nearness)
    assert (found.level, found.message) == (WARN, message)


def test_diagnostics_warn_of_every_value_below_its_limit():
    found, _ = status((0.0, 0.0, 0.0))
    assert found.level == WARN
    assert all(f'warn.{name}' in found.message for name in LIMITS)


def test_limit_of_0_disables_the_warning():
    assert status((0.0, 0.0, 0.0), limits=dict.fromkeys(LIMITS, 0.0))[0].level == OK


def test_value_at_its_limit_causes_no_warning():
    assert status(tuple(LIMITS.values()))[0].level == OK


def test_open_loop_error_takes_precedence_over_nearness_warning():
    found, values = status((0.0, 0.0, 0.0), is_open=True)
    assert found.level == ERROR
    assert 'nearest' not in found.message
    assert values[KEYS[0]] == '0'


@pytest.mark.parametrize(('inputs', 'unit'), [((CYLINDER,), 'm'), ((CRANK, CYLINDER), 'm or rad')])
def test_sliding_input_is_reported_in_metres(inputs, unit):
    _, values = status(inputs=inputs)
    assert values['Input boom_cylinder (m)'] == '0.250000'
    assert values[f'Input to the nearest toggle ({unit})'] == '0.5'


def test_warning_limit_changes_while_the_node_runs(graph, write_scene, start):
    text = 'rate: 100\ndrive: {topic: {max_age: 60, carry_forward: false}}'
    node = start(write_scene('nearness', text))
    publisher = graph.publisher(JointState, '/crank_states')
    wait_for(
        lambda: publisher.publish(crank(0.7)) or graph.value('loop closure', KEYS[0]), 'a value'
    )
    graph.diagnostics.clear()
    for key in KEYS:
        wait_for(lambda key=key: graph.value('loop closure', key), key)
    found = float(graph.value('loop closure', KEYS[0]))
    assert found == pytest.approx(transmission_angle(0.7), abs=1e-5)
    assert graph.next_status('loop closure').level == OK, 'off by default'
    value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=1.5)
    request = SetParameters.Request(
        parameters=[Parameter(name='warn.transmission_angle', value=value)]
    )
    graph.call(SetParameters, '/linkage_node/set_parameters', request)
    message = graph.wait_for_level('loop closure', WARN).message
    assert message == f'{KEYS[0]} is {found:.3g}, below warn.transmission_angle of 1.5'
    assert node.end() == 0
