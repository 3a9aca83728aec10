# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A linkage written as a file is read as the same linkage, to the last bit; and whole, or not."""

from dataclasses import replace
from math import inf
import os
import resource

from hypothesis import example, given, settings, strategies as st
from linkage_ros import load
from linkage_ros.description import (
    linkage_text,
    number_text,
    parse_yaml,
    read_any_closure,
    read_linkage,
    write_linkage,
)
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import (
    AssemblyPose,
    Limits,
    Linkage,
    Mass,
    PoseCorrections,
    RevoluteJoint,
    SlideJoint,
)
from linkage_ros.resources import spatial_linkage_names
import pytest
import yaml

from .conftest import CONFIG, FOUR_BAR

FILES = sorted((CONFIG / 'linkages').glob('*.yaml'))


def read(data: bytes) -> Linkage:
    return read_linkage(parse_yaml(data, 'linkage.yaml'))


GALLERY = {file.stem: read(file.read_bytes()) for file in FILES}


def reads_as(linkage: Linkage, text: str) -> bool:
    """Return whether a text is read as a linkage: bits, signs of zero and order are the same."""
    return repr(read(text.encode())) == repr(linkage)


@pytest.mark.sample(8)
@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_gallery_linkage_text_equals_its_file(file):
    linkage = GALLERY[file.stem]
    written = linkage_text(linkage)
    assert reads_as(linkage, written)
    # By another reader, which knows nothing of linkages: the same but for what may be left out.
    theirs = yaml.safe_load(file.read_text('utf-8'))
    if 'links' in theirs:  # the shorthand is written out
        said = {key: value for key, value in theirs.items() if value != {}}
        assert yaml.safe_load(written) == said
    assert max(map(len, written.splitlines())) <= 99


EVERY_KEY = """
units: mm
angles: degrees
points: {P: [300, 30, 100], Q: [100, 20, -100], T: [1500, 0, 400], "no": [1, -0.0, 1.0e-7]}
links: {ground: [Q], boom: [P, "no"], tip: [T]}
hinges:
  boom_joint: {parent: ground, child: boom, at: [0, 0, 0], axis: [0, -1, 0.1], value: 20,
               limits: [-90, 90], velocity: 100, effort: 7}
  bucket: {parent: boom, child: tip, at: [1500, 0, 400], axis: [0, -1, 0]}
slides: {lever: {parent: ground, child: knob, axis: [0, 2, 1], value: 10, limits: [-.inf, 20]}}
struts: {cylinder: [P, Q]}
ratios:
  bucket: {of: cylinder, ratio: 0.002, offset: -32.43163817237363}
  lever: {of: cylinder, ratio: 0.1, offset: -18.30194339616981}
input: cylinder
joints: [lever, boom_joint]
traced: ["no", T]
masses:
  boom: {mass: 3, center: [1, 2, 3], inertia: [1, 0.1, 0.2, 1.1, 0.3, 1.2]}
  tip: {mass: 0}
  knob: {mass: 1, center: [0, 0, 0], inertia: [0, 0, 0, 0, 0, 0]}
"""


def spatial_linkage(text: str):
    """Return a linkage of a file, without what the file does not say."""
    linkage = read_any_closure(parse_yaml(text.encode(), 'linkage.yaml')).linkage
    return replace(linkage, corrections=PoseCorrections())


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', [*spatial_linkage_names(), 'every key'])
def test_spatial_linkage_text_is_read_back_exactly(name):
    linkage = spatial_linkage(EVERY_KEY) if name == 'every key' else load(name).linkage
    linkage = replace(linkage, corrections=PoseCorrections())
    written = linkage_text(linkage, ['One.'])
    assert repr(spatial_linkage(written)) == repr(linkage)
    assert yaml.safe_load(written) == parse_yaml(written.encode(), 'linkage.yaml').mapping


ODD = [
    'yes', 'NO', 'off', 'null', '~', 'true', 'False', '.nan', '-.inf', '0', '1e3', '-1.5', '0x10',
    '1:30', '1_000', '2026-01-01', '<<', '=', ' ', ' a', 'a ', 'a b', 'a: b', 'a:', ':a', '#a',
    'a #b', '- a', '-', '?', '? a', ',', '[', ']', '{}', '"', "'", '\\', '\\n', '!a', '&a', '*a',
    '|', '>', '%a', '@', '`', '---', '...', 'é', 'a\u0301', '関節', '🦾', 'links', 'a.b',
]  # fmt: skip

