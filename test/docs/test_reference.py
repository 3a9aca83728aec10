# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The reference pages, as they are committed, have the text that the code makes."""

from __future__ import annotations

import re

from docs.make_reference import MADE, made_pages
from linkage_ros.cli import COMMANDS, REGISTRIES
from linkage_ros.description import linkage_schema, scene_schema
import pytest

from .blocks import ROOT

REFERENCE = ROOT / 'docs' / 'reference'
PAGES = made_pages()


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_reference_page_equals_make_reference(page):
    assert page.read_text('utf-8') == PAGES[page], 'run make reference'


def test_every_generated_part_is_on_a_page():
    made = re.findall(r'^<!-- made: (.+) -->$', ''.join(PAGES.values()), re.MULTILINE)
    assert sorted(made) == sorted(MADE)


def test_markdown_reference_lists_every_command_key_and_effect():
    names = {
        'commands.md': [f'## linkage {name}' for name in COMMANDS],
        'files.md': [
            f'| `{key}` |'
            for schema in (scene_schema(), linkage_schema()['then'], linkage_schema()['else'])
            for key in schema['properties']
        ],
        'parameters.md': [
            f'### {name}'.replace('_', '\\_') for each in REGISTRIES.values() for name in each
        ],
    }
    for file, wanted in names.items():
        text = (REFERENCE / file).read_text('utf-8')
        assert wanted
        assert [line for line in wanted if f'\n{line}' not in text] == []
