# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A moving picture shows each link where the closure, or the recorded run, has it."""

from itertools import pairwise
from math import cos, hypot, radians, sin
from pathlib import Path
import re
from xml.etree import ElementTree as ET

from linkage_ros.cli.main import main
from linkage_ros.description import load
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import frames_of_links, prepare_view, SpaceDrawing, usual_inputs
from linkage_ros.tools.drawing import animate, check_kind, range_motion, RATE
import numpy as np
import pytest

from ...browser.chromium import browser
from ...browser.opened import opened

image = pytest.importorskip('PIL.Image')
pytest.importorskip('matplotlib')

SOME = ('four_bar', 'slider_crank', 'double_rocker', 'class_3', 'excavator_bucket')


def moved(name, seconds=1.0):
    closure = load(name)
    shown = prepare_view(closure, usual_inputs(closure))
    return range_motion(shown, name, seconds)


@pytest.mark.parametrize('name', SOME)
def test_animated_links_equal_the_closure(name):
    motion = moved(name)
    closure = motion.view.closure
    assert len(motion.x) == RATE
    for x, frames in zip(motion.x, motion.frames, strict=True):
        found = frames_of_links(closure, closure.position(x))
        for link, (px, py, angle) in zip(motion.links, frames, strict=True):
            assert hypot(px - found[link].place.real, py - found[link].place.imag) < 1e-12
            assert cos(angle - found[link].angle) == pytest.approx(1.0)