NAMES = st.one_of(
    st.sampled_from(ODD),
    # Printable: all but controls and separators, of which the space alone is.
    st.text(
        st.characters(codec='utf-8', exclude_categories=('C', 'Z'), include_characters=' '),
        min_size=1,
        max_size=8,
    ),
)
NUMBERS = st.floats(-1e9, 1e9)
NEAR = st.floats(-0.1, 0.1)
POINTS = st.tuples(NUMBERS, NUMBERS)
MOST = st.just(inf) | st.floats(0.0, 1e9, exclude_min=True)
EXERTIONS = st.builds(Limits, velocity=MOST, effort=MOST)
# Limits that do not affect any state: tests here need no others.
FAR = st.sampled_from([(-inf, inf), (-1e9, inf), (-inf, 1e9), (-1e9, 1e9)])
LIMITS = st.builds(lambda ends, of: replace(of, low=ends[0], high=ends[1]), FAR, EXERTIONS)


@st.composite
def fresh_names(draw: st.DrawFn, count: int) -> list[str]:
    """Return names that differ from each other and from the ground's."""
    found = ['ground']
    for _ in range(count):
        name = draw(NAMES)
        # Made different: drawn until they differ, most draws would be thrown away.
        while name in found:
            name += str(len(found))
        found.append(name)
    return found[1:]


@st.composite
def linkages(draw: st.DrawFn) -> Linkage:
    """Return a linkage of the gallery with other names and sizes, and further points and keys."""
    # Of the others the pose tells the assembly, which another pose would contradict.
    told = [name for name, linkage in GALLERY.items() if linkage.assembly or not linkage.pose]
    linkage = GALLERY[draw(st.sampled_from(told))]
    old = {name for points in linkage.links.values() for name in points} | {
        *linkage.links,
        *linkage.sliders,
        *linkage.joints,
        *(given.joint for given in linkage.inputs),
    }
    old -= {'ground'}
    fresh = draw(fresh_names(len(old) + 1))
    new = dict(zip(sorted(old), fresh, strict=False)) | {'ground': 'ground', '': ''}
    times = draw(st.floats(1e-3, 1e3))
    links = {
        new[link]: {new[name]: (times * x, times * y) for name, (x, y) in points.items()}
        for link, points in linkage.links.items()
    }
    # A point of no use; far away it would make a slide's range too small to be found.
    x, y = draw(st.tuples(NEAR, NEAR))
    links[draw(st.sampled_from(sorted(links)))][fresh[-1]] = (times * x, times * y)
    return Linkage(
        links,
        tuple(
            replace(
                g,
                limits=draw(LIMITS),
                **{key: new[getattr(g, key)] for key in ('joint', 'parent', 'child', 'slider')},
            )
            for g in linkage.inputs
        ),
        {new[name]: side for name, side in linkage.assembly.items()},
        {
            new[name]: SlideJoint(new[joint.slider], draw(LIMITS))
            if isinstance(joint, SlideJoint)
            else RevoluteJoint(new[joint.parent], new[joint.child], draw(EXERTIONS))
            for name, joint in linkage.joints.items()
        },
        {
            new[name]: replace(
                slider,
                **{key: new[getattr(slider, key)] for key in ('point', 'along', 'through')},
                block=new[slider.block],
            )
            for name, slider in linkage.sliders.items()
        },
        tuple(draw(st.lists(st.sampled_from(fresh[-1:]), max_size=1))),
        draw(
            st.none()
            | st.builds(
                AssemblyPose,
                st.tuples(*[NUMBERS] * len(linkage.inputs)),
                # Points of the ground tell nothing: any place of them is read.
                st.dictionaries(st.sampled_from(sorted(links['ground'])), POINTS),
                st.dictionaries(st.just('ground'), st.floats(-1e9, 1e9)),
            )
        ),
        draw(
            st.dictionaries(
                st.sampled_from(sorted({*links} - {'ground'})),
                st.builds(
                    Mass,
                    st.floats(0.0, 1e12, exclude_min=True),
                    POINTS,
                    st.floats(0.0, 1e12),
                ),
            )
        ),
    )


@settings(deadline=None)
@given(linkages())
def test_random_linkage_text_is_read_back_exactly(linkage):
    text = linkage_text(linkage, ['One.', 'Other.'])
    assert reads_as(linkage, text)
    # YAML 1.1 has other numbers and words; both see the same here.
    assert yaml.safe_load(text) == parse_yaml(text.encode(), 'linkage.yaml').mapping


@given(st.floats(allow_nan=False, allow_infinity=False))
@example(-0.0)
@example(1e15)
@example(-1e-7)
@example(5e-324)
@example(1.7976931348623157e308)
def test_number_text_is_read_back_exactly(value):
    text = f'x: [{number_text(value)}]'
    (found,) = parse_yaml(text.encode(), 'x.yaml').numbers('x')
    assert found.hex() == value.hex()
    (theirs,) = yaml.safe_load(text)['x']
    assert isinstance(theirs, int | float)
    assert float(theirs).hex() == value.hex()


@pytest.mark.parametrize(
    ('value', 'text'),
    [(0.0, '0'), (-0.0, '-0.0'), (-3.0, '-3'), (0.1, '0.1'), (1e-7, '1.0e-07'), (1e16, '1.0e+16')],
)
def test_number_text_has_the_expected_format(value, text):
    assert number_text(value) == text


