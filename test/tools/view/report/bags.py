# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Bags written by hand for pages: every kind of event, names that are markup, and a long run."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
import json
from math import cos, nan, pi, sin
from pathlib import Path

from linkage_ros.bag import BagWriter, RUN_FILE
from linkage_ros.description import load_scene
from linkage_ros.messages import JointStateWriter, text_message, time_message
import numpy as np

from .runs import diagnostics, Said
from ....cli.recorded import BEGIN, FOUR_BAR, JOINT_STATE, MS, scene_file, SECOND, topic
from ....support.four_bar import four_bar_angles

STATES, CRANK, FAULTS = '/joint_states', '/crank_states', '/linkage/faults'
WITHHELD, RESETS, HEALTH = '/linkage/withheld', '/linkage/resets', '/diagnostics'
TYPES = {
    STATES: JOINT_STATE,
    CRANK: JOINT_STATE,
    FAULTS: 'std_msgs/msg/String',
    WITHHELD: 'builtin_interfaces/msg/Time',
    RESETS: 'builtin_interfaces/msg/Time',
    HEALTH: 'diagnostic_msgs/msg/DiagnosticArray',
}

# A double rocker: its loop is open where the crank is more than 66 degrees from the ground line.
A, B, C, D = 0.05, 0.06, 0.05, 0.12
DRILL = f'four_bar: {{a: {A}, b: {B}, c: {C}, d: {D}}}\n'
DRILL_SCENE = """
rate: 100
drive: {topic: {max_age: 0.2}}
effects: {velocity: {}}
faults: {plug: {silence: {}}}
"""
PERIOD = SECOND // 100
LATE = MS // 4  # after it was due a tick takes its sample
OLD = 3 * MS  # is the sample that a tick takes
LONG_ROWS, LONG_RATE, SPIKE_AT, SPIKE = 40_000, 1000, 12_345, 512.5
JOINTS = ('crank_joint', 'coupler_joint', 'rocker_joint')
Message = tuple[str, int, int, bytes]
"""Topic, log time, publish time, data."""


def follow(a: float, b: float, c: float, d: float, crank: float) -> tuple[float, float]:
    """Return the published angles of a four-bar's coupler and rocker."""
    coupler, rocker = four_bar_angles(crank, (a, b, c, d))
    return coupler - crank, rocker


def close(crank: float) -> tuple[float, float, float]:
    """Return all published angles of the four-bar of `FOUR_BAR`."""
    return (crank, *follow(0.04, 0.12, 0.08, 0.1, crank))


def write(
    folder: Path,
    messages: Iterable[Message],
    scene: Path | None = None,
    name: str = '',
    types: Mapping[str, str] = TYPES,
) -> Path:
    """Write a bag, of a scene's run or of nobody's; return its folder."""
    attachments = {}
    if scene is not None:
        loaded = load_scene(scene)
        attachments = {file: ('application/yaml', data) for file, data in loaded.files.items()}
        said = {
            'scene': name or loaded.name,
            'seed': loaded.seed,
            'joint_states_topic': STATES,
            'crank_topic': CRANK,
            'faults_topic': FAULTS,
            'withheld_topic': WITHHELD,
            'resets_topic': RESETS,
            'diagnostics_topic': HEALTH,
            'extra_topics': [],
        }
        attachments[RUN_FILE] = ('application/json', json.dumps(said).encode())
    numbers = {each: index for index, each in enumerate(types)}
    writer = BagWriter(folder, [topic(*each) for each in types.items()], attachments)
    for of, logged, published, data in messages:
        writer.write(numbers[of], logged, published, data)
    writer.close({})
    return folder


def write_states(
    folder: Path,
    scene: str,
    joints: Sequence[str],
    rows: Iterable[tuple[Sequence[float], Sequence[float]]],
    *,
    linkage: str = FOUR_BAR,
    period: int = PERIOD,
    name: str = '',
) -> Path:
    """Write the run of a scene that drives itself: angles and rates of each tick."""
    folder.mkdir()
    states = JointStateWriter(joints).write
    messages = (
        (STATES, BEGIN + index * period, BEGIN + index * period,
         states(BEGIN + index * period, *row))
        for index, row in enumerate(rows)
    )  # fmt: skip
    return write(folder / folder.name, messages, scene_file(folder, scene, linkage), name)


