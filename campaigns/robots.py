# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""
``python -m campaigns.robots CHECKOUT …``: robots as they are published, each by one command.

A checkout is a folder with the name of one of the repositories in `ROBOTS`, or a robot's file.
Each robot is read as its file is, and solved at random states near its pose. Another library,
yourdfpy, places the links at the joints that were found: the frames of all that closes loops have
to meet there. The page docs/robots.md says what it costs, and what is refused and why.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import io
from pathlib import Path
import resource
import shlex
import signal
import subprocess
import sys
from time import process_time
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

from linkage_ros.description import load, read_as_urdf
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import Array, PlanarClosure
import numpy as np
from trimesh.transformations import compose_matrix
import yourdfpy

PAGE = Path(__file__).parents[1] / 'docs' / 'robots.md'
STATES, SEED = 50, 1
LONGEST = 90
"""How long a robot may be read, in [s]."""

FARTHEST = 0.15
"""How far inputs are drawn from the pose, in [rad]; slides a tenth of it, in [m]."""

_LEG = ('motor_4barlink2', 'motor_4barlink4', 'motor_hip_x', 'motor_4barlink1', 'motor_4barlink3')
_CASSIE = tuple(
    f'{side}-{joint}'
    for side in ('left', 'right')
    for joint in ('knee', 'shin', 'heel-spring', 'foot')
)
# At 0 its legs are too short by 18 mm; so the foot stands under the hip.
_WL16 = ('motor_4=0.023', 'motor_1=0.019', 'motor_2=0.023', 'motor_3=0.14', 'motor_5=0.039')
_SPRINGS = ('right_spring_link_joint', 'left_spring_link_joint')

ROBOTS: dict[str, dict[str, tuple[str, ...]]] = {
    'Gepetto/example-parallel-robots': {
        f'robots/{name}/robot.yaml': typed
        for name, typed in {
            '5bar_linkage': (),
            '5bar_linkage_iso3d': (),
            '5bar_linkage_iso6d': (),
            'battobot_6d': (),
            'cassie_like': (),
            'digit_like': (),
            'digit_like_2legs': (),
            'digit_like_2legs_6D': (),
            'digit_like_2legs_old': (),
            'disney_like': (*_LEG, 'free_universal4'),
            'disney_robot': (),
            'kangaroo_like': (),
            'kangaroo_like_2legs': (),
            'robot_delta': (),
            'talos_like': (),
            'true_talos_2_legs': (),
            'wl16_like': _WL16,
        }.items()
    },
    'andrei-herdt/mujoco_menagerie': {
        'agility_cassie/cassie.xml': _CASSIE,
        'robotiq_2f85/2f85.xml': ('right_driver_joint', *_SPRINGS),
        'ufactory_xarm7/hand.xml': (),
    },
    'pollen-robotics/reachy_mini': {
        'src/reachy_mini/descriptions/reachy_mini/mjcf/reachy_mini.xml': (),
    },
    'Rhoban/placo-examples': {'models/spm/robot.xml': ('m1', 'm2', 'm3')},
    'Rhoban/onshape-to-robot-examples': {'planar-2dof/robot.xml': ()},
    'ROAM-Lab-ND/generalized_rbda': {
        'robot-models/four_bar.urdf': (),
        'robot-models/planar_leg_linkage.urdf': (),
        'robot-models/six_bar.urdf': ('joint1', 'joint2', 'joint3'),
    },
    'osrf/gazebo_tutorials': {
        'kinematic_loop/four_bar_sdf/model.sdf': ('joint_A',),
        'kinematic_loop/four_bar_split_fixed_sdf/model.sdf': ('joint_A',),
        'kinematic_loop/four_bar_split_fixed_urdf/model.urdf': ('joint_A',),
    },
}
"""Repositories and their robots with loops, each with inputs and values of a pose as typed."""

_HEAD = f"""\
# Robots as they are published

This page is made by `python -m campaigns.robots CHECKOUT … --write`; do not edit it. The files
are as published, and what was typed is below.

{STATES} states are drawn within {FARTHEST} rad of the pose and the limits of the inputs. At their
joints yourdfpy, a library of another make, places the links: "gap" is the farthest that ends of
what closes a loop are apart there, "turn" by how much frames of welds and axes of hinges differ
in direction. Pins of planar loops may end beside each other along their axes. "Check" is the
processor time of the command, with the search for the pose; "a state" that of one position, the
mean of all, most of them where none was solved before.

| robot | of | loops | inputs | joints found | check | a state | closed | gap | turn |
| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |
"""


