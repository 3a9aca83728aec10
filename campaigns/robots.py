# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Robots as they are published, each by one command.

A checkout is a folder with the name of one of the repositories in `ROBOTS`, or a robot's file.
Each robot is read as its file is, and solved at random states near its pose, from its motors to
its joints and back. The judge places the links of the robot's URDF by its own formulas, and
closes the loops from each state by Newton's method, with errors of 40 digits.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from copy import copy
from itertools import chain
import math
from pathlib import Path
import resource
import signal
import subprocess
import sys
from time import process_time
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

from bench import ROOT
from bench.report import say, Table
from campaigns.campaign import Findings, Page
from linkage_ros.description import load, read_as_urdf
from linkage_ros.errors import DefinitionError, LinkageError
from linkage_ros.kinematics import PlanarClosure
from mpmath import mp
import numpy as np
from scipy.linalg import qr

STATES = 50
LONGEST = 90
"""How long a robot may be read, in [s]."""

FARTHEST = 0.15
"""How far inputs are drawn from the pose, in [rad]; slides a tenth of it, in [m]."""

_DIGITS, _ROUNDS, _MET = 40, 8, 1e-25
"""Digits of the judge, most steps of its method, and the last of them."""

_STEP, _RANK = 1e-6, 1e-7
"""Step of its slopes, in [rad] and [m], and singular values that are rounding."""

_TRIED, _DRAWN = 12, 100
"""So many sets of joints are tried as inputs, of so many drawn ones."""

_WRONG = 1e-5
"""Largest difference of a joint that CAD's rounding of redundant equations explains."""

_LEG = ('motor_4barlink2', 'motor_4barlink4', 'motor_hip_x', 'motor_4barlink1', 'motor_4barlink3')
_CASSIE = tuple(
    f'{side}-{joint}'
    for side in ('left', 'right')
    for joint in ('knee', 'shin', 'heel-spring', 'foot')
)
# At 0 its legs are too short by 18 mm; so the foot stands under the hip.
_WL16 = ('motor_4=0.023', 'motor_1=0.019', 'motor_2=0.023', 'motor_3=0.14', 'motor_5=0.039')
_PISTONS = tuple(f'piston{leg}_prismatic_joint' for leg in range(1, 7))
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
    'Rhoban/onshape-to-robot-examples': {
        'planar-2dof/robot.xml': (),
        'orbita_mujoco/robot.xml': (),
    },
    'KennyVilella/excavator_simulator_mujoco': {'model/excavator/excavator.xml': ()},
    's-ritwik/Gazebo_stewart_platform': {'models/stewart/stewart_sdf.sdf': _PISTONS},
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


PAGE = Page(
    ROOT / 'docs' / 'robots.md',
    'Robots as they are published',
    f"""
Made by `python -m campaigns robots CHECKOUT … --write`; do not edit it. The files are as
published, and what was typed is below.

{STATES} states are drawn within {FARTHEST} rad of the pose and the limits of the inputs. *Off* is
the largest difference of a joint, in rad or m, from what the judge comes to: it places the links
by formulas of its own, from the URDF that the file is or becomes, and closes the loops by Newton's
method with 40 digits. Pins of planar loops may end beside each other. Where a robot has more
equations than needed, their rounding by CAD decides its last digits: the judge takes least
squares, the closure those that it needs.

*Back* gives as many joints as there are inputs, and finds the inputs; or it says why it cannot.
At most {_TRIED} sets of joints that tell the inputs in the pose are tried. *Check* is the
processor time of the command, with the search for the pose; *a state* that of one position, the
mean of all, most of them where none was solved before.
""",
)


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
        """Return what is typed as options of `load`."""
        told = dict(word.split('=') for word in self.typed if '=' in word)
        inputs = [word for word in self.typed if '=' not in word]
        given = {'input': inputs} if inputs else {}
        return {'near': True, 'at': {name: float(value) for name, value in told.items()}, **given}

    @property
    def command(self) -> list[str]:
        """Return what is typed, beside the checkout."""
        names = [(f'--{"start" if "=" in name else "input"}', name) for name in self.typed]
        file = str(Path(self.source.rpartition('/')[2], self.name))
        return ['linkage', 'check', file, '--near', *chain(*names)]


class _Joint(NamedTuple):
    """A joint of the tree."""

    name: str
    kind: str
    parent: str
    child: str
    base: Any  # Frame of the child at 0, in that of the parent
    axis: Any


class _End(NamedTuple):
    """An end of what closes a loop: a frame on a link, and an axis in that frame."""

    link: str
    frame: Any
    axis: Any

    def as_floats(self) -> _End:
        """Return the end with doubles."""
        return self._replace(frame=self.frame.astype(float), axis=self.axis.astype(float))


