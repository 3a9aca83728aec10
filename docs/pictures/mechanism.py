# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Pictures of the mechanism's effects, motion and compliance, over a turn of the crank."""

from __future__ import annotations

from math import tau
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from .paper import BLUE, GREEN, IDEAL, legend, ORANGE, over_a_turn, PURPLE, sheet, VERMILLION
from .runs import changed, CRANK, Run, run, Scene, Values

_ROCKER, _PISTON = 'rocker_joint', 'piston_slide'


def tolerance(scene: Scene) -> Figure:
    """Draw the errors of five mechanisms made from one drawing."""
    figure, axes = sheet()
    ideal = _turn(changed(scene, ('effects', {})))
    colours, lines = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE), ('-', '--', '-.', ':', '-')
    for seed, (colour, line) in enumerate(zip(colours, lines, strict=True), 1):
        made = _turn(changed(scene, ('seed', seed)))
        off = made.position(_ROCKER) - ideal.position(_ROCKER)
        axes.plot(ideal.crank()[0], 1e3 * off, color=colour, linestyle=line, label=f'seed: {seed}')
    axes.axhline(0.0, label='as drawn', **IDEAL)
    axes.set_ylabel('rocker: as made − as drawn [mrad]')
    over_a_turn(axes)
    legend(axes, 6)
    return figure


def backlash(scene: Scene) -> Figure:
    """Draw the angles of crank and motor over time, and over each other."""
    figure, (left, right) = sheet(1, 2, width_ratios=(1.6, 1.0))
    motor = run(changed(scene, ('effects', {})), 2.0)
    crank = run(scene, 2.0)
    left.plot(motor.times, motor.position(CRANK), label='motor', **IDEAL)
    left.plot(crank.times, crank.position(CRANK), color=BLUE, label='crank')
    left.set_xlabel('time [s]')
    left.set_ylabel('angle [rad]')
    legend(left)
    right.plot(*2 * [motor.position(CRANK)], label='without play', **IDEAL)
    right.plot(motor.position(CRANK), crank.position(CRANK), color=BLUE, label='with it')
    right.set_xlabel('motor [rad]')
    right.set_ylabel('crank [rad]')
    legend(right)
    return figure


def velocity(scene: Scene) -> Figure:
    """Draw a rate, and the difference quotients of the positions."""
    figure, (upper, lower) = sheet(2, 1, sharex=True)
    moving = _turn(scene)
    times, positions = moving.times, moving.position(_ROCKER)
    upper.plot(times, positions, color=BLUE)
    upper.set_ylabel('rocker [rad]')
    lower.plot(times, moving.rate(_ROCKER), color=VERMILLION, label='published rate')
    _slopes(lower, times, positions, 'slope of the positions')
    lower.set_ylabel('rocker [rad/s]')
    lower.set_xlabel('time [s]')
    legend(lower)
    return figure


def acceleration(scene: Scene) -> Figure:
    """Draw an acceleration, and the difference quotients of the rates."""
    figure, (upper, lower) = sheet(2, 1, sharex=True)
    moving = _turn(scene)
    times, rates = moving.times, moving.rate(_ROCKER)
    upper.plot(times, rates, color=BLUE)
    upper.set_ylabel('rocker [rad/s]')
    accelerations = moving.acceleration(_ROCKER)
    lower.plot(times, accelerations, color=VERMILLION, label='published acceleration')
    _slopes(lower, times, rates, 'slope of the rates')
    lower.set_ylabel('rocker [rad/s²]')
    lower.set_xlabel('time [s]')
    legend(lower)
    return figure


def friction(scene: Scene) -> Figure:
    """Draw the drive's torque with and without friction."""
    figure, axes = sheet()
    without = _turn(changed(scene, ('effects.friction', None)))
    rubbing = _turn(scene)
    axes.plot(without.crank()[0], 1e3 * without.effort(CRANK), label='without friction', **IDEAL)
    axes.plot(rubbing.crank()[0], 1e3 * rubbing.effort(CRANK), color=BLUE, label='with friction')
    axes.set_ylabel('effort of the drive [mN·m]')
    over_a_turn(axes)
    legend(axes)
    return figure


def loads(scene: Scene) -> Figure:
    """Draw the run-up of a crank under its motor's curve, alone and with all loads."""
    figure, axes = sheet()
    alone = changed(scene, ('loads.joint_springs', None), ('loads.efforts.rocker_joint', None))
    for given, label, style in (
        (alone, "motor's curve alone", IDEAL),
        (scene, 'with the loads on the rocker', {'color': BLUE}),
    ):
        moving = run(given, 1.5)
        axes.plot(moving.times, moving.crank()[1], label=label, **style)
    axes.set_xlabel('time [s]')
    axes.set_ylabel('crank [rad/s]')
    legend(axes)
    return figure


