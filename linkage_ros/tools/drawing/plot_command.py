# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Draw the joints of a bag, their rates and accelerations, over its crank or over time.

Of several linkages the first is drawn. A curve breaks at lost ticks, and where none was published.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import nan, pi, tau
from pathlib import Path
from threading import Event

from linkage_ros.cli import (
    add_bag,
    add_output,
    add_trust,
    open_bag,
    output_or,
    path_beside,
    PICTURES,
    scene_of,
)
from linkage_ros.description import Scene
from linkage_ros.errors import BagError
from linkage_ros.kinematics import (
    Closure,
    Curve,
    Input,
    InputRange,
    InputSweep,
    Linkage,
    RevoluteJoint,
    sweep_range,
)
from linkage_ros.messages import (
    ACCELERATION,
    JointStateReader,
    MessageValues,
    NANOSECONDS,
    Rejection,
)
from linkage_ros.names import picture_text
from linkage_ros.replay import replay_ticks
from linkage_ros.signals import StoppedError
from linkage_ros.tick import Pipeline
from linkage_ros.tools.drawing.figure import label_across, label_joints, plot_joints, stacked_axes
from linkage_ros.tools.drawing.painting import picture_settings, save_picture
import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Values = tuple[float, ...]
"""Values of joints, in [rad] or [m], and per second."""

_STEADY, _UNSTEADY = 1.5, 5.0
"""Usual steps that make a gap, of ticks at a rate and of ticks that come with samples."""

_PER = {'rate': 's', 'acceleration': 's²'}
"""What the unit of a derivative has below it."""

