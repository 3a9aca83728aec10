# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A picture of what two joints reach within the limits of two inputs, or inputs within theirs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from linkage_ros.cli import DisplayUnits
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import Closure, COLOURS, reach_boxes, ReachBox
from linkage_ros.names import picture_text
from linkage_ros.tools.drawing.painting import picture_settings, save_picture
import numpy as np
from numpy.typing import NDArray

_LINES, _STATES = 11, 61
"""Lines of equal inputs for each of them, the first and last at its limits; states on a line."""


def reach_lines(box: ReachBox) -> NDArray[np.float64]:
    """Return (2, lines, states, 2) values of two joints, where one input has a line's value."""
    values_at = box.values()
    lines = np.full((2, _LINES, _STATES, 2), np.nan)
    for index in np.ndindex(2, _LINES, _STATES):
        held, line, state = index
        parts = [line / (_LINES - 1), state / (_STATES - 1)]
        if values := values_at(parts[::-1] if held else parts):
            lines[index] = values[:2]
    return lines


def draw_reach(closure: Closure, file: Path, units: DisplayUnits) -> None:
    """
    Draw to a file what two joints reach; gaps are where the linkage does not close.

    A LinkageError says that no two inputs with limits move two joints.
    """
    pairs = (box for box in reach_boxes(closure) if len(box.limits) == 2 <= len(box.joints))
    box = next(pairs, None)
    if box is None:
        reason = 'has no two inputs with limits that move two joints'
        raise LinkageError(closure.name, reason, 'write limits of both inputs, or of two joints')
    unit_of = {name: joint.unit for name, joint in closure.linkage.named_joints.items()}
    first, second = (unit_of[name] for name in box.joints[:2])
    shown = reach_lines(box) * [units.convert(1.0, first), units.convert(1.0, second)]
    context = picture_settings()
    from matplotlib.figure import Figure  # local import: an extra, and slow to load

    with context:
        figure = Figure(figsize=(6.4, 5.6), dpi=110, layout='constrained')
        axes = figure.subplots()
        axes.set_title(picture_text(closure.name, 60), loc='left', fontsize=9)
        axes.set_xlabel(f'{picture_text(box.joints[0], 30)} [{units.name_unit(first)}]')
        axes.set_ylabel(f'{picture_text(box.joints[1], 30)} [{units.name_unit(second)}]')
        given = zip(box.closure.input_names, box.limits, COLOURS, shown, strict=False)
        for name, limits, colour, lines in given:
            unit = unit_of[name]
            low, high = (units.convert(end, unit) for end in (limits.low, limits.high))
            text = f'{picture_text(name, 30)}: {low:.4g} to {high:.4g} {units.name_unit(unit)}'
            _draw_lines(axes, lines, colour, text)
        axes.legend(loc='best', fontsize=7, title='limits, and tenths of them')
        save_picture(figure, file)


def _draw_lines(axes: Any, lines: NDArray[np.float64], colour: str, text: str) -> None:
    """Draw the lines of equal values of an input: those at its limits thick, and named."""
    for number, line in enumerate(lines):
        is_edge = number in (0, _LINES - 1)
        axes.plot(
            *line.T,
            color=colour,
            lw=2.0 if is_edge else 0.5,
            label=text if number == 0 else None,
        )