def effort(scene: Scene) -> Figure:
    """Draw the drive's torque at the scene's rate, and at a very low one."""
    figure, axes = sheet()
    fast = scene['drive']['constant_rate']['rate']
    for rate, style in (
        (0.01, {'label': 'creeping: gravity alone', **IDEAL}),
        (fast, {'label': f'at {fast:g} rad/s: inertia too', 'color': BLUE}),
    ):
        moving = _turn(changed(scene, ('drive.constant_rate.rate', rate)))
        axes.plot(moving.crank()[0], 1e3 * moving.effort(CRANK), **style)
    axes.set_ylabel('effort of the drive [mN·m]')
    over_a_turn(axes)
    legend(axes)
    return figure


def pin_forces(scene: Scene) -> Figure:
    """Draw the magnitudes of pin forces, and the direction of one of them."""
    figure, (left, right) = sheet(1, 2, width_ratios=(1.6, 1.0))
    moving = _turn(scene)
    crank = moving.crank()[0]
    for name, label, colour, line in (
        ('O2', 'O2', BLUE, '-'),
        ('A', 'A', VERMILLION, '--'),
        ('cylinder', 'cylinder, from the side', GREEN, '-.'),
    ):
        size = np.hypot(*moving.force(name))
        left.plot(crank, size, color=colour, linestyle=line, label=label)
    left.set_ylabel('force [N]')
    over_a_turn(left)
    legend(left)
    force = moving.force('A')
    right.plot(*force, color=VERMILLION, linestyle='--')
    beside = (('0', (-11, -3)), ('π/2', (-9, -13)), ('π', (7, -3)), ('3π/2', (-25, 3)))
    for index, (turned, offset) in enumerate(beside):
        at = int(np.argmin(abs(crank - index * tau / 4)))
        right.plot(*force[:, at], 'o', color='black', markersize=4)
        right.annotate(turned, force[:, at], xytext=offset, textcoords='offset points')
    right.set_title('A, at these crank angles')
    right.set_xlabel('force in x [N]')
    right.set_ylabel('force in y [N]')
    right.margins(0.15)
    return figure


def compliance(scene: Scene) -> Figure:
    """Draw the tension of the rod, and the displacement of the piston."""
    figure, (upper, lower) = sheet(2, 1, sharex=True)
    rigid, yielding = _turn(changed(scene, ('effects', {}))), _turn(scene)
    crank = rigid.crank()[0]
    shift = 1e6 * (yielding.position(_PISTON) - rigid.position(_PISTON))
    # The forces of crank and piston on the rod.
    along = crank + rigid.position('rod_joint')
    pull = -yielding.force('B') - yielding.force('A')
    upper.plot(crank, 0.5 * (pull[0] * np.cos(along) + pull[1] * np.sin(along)), color=VERMILLION)
    upper.set_ylabel('tension of rod [N]')
    lower.axhline(0.0, label='rigid', **IDEAL)
    lower.plot(crank, shift, color=BLUE, label='with a rod that stretches')
    lower.set_ylabel('piston is off [µm]')
    over_a_turn(lower)
    legend(lower)
    return figure


def clearance(scene: Scene) -> Figure:
    """Draw the displacement of a pin in its hole, and the error of the rocker."""
    figure, (left, right) = sheet(1, 2, width_ratios=(1.0, 1.6))
    tight, loose = _turn(changed(scene, ('effects', {'pin_forces': {}}))), _turn(scene)
    crank = tight.crank()[0]
    play = 1e6 * scene['effects']['clearance']['pins']['B']
    fx, fy = loose.force('B')
    size = np.hypot(fx, fy)
    left.axhline(0.0, **IDEAL)
    left.plot(crank, -play * fx / size, color=BLUE, label='in x')
    left.plot(crank, -play * fy / size, color=GREEN, linestyle='--', label='in y')
    left.set_ylabel('lean of pin B [µm]')
    over_a_turn(left)
    legend(left)
    right.axhline(0.0, label='without play', **IDEAL)
    off = 1e6 * (loose.position(_ROCKER) - tight.position(_ROCKER))
    right.plot(crank, off, color=VERMILLION, label='with play in A and B')
    right.set_ylabel('rocker is off [µrad]')
    over_a_turn(right)
    legend(right)
    return figure


def _turn(scene: Scene) -> Run:
    """Run one turn of a crank of constant rate, in 720 ticks."""
    rate = scene['drive']['constant_rate']['rate']
    seconds = tau / rate
    return run(changed(scene, ('rate', 720.0 / seconds)), seconds)


def _slopes(axes: Any, times: Values, values: Values, label: str) -> None:
    """Draw the central difference quotients of values at some times."""
    slopes = (values[2:] - values[:-2]) / (times[2:] - times[:-2])
    style = {'color': 'black', 'markersize': 4, 'markerfacecolor': 'none'}
    axes.plot(times[1:-1:24], slopes[::24], 'o', label=label, **style)


PICTURES = {
    'tolerance': tolerance,
    'backlash': backlash,
    'velocity': velocity,
    'acceleration': acceleration,
    'friction': friction,
    'loads': loads,
    'effort': effort,
    'pin_forces': pin_forces,
    'compliance': compliance,
    'clearance': clearance,
}