def test_bounded_range_is_animated_there_and_back():
    motion = moved('double_rocker')
    low, high = motion.view.interval.lowest, motion.view.interval.highest
    assert motion.x[0] == low
    assert motion.x[RATE // 2] == pytest.approx(high)
    assert motion.x[1:] == pytest.approx(motion.x[:0:-1])


def test_a_spatial_linkage_moves_before_a_camera(tmp_path, capsys):
    closure = load('rssr')
    shown = prepare_view(closure, usual_inputs(closure))
    motion = range_motion(shown, 'rssr', 1.0, (0.0, radians(90.0)))
    drawing = SpaceDrawing(closure)
    for x, places in zip(motion.x, motion.frames, strict=True):
        # The ball at the end of the crank goes round the z axis; the other is a rod away from it.
        ball = places[drawing.points['A']]
        assert ball == pytest.approx([0.04 * cos(x), 0.04 * sin(x), 0.0], abs=1e-12)
        rod = np.linalg.norm(places[drawing.points['B']] - ball)
        assert rod == pytest.approx(hypot(0.06, 0.02, 0.12), abs=1e-12)
    file = tmp_path / 'rssr.gif'
    animate(motion, file)
    with image.open(file) as found:
        assert found.n_frames == RATE
        pictures = []
        for number in range(RATE):
            found.seek(number)
            pictures.append(np.asarray(found.convert('RGB')).astype(int))
    # Seen from above, with x downward, the driven crank turns: its colour is about the axis.
    middles = []
    for picture in pictures:
        red, green, blue = np.moveaxis(picture[:, : picture.shape[1] // 2], 2, 0)
        rows, columns = np.nonzero((red - blue > 60) & (green < red - 30))
        middles.append(complex(columns.mean(), rows.mean()))
    turned = np.diff(np.unwrap(np.angle(np.array(middles) - np.mean(middles))))
    assert turned.sum() == pytest.approx(-2 * np.pi * (RATE - 1) / RATE, abs=0.4)
    with pytest.raises(LinkageError, match=r'does not project them from a camera; write x\.gif'):
        animate(motion, tmp_path / 'x.svg')
    assert main(['animate', 'four_bar', '-o', str(file), '--force', '--azimuth', '3']) == 2
    assert '--azimuth: is of a spatial linkage; leave it out' in capsys.readouterr().err


def rules(file):
    """Return the keyframes of an SVG by their name: percentages, and what holds at each."""
    text = file.read_text('utf-8')
    return {
        name: {float(at): dict(part.split(':') for part in held.split(';')) for at, held in keys}
        for name, keys in (
            (name, re.findall(r'([\d.]+)%\{([^}]*)\}', body))
            for name, body in re.findall(r'@keyframes (\w+) \{((?:[^{}]*\{[^{}]*\})*)\}', text)
        )
    }


def placed(transform):
    """Return what ``translate(…px,…px) rotate(…deg)`` says, in [px] and [rad]."""
    x, y, turn = re.fullmatch(
        r'translate\((.+?)(?:px)?[, ](.+?)(?:px)?\)(?: rotate\((.+?)(?:deg)?\))?', transform
    ).groups()
    return float(x), float(y), radians(float(turn or 0.0))


@pytest.mark.parametrize('name', ['four_bar', 'slider_crank'])
def test_svg_keyframes_place_links_as_the_closure(tmp_path, name):
    motion = moved(name, 2.0)
    file = tmp_path / 'x.svg'
    animate(motion, file)
    found = rules(file)
    made = frames_of_links(motion.view.closure, motion.view.position)
    # Pixels per metre, from the farthest places of the first link that changes its place.
    scales = set()
    for index, link in enumerate(motion.links):
        keys = found[f'link{index}']
        assert len(keys) == RATE + 1
        places = []
        for at, held in keys.items():
            x, y, angle = motion.frames[round(at / 100.0 * len(motion.x)) % len(motion.x), index]
            px, py, turn = placed(held['transform'])
            # The SVG's y axis points down, so that its angles are clockwise.
            assert cos(-turn - (angle - made[link].angle)) == pytest.approx(1.0, abs=1e-6)
            places.append((complex(x, y), complex(px, -py)))
        for (one, p), (other, q) in pairwise(places):
            if abs(other - one) > 1e-3:
                scales.add(complex((q - p) / (other - one)))
    scale = np.mean(list(scales))
    assert abs(scale.imag) < 1e-2 * scale.real
    assert max(abs(each - scale) for each in scales) < 0.02 * abs(scale)


def test_reduced_motion_shows_the_first_frame(tmp_path):
    motion = moved('double_rocker')  # begins at an end of its range, not at the pose of its shapes
    file = tmp_path / 'x.svg'
    animate(motion, file)
    found = rules(file)
    groups = [
        group
        for group in ET.parse(file).iter('{http://www.w3.org/2000/svg}g')
        if group.get('class', '').startswith('moving')
    ]
    assert len(groups) > 5
    for group in groups:
        first = found[group.get('class').split()[1]][0.0]['transform']
        assert placed(group.get('transform')) == pytest.approx(placed(first), abs=1e-3)


def test_gif_lasts_one_turn_and_is_small(tmp_path):
    file = tmp_path / 'x.gif'
    done = []
    animate(moved('jansen_leg', 2.0), file, lambda i, of: done.append((i, of)))
    assert done == [(i + 1, 2 * RATE) for i in range(2 * RATE)]
    with image.open(file) as picture:
        assert picture.n_frames == 2 * RATE
        assert picture.info['duration'] == 1000 / RATE
        assert picture.info['loop'] == 0  # for ever
        assert picture.convert('RGB').getpixel((0, 0)) == (255, 255, 255)
    assert file.stat().st_size < 150_000 * 2.0


@pytest.mark.parametrize('seconds', ['0', '-1', '31', 'nan'])
def test_animate_refuses_a_duration_out_of_bounds(tmp_path, monkeypatch, capsys, seconds):
    monkeypatch.chdir(tmp_path)
    assert main(['animate', 'four_bar', '--seconds', seconds]) == 2
    assert f'seconds: {seconds} is not between 0.1 and 30 s' in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_animate_refuses_another_file_ending_first(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(['animate', 'no_such_linkage', '-o', 'x.png']) == 2
    said = capsys.readouterr().err
    assert said == (
        "linkage animate: x.png: ends in '.png'; name a file that ends in .gif or .mp4 or .svg\n"
    )


def test_mp4_without_ffmpeg_is_refused(monkeypatch):
    monkeypatch.setenv('PATH', '')
    with pytest.raises(LinkageError, match='ffmpeg: is not installed; apt install ffmpeg'):
        check_kind(Path('x.mp4'))


@pytest.mark.parametrize('kind', ['gif', 'svg'])
def test_interrupted_animation_keeps_the_old_file(tmp_path, kind):
    file = tmp_path / f'x.{kind}'
    file.write_text('old')

    def interrupt(_done, _of):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        animate(moved('four_bar'), file, interrupt)
    assert file.read_text() == 'old'
    assert list(tmp_path.iterdir()) == [file]


def test_svg_moves_in_a_browser_without_errors(tmp_path):
    file = tmp_path / 'x.svg'
    animate(moved('four_bar', 2.0), file)
    with browser() as started, opened(started, file, width=400) as seen:
        assert (
            seen.page.evaluate(
                """() => {
                  document.getAnimations().forEach(a => { a.pause(); a.currentTime = 0 });
                  return document.getAnimations().length }"""
            )
            > 5
        )
        at = """time => {
          document.getAnimations().forEach(a => { a.currentTime = time });
          return [...document.querySelectorAll('.moving')].map(
            part => { const box = part.getBoundingClientRect(); return [box.x, box.y] }) }"""
        first, half = (np.array(seen.page.evaluate(at, time)) for time in (0.0, 1000.0))
        assert (np.abs(half - first).max(axis=1) > 1.0).sum() > 5
        assert seen.said == []
        assert len(seen.asked) == 1
