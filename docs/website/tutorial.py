# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A Python file in cells, ``# %%``, as a page with its text, its code and the output of the code.

``# %% [markdown]`` begins a cell of text, in comments. Editors, and Jupyter with jupytext, open
such a file as a notebook; Python runs it unchanged. A page shows the printed output of a cell, the
value of its last line, and its pictures.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from io import StringIO
import os
from pathlib import Path
import re
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from matplotlib import pyplot as plt, rc_context
from myst_parser.parsers.sphinx_ import MystParser

_CELL = re.compile(r'^# %%(.*)$', re.MULTILINE)
_SCRIPT = re.compile(r'<metadata>.*?</metadata>', re.DOTALL)


class Cell(NamedTuple):
    """A cell: text in Markdown or code, and its first line in the file."""

    is_text: bool
    content: str
    line: int


class PercentParser(MystParser):
    """Parses a file in cells for Sphinx."""

    supported = ('percent',)

    def parse(self, inputstring: str, document: Any) -> None:
        """Run the file, and parse it as Markdown with its results."""
        super().parse(page(inputstring, document['source']), document)


def cells(text: str) -> Iterator[Cell]:
    """Yield the cells of a file; text before the first mark belongs to no cell."""
    marks = list(_CELL.finditer(text))
    ends = [mark.start() for mark in marks[1:]] + [len(text)]
    for mark, end in zip(marks, ends, strict=True):
        begin = mark.end() + 1
        content = text[begin:end]
        is_text = '[markdown]' in mark[1]
        if is_text:
            content = re.sub(r'^# ?', '', content, flags=re.MULTILINE)
        yield Cell(is_text, content.strip('\n'), text.count('\n', 0, mark.end()) + 1)


def page(text: str, name: str) -> str:
    """Run a file in a temporary folder, and return it as Markdown."""
    variables: dict[str, Any] = {'__name__': 'tutorial'}
    parts = []
    with _elsewhere():
        for cell in cells(text):
            if cell.is_text:
                parts.append(f'{cell.content}\n')
                continue
            parts.append(f'```python\n{cell.content}\n```\n')
            parts += _results(cell, variables, name)
    return '\n'.join(parts)


@contextmanager
def _elsewhere() -> Iterator[None]:
    """Work in a temporary folder."""
    before = Path.cwd()
    with TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(before)


def _results(cell: Cell, variables: dict[str, Any], name: str) -> Iterator[str]:
    """Run a cell; yield its printed output, the value of its last line, and its pictures."""
    plt.switch_backend('agg')
    # For tracebacks, lines are numbered as in the file.
    tree = ast.parse('\n' * cell.line + cell.content, name)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    value = None
    with redirect_stdout(StringIO()) as printed:
        exec(compile(tree, name, 'exec'), variables)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), name, 'eval'), variables)
            if value is not None:
                print(repr(value))
    if printed.getvalue():
        yield f'```text\n{printed.getvalue().rstrip()}\n```\n'
    if picture := getattr(value, '_repr_svg_', lambda: None)():
        yield _framed(picture)
    for number in plt.get_fignums():
        yield _drawn(plt.figure(number))
    plt.close('all')


def _drawn(figure: Any) -> str:
    """Return a picture as SVG, the same for the same picture."""
    with StringIO() as file, rc_context({'svg.hashsalt': 'tutorial'}):
        figure.savefig(file, format='svg', bbox_inches='tight', metadata={'Date': None})
        svg = file.getvalue()
    _, mark, drawing = svg.partition('<svg')
    return _framed(_SCRIPT.sub('', mark + drawing))


def _framed(svg: str) -> str:
    lines = [line for line in svg.splitlines() if line.strip()]
    return f'<div class="picture">\n{chr(10).join(lines)}\n</div>\n'
