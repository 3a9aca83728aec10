# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The picture of docs/synthesis.md: decimals against error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isnan, nan
from pathlib import Path

from linkage_ros.kinematics import COLOURS, INK
from linkage_ros.tools.drawing import picture_settings, save_picture

_LINKS = ('crank', 'coupler', 'rocker')


def digits_picture(
    example: Mapping[int, tuple[Sequence[float], float]],
    random: Mapping[int, tuple[float, float, float]],
    printed: tuple[int, float],
    file: Path,
) -> None:
    """
    Draw the errors that rounding the cosines causes.

    Parameters
    ----------
    example
        By decimals: relative errors of crank, coupler and rocker, and the rocker's greatest error
        in degrees.
    random
        By decimals: median, 95th percentile and greatest error of the couplers of random designs.
    printed
        Decimals of the textbook, and the error of its coupler.
    file
        The file to write.

    """
    context = picture_settings()
    from matplotlib.figure import Figure

    with context:
        figure = Figure(figsize=(9.6, 4.2), dpi=110, layout='constrained')
        left, right = figure.subplots(1, 2)
        decimals = sorted(random)
        median, most, greatest = ([random[n][i] for n in decimals] for i in range(3))
        left.fill_between(
            decimals, median, most, color='0.82', linewidth=0, label='random, median to 95 %'
        )
        left.plot(decimals, greatest, color='0.5', linewidth=0.9, linestyle=(0, (4, 2)),
                  label='random, greatest')  # fmt: skip
        styles = zip(_LINKS, COLOURS, ('o', 's', '^'), strict=False)
        for i, (link, colour, marker) in enumerate(styles):
            errors = [example[n][0][i] for n in sorted(example)]
            left.plot(
                sorted(example), errors, color=colour, marker=marker, markersize=4.0,
                linewidth=1.2, label=f'the example, {link}',
            )  # fmt: skip
        left.plot([printed[0]], [printed[1]], 'x', color=INK, markersize=7.0, markeredgewidth=1.6)
        left.annotate(
            'the coupler in print', printed, (12.0, 14.0), textcoords='offset points',
            fontsize=7.5,
            arrowprops={'arrowstyle': '-', 'linewidth': 0.6, 'color': INK}, color=INK,
        )  # fmt: skip
        left.set_ylabel('relative error of a length')
        # Without a linkage the line is broken.
        met = {n: each if each < 360.0 else nan for n, (_, each) in sorted(example.items())}
        right.plot(list(met), list(met.values()), color=INK, marker='o', markersize=4.0,
                   linewidth=1.2, label='the example, rocker at the pairs')  # fmt: skip
        for n in (n for n, each in met.items() if isnan(each)):
            right.axvline(n, color=COLOURS[1], linewidth=1.0, linestyle=(0, (1, 2)),
                          label='cannot be assembled at one of the pairs')  # fmt: skip
        right.set_ylabel('greatest error of the rocker [°]')
        for axes in (left, right):
            axes.set_yscale('log')
            axes.set_xlabel('decimals of the cosines')
            axes.set_xticks(sorted(example))
            axes.grid(alpha=0.3, linewidth=0.5)
            axes.tick_params(labelsize=7, width=0.5)
            for side in ('top', 'right'):
                axes.spines[side].set_visible(False)
            axes.legend(frameon=False, fontsize=7, loc='upper right')
        save_picture(figure, file)
