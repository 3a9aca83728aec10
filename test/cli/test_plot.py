# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage plot``: joints over the crank, continuous, with units and names at their ends."""

from math import remainder, tau
from pathlib import Path

from linkage_ros.cli import simulate
from linkage_ros.description import read_linkage, read_yaml
from linkage_ros.kinematics import Closure, Curve, InputSweep, usual_inputs
from linkage_ros.resources import shipped_path
from linkage_ros.tools.drawing import (
    crank_curves,
    curves_over_time,
    is_after_gap,
    plot_command as command,
    plot_joints,
    stacked_axes,
)
import numpy as np
import pytest

from .recorded import answer, Recorded, scene_file

Figure = pytest.importorskip('matplotlib.figure').Figure


def closure_of(name: str) -> Closure:
    return Closure(read_linkage(read_yaml(str(shipped_path(f'linkages/{name}.yaml')))[0]))


def pieces(curve):
    """Return x and y of each line that a curve consists of."""
    x, y = np.array(curve.x), np.array(curve.y)
    breaks = np.flatnonzero(np.isnan(x))
    return [
        (own[~np.isnan(own)], values[~np.isnan(values)])
        for own, values in zip(np.split(x, breaks), np.split(y, breaks), strict=True)
    ]


@pytest.mark.parametrize('wrapped', [False, True], ids=['continuous', 'wrapped'])
@pytest.mark.parametrize('way', [1.0, -1.0], ids=['onward', 'backward'])
def test_plotted_angles_of_wrapped_runs_are_continuous(way, wrapped):
    closure = closure_of('four_bar')
    cranks = [(1.0 + way * 0.03 * row,) for row in range(700)]
    positions = [closure.position(*crank).joints for crank in cranks]
    if wrapped:
        positions = [tuple(remainder(value, tau) for value in each) for each in positions]
    joints, rates = crank_curves(closure.linkage, cranks, positions, [()] * len(cranks))
    assert [joint.name for joint in joints] == ['coupler_joint', 'rocker_joint']
    assert rates == []
    for joint in joints:
        # Over the same angle of the crank there is one value, in all turns.
        known = {}
        for x, y in pieces(joint):
            assert np.abs(np.diff(y)).max(initial=0.0) < 0.1
            for angle, value in zip(x, y, strict=True):
                known.setdefault(round(angle, 1), []).append(value)
        assert max(max(values) - min(values) for values in known.values()) < 0.2
        place = list(closure.linkage.joints).index(joint.name)
        for x, y in pieces(joint):
            ideal = [closure.position(angle).joints[place] for angle in x]
            assert np.exp(1j * y) == pytest.approx(np.exp(1j * np.array(ideal)))
        assert joint.x[-1] == np.nanmax(joint.x)


def test_curve_of_a_swinging_crank_spans_its_range():
    closure = closure_of('double_rocker')
    reach = InputSweep(closure, usual_inputs(closure)).widest_range
    middle, half = (reach.lowest + reach.highest) / 2, 0.45 * (reach.highest - reach.lowest)
    cranks = [(middle + half * np.sin(0.1 * row) + tau,) for row in range(200)]
    positions = [closure.position(*crank).joints for crank in cranks]
    rates = [(1.0,) * len(positions[0])] * 199 + [()]
    joints, joint_rates = crank_curves(closure.linkage, cranks, positions, rates)
    assert len(joint_rates) == len(joints)
    for joint in (*joints, *joint_rates):
        assert np.nanmin(joint.x) == pytest.approx(middle - half, abs=0.01)
        assert np.nanmax(joint.x) == pytest.approx(middle + half, abs=0.01)


def test_stuck_joint_is_drawn_at_one_angle():
    closure = closure_of('four_bar')
    cranks = [(0.01 * row,) for row in range(628)]
    positions = [(-3.0, 1.0)] * 628
    joints, _ = crank_curves(closure.linkage, cranks, positions, [()] * 628)
    for joint in joints:
        (values,) = (y for _, y in pieces(joint) if len(y))
        assert np.ptp(values) == 0.0


def test_nan_reading_removes_only_its_own_point():
    closure = closure_of('four_bar')
    cranks = [(0.01 * row,) for row in range(100)]
    positions = [closure.position(*crank).joints for crank in cranks]
    positions[50] = (np.nan, np.nan)
    joints, _ = crank_curves(closure.linkage, cranks, positions, [()] * len(cranks))
    for joint in joints:
        assert np.isfinite(joint.y).sum() == 99


@pytest.mark.parametrize('lost', [(), (100,), (100, 101), (50, 150, 151, 152)])
def test_curve_breaks_at_lost_ticks(lost):
    closure = closure_of('four_bar')
    rows = [row for row in range(200) if row not in lost]
    cranks = [(0.01 * row,) for row in rows]
    positions = [closure.position(*crank).joints for crank in cranks]
    times, no_rates = 0.001 * np.array(rows), [()] * len(rows)
    gaps = is_after_gap(times, steady=True)
    parts = 1 + len([row for row in lost if row - 1 not in lost])
    over_crank, _ = crank_curves(closure.linkage, cranks, positions, no_rates, gaps)
    over_time, _ = curves_over_time(closure.linkage, times, cranks, positions, no_rates, gaps)
    assert [curve.name for curve in over_time] == ['coupler_joint', 'rocker_joint', 'crank_joint']
    for curve in (*over_crank, *over_time):
        assert len([x for x, _ in pieces(curve) if len(x)]) == parts
    for curve, place in zip(over_time, range(2), strict=False):
        y = np.array(curve.y)
        assert y[~np.isnan(y)].tolist() == [values[place] for values in positions]


