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

"""A page has a bound, whatever is in the bag; so has what is held to make it."""

from __future__ import annotations

from dataclasses import replace
import json
from threading import Event

from linkage_ros.bag.contents import Contents
from linkage_ros.bag.reader import BagMessage
from linkage_ros.bag.run_events import run_account
from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writer import BagWriter
from linkage_ros.cli.report import report
from linkage_ros.errors import LinkageError
from linkage_ros.files.linkage_file import read_linkage
from linkage_ros.files.yaml_file import read_yaml
from linkage_ros.kinematics.closure import Closure
from linkage_ros.messages.joint_state import JointStateWriter
from linkage_ros.pages.document import plotting_library
from linkage_ros.replay.replay import recorded_scene
from linkage_ros.report.blocks import Blocks, Progress
from linkage_ros.report.curves import Kept, MOST_LINKAGES
from linkage_ros.report.data import page_data
from linkage_ros.report.decimation import (  # fmt: skip
    DURATION_BYTES,
    FRAME_BYTES,
    Histogram,
    MOST_FRAMES,
    PAGE_BYTES,
    SAMPLE_BYTES,
    SHAPE_BYTES,
    STATE_BYTES,
    TABLE_BYTES,
)
from linkage_ros.report.html import ReportHeader, run_html, TableOf
from linkage_ros.report.labels import LANES
from linkage_ros.report.run import (
    Column,
    Frames,
    Lane,
    LinkageRun,
    MOST_SPANS,
    MOST_TEXT,
    Run,
    Window,
)
from linkage_ros.report.scene_run import SceneRun
from linkage_ros.resources import shipped
import numpy as np
import pytest

from .runs import BEGIN, MS, recorded, sample

pytest.importorskip('plotly')
WORST = '<\U0001f984\udc80"&' * 100_000


def data_of(page):
    return json.loads(page.split('id="data">')[1].split('</script>')[0])


def size_of(page):
    return len(page.encode('utf-8', 'backslashreplace'))


class Long:
    """A bag of a run of many ticks, of which no message is held."""

    def __init__(self, like, ticks):
        self.path, self.topics, self.attachments = like.path, like.topics, like.attachments
        self.files, self.custom = like.files, like.custom
        self._ticks = ticks
        self._write = JointStateWriter(['coupler_joint', 'rocker_joint']).write

    def messages(self):
        for tick in range(self._ticks):
            time = BEGIN + tick * MS + tick * 7919 % 1000
            yield BagMessage('/crank', time, time, sample(tick, 0.007 * tick))
            angles = 1 + np.sin(0.001 * tick), np.cos(0.003 * tick) / (1 + tick % 997)
            yield BagMessage('/joint_states', time, time, self._write(time, angles, angles))


def held(thing, seen):
    """Return how many [bytes] of arrays hang on something of the report's."""
    if isinstance(thing, np.ndarray):
        return 0 if thing.base is not None else thing.nbytes
    if id(thing) in seen:
        return 0
    seen.add(id(thing))
    if isinstance(thing, dict):
        return sum(held(each, seen) for each in thing.values())
    if isinstance(thing, (list, tuple)):
        return sum(held(each, seen) for each in thing)
    if type(thing).__module__.startswith('linkage_ros.report'):
        return held(getattr(thing, '__dict__', {}), seen)
    return 0


@pytest.fixture(scope='module')
def long(tmp_path_factory):
    """Return a run of two minutes, and what was held block by block."""
    scene = 'effects: {velocity: {}}\n'
    bag = Long(recorded(tmp_path_factory.mktemp('long'), scene), 120_000)
    reader = SceneRun(bag, run_account(bag), recorded_scene(bag), Window())
    blocks, sizes = Blocks(bag, reader.topics, Progress()), []
    for block in blocks:
        reader.take(block)
        sizes.append(held(reader, set()))
    return reader.end(blocks.contents()), sizes


def test_what_is_held_does_not_grow_with_the_run(long):
    _, sizes = long
    assert len(sizes) > 25
    assert max(sizes) - sizes[2] < 100_000
    assert max(sizes) < 40e6