EXAMPLE = 'linkage plot my_bag -o my_bag.png'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_bag(parser)
    add_output(parser, PICTURES, 'BAG.png')
    parser.add_argument(
        '--over',
        choices=('crank', 'time'),
        help='the axis (default: crank; of several inputs time)',
    )
    add_trust(parser)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Draw the bag."""
    picture = output_or(arguments, path_beside(arguments.bag, '.png'))
    draw_bag(
        arguments.bag,
        picture,
        stop,
        over=arguments.over or '',
        trust_effects=arguments.trust_effects,
    )
    print(picture)
    return 0


def draw_bag(
    bag_path: Path,
    picture: Path,
    stop: Event,
    *,
    over: str = '',
    trust_effects: bool = False,
) -> None:
    """
    Draw a bag: each published joint, and its rate and acceleration if they were recorded.

    ``over`` is the axis: 'crank' or 'time'; by default the crank, and of several inputs the time.
    Angles are continuous over the range of the crank, as in `linkage draw`, in whichever turn they
    were recorded. A LinkageError is raised if matplotlib is not installed, or the bag holds
    nothing to draw; a StoppedError if the event was set.
    """
    picture_settings()  # without matplotlib, say so before the bag is read
    bag = open_bag(bag_path, stop)
    scene = scene_of(bag, trust_effects=trust_effects)
    # The x axis is the crank of the first linkage; its joints are drawn.
    scene_linkage = scene.linkages[0]
    reader = JointStateReader(scene_linkage.joint_names)
    times: list[int] = []
    cranks: list[Values] = []
    positions: list[Values] = []
    rates: list[Values] = []
    accelerations: list[Values] = []
    read_accelerations = _acceleration_reader(scene)
    for at, recorded, extras, tick in replay_ticks(bag, scene):
        if stop.is_set():
            raise StoppedError
        crank_state = tick.states[0].crank
        if crank_state is None or not recorded:
            continue
        sample = reader.read(recorded)
        if sample is Rejection.MISSING:  # for this linkage only; others had a reading
            continue
        if isinstance(sample, Rejection):
            raise BagError(bag_path, f'a joint state: {sample.value}', 'name another bag')
        times.append(at)
        cranks.append(tuple(crank_state.angles))
        positions.append(sample.angles)
        rates.append(sample.rates or ())
        accelerations.append(read_accelerations(extras))
    if not positions:
        raise BagError(bag_path, 'holds no joint states', 'record a run with a crank')
    seconds = (np.array(times) - times[0]) / NANOSECONDS
    gaps = is_after_gap(seconds, steady=scene.rate > 0.0)
    over_time = over == 'time' or (not over and len(scene_linkage.linkage.inputs) > 1)
    curves = partial(curves_over_time, scene_linkage.linkage, seconds)
    if not over_time:
        curves = partial(crank_curves, scene_linkage.linkage)
    joints, joint_rates = curves(cranks, positions, rates, gaps)
    joint_accelerations = (
        curves(cranks, positions, accelerations, gaps)[1] if any(accelerations) else []
    )
    if not joints:
        raise BagError(bag_path, 'holds no joint but its crank', 'name another bag')
    title = f'{scene.name}: {len(positions)} joint states'
    driven = None if over_time else scene_linkage.linkage.inputs[0]
    derivatives = {'rate': joint_rates, 'acceleration': joint_accelerations}
    _paint_curves(title, driven, joints, derivatives, picture, scene.units.length)


def _acceleration_reader(scene: Scene) -> Callable[[Sequence[bytes]], Values]:
    """Return a function that reads the first linkage's accelerations from a tick's messages."""
    linkage = Pipeline(scene).linkages[0]
    types = [extra.message for extra in linkage.extras]
    if 'acceleration' not in linkage.scene_linkage.effects:
        return lambda _: ()
    place = [extra.effect for extra in linkage.extras].index('acceleration')
    read = MessageValues(types[place]).read
    keys = [(name, ACCELERATION) for name in linkage.scene_linkage.joint_names]

    def read_accelerations(extras: Sequence[bytes]) -> Values:
        values = read(extras[place]) if place < len(extras) and extras[place] else ''
        if isinstance(values, str):
            return ()
        numbers = dict(zip(values.keys, values.numbers, strict=True))
        return tuple(numbers[key] for key in keys) if numbers.keys() >= {*keys} else ()

    return read_accelerations


def is_after_gap(times: Floats, *, steady: bool) -> Bools:
    """
    Return for each joint state whether ticks were lost before it, or nothing was published.

    The times are in [s]. Ticks that are not ``steady`` come with samples, at any times.
    """
    steps = np.diff(times)
    # Where the clock was set back, another part of the run begins.
    gaps = (steps > longest_step(times, steady=steady)) | (steps < 0.0)
    return np.concatenate([[False], gaps])


def longest_step(times: Floats, *, steady: bool) -> float:
    """Return the longest time between two joint states with no gap between them."""
    steps = np.diff(times)
    return (_STEADY if steady else _UNSTEADY) * float(np.median(steps)) if len(steps) else 0.0


def curves_over_time(
    linkage: Linkage,
    times: Floats,
    cranks: Sequence[Values],
    positions: Sequence[Values],
    rates: Sequence[Values],
    gaps: Bools,
) -> tuple[list[Curve], list[Curve]]:
    """Return crank and joints over the times, and the joints' rates; see `crank_curves`."""
    driven = linkage.inputs[0]
    named = {
        name: (isinstance(joint, RevoluteJoint), [values[place] for values in positions])
        for place, (name, joint) in enumerate(linkage.joints.items())
    }
    # The last, so that joints and rates have the same colours.
    named.setdefault(driven.joint, (not driven.slider, [inputs[0] for inputs in cranks]))
    joints = []
    for name, (turning, values) in named.items():
        breaks = gaps.copy()
        if turning:  # an angle may be wrapped
            breaks[1:] |= np.abs(np.diff(values)) > pi
        joints.append(_break_curve(name, turning, times, np.array(values), breaks))
    joint_rates = [
        _break_curve(
            name,
            isinstance(joint, RevoluteJoint),
            times,
            np.array([row[place] if row else nan for row in rates]),
            gaps,
        )
        for place, (name, joint) in enumerate(linkage.joints.items())
        if any(rates)
    ]
    return joints, joint_rates


def _break_curve(name: str, turning: bool, x: Floats, y: Floats, breaks: Bools) -> Curve:
    """Return a curve that begins anew at the breaks."""
    at = np.flatnonzero(breaks)
    points = (tuple(np.insert(values, at, nan).tolist()) for values in (x, y))
    return Curve(name, turning, *points)


