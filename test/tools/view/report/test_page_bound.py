# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Any bag gives a page of bounded size, made in bounded memory, or one clear line."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Event

from hypothesis import given, strategies as st
from linkage_ros.bag import BagMessage, BagWriter, Contents, read_bag, read_run_metadata, Topic
from linkage_ros.cli import Table
from linkage_ros.description import load
from linkage_ros.errors import LinkageError
from linkage_ros.messages import JointStateWriter
from linkage_ros.replay import recorded_scene
from linkage_ros.tools.view import bag_page
from linkage_ros.tools.view.pages import document, plotting_library
from linkage_ros.tools.view.report import (
    Blocks,
    blocks as blocks_module,
    BoundedCurves,
    CurveColumn,
    curves as curves_module,
    DURATION_BYTES,
    EVENT_TRACKS,
    EventTrack,
    FORCE_BYTES,
    FRAME_BYTES,
    Frames,
    Histogram,
    JointStates,
    LinkageRun,
    MOST_FRAMES,
    MOST_LINKAGES,
    MOST_SPANS,
    MOST_TEXT,
    PAGE_BYTES,
    Progress,
    read_statuses,
    ReportedRun,
    ReportHeader,
    SAMPLE_BYTES,
    SceneRun,
    SHAPE_BYTES,
    STATE_BYTES,
    TABLE_BYTES,
    Window,
)
import numpy as np
import pytest

from .runs import BEGIN, but, data_of, diagnostics, MS, page_of_run, recorded, Said, sample
from .test_messages import GOOD
from ....support.sampling import sample_count

pytest.importorskip('plotly')
WORST = '<\U0001f984\udc80"&' * 100_000


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
    if type(thing).__module__.startswith('linkage_ros.tools.view.report'):
        return held(getattr(thing, '__dict__', {}), seen)
    return 0


TICKS = 12_000