class _Loop(NamedTuple):
    """Two frames of links that meet, and what of their directions does."""

    kind: str
    ends: tuple[_End, _End]
    has_axis: bool


class Judge:
    """A URDF's tree and loops, in numbers of any kind: floats, or those of mpmath."""

    @mp.workdps(_DIGITS)
    def __init__(self, data: bytes, left_out: Sequence[str] = (), *, is_planar: bool) -> None:
        root = ET.fromstring(data)
        self._is_planar, waiting = is_planar, [*map(_read_joint, root.findall('joint'))]
        self.tree: list[_Joint] = []
        while waiting:  # From the root on
            left = {joint.child for joint in waiting}
            self.tree += [joint for joint in waiting if joint.parent not in left]
            waiting = [joint for joint in waiting if joint.parent in left]
        self._followers = [
            (joint.get('name', ''), mimic.attrib)
            for joint in root.findall('joint')
            for mimic in joint.findall('mimic')
            if f'mimic of {joint.get("name")}' not in left_out
        ]
        self.loops = [*self._find_loops(root)]
        self._rough = self._as_floats()

    def _as_floats(self) -> Judge:
        """Return the judge with doubles, which suffice for slopes."""
        rough = copy(self)
        rough.tree = [
            joint._replace(base=joint.base.astype(float), axis=joint.axis.astype(float))
            for joint in self.tree
        ]
        rough.loops = [
            loop._replace(ends=(loop.ends[0].as_floats(), loop.ends[1].as_floats()))
            for loop in self.loops
        ]
        return rough

    def _find_loops(self, root: ET.Element) -> Iterator[_Loop]:
        for loop in root:
            if loop.tag in ('loop_joint', 'loop', 'loop_constraint', 'constraint'):
                ends = [end for end in loop if 'link' in end.attrib][:2]
                axis = loop.find('parent_axis')
                axis = loop.find('axis') if axis is None else axis
                way = _numbers({} if axis is None else axis.attrib, 'xyz', '1 0 0')
                found = []
                for end in ends:
                    owns = (loop.find(f'{end.tag}_origin'), end.find('origin'), end)
                    at = next(own for own in owns if own is not None)
                    found.append(_End(end.attrib['link'], _frame(at.attrib), way / _size(way)))
                directed = all('rpy' in end.attrib for end in ends)
                kind = loop.get('type', '')
                kind = 'ball' if kind == 'fixed' and not directed else kind
                yield _Loop(kind, (found[0], found[1]), axis is not None)
        frames = self._frames({})
        for joint in root.findall('gazebo/joint'):
            # A joint of SDF is where it is in the child with all joints at 0.
            parent, child = (joint.findtext(end, '').strip() for end in ('parent', 'child'))
            pose = joint.findtext('pose', '0 0 0 0 0 0').split()
            there = _frame({'xyz': ' '.join(pose[:3]), 'rpy': ' '.join(pose[3:])})
            on = _inverse(frames[parent]) @ frames[child] @ there
            met = _End(parent, on, _AXIS), _End(child, there, _AXIS)
            yield _Loop(joint.get('type', ''), met, has_axis=False)

    def _frames(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the frames of all links."""
        frames: dict[str, Any] = {}
        for joint in self.tree:
            frame = frames.setdefault(joint.parent, np.eye(4)) @ joint.base
            value = values.get(joint.name, 0)
            if value != 0 and joint.kind != 'fixed':
                move = np.eye(4).astype(joint.base.dtype)
                if joint.kind == 'prismatic':
                    move[:3, 3] = value * joint.axis
                else:
                    move[:3, :3] = _turn(joint.axis, value)
                frame = frame @ move
            frames[joint.child] = frame
        return frames

    def misses(self, values: Mapping[str, Any]) -> Any:
        """Return by how much each equation is missed at values of the joints."""
        frames, found = self._frames(values), []
        for loop in self.loops:
            one, other = (frames[end.link] @ end.frame for end in loop.ends)
            gap = one[:3, 3] - other[:3, 3]
            axes = [at[:3, :3] @ end.axis for at, end in zip((one, other), loop.ends, strict=True)]
            if loop.has_axis and loop.kind.removesuffix('_joint') in ('revolute', 'continuous'):
                found += [*np.cross(*axes)]
                if self._is_planar:
                    gap = gap - (gap @ axes[0]) * axes[0]
            elif loop.kind == 'fixed':
                found += [*(one[:3, :3] - other[:3, :3]).ravel()]
            found += [*gap]
        for name, mimic in self._followers:
            if name in values and mimic['joint'] in values:
                own = mp.mpf(mimic.get('multiplier', '1')) * values[mimic['joint']]
                found.append(values[name] - own - mp.mpf(mimic.get('offset', '0')))
        return np.array(found)

    @mp.workdps(_DIGITS)
    def difference(self, values: Mapping[str, float], held: Sequence[str]) -> float:
        """Return how far Newton's method moves a joint, if those that are held stay."""
        free = [name for name in values if name not in held]
        at = {name: mp.mpf(value) for name, value in values.items()}
        slopes = []
        for name in free:
            high, low = ({**values, name: values[name] + by} for by in (_STEP, -_STEP))
            slopes.append((self._rough.misses(high) - self._rough.misses(low)) / (2 * _STEP))
        inverse = np.linalg.pinv(np.array(slopes, float).T, rcond=_RANK)
        for _ in range(_ROUNDS):
            errors = self.misses(at)
            steps = _numbers_of(inverse) @ errors
            at |= {name: at[name] - step for name, step in zip(free, steps, strict=True)}
            if max(map(abs, steps), default=0) < _MET:
                break
        left = max(map(abs, self.misses(at)), default=0)
        off = max((abs(at[name] - values[name]) for name in free), default=0)
        return float(off if left < _WRONG else left)


def _read_joint(joint: ET.Element) -> _Joint:
    found = {child.tag: child.attrib for child in joint}
    way = _numbers(found.get('axis', {}), 'xyz', '1 0 0')
    way = way / (_size(way) or 1)
    parent, child = (found[end]['link'] for end in ('parent', 'child'))
    base = _frame(found.get('origin', {}))
    return _Joint(joint.get('name', ''), joint.get('type', ''), parent, child, base, way)


def _numbers_of(values: Any) -> Any:
    """Return numbers of mpmath."""
    return np.vectorize(mp.mpf, otypes=[object])(values)


def _numbers(attributes: Mapping[str, str], key: str, default: str) -> Any:
    return np.array([mp.mpf(word) for word in attributes.get(key, default).split()])


def _size(vector: Any) -> Any:
    return mp.sqrt(vector @ vector)


_EYE, _AXIS = _numbers_of(np.eye(4)), _numbers_of((1, 0, 0))


def _turn(axis: Any, angle: Any) -> Any:
    """Return the matrix of a turn about an axis of length 1: Rodrigues."""
    x, y, z = axis
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    of = math if isinstance(angle, float) else mp
    sine, cosine = of.sin(angle), of.cos(angle)
    return np.eye(3) + sine * skew + (1 - cosine) * (skew @ skew)


def _frame(origin: Mapping[str, str]) -> Any:
    """Return the matrix of an origin of a URDF: roll, pitch and yaw about fixed axes."""
    turned = _numbers_of(np.eye(3))
    for way, angle in zip(_numbers_of(np.eye(3)), _numbers(origin, 'rpy', '0 0 0'), strict=True):
        turned = _turn(way, angle) @ turned
    frame = _EYE.copy()
    frame[:3, :3], frame[:3, 3] = turned, _numbers(origin, 'xyz', '0 0 0')
    return frame


def _inverse(frame: Any) -> Any:
    back = frame.copy()
    back[:3, :3] = frame[:3, :3].T
    back[:3, 3] = -(frame[:3, :3].T @ frame[:3, 3])
    return back


def _drive_by_joints(closure: Any, draw: np.random.Generator) -> tuple[Any, str]:
    """
    Return the closure with as many joints as inputs, or None and why there is none.

    Of the first joints of the file, and of random ones, those are found that tell the inputs best,
    by a factorization with pivots. The best such sets are tried: a rod's spin tells of inputs that
    it does not drive.
    """
    slopes = np.array(closure.jacobian(closure.close_unlimited(*closure.linkage.pose.inputs)))
    rows = [k for k, name in enumerate(closure.joint_names) if name not in closure.input_names]
    rank = int(np.linalg.matrix_rank(slopes[rows], _RANK))
    wanted = len(closure.input_names)
    if rank < wanted:
        return None, f'joints tell {rank} of {wanted} inputs'
    parts = [rows[:size] for size in range(wanted, len(rows) + 1)]
    parts += [draw.permutation(rows)[: wanted + 2].tolist() for _ in range(_DRAWN)]
    fitness: dict[frozenset[int], float] = {}
    for among in parts:
        _, least, order = qr(slopes[among].T, pivoting=True)
        fitness[frozenset(among[k] for k in order[:wanted])] = abs(least[wanted - 1, wanted - 1])
    tried = sorted(fitness, key=fitness.__getitem__, reverse=True)[:_TRIED]
    for chosen in tried:
        if fitness[chosen] > _RANK:
            with suppress(DefinitionError):
                return closure.driven_by(*(closure.joint_names[k] for k in sorted(chosen))), ''
    return None, f'none of {len(tried)} sets drives all'


def _check(robot: Robot) -> float:
    """Return the processor time of the command that is typed, in [s]."""
    words = [sys.executable, '-m', 'linkage_ros', *robot.command[1:]]
    words[words.index('check') + 1] = str(robot.checkout / robot.name)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(words, capture_output=True, check=True, timeout=LONGEST)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


class Measured(NamedTuple):
    """What was found of a way through a robot: from inputs to joints, or back."""

    closed: int
    off: float  # In [rad] or [m]
    seconds: float  # For a state


def solve_states(closure: Any, states: Sequence[Sequence[float]], judge: Judge) -> Measured:
    """Solve states, and let them be judged."""
    closed, off, solving = 0, 0.0, 0.0
    for state in states:
        begun = process_time()
        position = closure.close_unlimited(*state)
        solving += process_time() - begun
        if position.joints:
            closed += 1
            values = dict(zip(closure.joint_names, position.joints, strict=True))
            values |= dict(zip(closure.input_names, state, strict=True))
            off = max(off, judge.difference(values, closure.input_names))
    return Measured(closed, off, solving / len(states))


def measure(robot: Robot, seed: int, states: int = STATES) -> tuple[list[str], str]:
    """Return a row of the page, and '' or why the robot is refused."""
    file, draw = robot.checkout / robot.name, np.random.default_rng(seed)
    signal.signal(signal.SIGALRM, _give_up)
    signal.alarm(LONGEST)
    try:
        closure: Any = load(file, robot.options)
    except LinkageError as error:
        return [], f'{error.reason}; {error.remedy}'
    except _TooLongError:
        return [], f'read for more than {LONGEST} s'
    finally:
        signal.alarm(0)
    is_planar = isinstance(closure, PlanarClosure)
    judge = Judge(read_as_urdf(file), closure.linkage.left_out, is_planar=is_planar)
    inputs = closure.linkage.inputs
    far = np.array([FARTHEST * (0.1 if given.slider else 1.0) for given in inputs])
    start = np.array(closure.linkage.pose.inputs)
    low = np.maximum(start - far, [given.limits.low for given in inputs])
    high = np.minimum(start + far, [given.limits.high for given in inputs])
    drawn = draw.uniform(low, high, (states, len(inputs))).tolist()
    there = solve_states(closure, drawn, judge)
    row = [
        *(robot.title, robot.source, f'{len(judge.loops)}', f'{len(inputs)}'),
        *(f'{len(closure.joint_names)}', f'{_check(robot):.1f}', f'{there.seconds * 1e6:.0f}'),
        *(f'{there.closed} of {states}', f'{there.off:.0e}'),
    ]
    inverse, reason = _drive_by_joints(closure, draw)
    if inverse is None:
        return [*row, reason, '', ''], ''
    rows = [closure.joint_names.index(name) for name in inverse.input_names]
    found = [closure.close_unlimited(*state).joints for state in drawn]
    back = solve_states(inverse, [[of[k] for k in rows] for of in found if of], judge)
    last = f'{back.seconds * 1e6:.0f}', f'{back.closed} of {states}', f'{back.off:.0e}'
    return [*row, *last], ''


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


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this campaign; it runs in one process."""
    parser.set_defaults(jobs=1)
    names = ', '.join(ROBOTS)
    parser.add_argument('place', type=Path, nargs='+', help=f'a robot, or a checkout: {names}')


def run(options: argparse.Namespace) -> Findings:
    """Measure robots."""
    head = (
        'robot',
        'of',
        'loops',
        'inputs',
        'joints',
        'check [s]',
        'a state [µs]',
        'closed',
        'off',
    )
    table = Table('Found', (*head, 'back [µs]', 'closed', 'off'))
    refused = Table('Refused, and why', ('robot', 'of', 'why'))
    typed = Table('What was typed', ('robot', 'typed'))
    faults, plain = [], 0
    robots = [robot for place in options.place for robot in _find_robots(place)]
    for robot in robots:
        row, reason = measure(robot, options.seed)
        say(' '.join(row) or f'{robot.title}: {reason}')
        if row:
            table.rows.append(row)
            plain += not robot.typed
            faults += [
                f'{robot.title}: {off} off' for off in row[8::3] if float(off or 0) > _WRONG
            ]
        else:
            refused.rows.append((robot.title, robot.source, reason))
        typed.rows.append((robot.title, f'`{" ".join(robot.command)}`'))
    count = f'{len(table.rows)} of {len(robots)}', f'{plain}'
    facts = [('robots that run', count[0]), ('of these with `--near` alone', count[1])]
    return Findings([table, refused, typed], faults, facts)