def crank_curves(
    linkage: Linkage,
    cranks: Sequence[Values],
    positions: Sequence[Values],
    rates: Sequence[Values],
    gaps: Bools | None = None,
) -> tuple[list[Curve], list[Curve]]:
    """
    Return the joints over the crank, and their rates if they were recorded.

    For each joint state ``cranks`` has the inputs, ``positions`` the joints, in [rad] or [m],
    ``rates`` their rates per second, or () if not recorded. ``gaps`` marks the joint states at
    which a curve begins anew, as after lost ticks.
    """
    driven = linkage.inputs[0]
    closure = Closure(linkage)
    input_sweep = InputSweep(closure, cranks[0])
    about = (interval for interval in input_sweep.ranges if _is_within(cranks[0][0], interval))
    interval = next(about, input_sweep.widest_range)
    ideal = sweep_range(input_sweep, interval).joints if interval else ()
    crank = np.array([inputs[0] for inputs in cranks])
    if interval and not driven.slider:
        crank = crank + np.array([interval.shift(value) for value in crank.tolist()])
    # The curves end at the greatest angle, where their names stand.
    end = int(crank.argmax()) + 1
    order = [*range(end, len(crank)), *range(end)]
    crank = crank[order]
    begins = np.arange(len(crank)) == len(crank) - end
    if gaps is not None:
        begins |= gaps[order]
    if not driven.slider:
        begins[1:] |= np.abs(np.diff(crank)) > pi
    joints, joint_rates = [], []
    for place, (name, joint) in enumerate(linkage.joints.items()):
        if name == driven.joint:
            continue
        turning = isinstance(joint, RevoluteJoint)
        values = np.array([positions[i][place] for i in order])
        breaks = begins.copy()
        if turning:
            breaks[1:] |= np.abs(np.diff(values)) > pi
            # Whatever turn a piece was recorded in, it is drawn in the ideal motion's turn.
            near = np.interp(crank, ideal[place].x, ideal[place].y) if ideal else 0.0 * crank
            turns = np.round((values - near) / tau)
            for piece in np.split(np.arange(len(values)), np.flatnonzero(breaks)):
                known = piece[np.isfinite(values[piece])]
                if len(known):
                    values[known] -= tau * np.round(np.median(turns[known]))
        joints.append(_break_curve(name, turning, crank, values, breaks))
        if any(rates):
            # At a toggle there are no rates.
            its_rates = np.array([rates[i][place] if rates[i] else nan for i in order])
            joint_rates.append(_break_curve(name, turning, crank, its_rates, breaks))
    return joints, joint_rates


def _is_within(value: float, interval: InputRange) -> bool:
    return interval.lowest <= value + interval.shift(value) <= interval.highest


def _paint_curves(
    title: str,
    driven: Input | None,
    joints: Sequence[Curve],
    derivatives: Mapping[str, Sequence[Curve]],
    picture: Path,
    length: str,
) -> None:
    """Paint joints and their derivatives over the crank; over time, if none is driven."""
    context = picture_settings()
    from matplotlib.figure import Figure  # local import: an extra, and slow to load
    from matplotlib.ticker import AutoLocator

    parts = {'': joints} | {name: part for name, part in derivatives.items() if part}
    panels_each = len({joint.turning for joint in joints})
    with context:
        figure = Figure(
            figsize=(8.0, 0.8 + 2.6 * panels_each * len(parts)), dpi=120, layout='constrained'
        )
        stacked = stacked_axes(figure.add_gridspec, [*parts.values()])
        drawn = []
        in_degrees = driven is not None and not driven.slider
        for panels, (name, part) in zip(stacked, parts.items(), strict=True):
            lines = plot_joints(panels, part, degrees_x=in_degrees, length=length)
            drawn.append((panels, part, lines))
            for turning, axes in panels.items() if name else ():
                if turning:
                    axes.yaxis.set_major_locator(AutoLocator())
                quantity = axes.get_ylabel()[:-1]
                axes.set_ylabel(f'{name} of {quantity}/{_PER[name]}]')
        lowest = list(drawn[-1][0].values())[-1]
        if driven is None:
            lowest.set_xlabel('time since the first joint state [s]')
        else:
            unit = 'm' if driven.slider else '°'
            label_across(lowest, picture_text(driven.joint), unit, length)
        figure.suptitle(picture_text(title, 160))
        figure.align_ylabels()
        figure.draw_without_rendering()  # only now axes and texts have a size
        for panels, part, lines in drawn:
            label_joints(panels, part, lines)
        save_picture(figure, picture)
