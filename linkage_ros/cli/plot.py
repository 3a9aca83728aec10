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


"""Draw the joints of a bag, and their rates, over its crank, the first where there are several."""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from math import nan, pi, tau
from pathlib import Path
from threading import Event
from typing import Any

from linkage_ros.cli.bag_reading import add_trust, beside, opened, scene_of
from linkage_ros.drawing.painting import save
from linkage_ros.effects.angle_unwrap import wrapped
from linkage_ros.errors import BagError, LinkageError, shortened
from linkage_ros.kinematics.linkage import Input, RevoluteJoint
from linkage_ros.messages.joint_state import JointStateReader, Rejection
from linkage_ros.replay.replay import replay
from linkage_ros.signals import StoppedError

_COLOURS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9')
"""Colours by Okabe and Ito, which colour-blind readers can distinguish."""

Curves = dict[str, tuple[list[float], list[float]]]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('bag', type=Path, help="the bag's folder or its .mcap file")
    parser.add_argument('-o', '--output', type=Path, help='PNG, SVG or PDF; without it BAG.png')
    add_trust(parser)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Draw the bag."""
    picture = arguments.output or beside(arguments.bag, '.png')
    draw(arguments.bag, picture, stop, trust_effects=arguments.trust_effects)
    print(picture)
    return 0


def draw(bag_path: Path, picture: Path, stop: Event, *, trust_effects: bool = False) -> None:
    """
    Draw a bag: each published joint, and its rate if recorded, over one turn of the crank.

    A sliding crank is drawn over the length of its motion.

    Raises
    ------
    LinkageError
        If matplotlib is not installed, or the bag holds nothing to draw.
    StoppedError
        The event was set.

    """
    if find_spec('matplotlib') is None:
        raise LinkageError(
            'matplotlib', 'is not installed', 'pip install linkage_ros[report], or apt its package'
        )
    bag = opened(bag_path, stop)
    scene = scene_of(bag, trust_effects=trust_effects)
    # The x axis is the crank of the first linkage; its joints are drawn.
    member = scene.members[0]
    linkage = member.linkage
    driven = linkage.inputs[0]
    drawn = {
        name: (place, isinstance(joint, RevoluteJoint))
        for place, (name, joint) in enumerate(linkage.joints.items())
        if name != driven.joint
    }
    positions: Curves = {name: ([], []) for name in drawn}
    rates: Curves = {name: ([], []) for name in drawn}
    reader = JointStateReader(member.joints)
    states = 0
    for _, recorded, _, tick in replay(bag, scene):
        if stop.is_set():
            raise StoppedError
        crank_state = tick.looks[0].crank
        if crank_state is None or not recorded:
            continue
        sample = reader.read(recorded)
        if sample is Rejection.MISSING:  # for this linkage only; others had a reading
            continue
        if isinstance(sample, Rejection):
            raise BagError(bag_path, f'a joint state: {sample.value}', 'name another bag')
        states += 1
        crank = crank_state.angles[0]
        if not driven.slider:
            crank %= tau
        for name, (place, turning) in drawn.items():
            value = sample.angles[place]
            _add(positions[name], crank, wrapped(value) if turning else value, turning)
            if sample.rates:
                _add(rates[name], crank, sample.rates[place], False)
    if not states:
        raise BagError(bag_path, 'holds no joint states', 'record a run with a crank')
    over = driven.joint if driven.slider else f'one turn of {driven.joint}'
    title = f'{scene.name}: dependent joints over {over} ({states} joint states)'
    turns = [turning for _, turning in drawn.values()]
    used = (('rad', any(turns)), ('m', not all(turns)))
    units = [unit for unit, is_used in used if is_used]
    _figure(title, driven, units, positions, rates, picture)


def _add(curve: tuple[list[float], list[float]], x: float, y: float, turning: bool) -> None:
    """Add a point; break the curve where crank or joint begins a new turn."""
    xs, ys = curve
    if xs and (abs(x - xs[-1]) > pi or (turning and abs(y - ys[-1]) > pi)):
        xs.append(nan)
        ys.append(nan)
    xs.append(x)
    ys.append(y)


def _figure(
    title: str, driven: Input, units: list[str], positions: Curves, rates: Curves, picture: Path
) -> None:
    import matplotlib as mpl  # local import: an optional dependency, and slow to load

    mpl.use('Agg')
    from matplotlib import pyplot as plt

    panels = [(f'joint position [{", ".join(units)}]', positions)]
    if any(xs for xs, _ in rates.values()):
        per_second = ', '.join(f'{unit}/s' for unit in units)
        panels.append((f'joint rate [{per_second}]', rates))
    figure, axes = plt.subplots(
        len(panels), 1, sharex=True, squeeze=False, figsize=(8, 1 + 3 * len(panels)), dpi=120
    )
    for (label, curves), axis in zip(panels, axes[:, 0], strict=True):
        _panel(axis, label, curves)
    if driven.slider:
        axes[-1, 0].set_xlabel(f'{_plain(driven.joint, 80)} [m]')
    else:
        axes[-1, 0].set_xlabel('crank angle [rad]')
        axes[-1, 0].set_xlim(0.0, tau)
        ticks = [0.0, pi / 2, pi, 3 * pi / 2, tau]
        axes[-1, 0].set_xticks(ticks, ['0', 'π/2', 'π', '3π/2', '2π'])
    figure.suptitle(_plain(title, 160), fontsize=11)
    figure.tight_layout()
    try:
        save(figure, picture)
    finally:
        plt.close(figure)


def _plain(text: str, most: int) -> str:
    """Escape dollar signs: matplotlib reads a text between two of them as mathematics."""
    return shortened(text, most).replace('$', r'\$')


def _panel(axis: Any, label: str, curves: Curves) -> None:
    for number, (name, (xs, ys)) in enumerate(curves.items()):
        axis.plot(
            xs,
            ys,
            label=_plain(name, 80),
            color=_COLOURS[number % len(_COLOURS)],
            linewidth=1.6,
        )
    axis.set_ylabel(label)
    axis.grid(alpha=0.3)
    axis.legend(loc='best', frameon=False)
