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


"""Tables and text in Markdown, out of what is written for a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain, zip_longest
import re


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table, its cells as they are."""
    lines = [heads, ['---'] * len(heads), *rows]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines) + '\n'


def plain(text: str) -> str:
    """Return a text that Markdown leaves as it is, also in a table; but for code in backticks."""
    parts = re.split(r'(`[^`]+`)', ' '.join(text.split()))
    escaped = [re.sub(r'([\\`*_\[\]<>|~{}$])', r'\\\1', part) for part in parts[::2]]
    kept = [part.replace('|', '\\|') for part in parts[1::2]]
    return ''.join(chain.from_iterable(zip_longest(escaped, kept, fillvalue='')))


def code(text: str) -> str:
    """Return a text as code, also in a table; nothing where there is none."""
    escaped = text.replace('|', '\\|')
    return f'`{escaped}`' if text else ''
