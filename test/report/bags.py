# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Bags written by hand for pages: every kind of event, names that are markup, and a long run."""

from cmath import phase, rect
from collections.abc import Iterable, Iterator, Mapping, Sequence
import json
from math import acos, cos, nan, pi, sin
from pathlib import Path
from struct import unpack_from

from linkage_ros.bag import BagWriter, RUN_FILE
from linkage_ros.description import load_scene
from linkage_ros.messages import JointStateWriter, time_message
from linkage_ros.resources import shipped_path
from mcap.reader import make_reader
import numpy as np

from ..cli.recorded import BEGIN, JOINT_STATE, MS, scene_file, SECOND, STORE, topic
from ..support.messages import wrench_stamped

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
Message = tuple[str, int, int, bytes]
"""Topic, log time, publish time, data."""


def follow(a: float, b: float, c: float, d: float, crank: float) -> tuple[float, float]:
    """Return the published angles of a four-bar's coupler and rocker, by the law of cosines."""
    pin = rect(a, crank)
    s, way = abs(d - pin), phase(d - pin)
    coupler = way + acos((b * b + s * s - c * c) / (2 * b * s))
    return coupler - crank, phase(pin + rect(b, coupler) - d)


def write(
    folder: Path,
    messages: Iterable[Message],
    scene: Path | None = None,
    name: str = '',
    types: Mapping[str, str] = TYPES,
    wrenches: Sequence[str] = (),
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
            'wrench_topics': [*wrenches],
        }
        attachments[RUN_FILE] = ('application/json', json.dumps(said).encode())
    numbers = {each: index for index, each in enumerate(types)}
    writer = BagWriter(folder, [topic(*each) for each in types.items()], attachments)
    for of, logged, published, data in messages:
        writer.write(numbers[of], logged, published, data)
    writer.close({})
    return folder


