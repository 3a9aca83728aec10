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
Measure the cost of accuracy for scenes that come with the package, for docs/accuracy.md.

A scene takes about two and a half minutes. Run it in the folder of the checkout, as `make
accuracy_page` does: ``python -m docs.make_accuracy [SCENE …]``.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys

from linkage_ros.accuracy import measure_accuracy, PARTS
from linkage_ros.accuracy.page.files import write_markdown
from linkage_ros.scene.load import load_scene

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / 'accuracy.md'
SCENES = DOCS.parent / 'config' / 'scenes'

SHOWN = ('demo', 'torque_crank', 'jansen_leg')
"""Scenes with a measured crank, with a torque drive, and with several loops."""


def main() -> int:
    """Measure and write."""
    parser = argparse.ArgumentParser('python -m docs.make_accuracy', description=__doc__)
    parser.add_argument('scenes', nargs='*', default=SHOWN, help='names of shipped scenes')
    parser.add_argument('--quick', action='store_true', help='faster, to see the page only')
    arguments = parser.parse_args()
    results = []
    for name in arguments.scenes:
        scene = load_scene(SCENES / f'{name}.yaml')
        printed: set[str] = set()

        def progress(
            part: str, share: float, name: str = name, printed: set[str] = printed
        ) -> None:
            if part not in printed:
                printed.add(part)
                sys.stderr.write(f'{name}: {part}\n')

        results.append(measure_accuracy(scene, PARTS, arguments.quick, DOCS.parent, progress))
    write_markdown(results, PAGE)
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