@pytest.fixture(scope='module')
def long(tmp_path_factory):
    """Return a run in a tenth of the room that a page has, and what was held block by block."""
    scene = 'effects: {velocity: {}}\n'
    bag = Long(recorded(tmp_path_factory.mktemp('long'), scene), TICKS)
    with pytest.MonkeyPatch.context() as patch:
        for room in ('STATE_BYTES', 'SAMPLE_BYTES', 'DURATION_BYTES', 'FRAME_BYTES'):
            patch.setattr(curves_module, room, getattr(curves_module, room) // 10)
        patch.setattr(blocks_module, '_MOST_MESSAGES', 800)
        reader = SceneRun(bag, read_run_metadata(bag), recorded_scene(bag), Window())
        blocks, sizes = Blocks(bag, reader.topics, Progress()), []
        for block in blocks:
            reader.add_block(block)
            sizes.append(held(reader, set()))
    return reader.finish_run(blocks.count_contents()), sizes


def test_report_memory_does_not_grow_with_the_run(long):
    _, sizes = long
    assert len(sizes) > 25
    assert max(sizes) - sizes[2] < 10_000
    assert max(sizes) < 4e6


def test_long_run_is_thinned_and_keeps_its_extremes(long):
    states = long[0].curves[0]
    assert states.rows == TICKS
    rows, begins, ends, first, second = states.intervals
    assert rows > 1
    ticks = np.arange(TICKS)
    values = np.cos(0.003 * ticks) / (1 + ticks % 997)
    place = [column.name for column in states.columns].index('rocker_joint')
    assert [*begins // MS] == [0, *(ends[:-1] // MS + 1)]
    assert ends[-1] // MS == TICKS - 1
    for index, (begin, end) in enumerate(zip(begins // MS, ends // MS, strict=True)):
        own = values[slice(begin, end + 1)]
        told = sorted([first[index, place], second[index, place]])
        assert told == pytest.approx([own.min(), own.max()], abs=1e-15)


def test_page_of_a_long_run_names_its_thinning(long):
    page = page_of_run(long[0])
    assert 'of the moving picture one joint state of every' in page
    assert len(data_of(page)['curves']) == 4


def filled(room, names, quantity='position'):
    """Return curves that take all the room that they may."""
    columns = [CurveColumn(name, quantity, 'rad') for name in names]
    kept = BoundedCurves(WORST, columns, room, Window())
    most = kept._kept._most
    kept.add(np.arange(2 * most), np.random.default_rng(1).normal(size=(2 * most, len(columns))))
    return kept.build_curves()


def full_lane(**options):
    lane = EventTrack(**options)
    for index in range(5000):
        time = (index * index % 9973 + 10_000 * index) * 1_000_003 // 7
        lane.add(time, time + 1, f'{index}{WORST[:200]}')
    while len(lane.spans) < options.get('most', MOST_SPANS):
        time += 10**13
        lane.add(time, time + 1)
    return lane


def worst_run():
    closures = [load(name) for name in ('klann_leg', 'jansen_leg', 'four_bar')]
    linkages, values = [], {}
    for index in range(MOST_LINKAGES):
        closure = closures[index % len(closures)]
        prefix = f'l{index}_'
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
    return ReportedRun(
        begin=BEGIN,
        end=2**62,
        window=Window(),
        contents=Contents((), 0, 0, '', False),
        curves=[
            filled(STATE_BYTES, values),
            filled(SAMPLE_BYTES, [*values][:60]),
            filled(FORCE_BYTES, [*values][:60], 'force')._replace(
                columns=[CurveColumn(name, 'force', 'N') for name in [*values][:60]]
            ),
            filled(DURATION_BYTES, ['tick'], 'lateness')._replace(
                columns=[CurveColumn('tick', 'lateness', 'ms')]
            ),
            filled(DURATION_BYTES, ['input'], 'age')._replace(
                columns=[CurveColumn('input', 'age', 'ms')]
            ),
        ],
        frames=Frames(1, np.arange(most), {name: np.linspace(0, 9, most) for name in values}),
        linkages=linkages,
        event_tracks={key: full_lane() for key in EVENT_TRACKS},
        lateness=durations,
        age=durations,
        last_values={(f'task {n}', WORST[:80]): WORST[:80] for n in range(500)},
    )


def test_page_of_the_worst_run_fits_its_limit():
    run = worst_run()
    tables = [
        Table(WORST, ('a', '>b'), [(WORST, WORST)] * 5000),
        *(Table('t', ('a',), [('b',)]) for _ in range(5000)),
    ]
    told = ReportHeader(WORST, [(f'fact {n}', WORST) for n in range(8)], [WORST] * 10, tables)
    page = page_of_run(run, told)
    size = size_of(page)
    assert size < PAGE_BYTES
    # It is the worst indeed; intervals are a power of two, so half of a room may be left.
    assert size > 0.7 * PAGE_BYTES
    data = data_of(page)
    assert len(data['lanes']) == len(EVENT_TRACKS)
    assert 'more rows.' in page
    assert all(len(lane['spans']) <= MOST_SPANS for lane in data['lanes'])


def test_size_limits_of_page_parts_add_up():
    library = len(plotting_library()) + 100_000  # with what is ours of script and style
    texts = len(EVENT_TRACKS) * (MOST_TEXT + 60 * MOST_SPANS) + MOST_LINKAGES * 400 * 45
    numbers = STATE_BYTES + SAMPLE_BYTES + FORCE_BYTES + 2 * DURATION_BYTES + FRAME_BYTES
    assert library + numbers * 4 / 3 + texts + SHAPE_BYTES + TABLE_BYTES < 0.98 * PAGE_BYTES
    assert MOST_FRAMES * 16 < FRAME_BYTES


def test_oversized_names_are_refused_in_one_line(long):
    first = long[0].linkages[0]._replace(name='x' * 15_000_000)
    with pytest.raises(LinkageError, match='its page would be larger than 20 MB; shorten'):
        page_of_run(replace(long[0], linkages=[first]))


def test_bag_of_100_topics_gives_a_bounded_page(tmp_path):
    names = [f'/{n}{"<" * 3000}' for n in range(100)]
    kind = 'sensor_msgs/msg/JointState'
    writer = BagWriter(tmp_path / 'bag', [Topic(name, kind, '', '') for name in names])
    write = JointStateWriter([f'{n}{"é" * 10_000}' for n in range(100)]).write
    for index in range(100):
        message = write(BEGIN, [float(index)] * 100, [1.0] * 100) if index < 6 else b''
        writer.write(index, BEGIN + index * MS, 0, message)
    writer.close()
    (file,) = writer.folder.glob('*.mcap')
    page = bag_page(file, Window(), Event())
    assert size_of(page) < len(plotting_library()) + 3_000_000
    assert len(data_of(page)['plots']) == 2
    assert 'more rows.' in page


# Whatever a bag's bytes are: a page, or one clear line; never a traceback.


SCENE = 'effects: {velocity: {}}\nfaults: {quiet: {silence: {}, at: [0.01], seconds: 0.005}}\n'


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    bad = sample(0, 0.1)[:50]
    moments = but(60, lambda tick, m: m._replace(messages=(*m.messages, bad)) if tick == 9 else m)
    said = [Said(20, 'tick', {'Lost ticks': 1}, 1, 'm')]
    folder = recorded(tmp_path_factory.mktemp('bag'), SCENE, moments, said=said).path
    (file,) = folder.glob('*.mcap')
    return file


def told(file: Path) -> str:
    """Return the line for which a bag is refused; of one that is not, ''."""
    try:
        page = bag_page(file, Window(), Event())
    except LinkageError as error:
        return str(error) or pytest.fail('without a word')
    data_of(page)
    assert page.endswith('</html>\n')
    return ''


def flipped(bag, folder, random, index):
    """Return a bag of which bits are flipped; every third is cut as well."""
    content = bytearray(bag.read_bytes())
    if index % 3 == 0:
        content = content[: random.integers(1, len(content))]
    for at in random.integers(len(content), size=random.integers(1, 4)):
        content[at] ^= 1 << int(random.integers(8))
    file = folder / 'odd.mcap'
    file.write_bytes(content)
    return file


def rewritten(bag, folder, random, index):
    """Return a bag with sound checksums of which messages, or every second time files, changed."""
    whole = read_bag(bag)
    messages = [*whole.messages()]
    numbers = {each.name: number for number, each in enumerate(whole.topics)}
    attached = {name: ('', data) for name, data in whole.attachments.items()}
    if index % 2:
        name = str(random.choice([*attached]))
        attached[name] = '', changed(attached[name][1], random)
    writer = BagWriter(folder / f'{index}', whole.topics, attached)
    odd = {*random.integers(len(messages), size=random.integers(1, 30)).tolist()}
    for place, (topic, logged, published, data) in enumerate(messages):
        time = TIMES[random.integers(len(TIMES))] if place in odd else 0
        writer.write(
            numbers[topic], time or logged, time and published,
            changed(data, random) if place in odd else data,
        )  # fmt: skip
    writer.close()
    return writer.folder


@pytest.mark.parametrize(('harm', 'of_all', 'few'), [(flipped, 300, 45), (rewritten, 50, 10)])
def test_damaged_bag_is_reported_or_refused_in_one_line(
    bag, tmp_path, monkeypatch, harm, of_all, few
):
    # The library makes pages long, and nothing else.
    monkeypatch.setattr(document, 'plotting_library', str)
    make = partial(harm, bag, tmp_path, np.random.default_rng(0))
    lines = [told(make(index)) for index in range(sample_count(of_all, few))]
    assert '' in lines
    assert any(lines) or harm is rewritten
    assert all('\n' not in line for line in lines)


def test_repeated_report_gives_the_same_page(bag):
    assert len({bag_page(bag, Window(), Event()) for _ in range(2)}) == 1


TIMES = (0, 0, 0, 1, 10**18, 2**62, 2**63 - 1)
"""In the place of a log time; 0 leaves it."""


def changed(data, random):
    content = bytearray(data)
    for at in random.integers(len(content) or 1, size=random.integers(1, 4)):
        if content:
            content[at] = random.integers(256)
    return bytes(content)


WHOLE = diagnostics(
    [Said(0, 'tick', {'a': 'b', 'Lost ticks': 3}, 1, 'late'), Said(0, 'crank', {})]
)
HEADS = (b'', b'\0\1\0\0' + bytes(8) + b'\1\0\0\0\0\0\0\0')


def damaged(good):
    """Draw a message of which bytes are others."""

    def change(changes):
        data = bytearray(good)
        for at, value in changes:
            data[at] = value
        return bytes(data)

    places = st.tuples(st.integers(0, len(good) - 1), st.integers(0, 255))
    return st.lists(places, max_size=6).map(change)


@given(damaged(WHOLE) | st.builds(bytes.__add__, st.sampled_from(HEADS), st.binary(max_size=300)))
def test_random_bytes_do_not_break_the_diagnostics_reader(data):
    for status in read_statuses(data):
        assert status.level in range(256)
        assert sum(map(len, status.values)) <= 10 * len(WHOLE)


@given(st.lists(st.binary(max_size=200) | damaged(GOOD), max_size=8))
def test_random_bytes_do_not_break_the_joint_state_reader(messages):
    reader = JointStates()
    block = reader.read(messages)
    assert len(block.good) == len(messages)
    assert (~block.good).sum() == sum(
        n for reason, n in reader.left_out.items() if not reason.startswith('joints beyond')
    )
