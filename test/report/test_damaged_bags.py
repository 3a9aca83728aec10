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

"""Whatever a bag's bytes are: a page, or one clear line; never a traceback."""

from __future__ import annotations

import json
from pathlib import Path
from threading import Event

from hypothesis import given
from hypothesis import strategies as st
from linkage_ros.bag.reader import read_bag
from linkage_ros.bag.writer import BagWriter
from linkage_ros.cli.report import report
from linkage_ros.errors import LinkageError
from linkage_ros.report.diagnostics_summary import statuses
from linkage_ros.report.joint_states import JointStates
from linkage_ros.report.run import Window
import numpy as np
import pytest

from .runs import but, diagnostics, recorded, Said, sample
from .test_messages import encoded, state

pytest.importorskip('plotly')
SCENE = 'effects: {velocity: {}}\nfaults: {quiet: {silence: {}, at: [0.01], seconds: 0.005}}\n'
PIECES = 300


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
        page = report(file, Window(), Event())
    except LinkageError as error:
        return str(error) or pytest.fail('without a word')
    json.loads(page.split('id="data">')[1].split('</script>')[0], parse_constant=pytest.fail)
    assert page.endswith('</html>\n')
    return ''


@pytest.mark.parametrize('seed', range(3))
def test_flipped_and_cut_bytes(bag, tmp_path, seed, monkeypatch):
    # The library makes pages long, and nothing else.
    monkeypatch.setattr('linkage_ros.pages.document.plotting_library', lambda: '')
    random = np.random.default_rng(seed)
    whole = bag.read_bytes()
    file = tmp_path / 'odd.mcap'
    lines = []
    for number in range(PIECES // 3):
        content = bytearray(whole)
        if number % 3 == 0:
            content = content[: random.integers(len(content))]
        for at in random.integers(len(content) or 1, size=random.integers(1, 4)):
            if len(content):
                content[at] ^= 1 << int(random.integers(8))
        file.write_bytes(content)
        lines.append(told(file))
    # Some are told as far as they go, and some are refused.
    assert '' in lines
    assert any(lines)
    assert all('\n' not in line for line in lines)


@pytest.mark.parametrize('seed', range(2))
def test_what_fits_its_checksums_may_still_be_anything(bag, tmp_path, seed, monkeypatch):
    monkeypatch.setattr('linkage_ros.pages.document.plotting_library', lambda: '')
    random = np.random.default_rng(seed)
    whole = read_bag(bag)
    messages = [*whole.messages()]
    numbers = {each.name: number for number, each in enumerate(whole.topics)}
    lines = []
    for number in range(PIECES // 12):
        attached = {name: ('', data) for name, data in whole.attachments.items()}
        if number % 2:
            name = str(random.choice([*attached]))
            attached[name] = '', changed(attached[name][1], random)
        writer = BagWriter(tmp_path / f'{number}', whole.topics, attached)
        odd = {*random.integers(len(messages), size=random.integers(1, 30)).tolist()}
        for place, (topic, logged, published, data) in enumerate(messages):
            time = TIMES[random.integers(len(TIMES))] if place in odd else 0
            writer.write(
                numbers[topic], time or logged, time and published,
                changed(data, random) if place in odd else data,
            )  # fmt: skip
        writer.close()
        lines.append(told(writer.folder))
    assert '' in lines
    assert all('\n' not in line for line in lines)


TIMES = (0, 0, 0, 1, 10**18, 2**62, 2**63 - 1)
"""In the place of a log time; 0 leaves it."""


def changed(data, random):
    content = bytearray(data)
    for at in random.integers(len(content) or 1, size=random.integers(1, 4)):
        if content:
            content[at] = random.integers(256)
    return bytes(content)


@given(st.binary(max_size=300))
def test_no_bytes_break_the_reader_of_diagnostics(data):
    for head in (b'', b'\0\1\0\0' + bytes(8) + b'\1\0\0\0\0\0\0\0'):
        for status in statuses(head + data):
            assert status.level in range(256)


WHOLE = diagnostics(
    [Said(0, 'tick', {'a': 'b', 'Lost ticks': 3}, 1, 'late'), Said(0, 'crank', {})]
)


@given(st.lists(st.tuples(st.integers(0, len(WHOLE) - 1), st.integers(0, 255)), max_size=6))
def test_no_change_of_bytes_breaks_it(changes):
    data = bytearray(WHOLE)
    for at, value in changes:
        data[at] = value
    for status in statuses(bytes(data)):
        assert sum(map(len, status.values)) <= 10 * len(WHOLE)


GOOD = encoded(state(5, {'a': 1.0, 'b': 2.0}))


def replaced(change):
    at, value = change
    data = bytearray(GOOD)
    data[at] = value
    return bytes(data)


@given(
    st.lists(
        st.binary(max_size=200)
        | st.tuples(st.integers(0, len(GOOD) - 1), st.integers(0, 255)).map(replaced),
        max_size=8,
    )
)
def test_no_bytes_break_the_reader_of_joint_states(messages):
    reader = JointStates()
    block = reader.read(messages)
    assert len(block.good) == len(messages)
    assert (~block.good).sum() == sum(
        n for reason, n in reader.left_out.items() if not reason.startswith('joints beyond')
    )
