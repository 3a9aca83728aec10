# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The style of the pictures: size, colours and file format."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
import numpy as np
from PIL import Image
from PIL.PngImagePlugin import PngInfo

mpl.use('Agg')
mpl.rcParams.update(
    {
        'font.size': 9.0,
        'axes.titlesize': 9.5,
        'axes.titlelocation': 'left',
        'axes.spines.top': False,
        'axes.spines.right': False,
        'axes.grid': True,
        'axes.axisbelow': True,
        'grid.alpha': 0.3,
        'lines.linewidth': 1.8,
        'legend.frameon': False,
        'legend.borderaxespad': 0.0,
        'figure.facecolor': 'white',
    }
)

BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = (
    '#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9',
)  # fmt: skip
"""The palette of Okabe and Ito, which colour-blind readers can distinguish."""

IDEAL: dict[str, Any] = {'color': 'black', 'linewidth': 1.0, 'linestyle': (0, (4, 2))}
"""The line style of the ideal result, without the effect."""

SCENE = 'Scene'
"""The key of the PNG text that holds the scene of a picture."""

_SIZE = (8.0, 3.5)
_DPI = 120
_COLOURS = 256
_FEW_COLOURS = 64


def sheet(rows: int = 1, columns: int = 1, **layout: Any) -> tuple[Figure, Any]:
    """Return a figure, and its axes or an array of them."""
    figure = empty_sheet()
    return figure, figure.subplots(rows, columns, **layout)


def empty_sheet() -> Figure:
    """Return a figure without axes."""
    return Figure(figsize=_SIZE, dpi=_DPI, layout=ConstrainedLayoutEngine(w_pad=0.09, h_pad=0.07))


def save(figure: Figure, scene: str, file: Path) -> None:
    """Store a picture as PNG with few colours, and with its scene."""
    figure.align_ylabels()
    drawn = BytesIO()
    figure.savefig(drawn, format='png')
    about = PngInfo()
    about.add_itxt(SCENE, scene)
    with Image.open(drawn) as image:
        few = image.convert('RGB').quantize(_COLOURS, dither=Image.Dither.NONE)
        few.save(file, optimize=True, pnginfo=about)


def save_small(figure: Figure, small: Path) -> Path:
    """Store a picture half as wide, for an overview: without letters, which would be too small."""
    for axes in figure.axes:
        axes.set(xlabel='', ylabel='', title='')
        axes.tick_params(which='both', length=0.0, labelbottom=False, labelleft=False)
        for letters in (*axes.texts, axes.get_legend()):
            if letters is not None:
                letters.remove()
    for legend_of_all in (*figure.legends, *figure.texts):
        legend_of_all.remove()
    width, height = figure.get_size_inches()
    figure.set_size_inches(0.5 * width, 0.5 * height)
    drawn = BytesIO()
    figure.savefig(drawn, format='png')
    with Image.open(drawn) as image:
        few = image.convert('RGB').quantize(_FEW_COLOURS, dither=Image.Dither.NONE)
        few.save(small, optimize=True)
    return small


def over_a_turn(axes: Any, label: str = 'crank angle [rad]') -> None:
    """Set the horizontal axis to one turn of the crank."""
    axes.set_xlim(0.0, 2.0 * np.pi)
    axes.set_xticks([0.5 * n * np.pi for n in range(5)], ['0', 'π/2', 'π', '3π/2', '2π'])
    axes.set_xlabel(label)


def legend(axes: Any, columns: int = 4) -> None:
    """Add the legend above the axes."""
    axes.legend(loc='lower left', bbox_to_anchor=(0.0, 1.02), ncols=columns, handlelength=2.2)
