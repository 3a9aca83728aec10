# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A picture of a study: each joint over the time, with median, 5–95 % band and extremes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from linkage_ros.kinematics import COLOURS
from linkage_ros.names import picture_text
from linkage_ros.tools.drawing.painting import picture_settings, save_picture
import numpy as np
from numpy.typing import NDArray

_PERCENTILES = (0.0, 5.0, 50.0, 95.0, 100.0)
_MEDIAN = 2


class JointSpread(NamedTuple):
    """A joint in all runs: a row for each run, a column for each instant; NaN if not published."""

    name: str
    unit: str
    values: NDArray[np.float64]


def draw_spread(title: str, seconds: float, joints: Sequence[JointSpread], file: Path) -> None:
    """
    Draw a study to a file: each joint, and next to it how far the runs are from their median.

    The suffix selects the format. A LinkageError says that matplotlib is not installed, or that
    the file cannot be written.
    """
    context = picture_settings()
    from matplotlib.figure import Figure  # local import: an extra, and slow to load

    with context:
        figure = Figure(figsize=(8.0, 0.6 + 2.0 * len(joints)), dpi=110, layout='constrained')
        figure.suptitle(picture_text(title, 120), x=0.01, ha='left', fontsize=9)
        grid = figure.subplots(len(joints), 2, sharex=True, squeeze=False)
        for index, ((left, right), joint) in enumerate(zip(grid, joints, strict=True)):
            colour = COLOURS[index % len(COLOURS)]
            times = np.linspace(0.0, seconds, joint.values.shape[1])
            levels = _percentile_levels(joint.values)
            _draw_band(left, times, levels, colour)
            _draw_band(right, times, levels - levels[_MEDIAN], colour)
            left.set_ylabel(f'{picture_text(joint.name, 30)} [{joint.unit}]')
            right.set_ylabel(f'less the median [{joint.unit}]')
        for axes in grid[-1]:
            axes.set_xlabel('time [s]')
        grid[0][0].legend(loc='best', fontsize=7)
        save_picture(figure, file)


def _percentile_levels(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the percentiles of the runs at each instant; not a number where no run has any."""
    there = ~np.isnan(values).all(axis=0)
    levels = np.full((len(_PERCENTILES), values.shape[1]), np.nan)
    levels[:, there] = np.nanpercentile(values[:, there], _PERCENTILES, axis=0)
    return levels


def _draw_band(
    axes: Any, times: NDArray[np.float64], levels: NDArray[np.float64], colour: str
) -> None:
    least, low, middle, high, most = levels
    axes.fill_between(times, least, most, color=colour, alpha=0.15, lw=0, label='all runs')
    axes.fill_between(times, low, high, color=colour, alpha=0.35, lw=0, label='5 to 95 %')
    axes.plot(times, middle, color=colour, lw=1.2, label='median')
