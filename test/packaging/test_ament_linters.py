# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""ament's own linters have nothing to say, so that `colcon test` has not on a robot either."""

import logging
import re
import subprocess

import pytest

from ..support.sampling import TAKES_ALL

HEADER = """\
# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""

# Folders are named one by one: a linter on `.` would also read build/ and install/.
NAMES = ('setup.py', 'bench', 'campaigns', 'docs', 'examples', 'launch', 'linkage_ros', 'test')


def test_linters_cover_every_tracked_python_folder(root):
    git = subprocess.run(
        ['git', 'ls-files', '*.py'], cwd=root, capture_output=True, text=True, check=False
    )
    if git.returncode:
        pytest.skip('no checkout of git')
    assert {file.partition('/')[0] for file in git.stdout.split()} == {*NAMES}


@pytest.fixture
def sources(root, monkeypatch):
    monkeypatch.chdir(root)
    return [name for name in NAMES if (root / name).exists()]


@pytest.fixture
def linted(root, sources):
    """Return what `make test` lints: what is new since some commits, if there are so many."""
    recent = () if TAKES_ALL else ('diff', '--name-only', '--diff-filter=d', 'HEAD~10', '*.py')
    git = subprocess.run(['git', *recent], cwd=root, capture_output=True, text=True, check=False)
    return sources if git.returncode or not recent else git.stdout.split() or ['setup.py']


@pytest.mark.linter
@pytest.mark.timeout(300)  # it reads every file there is
def test_flake8_reports_no_error(linted):
    flake8 = pytest.importorskip('ament_flake8.main')
    failed, errors = flake8.main_with_errors(argv=linted)
    assert not failed, '\n'.join(['', *errors])


@pytest.mark.linter
def test_pep257_reports_no_error(linted, capfd, caplog):
    pep257 = pytest.importorskip('ament_pep257.main')
    # It logs every file that it reads.
    caplog.set_level(logging.WARNING, 'pydocstyle.utils')
    failed = pep257.main(argv=linted)
    assert not failed, '\n' + capfd.readouterr().err


@pytest.mark.linter
def test_ament_copyright_reports_no_error(sources):
    # No wheel of this one exists; on a robot it is there.
    copyright_ = pytest.importorskip('ament_copyright.main')
    assert copyright_.main(argv=['.', '--exclude', 'build', 'install', 'log']) == 0


@pytest.mark.linter
def test_every_source_file_begins_with_the_licence_header(root, sources):
    files = [
        file
        for source in sources
        for file in ([root / source] if source.endswith('.py') else (root / source).rglob('*.py'))
    ]
    # As ament_copyright, which wants no licence of an empty file.
    texts = {str(file): file.read_text('utf-8') for file in files}
    assert not [file for file, text in texts.items() if text and not text.startswith(HEADER)]


@pytest.mark.linter
def test_contributing_page_quotes_section_5_of_the_licence(root):
    # ament_copyright looks for this paragraph of the licence in CONTRIBUTING.md.
    def words(name):
        return ' '.join((root / name).read_text('utf-8').split())

    (paragraph,) = re.findall(r'5\. Submission of Contributions.*?(?= 6\. )', words('LICENSE'))
    assert paragraph in words('CONTRIBUTING.md')
