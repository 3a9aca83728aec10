# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Pictures of the drives: the angle of the crank and its rate, over time."""

from __future__ import annotations

from math import cos, sin, tau
from typing import Any

from linkage_ros.messages import JOINT_STATE_TYPE, JointStateReader
from matplotlib.figure import Figure
import numpy as np

from .paper import BLUE, empty_sheet, GREEN, legend, sheet, SKY, VERMILLION
from .runs import changed, CRANK, extra_messages, Run, run, Sample, Scene

_RESTS = 0.5
"""Time shown after the end of the drive, in [s]."""


def topic(scene: Scene) -> Figure:
    """Draw the crank between and after samples at 10 Hz."""
    samples = _swinging(0.1, 11)
    figure, axes = sheet(2, 1, sharex=True)
    held = run(changed(scene, ('drive.topic.carry_forward', False)), 1.5, samples)
    carried = run(scene, 1.5, samples)
    _over_time(axes, held, color=VERMILLION, linestyle='--', label='carry_forward: false')
    _over_time(axes, carried, color=BLUE, label='carry_forward: true')
    _dots(axes, samples, 'samples')
    end = held.times[np.isfinite(held.crank()[0])][-1]
    for each in axes:
        each.axvspan(end, held.times[-1], color=SKY, alpha=0.3, linewidth=0.0, label='no crank')
    legend(axes[0])
    return figure


def constant_rate(scene: Scene) -> Figure:
    """Draw a crank that turns at a constant rate."""
    figure, axes = sheet(2, 1, sharex=True)
    _over_time(axes, run(scene, 2.0), color=BLUE)
    for each in axes:
        each.set_ylim(bottom=0.0)
    return figure


def sine(scene: Scene) -> Figure:
    """Draw a crank that oscillates."""
    return _one(scene, 2.0)


def chirp(scene: Scene) -> Figure:
    """Draw a crank that oscillates with increasing frequency."""
    return _one(scene, scene['drive']['chirp']['seconds'] + _RESTS)


def profile(scene: Scene) -> Figure:
    """Draw the three interpolations of a table."""
    figure, axes = sheet(2, 1, sharex=True)
    table = scene['drive']['profile']['table']
    seconds = table[-1][0] + _RESTS
    for interpolation, style in (
        ('linear', {'color': GREEN, 'linestyle': '--'}),
        ('cubic', {'color': BLUE}),
        ('minimum_jerk', {'color': VERMILLION, 'linestyle': '-.'}),
    ):
        moving = run(changed(scene, ('drive.profile.interpolation', interpolation)), seconds)
        _over_time(axes, moving, label=interpolation, **style)
    axes[0].plot(*zip(*table, strict=True), 'o', color='black', markersize=4, label='table')
    legend(axes[0])
    return figure


def bag(scene: Scene) -> Figure:
    """Draw the crank from a bag that is played twice."""
    samples = _swinging(0.05, 20)
    figure, axes = sheet(2, 1, sharex=True)
    _over_time(axes, run(scene, 2.0, samples), color=BLUE, label='crank')
    _dots(axes, samples, 'samples in the bag')
    for each in axes:
        each.axvline(samples[-1][0] + 0.05, label='begins again', color=VERMILLION)
    legend(axes[0])
    return figure


def torque(scene: Scene) -> Figure:
    """Draw a four-bar that swings under its weight, and the energy error of the integration."""
    figure = empty_sheet()
    axes = figure.subplot_mosaic([['angle', 'energy'], ['rate', 'energy']])
    right = axes['energy']
    seconds = 4.0
    swinging = run(scene, seconds)
    _over_time((axes['angle'], axes['rate']), swinging, color=BLUE)
    axes['angle'].set_xticklabels([])
    span = _span_of_potential(scene)
    methods: tuple[tuple[str, dict[str, Any]], ...] = (
        ('semi_implicit_euler', {'color': GREEN, 'linestyle': '-.'}),
        ('rk4', {'color': BLUE}),
        ('gauss_legendre', {'color': VERMILLION, 'linestyle': '--'}),
    )
    for method, style in methods:
        energy = run(changed(scene, ('drive.torque.method', method)), seconds).energy()
        drift = np.maximum.accumulate(abs(energy - energy[0])) / span
        right.plot(swinging.times, drift, label=method, **style)
    right.set_yscale('log')
    right.set_ylim(1e-14, 10.0)
    right.set_ylabel('largest error of the energy so far,\nrelative to the span of the potential')
    right.set_xlabel('time [s]')
    right.legend(loc='lower right', handlelength=2.2)
    return figure