def drill(folder: Path) -> Path:
    """Write eight seconds in which everything happens that a page has a lane for."""
    folder.mkdir()
    scene = scene_file(folder, DRILL_SCENE, DRILL)
    return write(folder / 'drill', _drill(), scene, 'drill & <b>bold</b>')


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
                yield (
                    FAULTS,
                    logged,
                    logged,
                    _text(json.dumps({'fault': 'plug', 'kind': 'silence', 'injected': on})),
                )
        if tick == 600:
            yield RESETS, logged, logged, time_message(logged)
        if tick % 100 == 50:
            yield HEALTH, logged, logged, _diagnostics(tick // 100, stamp)
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


def _diagnostics(number: int, stamp: int) -> bytes:
    """Return the message of the second of that number: all counts grow in one of them."""

    def status(task: str, values: dict[str, int], level: int = 0, message: str = '') -> object:
        pair = STORE.types['diagnostic_msgs/msg/KeyValue']
        pairs = [pair(key, str(value)) for key, value in values.items()]
        kind = STORE.types['diagnostic_msgs/msg/DiagnosticStatus']
        return kind(level, f'linkage: {task}', message, 'robot', pairs)

    header = STORE.types['std_msgs/msg/Header'](
        STORE.types['builtin_interfaces/msg/Time'](*divmod(stamp, SECOND)), ''
    )
    warm = number == 6
    message = STORE.types[TYPES[HEALTH]](
        header,
        [
            status('tick', {'Lost ticks': 7 * (number >= 2)}, int(warm), 'it is warm' * warm),
            status(
                'loop closure',
                {'Ticks open': 30 * (number >= 5), 'Ticks at a toggle': 5 * (number >= 4)},
            ),
            status('recording', {f'Dropped: {STATES}': 4 * (number >= 3)}),
        ],
    )
    return bytes(STORE.serialize_cdr(message, TYPES[HEALTH]))


def _text(text: str) -> bytes:
    return bytes(STORE.serialize_cdr(STORE.types[TYPES[FAULTS]](text), TYPES[FAULTS]))


def long(folder: Path) -> tuple[Path, np.ndarray]:
    """Write a run with more rows than a page has room for; return it and the rocker's angles."""
    folder.mkdir()
    linkage = 'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n'
    scene = scene_file(folder, f'rate: {LONG_RATE}\ndrive: {{constant_rate: {{rate: 3.0}}}}\n'
                       'effects: {velocity: {}}\n', linkage)  # fmt: skip
    writer = JointStateWriter(['crank_joint', 'coupler_joint', 'rocker_joint'])
    rockers = np.empty(LONG_ROWS)

    def messages() -> Iterator[Message]:
        for row in range(LONG_ROWS):
            crank = 3.0 * row / LONG_RATE
            coupler, rockers[row] = follow(0.04, 0.12, 0.08, 0.1, crank)
            rates = [3.0, 0.0, SPIKE if row == SPIKE_AT else 0.0]
            stamp = BEGIN + row * (SECOND // LONG_RATE)
            data = writer.write(stamp, [crank, coupler, rockers[row]], rates)
            yield STATES, stamp, stamp, data

    return write(folder / 'long', messages(), scene), rockers


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
    folder.mkdir()
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
    scene = scene_file(folder, 'rate: 100\ndrive: {constant_rate: {rate: 3.0}}\n', linkage)
    writer = JointStateWriter([NAMES[0], NAMES[1], 'rocker_joint'])

    def messages() -> Iterator[Message]:
        for row in range(200):
            stamp, angle = BEGIN + row * PERIOD, 0.03 * row
            angles = [angle, *follow(0.04, 0.12, 0.08, 0.1, angle)]
            yield STATES, stamp, stamp, writer.write(stamp, angles, [])

    return write(folder / 'named', messages(), scene, MARKUP)


def empty(folder: Path) -> Path:
    """Write a run that ended before it began."""
    folder.mkdir()
    return write(folder / 'empty', [], scene_file(folder, DRILL_SCENE, DRILL))


FOUR_BAR = 'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n'
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
    folder.mkdir()
    scene = scene_file(folder, FINGERS, FOUR_BAR)
    sides = ('left', 'right')
    names = [f'{side}_{joint}_joint' for side in sides for joint in ('crank', 'coupler', 'rocker')]
    writer = JointStateWriter(names)

    def messages() -> Iterator[Message]:
        for row in range(200):
            stamp, cranks = BEGIN + row * PERIOD, (0.01 * row, -0.02 * row)
            angles = [x for each in cranks for x in (each, *follow(0.04, 0.12, 0.08, 0.1, each))]
            yield STATES, stamp, stamp, writer.write(stamp, angles, [])

    return write(folder / 'fingers', messages(), scene)


def late(folder: Path) -> Path:
    """Write a run whose crank comes 0.6 s after its beginning."""
    folder.mkdir()
    scene = scene_file(folder, 'rate: 100\ndrive: {topic: {}}\n', FOUR_BAR)
    crank = JointStateWriter(['crank_joint'])
    states = JointStateWriter(['coupler_joint', 'rocker_joint'])

    def messages() -> Iterator[Message]:
        yield HEALTH, BEGIN, BEGIN, _diagnostics(0, BEGIN)
        for row in range(60, 160):
            stamp, angle = BEGIN + row * PERIOD, 0.01 * row
            joints = follow(0.04, 0.12, 0.08, 0.1, angle)
            yield CRANK, stamp, stamp, crank.write(stamp, [angle], [1.0])
            yield STATES, stamp, stamp, states.write(stamp, joints, [])

    return write(folder / 'late', messages(), scene)


PUSH, TWIST = '/linkage_node/wrenches/coupler', '/linkage_node/wrenches/rocker'


def pushed(folder: Path) -> Path:
    """Write a run of a four-bar on whose links two topics put wrenches, at times of their own."""
    folder.mkdir()
    scene = scene_file(
        folder,
        'rate: 100\ndrive: {torque: {start: 1.0}}\nloads: {wrenches: {coupler: {}, rocker: {}}}\n',
        shipped_path('linkages/four_bar.yaml').read_text('utf-8'),
    )
    writer = JointStateWriter(['coupler_joint', 'rocker_joint'])

    def messages() -> Iterator[Message]:
        for row in range(100):
            stamp = BEGIN + row * PERIOD
            if row % 2:
                yield PUSH, stamp, stamp, wrench_stamped(3.0 * row, 4.0 * row, 0.0)
            if row % 5 == 0:
                yield TWIST, stamp, stamp, wrench_stamped(0.0, -1.0, 0.1 * row)
            if row == 50:
                yield TWIST, stamp, stamp, b'no message'
            angles = follow(0.04, 0.12, 0.08, 0.1, 1.0 + 0.01 * row)
            yield STATES, stamp, stamp, writer.write(stamp, angles, [])

    types = TYPES | dict.fromkeys((PUSH, TWIST), 'geometry_msgs/msg/WrenchStamped')
    return write(folder / 'pushed', messages(), scene, types=types, wrenches=[PUSH, TWIST])


def joint_states(bag: Path, of: str) -> list[tuple[int, int, int, list[str], Sequence[float]]]:
    """Return number, log time, stamp, names, positions and rates, as mcap reads them."""
    found = []
    (file,) = bag.glob('*.mcap')
    with file.open('rb') as stream:
        messages = make_reader(stream).iter_messages(log_time_order=False)
        for index, (_, channel, message) in enumerate(messages):
            if channel.topic != of:
                continue
            data = message.data
            seconds, nanoseconds, frame = unpack_from('<iII', data, 4)
            at = 16 + frame
            names = []
            at += -at % 4
            (count,) = unpack_from('<I', data, at)
            at += 4
            for _ in range(count):
                at += -at % 4
                (length,) = unpack_from('<I', data, at)
                begin, at = at + 4, at + 4 + length
                end = at - 1  # without the zero
                names.append(data[begin:end].decode())
            numbers: list[float] = []
            for _ in range(2):
                at += -at % 4
                (length,) = unpack_from('<I', data, at)
                at += 4
                # Doubles are aligned behind the four bytes that say how all is encoded.
                at += -(at - 4) % 8 if length else 0
                numbers += unpack_from(f'<{length}d', data, at)
                at += 8 * length
            stamp = seconds * SECOND + nanoseconds
            found.append((index, message.log_time, stamp, names, numbers))
    return found
