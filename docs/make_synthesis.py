# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Make docs/synthesis.md and its pictures: the cost of accuracy in design work.

Every number of the page is computed here. Run it in the folder of the checkout, as
`make synthesis` does: ``python -m docs.make_synthesis``.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import sys

from mpmath import mp

from .synthesis_page import kinds, rounding
from .synthesis_page.digits import COUPLER, PRECISION

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / 'synthesis.md'
PICTURES = DOCS / 'synthesis'

LARGEST = 180_000
"""Maximum size of a picture, in bytes."""

DECIMALS = range(3, 17)
"""Decimals in the picture of the example."""


def main() -> int:
    """Write page and pictures; return 1 if a picture is too large."""
    from linkage_ros.tools.design import draw_design

    from .pictures.digits import digits_picture

    PICTURES.mkdir(exist_ok=True)
    for old in PICTURES.iterdir():
        old.unlink()
    with mp.workdps(PRECISION):
        study = rounding.study()
        task = rounding.example()
        rows = {n: task.by_cosines(n) for n in DECIMALS}
        digits_picture(
            {n: ([float(x) for x in row.off], float(row.missed)) for n, row in rows.items()},
            {n: rounding.spread(each) for n, each in study.cosines.items()},
            (rounding.PRINTED_DECIMALS, float(rounding.printed().off[COUPLER])),
            PICTURES / 'digits.svg',
        )
        draw_design(rounding.designed()[0], rounding.PAIRS, PICTURES / 'example.svg')
        PAGE.write_text('\n'.join(page(study)).rstrip() + '\n', encoding='utf-8')
    large = [file for file in PICTURES.iterdir() if file.stat().st_size > LARGEST]
    for file in large:
        sys.stderr.write(f'{file}: more than {LARGEST} bytes\n')
    return 1 if large else 0


def page(study: rounding.Study) -> Iterator[str]:
    """Yield the lines of the page."""
    yield from rounding.introduction()
    yield from rounding.by_hand()
    yield from rounding.decimals()
    yield from rounding.at_random(study)
    yield from rounding.on_the_bench()
    yield from kinds.chapter(PICTURES)


if __name__ == '__main__':
    raise SystemExit(main())
