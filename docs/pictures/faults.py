# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The picture of the faults: two joints around each of them."""

from __future__ import annotations

from math import cos, pi, sin

from linkage_ros.stages.faults import FAULTS
from matplotlib.figure import Figure
import numpy as np

from .paper import BLUE, IDEAL, ORANGE, sheet, SKY
from .runs import changed, run, Scene

_BESIDE = 0.5
"""Time shown before and after a fault, in [s]."""


def faults(scene: Scene) -> Figure:
    """Draw two joints around each fault, one panel each."""
    figure, panels = sheet(2, 3, sharey=True)
    figure.set_size_inches(8.0, 4.8)
    spans = [
        (at, at + fault['seconds'], next(key for key in fault if key in FAULTS))
        for fault in scene['faults'].values()
        for at in fault['at']
    ]
    seconds = max(end for _, end, _ in spans) + _BESIDE
    times = [index * 0.005 for index in range(round(seconds / 0.005))]
    samples = [(time, sin(pi * time), pi * cos(pi * time)) for time in times]
    ideal = run(changed(scene, ('faults', None)), seconds, samples)
    faulty = run(scene, seconds, samples)
    ahead = faulty.stamps() - ideal.times
    for axes, (at, end, kind) in zip(panels.flat, spans, strict=True):
        for joint, colour in (('rocker_joint', BLUE), ('coupler_joint', ORANGE)):
            axes.plot(ideal.times, faulty.position(joint), color=colour, label=joint)
            axes.plot(ideal.times, ideal.position(joint), **IDEAL)
        axes.axvspan(at, end, color=SKY, alpha=0.3, linewidth=0.0)
        axes.set_xlim(at - _BESIDE, end + _BESIDE)
        most = 1e3 * np.nanmax(ahead[(ideal.times >= at) & (ideal.times <= end)], initial=0.0)
        axes.set_title(f'{kind}: stamps {most:.0f} ms ahead' if most > 0.5 else kind)
    axes.plot([], [], label='without faults', **IDEAL)
    figure.legend(*axes.get_legend_handles_labels(), loc='outside upper left', ncols=3)
    figure.supxlabel('time [s]', fontsize='medium')
    figure.supylabel('joint [rad]', fontsize='medium')
    return figure


PICTURES = {'faults': faults}