def test_long_link_is_written_in_rows():
    third = 1.0 / 3.0
    linkage = read(FOUR_BAR)
    points = dict.fromkeys(('first', 'second', 'third'), (third, -third))
    linkage = replace(
        linkage, links={**linkage.links, 'coupler': linkage.links['coupler'] | points}
    )
    assert linkage_text(linkage).splitlines()[:10] == [
        'links:',
        '  ground: {O2: [0, 0], O4: [0.1, 0]}',
        '  crank: {O2: [0, 0], A: [0.04, 0]}',
        '  coupler:',
        '    A: [0, 0]',
        '    B: [0.12, 0]',
        '    first: [0.3333333333333333, -0.3333333333333333]',
        '    second: [0.3333333333333333, -0.3333333333333333]',
        '    third: [0.3333333333333333, -0.3333333333333333]',
        '  rocker: {O4: [0, 0], B: [0.08, 0]}',
    ]


def test_linkage_comments_are_wrapped_at_the_head():
    long = 'x' * 120
    comment = ['word ' * 40, '', f'a {long} b', 'two\nlines', 'a\0bell\a']
    text = linkage_text(read(FOUR_BAR), comment)
    head = text[: text.index('links:')].splitlines()
    assert head[0] == '# ' + ('word ' * 19).strip()
    assert head[3:] == ['#', '# a', f'# {long}', '# b', '# two', '# lines', '# a bell']
    assert reads_as(read(FOUR_BAR), text)


def test_written_linkage_replaces_the_previous_file(tmp_path):
    file, link = tmp_path / 'linkage.yaml', tmp_path / 'link.yaml'
    file.write_text('before')
    link.symlink_to(file)
    write_linkage(read(FOUR_BAR), link, ['Mine.'])
    assert file.read_text() == linkage_text(read(FOUR_BAR), ['Mine.'])
    assert link.is_symlink()
    umask = os.umask(0)
    os.umask(umask)
    assert file.stat().st_mode & 0o777 == 0o666 & ~umask
    assert sorted(tmp_path.iterdir()) == [link, file]


# A name within the test's folder, and the error.
NOT_WRITTEN = {
    'no/linkage.yaml': 'there is no folder ',
    'file/linkage.yaml': 'cannot be written (Not a directory); name another file',
    '.': 'exists and is not a file; name another file',
    'pipe': 'exists and is not a file; name another file',
    'circle': 'cannot be written (',
    'n' * 300: 'cannot be written (File name too long); name another file',
    'nul\0': 'cannot be written (embedded null byte); name another file',
}


@pytest.mark.parametrize('name', NOT_WRITTEN)
def test_unwritable_linkage_path_is_refused(tmp_path, name):
    (tmp_path / 'file').write_text('')
    os.mkfifo(tmp_path / 'pipe')
    (tmp_path / 'circle').symlink_to(tmp_path / 'circle')
    before = sorted(tmp_path.iterdir())
    with pytest.raises(LinkageError) as caught:
        write_linkage(read(FOUR_BAR), f'{tmp_path}/{name}')
    assert NOT_WRITTEN[name] in str(caught.value)
    assert str(caught.value).isprintable() or '\0' in name
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.skipif(os.geteuid() == 0, reason='root may write everywhere')
@pytest.mark.parametrize('read_only', ['.', 'linkage.yaml'])
def test_read_only_linkage_file_stays_unchanged(tmp_path, read_only):
    file = tmp_path / 'linkage.yaml'
    file.write_text('before')
    mode = (tmp_path / read_only).stat().st_mode
    (tmp_path / read_only).chmod(mode & ~0o222)
    try:
        with pytest.raises(LinkageError, match=r'cannot be written \(Permission denied\)'):
            write_linkage(read(FOUR_BAR), file)
    finally:
        (tmp_path / read_only).chmod(mode)
    assert file.read_text() == 'before'


def test_full_disk_keeps_the_previous_linkage_file(tmp_path):
    file = tmp_path / 'linkage.yaml'
    file.write_text('before')
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        with pytest.raises(LinkageError, match=r'cannot be written \(File too large\)'):
            write_linkage(read(FOUR_BAR), file)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert file.read_text() == 'before'
    assert list(tmp_path.iterdir()) == [file]


def test_linkage_that_never_closes_is_not_written(tmp_path):
    apart = replace(
        read(FOUR_BAR), links=read(FOUR_BAR).links | {'rocker': {'O4': (0, 0), 'B': (9, 0)}}
    )
    with pytest.raises(LinkageError, match=r'linkage.yaml:1: links: the loops close at no value'):
        write_linkage(apart, tmp_path / 'linkage.yaml')
    assert list(tmp_path.iterdir()) == []
