# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Take the moving picture of `linkage view` for the README, and a still one for its how-to.

A browser opens the page, as a reader would; a hand drags a pin and turns the crank.
"""

from __future__ import annotations

from io import BytesIO
from math import cos, pi, sin
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event, Thread
from typing import Any

from linkage_ros.resources import shipped_path
from linkage_ros.tools.view import build_model, Conversation, page_html as page_of, serve, UserFile
from PIL import Image

from test.browser import chromium  # noqa: I100 (our own, not that of Python)

HERE = Path(__file__).parent
NAME = 'hoeken'
PIN = 'B'
WIDTH, HEIGHT = 1180, 720
SHOWN = 800
"""Width of the moving picture, in pixels."""

_STEPS = 18
_FAR = 26.0
"""The pin is dragged around a circle of this radius, in pixels."""


def main() -> None:
    """Write the pictures."""
    with TemporaryDirectory() as folder:
        file = Path(folder, f'{NAME}.yaml')
        file.write_text(shipped_path(f'linkages/{NAME}.yaml').read_text('utf-8'), 'utf-8')
        found = build_model(file.read_text('utf-8'), NAME)
        shown = page_of(found, mode='edit', can_save=True)
        stop, address, known = Event(), [], Event()

        def ready(at: str) -> None:
            address.append(at)
            known.set()

        routes = [Conversation(NAME, None, UserFile(file)).add_routes]
        server = Thread(target=serve, args=(lambda: shown, routes, stop, ready, print))
        server.start()
        try:
            known.wait(30.0)
            with chromium.browser() as browser:
                pictures = take(browser.new_page(viewport={'width': WIDTH, 'height': HEIGHT}),
                                address[0])  # fmt: skip
        finally:
            stop.set()
            server.join()
    pictures[0].save(HERE / 'view.png', optimize=True)
    small = [
        picture.resize((SHOWN, SHOWN * HEIGHT // WIDTH), Image.Resampling.LANCZOS).quantize(96)
        for picture in pictures
    ]
    small[0].save(
        HERE / 'view.gif', save_all=True, append_images=small[1:], duration=110, loop=0,
        optimize=True,
    )  # fmt: skip
    print(HERE / 'view.png', HERE / 'view.gif')


def take(page: Any, address: str) -> list[Image.Image]:
    """Return pictures of a page on which a pin is dragged, and then the crank turns."""
    page.goto(address)
    page.wait_for_function('() => !View.state().busy && View.state().there')
    pictures = [picture(page)]
    box = page.locator('#drawing').bounding_box()
    x, y = page.evaluate(
        'pin => View.board.toPixel(View.linkage.pins().find((p) => p.name === pin).place)', PIN
    )
    x, y = x + box['x'], y + box['y']
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(1, _STEPS + 1):
        angle = 2.0 * pi * step / _STEPS
        page.mouse.move(x + _FAR * (cos(angle) - 1.0), y + _FAR * sin(angle))
        page.wait_for_timeout(250)
        pictures.append(picture(page))
    page.mouse.up()
    page.wait_for_function('() => !View.state().busy')
    start = page.evaluate('() => View.state().inputs[0]')
    for step in range(_STEPS + 1):
        page.evaluate('value => View.seek([value])', start + 2.0 * pi * step / _STEPS)
        pictures.append(picture(page))
    return pictures


def picture(page: Any) -> Image.Image:
    """Return what the window shows."""
    return Image.open(BytesIO(page.screenshot())).convert('RGB')


if __name__ == '__main__':
    main()
