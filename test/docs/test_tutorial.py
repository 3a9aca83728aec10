# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The tutorial runs as a file, and as a page with its results."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from .blocks import ROOT

pytest.importorskip('matplotlib')
pytest.importorskip('myst_parser', reason="pip install '.[docs]'")

TUTORIAL = ROOT / 'docs' / 'tutorial.py'


@pytest.fixture
def website(monkeypatch):
    """Import the module that makes the page, which is not in the package."""
    monkeypatch.syspath_prepend(ROOT)
    from docs.website import tutorial

    return tutorial


def test_tutorial_runs_as_a_script(tmp_path):
    done = subprocess.run(
        [sys.executable, '-W', 'error', str(TUTORIAL)],
        cwd=tmp_path,
        env=os.environ | {'MPLBACKEND': 'agg', 'PYTHONPATH': str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, '')


def test_tutorial_page_shows_output_values_and_pictures(website):
    text = (
        '"""Not shown."""\n'
        '# %% [markdown]\n# # A title\n#\n# And text.\n'
        '# %%\nprint("printed")\n6 * 7\n'
        '# %%\nfrom matplotlib import pyplot as plt\nfigure = plt.figure()\n'
        '# %%\nNone\n'
    )
    page = website.page(text, 'file.py')
    assert page.startswith('# A title\n\nAnd text.\n\n```python\nprint("printed")\n6 * 7\n```\n')
    assert '```text\nprinted\n42\n```' in page
    assert page.count('<svg') == page.count('```text') == 1
    assert 'Not shown' not in page
    assert page.endswith('```python\nNone\n```\n')


def test_repeated_cells_make_the_same_page(website):
    text = '# %%\nfrom matplotlib import pyplot as plt\nlines = plt.plot([1, 2])\n'
    assert website.page(text, 'file.py') == website.page(text, 'file.py')


def test_tutorial_exception_names_file_and_line(website):
    with pytest.raises(ZeroDivisionError) as caught:
        website.page('# %% [markdown]\n# Text\n# %%\nx = 0\n1 / x\n', 'file.py')
    last = caught.traceback[-1]
    assert (str(last.path).rpartition('/')[2], last.lineno + 1) == ('file.py', 5)


def test_tutorial_page_leaves_no_files(website, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    website.page("# %%\nfrom pathlib import Path\nPath('here').touch()\n", 'file.py')
    assert list(tmp_path.iterdir()) == []
