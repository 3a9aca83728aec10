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


"""A campaign's outcome as a page that is kept."""

from __future__ import annotations

from collections.abc import Sequence
import os
from pathlib import Path

from bench.report import say, Table


def write_page(file: Path, title: str, intro: str, tables: Sequence[Table]) -> None:
    """Write tables as Markdown, behind what is to be known of them."""
    file.parent.mkdir(parents=True, exist_ok=True)
    text = '\n'.join([f'# {title}', '', intro.strip(), '', *(t.markdown() for t in tables)])
    file.write_text(text, encoding='utf-8')
    say(f'kept in {file}')


def load() -> str:
    """Return how many processes wanted to run of late: what is late may be so for their sake."""
    return ', '.join(
        f'{each:.1f} over {m} min' for each, m in zip(os.getloadavg(), (1, 5, 15), strict=True)
    )
