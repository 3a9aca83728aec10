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


"""
What pages of reference say of the code: put in while the site is built.

A page names it in a comment of its own line, ``<!-- made: commands -->``. On a forge there is the
comment only; `linkage scene --list`, `linkage COMMAND --help` and config/schema say the same.

Links into the checkout, which a forge follows, become downloads.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
import re

from docs.website.commands import commands
from docs.website.parameters import parameters
from docs.website.schemas import linkage_keys, scene_keys

MADE: Mapping[str, Callable[[], str]] = {
    'commands': commands,
    'drives': lambda: parameters('drive'),
    'effects': lambda: parameters('effect'),
    'faults': lambda: parameters('fault'),
    'solvers': lambda: parameters('solver'),
    'scene keys': scene_keys,
    'linkage keys': linkage_keys,
}
"""What there is to put in, by its name."""

_DOCS = Path(__file__).resolve().parents[1]
_LINK = re.compile(r'(?<!!)\[([^\]\n]+)\]\((\.\./[^)#\s]+)(?:#[^)]*)?\)')
_MARK = re.compile(r'^<!-- made: (.+) -->$', re.MULTILINE)


def put_in(docname: str, source: list[str]) -> None:
    """Put into a page what it names; Sphinx wants the page changed in its list of one."""
    names = _MARK.findall(source[0])
    unknown = sorted({*names} - {*MADE})
    assert not unknown, f'{docname}: nothing makes {", ".join(unknown)}'
    text = _LINK.sub(lambda found: _within(found, (_DOCS / docname).parent), source[0])
    source[0] = _MARK.sub(lambda found: MADE[found[1]](), text)


def _within(link: re.Match[str], folder: Path) -> str:
    """Return a link that stays within the site: to a file of the checkout it brings the file."""
    shown, to = link.groups()
    target = (folder / to).resolve()
    if target.is_relative_to(_DOCS):
        return link[0]
    if target.is_file():
        return f'{{download}}`{shown.strip("`")} <{to}>`'
    return shown