class Robot(NamedTuple):
    """A robot's file, and what is typed of it."""

    checkout: Path  # The folder in which the file is named
    source: str  # OWNER/NAME of the repository, '' if it is none of `ROBOTS`
    name: str  # The file, from the checkout
    typed: tuple[str, ...]  # Inputs, and values as NAME=VALUE

    @property
    def title(self) -> str:
        """Return a short name."""
        path = Path(self.name)
        return path.parent.name if path.stem in ('robot', 'model') else path.stem

    @property
    def options(self) -> dict[str, Any]:
        """Return the same as options of `load`."""
        told = dict(word.split('=') for word in self.typed if '=' in word)
        inputs = [word for word in self.typed if '=' not in word]
        given = {'input': inputs} if inputs else {}
        return {'near': True, 'at': {name: float(value) for name, value in told.items()}, **given}

    @property
    def command(self) -> list[str]:
        """Return what is typed, beside the checkout."""
        names = [(f'--{"start" if "=" in name else "input"}', name) for name in self.typed]
        options = [word for pair in names for word in pair]
        file = str(Path(self.source.rpartition('/')[2], self.name))
        return ['linkage', 'check', file, '--near', *options]


class _Loop(NamedTuple):
    """Two frames of links that meet, and what of their directions does."""

    kind: str
    links: tuple[str, str]
    frames: tuple[Array, Array]  # In those of the links
    axes: tuple[Array, Array] | None  # Of a hinge, in these frames
    is_directed: bool


def _find_loops(root: ET.Element, model: yourdfpy.URDF) -> Iterator[_Loop]:
    """Yield what closes the loops of a URDF."""
    for loop in root:
        if loop.tag in ('loop_joint', 'loop', 'loop_constraint', 'constraint'):
            ends = [end for end in loop if 'link' in end.attrib][:2]
            own = [end.find('origin') for end in ends]
            origins = [end if at is None else at for end, at in zip(ends, own, strict=True)]
            first, second = (_frame(origin.attrib) for origin in origins)
            axis = loop.find('parent_axis')
            axis = loop.find('axis') if axis is None else axis
            way = (
                None if axis is None else np.array([float(x) for x in axis.attrib['xyz'].split()])
            )
            yield _Loop(
                loop.get('type', ''),
                (ends[0].attrib['link'], ends[1].attrib['link']),
                (first, second),
                None if way is None else (way, way),
                all('rpy' in origin.attrib for origin in origins),
            )
    for joint in root.findall('gazebo/joint'):
        # A joint of SDF is where it is in the child with all joints at 0.
        parent, child = (joint.findtext(end, '').strip() for end in ('parent', 'child'))
        pose = joint.findtext('pose', '0 0 0 0 0 0').split()
        there = _frame({'xyz': ' '.join(pose[:3]), 'rpy': ' '.join(pose[3:])})
        model.update_cfg(dict.fromkeys(model.actuated_joint_names, 0.0))
        on = np.linalg.inv(model.get_transform(parent)) @ model.get_transform(child) @ there
        yield _Loop(joint.get('type', ''), (parent, child), (on, there), None, True)


def _frame(origin: dict[str, str]) -> Array:
    """Return the matrix of an origin of a URDF."""
    xyz, rpy = ([*map(float, origin.get(key, '0 0 0').split())] for key in ('xyz', 'rpy'))
    return np.asarray(compose_matrix(translate=xyz, angles=rpy))


class _Placed:
    """The links of a robot as yourdfpy places them, and how far its loops are from closed."""

    def __init__(self, data: bytes) -> None:
        root = ET.fromstring(data)
        for joint in root.findall('joint'):
            # Every joint has the value that was found for it.
            for mimic in joint.findall('mimic'):
                joint.remove(mimic)
        self._model = yourdfpy.URDF.load(
            io.BytesIO(ET.tostring(root)), load_meshes=False, load_collision_meshes=False
        )
        self.loops = [*_find_loops(root, self._model)]

    def errors(self, values: dict[str, float], is_planar: bool) -> tuple[float, float]:
        """Return the largest gap, in [m], and difference of directions at values of joints."""
        model, gap, turn = self._model, 0.0, 0.0
        model.update_cfg({name: values.get(name, 0.0) for name in model.actuated_joint_names})
        for loop in self.loops:
            one, other = (
                model.get_transform(link) @ frame
                for link, frame in zip(loop.links, loop.frames, strict=True)
            )
            apart = one[:3, 3] - other[:3, 3]
            if loop.axes is not None and loop.kind in ('revolute', 'continuous'):
                axes = [at[:3, :3] @ way for at, way in zip((one, other), loop.axes, strict=True)]
                axes = [axis / np.linalg.norm(axis) for axis in axes]
                turn = max(turn, float(np.linalg.norm(np.cross(*axes))))
                if is_planar:
                    apart -= apart @ axes[0] * axes[0]
            elif loop.kind == 'fixed' and loop.is_directed:
                turn = max(turn, float(np.abs(one[:3, :3] - other[:3, :3]).max()))
            gap = max(gap, float(np.linalg.norm(apart)))
        return gap, turn


