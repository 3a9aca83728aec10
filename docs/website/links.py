# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Links of the pages of the site."""

from __future__ import annotations

from pathlib import Path
import re

_DOCS = Path(__file__).resolve().parents[1]
_LINK = re.compile(r'(?<!!)\[([^\]\n]+)\]\((\.\./[^)#\s]+)(?:#[^)]*)?\)')


def make_links_local(docname: str, source: list[str]) -> None:
    """
    Let the links of a page stay within the site; links to files of the checkout become downloads.

    Sphinx passes the page as the only item of a list.
    """
    folder = (_DOCS / docname).parent
    source[0] = _LINK.sub(lambda found: _local_link(found, folder), source[0])


def _local_link(link: re.Match[str], folder: Path) -> str:
    shown, to = link.groups()
    target = (folder / to).resolve()
    if target.is_relative_to(_DOCS):
        return link[0]
    if target.is_file():
        return f'{{download}}`{shown.strip("`")} <{to}>`'
    return shown
