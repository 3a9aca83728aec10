# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Forces in pins that were recorded are plotted, and what is zero throughout is not."""

from linkage_ros.messages import JointWrenchWriter, MessageValues, WRENCHES
from linkage_ros.resources import shipped_path
from linkage_ros.tools.view.report import (
    LATER_PINS,
    PinForces,
    ReportHeader,
    run_html,
    time_plots,
    Window,
    zero_plots,
)
import numpy as np
import pytest

from .runs import BEGIN, but, curve, read, recorded
from ....support.messages import wrench_stamped

SCENE = """\
drive: {constant_rate: {rate: 7.0}}
effects: {velocity: {}, effort: {}, pin_forces: {}}
"""
FORCES = '/extra_0'
PINS = ('O2', 'A', 'B', 'cylinder')


@pytest.fixture(scope='module')
def press(tmp_path_factory):
    """Return the bag of a slider-crank with the masses of its links."""
    linkage = shipped_path('linkages/slider_crank.yaml').read_text()
    moments = but(200, lambda _tick, moment: moment._replace(messages=()))
    return recorded(tmp_path_factory.mktemp('press'), SCENE, moments, linkage)


def test_report_plots_the_magnitude_of_each_pin_force(press):
    reader = MessageValues(WRENCHES)
    messages = [reader.read(each.data) for each in press.messages() if each.topic == FORCES]
    assert len(messages) == 200
    assert messages[0].names == PINS
    wrenches = np.array([each.numbers for each in messages]).reshape(-1, len(PINS), 6)
    found = read(press)
    for place, name in enumerate(PINS):
        _, told = curve(found, name, 'force')
        assert told == pytest.approx(np.hypot(wrenches[:, place, 0], wrenches[:, place, 1]))
    (plot,) = (each for each in time_plots(found) if each['key'] == 'pin_forces')
    assert [each['name'] for each in plot['curves']] == [*PINS]
    assert plot['unit'] == 'N'


def test_report_names_plots_of_zeros_without_drawing(press):
    found = read(press)
    # Only the crank is driven: the effort of the sliding joint is zero.
    assert zero_plots(found) == ['Forces']
    assert 'efforts_m' not in [each['key'] for each in time_plots(found)]
    assert 'efforts_rad' in [each['key'] for each in time_plots(found)]
    page = run_html(found, ReportHeader('t', [], [], []))
    assert 'Zero throughout, so not plotted: Forces.' in page


def collected(*messages):
    """Return what is collected of messages, each with its time in [ns]."""
    forces = PinForces(FORCES, Window())
    for time, message in messages:
        forces.add(np.array([time]), [message])
    return forces


def test_two_linkages_have_separate_pin_force_curves(tmp_path):
    scene = f"""
linkages:
- {{name: left, linkage: l.yaml, {SCENE.replace(chr(10), ', ')}}}
- {{name: right, linkage: l.yaml, {SCENE.replace(chr(10), ', ')}}}
"""
    linkage = shipped_path('linkages/slider_crank.yaml').read_text()
    moments = but(20, lambda _tick, moment: moment._replace(messages=()))
    found = read(recorded(tmp_path, scene, moments, linkage))
    (plot,) = (each for each in time_plots(found) if each['key'] == 'pin_forces')
    assert [each['name'] for each in plot['curves']] == [
        f'{side}_{pin}' for side in ('left', 'right') for pin in PINS
    ]
    assert curve(found, 'right_A', 'force') == curve(found, 'left_A', 'force')


def test_pin_moments_are_plotted_where_any_is_nonzero():
    write = JointWrenchWriter(['pin', 'slider'], planar=True).write
    curves = collected(*((time, write(BEGIN, [(3.0, 4.0, 0.0), (0.0, 1.0, -2.0)]))
                         for time in range(5))).build_curves()  # fmt: skip
    assert [(column.name, column.quantity, column.unit) for column in curves.columns] == [
        ('pin', 'force', 'N'), ('slider', 'force', 'N'), ('slider', 'moment', 'N·m'),
    ]  # fmt: skip
    assert curves.intervals.first.tolist() == [[5.0, 1.0, -2.0]] * 5


def test_pin_forces_of_one_time_share_a_row():
    left, right = (
        JointWrenchWriter([name], planar=True).write(BEGIN, [(1.0, 0.0, 0.0)]) for name in 'ab'
    )
    forces = PinForces(FORCES, Window())
    forces.add(np.array([5, 9, 3, 5]), [left, left, right, right])
    curves = forces.build_curves()
    assert curves.intervals.begins.tolist() == [3, 5, 9]
    np.testing.assert_equal(curves.intervals.first, [[np.nan, 1.0], [1.0, 1.0], [1.0, np.nan]])


def test_malformed_pin_forces_are_left_out_and_counted():
    good = JointWrenchWriter(['a'], planar=True).write(BEGIN, [(1.0, 0.0, 0.0)])
    other = JointWrenchWriter(['b'], planar=True).write(BEGIN, [(1.0, 0.0, 0.0)])
    forces = collected((1, b'no message'), (2, good), (3, other))
    assert forces.left_out == {'malformed message': 1, LATER_PINS: 1}
    assert forces.build_curves().rows == 2


def test_report_plots_recorded_wrenches_on_links(tmp_path):
    def pushed(row, moment):
        wrenches = [(0, wrench_stamped(3.0 * row, 4.0 * row, 0.0))] if row % 2 else []
        wrenches += [(1, wrench_stamped(0.0, -1.0, 0.1 * row))] if row % 5 == 0 else []
        wrenches += [(1, b'no message')] if row == 50 else []
        return moment._replace(messages=(), wrenches=tuple(wrenches))

    scene = 'drive: {torque: {start: 1.0}}\nloads: {wrenches: {coupler: {}, rocker: {}}}\n'
    linkage = shipped_path('linkages/four_bar.yaml').read_text('utf-8')
    found = read(recorded(tmp_path, scene, but(100, pushed), linkage))
    times, force = curve(found, 'wrench_0', 'load')
    rows = np.arange(1, 100, 2)
    assert force == pytest.approx(5.0 * rows)
    assert np.diff(times) == pytest.approx(times[1] - times[0])
    moment = np.array(curve(found, 'wrench_1', 'moment of a load')[1], float)
    assert moment[np.isfinite(moment)] == pytest.approx(0.1 * np.arange(0, 100, 5))
    titles = {each['key']: [one['name'] for one in each['curves']] for each in time_plots(found)}
    assert titles['loads'] == ['wrench_0', 'wrench_1']
    assert 'wrench_1' in titles['load_moments']
    assert found.left_out['wrenches', 'malformed message'] == 1