def _check(robot: Robot) -> float:
    """Return the processor time of the command that is typed, in [s]."""
    words = [sys.executable, '-m', 'linkage_ros', *robot.command[1:]]
    words[words.index('check') + 1] = str(robot.checkout / robot.name)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(words, capture_output=True, check=True, timeout=LONGEST)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def measure(robot: Robot, draw: np.random.Generator) -> tuple[str, str]:
    """Return a row of the page, and '' or why the robot is refused."""
    file = robot.checkout / robot.name
    signal.signal(signal.SIGALRM, _give_up)
    signal.alarm(LONGEST)
    try:
        closure: Any = load(file, robot.options)
    except LinkageError as error:
        return '', f'* {robot.title}, of {robot.source}: {error.reason}; {error.remedy}'
    except _TooLongError:
        return '', f'* {robot.title}, of {robot.source}: read for more than {LONGEST} s'
    finally:
        signal.alarm(0)
    checking, placed = _check(robot), _Placed(read_as_urdf(file))
    inputs = closure.linkage.inputs
    far = np.array([FARTHEST * (0.1 if given.slider else 1.0) for given in inputs])
    start = np.array(closure.linkage.pose.inputs)
    low = np.maximum(start - far, [given.limits.low for given in inputs])
    high = np.minimum(start + far, [given.limits.high for given in inputs])
    closed, gap, turn, solving = 0, 0.0, 0.0, 0.0
    for _ in range(STATES):
        state = draw.uniform(low, high)
        begun = process_time()
        position = closure.position(*state.tolist())
        solving += process_time() - begun
        if position.joints:
            closed += 1
            values = dict(zip(closure.joint_names, position.joints, strict=True))
            values |= dict(zip(closure.input_names, state.tolist(), strict=True))
            found = placed.errors(values, is_planar=isinstance(closure, PlanarClosure))
            gap, turn = max(gap, found[0]), max(turn, found[1])
    row = (
        f'| {robot.title} | {robot.source} | {len(placed.loops)} | {len(inputs)} | '
        f'{len(closure.joint_names)} | {checking:.1f} s | {solving / STATES * 1e6:.0f} µs | '
        f'{closed} of {STATES} | {gap:.0e} m | {turn:.0e} |'
    )
    return row, ''


class _TooLongError(Exception):
    """A robot takes too long."""


def _give_up(_signal: int, _frame: object) -> None:
    raise _TooLongError


def _find_robots(place: Path) -> list[Robot]:
    """Return the robots of a checkout, or that of a file."""
    if place.is_file():
        return [Robot(place.parent, '', place.name, ())]
    return [
        Robot(place, source, name, typed)
        for source, robots in ROBOTS.items()
        if source.rpartition('/')[2] == place.name
        for name, typed in robots.items()
    ]


def main() -> int:
    """Measure robots."""
    parser = argparse.ArgumentParser('python -m campaigns.robots', description=__doc__)
    names = ', '.join(ROBOTS)
    parser.add_argument('place', type=Path, nargs='+', help=f'a robot, or a checkout: {names}')
    parser.add_argument('--write', action='store_true', help='write docs/robots.md')
    options = parser.parse_args()
    rows, refused, typed, plain = [], [], [], 0
    for robot in (robot for place in options.place for robot in _find_robots(place)):
        row, reason = measure(robot, np.random.default_rng(SEED))
        print(row or reason, flush=True)
        (rows if row else refused).append(row or reason)
        plain += bool(row and not robot.typed)
        typed.append(shlex.join(robot.command))
    block = ['```sh no-test: needs a checkout of the robots', *typed, '```']
    count = f'{len(rows)} of {len(typed)} robots run, {plain} of them with `--near` alone.'
    page = [_HEAD + '\n'.join(rows), '', count, '', '## Refused, and why', '', *refused, '']
    if options.write:
        PAGE.write_text('\n'.join([*page, '## What was typed', '', *block, '']), 'utf-8')
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