def motor(scene: Scene) -> Figure:
    """Draw a crank that a voltage accelerates, with the inductance and without."""
    figure, (upper, lower) = sheet(2, 1, sharex=True)
    commands = [(0.05 * index, 12.0) for index in range(1, 6)]
    at_once = changed(scene, ('drive.torque.motor.inductance', None))
    for given, style in (
        (at_once, {'color': VERMILLION, 'linestyle': '--', 'label': 'without inductance'}),
        (scene, {'color': BLUE, 'label': 'with it'}),
    ):
        moving = run(given, 0.3, commands=commands)
        _, rate, acceleration = moving.crank()
        upper.plot(moving.times, rate, **style)
        lower.plot(moving.times, acceleration, **style)
    upper.set_ylabel('crank [rad/s]')
    lower.set_ylabel('crank [rad/s²]')
    lower.set_xlabel('time [s]')
    legend(upper)
    return figure


def play(scene: Scene) -> Figure:
    """Draw a motor and its crank as they meet, and the distance between both."""
    figure, (upper, lower) = sheet(2, 1, sharex=True)
    seconds = 1.0
    moving = run(scene, seconds)
    read = JointStateReader([f'{CRANK}_motor']).read
    read_motor = [read(data) for data in extra_messages(scene, JOINT_STATE_TYPE, seconds)]
    angles = np.array([sample.angles[0] for sample in read_motor])
    crank, _, _ = moving.crank()
    upper.plot(moving.times, angles, color=VERMILLION, linestyle='--', label='motor')
    upper.plot(moving.times, crank, color=BLUE, label='crank')
    upper.set_ylabel('angle [rad]')
    lower.plot(moving.times, angles - crank, color=GREEN)
    half = 0.5 * scene['drive']['torque']['play']['width']
    for end in (-half, half):
        lower.axhline(end, color='black', linewidth=0.8)
    lower.set_ylabel('motor − crank [rad]')
    lower.set_xlabel('time [s]')
    legend(upper)
    return figure


def _span_of_potential(scene: Scene) -> float:
    """Return the span of the potential energy of a linkage, in [J]."""
    creeping = {**scene, 'drive': {'constant_rate': {'rate': tau}}, 'effects': {'effort': {}}}
    moving = run(creeping, 1.0)
    potential = moving.pipeline.linkages[0].context.mechanics.potential_energy
    values = [potential(state.position) for state in moving.states if state.position is not None]
    return max(values) - min(values)


def _one(scene: Scene, seconds: float) -> Figure:
    figure, axes = sheet(2, 1, sharex=True)
    _over_time(axes, run(scene, seconds), color=BLUE)
    return figure


def _over_time(axes: Any, moving: Run, **style: Any) -> None:
    upper, lower = axes
    angle, rate, _ = moving.crank()
    upper.plot(moving.times, angle, **style)
    lower.plot(moving.times, rate, **style)
    upper.set_ylabel('crank [rad]')
    lower.set_ylabel('crank [rad/s]')
    lower.set_xlabel('time [s]')


def _dots(axes: Any, samples: list[Sample], label: str) -> None:
    times, angles, rates = zip(*samples, strict=True)
    for each, values in zip(axes, (angles, rates), strict=True):
        each.plot(times, values, 'o', color='black', markersize=4, label=label)


def _swinging(interval: float, count: int) -> list[Sample]:
    """Return samples of a crank that oscillates at 1 Hz with an amplitude of 1 rad."""
    times = [index * interval for index in range(count)]
    return [(time, sin(tau * time), tau * cos(tau * time)) for time in times]


PICTURES = {
    'topic': topic,
    'constant_rate': constant_rate,
    'profile': profile,
    'sine': sine,
    'chirp': chirp,
    'bag': bag,
    'torque': torque,
    'motor': motor,
    'play': play,
}