def test_a_long_run_is_thinned_and_its_extremes_are_kept(long):
    run, _ = long
    states = run.curves[0]
    assert states.rows == 120_000
    rows, begins, ends, first, second = states.intervals
    assert rows > 1
    ticks = np.arange(120_000)
    values = np.cos(0.003 * ticks) / (1 + ticks % 997)
    place = [column.name for column in states.columns].index('rocker_joint')
    assert np.fmin(first, second)[:, place].min() == pytest.approx(values.min(), abs=1e-15)
    assert np.fmax(first, second)[:, place].max() == pytest.approx(values.max(), abs=1e-15)
    for number, (begin, end) in enumerate(zip(begins // MS, ends // MS, strict=True)):
        own = values[slice(begin, end + 1)]
        told = sorted([first[number, place], second[number, place]])
        assert told == pytest.approx([own.min(), own.max()], abs=1e-15)


def test_its_page_is_below_the_bound_and_says_how_much_it_holds(long):
    page = run_html(long[0], ReportHeader('t', [], [], []))
    assert size_of(page) < PAGE_BYTES
    assert 'of the moving picture one joint state of every' in page
    assert len(data_of(page)['curves']) == 4


def filled(room, names, quantity='position'):
    """Return curves that take all the room that they may."""
    columns = [Column(name, quantity, 'rad') for name in names]
    kept = Kept(WORST, columns, room, Window())
    most = kept._kept._most
    kept.add(np.arange(2 * most), np.random.default_rng(1).normal(size=(2 * most, len(columns))))
    return kept.curves()


def full_lane(**options):
    lane = Lane(**options)
    for number in range(5000):
        time = (number * number % 9973 + 10_000 * number) * 1_000_003 // 7
        lane.add(time, time + 1, f'{number}{WORST[:200]}')
    while len(lane.spans) < options.get('most', MOST_SPANS):
        time += 10**13
        lane.add(time, time + 1)
    return lane


def closures():
    names = ('klann_leg', 'jansen_leg', 'four_bar')
    files = [shipped(f'linkages/{name}.yaml') for name in names if _is_there(name)]
    return [Closure(read_linkage(read_yaml(str(file))[0])) for file in files]


def _is_there(name):
    return (shipped('linkages/four_bar.yaml').parent / f'{name}.yaml').exists()


def worst_run():
    found = [closures()[n % len(closures())] for n in range(MOST_LINKAGES)]
    linkages, values = [], {}
    for number, closure in enumerate(found):
        prefix = f'l{number}_'
        names = tuple(
            prefix + name
            for name in dict.fromkeys(
                [*(given.joint for given in closure.linkage.inputs), *closure.linkage.joints]
            )
        )
        values |= dict.fromkeys(names)
        inputs = tuple(prefix + given.joint for given in closure.linkage.inputs)
        linkages.append(
            LinkageRun(
                prefix, prefix, closure, inputs, names, ('rad',) * len(inputs),
                full_lane(longest=True, most=400),
            )
        )  # fmt: skip
    bodies = sum(len(each.closure.structure.links) for each in linkages)
    most = FRAME_BYTES // (8 * (1 + len(values)) + 12 * bodies + 4 * len(linkages))
    durations = Histogram()
    durations.add(10 ** np.arange(16))
    return Run(
        begin=BEGIN,
        end=2**62,
        window=Window(),
        contents=Contents((), 0, 0, '', False),
        curves=[
            filled(STATE_BYTES, values),
            filled(SAMPLE_BYTES, [*values][:60]),
            filled(DURATION_BYTES, ['tick'], 'lateness')._replace(
                columns=[Column('tick', 'lateness', 'ms')]
            ),
            filled(DURATION_BYTES, ['input'], 'age')._replace(
                columns=[Column('input', 'age', 'ms')]
            ),
        ],
        frames=Frames(1, np.arange(most), {name: np.linspace(0, 9, most) for name in values}),
        linkages=linkages,
        lanes={key: full_lane() for key in LANES},
        lateness=durations,
        age=durations,
        said={(f'task {n}', WORST[:80]): WORST[:80] for n in range(500)},
    )


def test_the_page_of_the_worst_run_is_below_the_bound():
    run = worst_run()
    tables = [
        TableOf(WORST, ('a', '>b'), [(WORST, WORST)] * 5000),
        *(TableOf('t', ('a',), [('b',)]) for _ in range(5000)),
    ]
    told = ReportHeader(WORST, [(f'fact {n}', WORST) for n in range(8)], [WORST] * 10, tables)
    page = run_html(run, told)
    size = size_of(page)
    assert size < PAGE_BYTES
    # It is the worst indeed; intervals are a power of two, so half of a room may be left.
    assert size > 0.7 * PAGE_BYTES
    data = data_of(page)
    assert len(data['lanes']) == len(LANES)
    assert 'more rows.' in page
    for lane in data['lanes']:
        assert len(lane['spans']) <= MOST_SPANS


def test_the_rooms_come_to_less_than_the_bound():
    library = len(plotting_library()) + 100_000  # with what is ours of script and style
    texts = len(LANES) * (MOST_TEXT + 60 * MOST_SPANS) + MOST_LINKAGES * 400 * 45
    numbers = (STATE_BYTES + SAMPLE_BYTES + 2 * DURATION_BYTES + FRAME_BYTES) * 4 / 3
    assert library + numbers + texts + SHAPE_BYTES + TABLE_BYTES < 0.98 * PAGE_BYTES
    assert MOST_FRAMES * 16 < FRAME_BYTES


def test_names_beyond_all_measure_are_refused_in_a_line():
    run = worst_run()
    name = 'x' * 15_000_000
    first = run.linkages[0]._replace(name=name)
    with pytest.raises(LinkageError, match='its page would be larger than 20 MB; shorten'):
        run_html(replace(run, linkages=[first]), ReportHeader('t', [], [], []))


def test_a_bag_of_hundreds_of_topics_and_joints_with_endless_names(tmp_path):
    names = [f'/{n}{"<" * 3000}' for n in range(300)]
    kind = 'sensor_msgs/msg/JointState'
    writer = BagWriter(tmp_path / 'bag', [Topic(name, kind, '', '') for name in names])
    write = JointStateWriter([f'{n}{"é" * 10_000}' for n in range(100)]).write
    for number in range(300):
        message = write(BEGIN, [float(number)] * 100, [1.0] * 100) if number < 6 else b''
        writer.write(number, BEGIN + number * MS, 0, message)
    writer.close()
    (file,) = writer.folder.glob('*.mcap')
    page = report(file, Window(), Event())
    assert size_of(page) < len(plotting_library()) + 3_000_000
    assert len(data_of(page)['plots']) == 2
    assert 'more rows.' in page


def test_the_same_bag_makes_the_same_page(tmp_path):
    bag = recorded(tmp_path, 'effects: {velocity: {}}\n')

    def made():
        reader = SceneRun(bag, run_account(bag), recorded_scene(bag), Window())
        blocks = Blocks(bag, reader.topics, Progress())
        for block in blocks:
            reader.take(block)
        return run_html(reader.end(blocks.contents()), ReportHeader('t', [], [], []))

    assert made() == made()


def test_no_number_of_a_page_is_none(long):
    json.dumps(page_data(long[0], wrapped=False), allow_nan=False)
