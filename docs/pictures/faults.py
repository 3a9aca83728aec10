# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""The picture of the faults: one timeline with all of them."""

from __future__ import annotations

from math import cos, pi, sin

from linkage_ros.faults.fault import FAULTS
from matplotlib.figure import Figure

from .paper import BLUE, IDEAL, legend, ORANGE, sheet, SKY
from .runs import changed, run, Scene


def faults(scene: Scene) -> Figure:
    """Draw two joints and the clock while one fault comes after the other."""
    figure, (upper, lower) = sheet(2, 1, sharex=True, height_ratios=(2.6, 1.0))
    last = max(at + fault['seconds'] for fault in scene['faults'].values() for at in fault['at'])
    seconds = last + 0.5
    times = [number * 0.005 for number in range(round(seconds / 0.005))]
    samples = [(time, sin(pi * time), pi * cos(pi * time)) for time in times]
    ideal = run(changed(scene, ('faults', None)), seconds, samples)
    harmed = run(scene, seconds, samples)
    for joint, colour in (('rocker_joint', BLUE), ('coupler_joint', ORANGE)):
        upper.plot(ideal.times, ideal.position(joint), **IDEAL)
        upper.plot(ideal.times, harmed.position(joint), color=colour, label=joint)
    upper.plot([], [], label='without faults', **IDEAL)
    upper.set_ylabel('joint [rad]')
    lower.plot(ideal.times, 1e3 * (harmed.stamps() - ideal.times), color='black')
    lower.set_ylabel('stamp − time\n[ms]')
    lower.set_xlabel('time [s]')
    lower.margins(y=0.2)
    upper.set_ylim(-1.8, 2.6)
    for fault in scene['faults'].values():
        kind = next(key for key in fault if key in FAULTS)
        for at in fault['at']:
            end = at + fault['seconds']
            for axes in (upper, lower):
                axes.axvspan(at, end, color=SKY, alpha=0.3, linewidth=0.0)
            upper.text(
                0.5 * (at + end), 0.03, kind, ha='center', transform=upper.get_xaxis_transform()
            )
    legend(upper)
    return figure


PICTURES = {'faults': faults}
