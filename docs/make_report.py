# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Make docs/report.png: a report page as a browser shows it.

The run is the fault drill, as ``linkage demo`` runs it; the page is `linkage report`'s. Run it in
the folder of the checkout, as `make report` does: ``python -m docs.make_report``.
"""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys
import tempfile

from PIL import Image

from test.browser.chromium import browser  # noqa: I100 (our own, not that of Python)
from test.browser.opened import opened

FILE = Path(__file__).resolve().parent / 'report.png'
LARGEST = 150_000
"""Maximum size of the picture, in bytes."""

SCENE = 'fault_drill'
_SECONDS = 9
_SHOWN_AT = 1.2
"""Time of the run at which the linkage is shown, in [s]."""

_WIDTH, _HEIGHT = 1400, 1180
_COLOURS = 96


def main() -> int:
    """Draw the picture; return 1 if it is too large."""
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder, 'run.html')
        _linkage('demo', SCENE, '--seconds', str(_SECONDS), '--plain', '--runs', folder)
        (bag,) = Path(folder).glob(f'{SCENE}_*/')
        _linkage('report', str(bag), '-o', str(page))
        with browser() as started, opened(started, page, width=_WIDTH, height=_HEIGHT) as shown:
            shown.page.evaluate(f'Report.seek({_SHOWN_AT})')
            shown.page.screenshot(path=FILE)
    with Image.open(FILE) as drawn:
        drawn.convert('RGB').quantize(_COLOURS, dither=Image.Dither.NONE).save(FILE, optimize=True)
    if FILE.stat().st_size > LARGEST:
        sys.stderr.write(f'{FILE}: more than {LARGEST} bytes\n')
        return 1
    return 0


def _linkage(*arguments: str) -> None:
    subprocess.run([Path(sys.executable).with_name('linkage'), *arguments], check=True)


if __name__ == '__main__':
    sys.exit(main())
