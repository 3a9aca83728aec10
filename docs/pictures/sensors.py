# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Pictures of sensor readings of a moving rocker."""

from __future__ import annotations

from itertools import pairwise

from matplotlib.figure import Figure
import numpy as np

from .paper import BLUE, IDEAL, legend, ORANGE, sheet, SKY, VERMILLION
from .runs import changed, Run, run, Scene

_ROCKER = 'rocker_joint'


def jitter(scene: Scene) -> Figure:
    """Draw the errors of readings, and their bound."""
    figure, axes = sheet()
    ideal, read = _pair(scene, 1.0)
    most = scene['effects']['jitter']['seconds'] * 1e3
    reach = -most * ideal.rate(_ROCKER)
    axes.fill_between(
        ideal.times, 0.0, reach, color=SKY, alpha=0.4, linewidth=0.0, label=f'rate · {most:g} ms'
    )
    axes.axhline(0.0, label='looks at once', **IDEAL)
    off = 1e3 * (read.position(_ROCKER) - ideal.position(_ROCKER))
    axes.plot(read.times, off, '.', color=BLUE, markersize=3, label='looks earlier')
    axes.set_xlabel('time [s]')
    axes.set_ylabel('rocker is off [mrad]')
    legend(axes)
    return figure


def bias(scene: Scene) -> Figure:
    """Draw the reading and the joint."""
    figure, axes = sheet()
    ideal, read = _pair(scene, 2.0)
    axes.plot(ideal.times, ideal.position(_ROCKER), label='the joint', **IDEAL)
    axes.plot(read.times, read.position(_ROCKER), color=BLUE, label='as read')
    axes.set_xlabel('time [s]')
    axes.set_ylabel('rocker [rad]')
    legend(axes)
    return figure


def noise(scene: Scene) -> Figure:
    """Draw the noise alone, and the standard deviation of its random walk."""
    figure, axes = sheet()
    ideal, read = _pair(scene, 20.0)
    walk = 1e3 * scene['effects']['noise']['joints'][_ROCKER]['walk'] * np.sqrt(read.times)
    axes.fill_between(
        read.times,
        -walk,
        walk,
        color=ORANGE,
        alpha=0.3,
        linewidth=0.0,
        label='± standard deviation of the walk',
    )
    axes.axhline(0.0, label='the joint', **IDEAL)
    off = 1e3 * (read.position(_ROCKER) - ideal.position(_ROCKER))
    axes.plot(read.times, off, color=BLUE, linewidth=0.6, label='as read')
    axes.set_xlabel('time [s]')
    axes.set_ylabel('rocker is off [mrad]')
    legend(axes)
    return figure


def encoder(scene: Scene) -> Figure:
    """Draw the steps of some counts, and the rates computed from them."""
    figure, (left, right) = sheet(1, 2)
    ideal, read = _pair(scene, 0.5)
    first, last = 250, 271
    times = 1e3 * read.times
    for axes, values in ((left, Run.position), (right, Run.rate)):
        axes.plot(
            times[first:last], values(read, _ROCKER)[first:last],
            color=BLUE, drawstyle='steps-post', marker='.', label='as read',
        )  # fmt: skip
        axes.plot(
            times[first:last], values(ideal, _ROCKER)[first:last], label='the joint', **IDEAL
        )
        axes.set_xlabel('time [ms]')
        legend(axes)
    left.set_ylabel('rocker [rad]')
    right.set_ylabel('rocker [rad/s]')
    return figure


def rate_limit(scene: Scene) -> Figure:
    """Draw the held readings."""
    figure, axes = sheet()
    ideal, read = _pair(scene, 1.0)
    axes.plot(ideal.times, ideal.position(_ROCKER), label='the joint', **IDEAL)
    axes.plot(
        read.times, read.position(_ROCKER), color=BLUE, label='as read', drawstyle='steps-post'
    )
    axes.set_xlabel('time [s]')
    axes.set_ylabel('rocker [rad]')
    legend(axes)
    return figure


def dropout(scene: Scene) -> Figure:
    """Draw the readings that arrive, and the gaps."""
    figure, axes = sheet()
    ideal, read = _pair(scene, 1.0)
    axes.plot(ideal.times, ideal.position(_ROCKER), label='the joint', **IDEAL)
    values = read.position(_ROCKER)
    axes.plot(read.times, values, '.', color=BLUE, markersize=5, label='arrives')
    half = 0.5 * (read.times[1] - read.times[0])
    lost = np.isnan(values).astype(int)
    edges = np.flatnonzero(np.diff(lost, prepend=0, append=0))
    for index, (begin, end) in enumerate(edges.reshape(-1, 2)):
        axes.axvspan(
            read.times[begin] - half, read.times[end - 1] + half,
            color=ORANGE, alpha=0.4, linewidth=0.0, label='' if index else 'lost',
        )  # fmt: skip
    axes.set_xlabel('time [s]')
    axes.set_ylabel('rocker [rad]')
    legend(axes)
    return figure


def delay(scene: Scene) -> Figure:
    """Draw the delayed readings and the joint."""
    figure, axes = sheet()
    ideal, read = _pair(scene, 3.0)
    axes.plot(ideal.times, ideal.position(_ROCKER), label='the joint', **IDEAL)
    axes.plot(read.times, read.position(_ROCKER), color=BLUE, label='as it arrives')
    late = scene['effects']['delay']['seconds']
    values = ideal.position(_ROCKER)
    # An arrow from the first peak to where it arrives.
    peak = next(
        n for n, (before, after) in enumerate(pairwise(np.diff(values)), 1) if before > 0 >= after
    )
    begin, top = ideal.times[peak], values[peak]
    arrow = {'arrowstyle': '->', 'color': VERMILLION, 'shrinkA': 0.0, 'shrinkB': 0.0}
    axes.annotate('', (begin + late, top), (begin, top), arrowprops=arrow)
    axes.text(begin + 0.5 * late, top + 0.012, f'{1e3 * late:g} ms', ha='center', color=VERMILLION)
    axes.set_ylim(top=top + 0.04)
    axes.set_xlabel('time [s]')
    axes.set_ylabel('rocker [rad]')
    legend(axes)
    return figure


def _pair(scene: Scene, seconds: float) -> tuple[Run, Run]:
    """Return the runs of a scene with ideal sensors, and with its own sensors."""
    ideal = changed(scene, ('effects', {'velocity': {}}))
    return run(ideal, seconds), run(scene, seconds)


PICTURES = {
    'jitter': jitter,
    'bias': bias,
    'noise': noise,
    'measuring_range': bias,
    'encoder': encoder,
    'rate_limit': rate_limit,
    'dropout': dropout,
    'delay': delay,
}