def drill(folder: Path, begin: float = 0.0) -> Path:
    """Write the eight seconds, from a time on, in which everything happens that has a lane."""
    folder.mkdir()
    messages = [each for each in _drill() if each[1] >= BEGIN + begin * SECOND]
    if begin:
        messages.insert(0, (HEALTH, BEGIN, BEGIN, _diagnostics(0)))
    scene = scene_file(folder, DRILL_SCENE, DRILL)
    return write(folder / folder.name, messages, scene, 'drill & <b>bold</b>')


def _drill() -> Iterator[Message]:
    states, crank = (
        JointStateWriter(['coupler_joint', 'rocker_joint']),
        JointStateWriter(['crank_joint']),
    )
    sample = (0, 0.0, 0.0)  # the newest good one: stamp, angle, rate
    for tick in range(800):
        time = tick / 100
        # At 7 s the clock is set back by half a second.
        stamp = BEGIN + tick * PERIOD - (SECOND // 2 if tick >= 700 else 0)
        logged = stamp + LATE
        for when, on in ((100, True), (150, False)):
            if tick == when:
                said = json.dumps({'fault': 'plug', 'kind': 'silence', 'injected': on})
                yield FAULTS, logged, logged, text_message(said)
        if tick == 600:
            yield RESETS, logged, logged, time_message(logged)
        if tick % 100 == 50:
            yield HEALTH, logged, logged, _diagnostics(tick // 100)
        opens, refused = 500 <= tick < 530, 200 <= tick < 210
        if not 300 <= tick < 360:
            angle = 1.3 if opens else 0.9 * sin(pi * time)
            rate = 0.0 if opens else 0.9 * pi * cos(pi * time)
            if not refused:
                sample = stamp - OLD, angle, rate
            told = nan if refused else angle
            yield CRANK, logged, stamp - OLD, crank.write(stamp - OLD, [told], [rate])
        if 120 <= tick < 125:
            yield WITHHELD, logged, stamp, time_message(stamp)
        if opens or 100 <= tick < 150 or 320 <= tick < 360:
            continue
        taken, angle, rate = sample
        coupler, rocker = follow(A, B, C, D, angle + rate * (stamp - taken) * 1e-9)
        # A sensor that is wrong: what is shown is what was recorded.
        rocker += 0.05 if tick >= 750 else 0.0
        rates = [] if 400 <= tick < 405 else [0.1, 0.2]
        yield STATES, logged, stamp, states.write(stamp, [coupler, rocker], rates)


DRILL_LANES = {
    'fault injected': [(1.0, 1.5, 'plug (silence)')],
    'loop open': [(5.0, 5.29, 'the links miss by 0.007 m')],
    'no pose, by diagnostics': [(4.5, 5.5, 'open')],
    'at a toggle': [(4.0, 4.04, '')],
    'at a toggle, by diagnostics': [(3.5, 4.5, '')],
    'gap in joint states': [(0.99, 1.5, ''), (3.19, 3.6, ''), (4.99, 5.3, '')],
    'withheld': [(1.2, 1.24, '')],
    'samples rejected': [(2.0, 2.09, 'not finite')],
    'no samples': [(2.99, 3.6, '')],
    'ticks lost': [(1.5, 2.5, '')],
    'messages dropped': [(2.5, 3.5, STATES)],
    'reset': [(6.0, 6.0, '')],
    'clock jumped back': [(6.99, 6.99, 'by 0.49 s')],
    'warnings, errors': [(5.5, 6.5, 'warning, tick: it is warm')],
}
"""What a page has to tell of it, to a tick: title of the lane, begin and end of spans, a word."""


def _diagnostics(number: int) -> bytes:
    """Return the message of the second of that number: all counts grow in one of them."""
    warm = number == 6
    closing = {'Ticks open': 30 * (number >= 5), 'Ticks at a toggle': 5 * (number >= 4)}
    return diagnostics(
        [
            Said(0, 'tick', {'Lost ticks': 7 * (number >= 2)}, int(warm), 'it is warm' * warm),
            Said(0, 'loop closure', closing),
            Said(0, 'recording', {f'Dropped: {STATES}': 4 * (number >= 3)}),
        ]
    )


def long(folder: Path) -> tuple[Path, np.ndarray]:
    """Write a run with more rows than a page has room for; return it and the rocker's angles."""
    rows = [close(3.0 * row / LONG_RATE) for row in range(LONG_ROWS)]
    rates = ([3.0, 0.0, SPIKE if row == SPIKE_AT else 0.0] for row in range(LONG_ROWS))
    scene = (
        f'rate: {LONG_RATE}\ndrive: {{constant_rate: {{rate: 3.0}}}}\n'
        'effects: {velocity: {}}\n'
    )
    bag = write_states(
        folder, scene, JOINTS, zip(rows, rates, strict=True), period=SECOND // LONG_RATE
    )
    return bag, np.array(rows)[:, 2]


def turning(folder: Path, angles: str) -> Path:
    """Write a run of a crank that turns twice in 4 s, with angles as a scene publishes them."""
    scene = (
        f'rate: 100\nangles: {angles}\ndrive: {{constant_rate: {{rate: {pi}}}}}\n'
        'effects: {velocity: {}}\n'
    )
    rows = np.array([close(0.01 * pi * row) for row in range(401)])
    if angles == 'wrapped':
        rows = np.angle(np.exp(1j * rows))
    return write_states(folder, scene, JOINTS, ((row, [pi, 0.0, 0.0]) for row in rows.tolist()))


MARKUP = '<img src=x onerror="window.hit=1">'
NAMES = (
    MARKUP,
    r'$\sqrt{2}$ & <b>bold</b> &lt;',
    '</script><script>window.hit=1</script>',
    'joint_' + 40 * 'very_' + 'long',
    'مفصل الذراع',
    '%{x} {y}',
)


def foreign(folder: Path) -> Path:
    """Write what somebody else has recorded, with names that want to be more than names."""
    folder.mkdir()
    types = {f'/{MARKUP}': JOINT_STATE, '/other': JOINT_STATE}
    writer = JointStateWriter(NAMES)

    def messages() -> Iterator[Message]:
        for row in range(200):
            stamp = BEGIN + row * 10 * MS
            angles = [sin(0.05 * row + k) for k in range(len(NAMES))]
            for of in types:
                yield of, stamp, stamp, writer.write(stamp, angles, angles)

    return write(folder / 'foreign', messages(), types=types)


def named(folder: Path) -> Path:
    """Write a run of a scene in which links, joints and the scene itself have such names."""
    crank, coupler, link = json.dumps(NAMES[0]), json.dumps(NAMES[1]), json.dumps(NAMES[3])
    linkage = f"""
links:
  ground: {{O2: [0, 0], O4: [0.1, 0]}}
  {link}: {{O2: [0, 0], A: [0.04, 0]}}
  coupler: {{A: [0, 0], B: [0.12, 0], P: [0.06, 0.03]}}
  rocker: {{O4: [0, 0], B: [0.08, 0]}}
input: {{joint: {crank}, parent: ground, child: {link}}}
assembly: {{B: left}}
joints:
  {coupler}: {{parent: {link}, child: coupler}}
  rocker_joint: {{parent: ground, child: rocker}}
traced: [P]
"""
    scene = 'rate: 100\ndrive: {constant_rate: {rate: 3.0}}\n'
    rows = ((close(0.03 * row), ()) for row in range(200))
    joints = [NAMES[0], NAMES[1], 'rocker_joint']
    return write_states(folder, scene, joints, rows, linkage=linkage, name=MARKUP)


def empty(folder: Path) -> Path:
    """Write a run that ended before it began."""
    return write_states(folder, DRILL_SCENE, [], [], linkage=DRILL)


FINGERS = """
rate: 100
linkages:
  - name: left
    linkage: l.yaml
    drive: {constant_rate: {rate: 1.0}}
  - name: right
    linkage: l.yaml
    drive: {constant_rate: {rate: -2.0}}
"""


def fingers(folder: Path) -> Path:
    """Write a run of two four-bars, the right of which turns the other way, and twice as fast."""
    joints = [f'{side}_{joint}' for side in ('left', 'right') for joint in JOINTS]
    rows = (((*close(0.01 * row), *close(-0.02 * row)), ()) for row in range(200))
    return write_states(folder, FINGERS, joints, rows)