def test_unsteady_samples_have_gaps_only_at_long_silences():
    times = np.cumsum([0.01, 0.02, 0.005, 0.02, 0.01, 0.5, 0.01])
    assert is_after_gap(times, steady=False).tolist() == [False] * 5 + [True, False]


def test_axes_name_quantities_with_units(tmp_path: Path) -> None:
    scene = scene_file(tmp_path, 'effects: {velocity: {}}\n')
    bag = Recorded(
        tmp_path / 'bag', scene, lambda row: {'crank_joint': (1.0 + 0.007 * row, 7.0)}
    ).run(300)
    assert answer(command, bag, '-o', tmp_path / 'x.svg') == 0
    text = (tmp_path / 'x.svg').read_text()
    for label in ('joint angle [°]', 'rate of joint angle [°/s]', 'crank_joint [°]'):
        assert f'<!-- {label} -->' in text
    # At the end of its position and at that of its rate.
    assert text.count('<!-- rocker_joint -->') == 2


def test_time_axis_names_its_unit(tmp_path: Path) -> None:
    scene = scene_file(tmp_path, 'effects: {velocity: {}}\n')
    bag = Recorded(
        tmp_path / 'bag', scene, lambda row: {'crank_joint': (1.0 + 0.007 * row, 7.0)}
    ).run(300)
    assert answer(command, bag, '--over', 'time', '-o', tmp_path / 'x.svg') == 0
    text = (tmp_path / 'x.svg').read_text()
    assert '<!-- time since the first joint state [s] -->' in text
    assert text.count('<!-- crank_joint -->') == 1


@pytest.mark.parametrize(
    ('typed', 'axis'),
    [((), 'time since the first joint state [s]'), (('--over', 'crank'), 'm1 [°]')],
)
def test_joints_of_two_inputs_are_drawn_over_time(
    tmp_path: Path, typed: tuple[str, ...], axis: str
) -> None:
    linkage = shipped_path('linkages/space/ankle_motors.yaml').read_text()
    scene = scene_file(tmp_path, 'drive: {sine: {amplitude: 0.1, frequency: 2.0}}\n', linkage)
    assert answer(simulate, scene, '--seconds', '0.5', '-o', tmp_path / 'bag') == 0
    assert answer(command, tmp_path / 'bag', *typed, '-o', tmp_path / 'x.svg') == 0
    assert f'<!-- {axis} -->' in (tmp_path / 'x.svg').read_text()


@pytest.fixture
def drawn(monkeypatch):
    """Return the figures that were drawn, laid out."""
    figures = []

    def keep(figure, _file):
        figure.draw_without_rendering()
        figures.append(figure)

    monkeypatch.setattr(command, 'save_picture', keep)
    return figures


@pytest.mark.sample(1)
@pytest.mark.parametrize('over', ['crank', 'time'])
def test_recorded_accelerations_are_drawn_below_the_rates(tmp_path, drawn, over):
    linkage = shipped_path('linkages/slider_crank.yaml').read_text()
    scene = scene_file(tmp_path, 'effects: {acceleration: {}}\n', linkage)
    bag = Recorded(
        tmp_path / 'bag', scene, lambda row: {'crank_joint': (1.0 + 0.007 * row, 7.0)}
    ).run(500)
    assert answer(command, bag, '--over', over, '-o', tmp_path / 'x.svg') == 0
    (figure,) = drawn
    assert [axes.get_ylabel() for axes in figure.axes] == [
        'joint angle [°]', 'slide [mm]', 'rate of joint angle [°/s]', 'rate of slide [mm/s]',
        'acceleration of joint angle [°/s²]', 'acceleration of slide [m/s²]',
    ]  # fmt: skip
    edges = {round(axes.get_position().x0, 9) for axes in figure.axes}
    assert len(edges) == 1
    # The accelerations are the slopes of the rates: over the crank, in degrees, at 7 rad/s.
    per_x = 1.0 if over == 'time' else np.degrees(7.0)
    for rates, accelerations in zip(figure.axes[2:4], figure.axes[4:], strict=True):
        (rate,), (acceleration,) = rates.get_lines(), accelerations.get_lines()
        x, y = rate.get_data()
        slopes = np.gradient(y, x) * per_x
        known = np.isfinite(slopes)
        _, found = acceleration.get_data()
        assert np.sum(known) > 400
        assert found[known] == pytest.approx(slopes[known], abs=0.02 * np.nanmax(np.abs(found)))


def test_28_curves_differ_in_colour_or_dashes():
    names = [f'joint_{index}' for index in range(28)]
    curves = [Curve(name, True, (0.0, 1.0), (float(i), float(i))) for i, name in enumerate(names)]
    figure = Figure()
    (panels,) = stacked_axes(figure.add_gridspec, [curves])
    lines = plot_joints(panels, curves, degrees_x=False).values()
    looks = {(line.get_color(), str(line._dash_pattern)) for line in lines}
    assert len(looks) == 28
