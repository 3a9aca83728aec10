# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The documentation site: built without a warning, whole, and without a dead link."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path
import subprocess
import sys
from urllib.parse import unquote, urlsplit

import linkage_ros as lr
from linkage_ros.cli import COMMANDS, REGISTRIES
from linkage_ros.description import linkage_schema, scene_schema
import pytest

from .blocks import ROOT
from ..browser.opened import opened
from ..support.sampling import TAKES_ALL

for needed in ('sphinx', 'myst_parser', 'furo', 'matplotlib'):
    pytest.importorskip(needed, reason="pip install '.[docs]'")

DOCS = ROOT / 'docs'
NOT_PAGES = ('website', 'pictures')
LOOKED_AT = (
    *('index', 'start', 'tutorial', 'effects', 'gallery', 'troubleshooting', 'faq'),
    *('how_to/robot', 'how_to/moveit', 'reference/topics', 'reference/files'),
)

pytestmark = pytest.mark.timeout(300)  # the first of these builds the site


class Page(HTMLParser):
    """The content of a page: links, anchors, headings and text."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.brought: list[str] = []
        self.ids: set[str] = set()
        self.headings: list[str] = []
        self.words: list[str] = []
        self._heading = False
        self.feed(file.read_text('utf-8'))

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if 'id' in given:
            self.ids.add(given['id'])
        if tag == 'a' and 'href' in given:
            self.links.append(given['href'])
        elif tag in ('script', 'img') and 'src' in given:
            self.brought.append(given['src'])
        elif tag == 'link' and given.get('rel') in ('stylesheet', 'icon'):
            self.brought.append(given['href'])
        if tag in ('h1', 'h2', 'h3', 'h4'):
            self._heading = True
            self.headings.append('')

    def handle_endtag(self, tag):
        if tag in ('h1', 'h2', 'h3', 'h4'):
            self._heading = False

    def handle_data(self, data):
        self.words.append(data)
        if self._heading:
            self.headings[-1] += data

    @property
    def text(self) -> str:
        return ' '.join(' '.join(self.words).split())


@pytest.fixture(scope='module')
def site(tmp_path_factory) -> Path:
    """Build the site as `make docs` does; in `make test` with a theme that takes half the time."""
    folder = tmp_path_factory.mktemp('site')
    plain = ('-D', 'html_theme=basic', '-D', 'html_theme_options.nosidebar=true')
    theme = () if TAKES_ALL else plain
    done = subprocess.run(
        [
            *(sys.executable, '-m', 'sphinx', '-q', '-W', '--keep-going', *theme),
            *('-d', str(folder / 'read'), str(DOCS), str(folder / 'html')),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ''
    return folder / 'html'


@pytest.fixture(scope='module')
def pages(site) -> dict[str, Page]:
    files = [file for file in site.rglob('*.html') if '_static' not in file.parts]
    return {file.relative_to(site).as_posix(): Page(file) for file in files}


def headings(page: Page) -> list[str]:
    """Return the headings of a page, without those of the theme."""
    told = (heading.rstrip('¶').strip() for heading in page.headings)
    return [heading for heading in told if heading != 'Navigation']


def test_every_source_page_is_in_the_site(pages):
    sources = [
        file.relative_to(DOCS).with_suffix('.html').as_posix()
        for file in DOCS.rglob('*.md')
        if not {*file.relative_to(DOCS).parts} & {*NOT_PAGES}
    ]
    assert {*sources, 'tutorial.html'} <= {*pages}


def test_site_has_no_dead_link(site, pages):
    dead = []
    for name, page in pages.items():
        for link in (*page.links, *page.brought):
            parts = urlsplit(link)
            if parts.scheme:
                continue
            there = (site / name).parent / unquote(parts.path) if parts.path else site / name
            where = there.resolve()
            where = where / 'index.html' if where.is_dir() else where
            key = where.relative_to(site.resolve()).as_posix()
            if not where.is_file() or (
                parts.fragment and key in pages and unquote(parts.fragment) not in pages[key].ids
            ):
                dead.append(f'{name}: {link}')
    assert not dead


def test_site_loads_no_file_of_another_host(pages):
    foreign = {link for page in pages.values() for link in page.brought if urlsplit(link).netloc}
    assert not foreign


def test_python_reference_lists_every_public_name(pages):
    missing = {f'linkage_ros.{name}' for name in lr.__all__} - pages['reference/python.html'].ids
    assert not missing


def test_command_reference_lists_every_command(pages):
    found = headings(pages['reference/commands.html'])
    assert [heading for heading in found if heading.startswith('linkage ')] == [
        f'linkage {command}' for command in COMMANDS
    ]


@pytest.mark.parametrize(
    ('page', 'text'),
    [
        ('reference/commands.html', '--min-transmission ANGLE'),
        ('reference/commands.html', '--set KEY=VALUE'),
        ('reference/commands.html', 'one line names place, reason and remedy'),
        ('reference/commands.html', 'linkage gallery worn_press -o my_press.yaml'),
        ('reference/commands.html', '--schema scene|linkage'),
        ('reference/parameters.html', 'counts in a turn, or in a metre of a slide'),
        ('reference/files.html', 'a whole number from 0 to 9007199254740992'),
        ('reference/files.html', 'masses.NAME.inertia'),
        ('reference/topics.html', 'trajectory_msgs/JointTrajectory'),
        ('reference/ros_parameters.html', 'warn.transmission_angle'),
        ('reference/python.html', 'A planar linkage, as a linkage file says it.'),
        ('how_to/see_it.html', 'joint_state_topic_hardware_interface'),
        ('changelog.html', f'{lr.__version__} ('),
        ('tutorial.html', 'crank 50°: rocker misses by'),
    ],
)
def test_reference_quotes_the_text_of_the_code(pages, page, text):
    assert text in pages[page].text


def test_parameter_reference_lists_every_drive_effect_and_fault(pages):
    found = headings(pages['reference/parameters.html'])[1:]
    kinds = {'Drives': 'drive', 'Effects': 'effect', 'Faults': 'fault'}
    expected = [word for kind, name in kinds.items() for word in (kind, *REGISTRIES[name])]
    assert found == expected


SCHEMAS = {
    'scene': scene_schema(),
    'linkage': linkage_schema()['else'],
    'spatial linkage': linkage_schema()['then'],
}


@pytest.mark.parametrize('schema', SCHEMAS.values(), ids=SCHEMAS.keys())
def test_file_reference_lists_every_key(pages, schema):
    words = {word.strip() for word in pages['reference/files.html'].words}
    assert {*schema['properties']} <= words


def test_tutorial_page_shows_its_pictures(site):
    assert (site / 'tutorial.html').read_text('utf-8').count('<svg') >= 3


@pytest.mark.sample(0)
@pytest.mark.parametrize(
    ('width', 'scheme'),
    [(1600, 'light'), (400, 'dark')],
    ids=['wide and light', 'narrow and dark'],
)
def test_site_fits_its_window_without_foreign_requests(browser, site, pages, width, scheme):
    for name in LOOKED_AT:
        with opened(browser, site / f'{name}.html', width=width, color_scheme=scheme) as page:
            assert page.said == [], name
            assert [asked for asked in page.asked if not asked.startswith('file:')] == []
            assert not page.is_wider_than_its_window(), name
