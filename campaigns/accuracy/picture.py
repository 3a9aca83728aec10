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

"""The distribution of the errors of all families, as a picture."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from campaigns.accuracy.judge import QUANTITIES
from campaigns.accuracy.tally import BINS, edges, OCTAVE, Tally
import matplotlib as mpl
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
import numpy as np

_SHOWN = (2.0**-12, 2.0**7)


def draw(tallies: Mapping[str, Tally], file: Path, limit: float) -> None:
    """
    Draw a row per family: how many of its errors lie where, and its worst.

    Parameters
    ----------
    tallies
        What was found.
    file
        Where to.
    limit
        Shown as a line, in u·κ.

    """
    mpl.rcParams['svg.hashsalt'] = 'linkage_ros'
    families = list(tallies)
    figure = Figure(figsize=(13, 1.6 + 0.24 * len(families)), layout='constrained')
    panels = figure.subplots(1, len(QUANTITIES), sharey=True)
    # Four bins to an octave are what the eye can tell apart.
    step = OCTAVE // 4
    borders = edges()[::step]
    image: Any = None
    for axes, quantity in zip(panels, QUANTITIES, strict=True):
        rows = np.zeros((len(families), len(borders) - 1))
        for i, family in enumerate(families):
            found = tallies[family].quantities.get(quantity)
            if found is None:
                continue
            inner = found.histogram[1 : BINS - 1]
            coarse = inner[: len(inner) // step * step].reshape(-1, step).sum(axis=1)
            coarse = coarse[: rows.shape[1]].astype(float)
            coarse[np.searchsorted(borders, _SHOWN[0])] += found.histogram[0]
            rows[i, : len(coarse)] = coarse / found.count()
            if found.greatest() > _SHOWN[1]:
                axes.plot(_SHOWN[1] / 1.15, i, 'r>', markersize=5)
            else:
                axes.plot(max(found.greatest(), _SHOWN[0]), i, 'k|', markersize=8, mew=1.5)
        image = axes.pcolormesh(
            borders,
            np.arange(len(families) + 1) - 0.5,
            np.where(rows > 0, rows, np.nan),
            norm=LogNorm(1e-7, 0.3),
            cmap='viridis_r',
            rasterized=True,
        )
        axes.axvline(limit, color='crimson', linewidth=1)
        axes.set(xscale='log', xlim=_SHOWN, title=quantity, xlabel='error / (u·κ)')
        axes.grid(visible=True, axis='x', alpha=0.3)
    panels[0].set_yticks(range(len(families)), families)
    panels[0].set_ylim(len(families) - 0.5, -0.5)
    figure.colorbar(image, ax=panels, label='part of the errors', fraction=0.02)
    figure.suptitle(
        f'Errors of all cases; | the worst of a family (red: outside), red line: {limit:g} u·κ'
    )
    file.parent.mkdir(parents=True, exist_ok=True)
    metadata = {'Date': None} if file.suffix == '.svg' else None
    figure.savefig(file, dpi=110, metadata=metadata)
