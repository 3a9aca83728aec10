# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""
``python -m campaigns.robots FOLDER``: robots as they are published, each by one command.

The folder holds robots in folders of their own, as ``robots`` of Gepetto/example-parallel-robots
does. Each is read as its files are, and solved at random states near its pose. Another library,
yourdfpy, places the links at the joints that were found: the frames of all that closes loops have
to meet there. The page docs/robots.md says what it costs, and what is refused and why.
"""

from __future__ import annotations

import argparse
import io
from pathlib import Path
import signal
from time import process_time
from typing import Any
from xml.etree import ElementTree as ET

from linkage_ros.description import load, read_as_urdf
from linkage_ros.errors import LinkageError
import numpy as np
import yourdfpy

PAGE = Path(__file__).parents[1] / 'docs' / 'robots.md'
STATES, SEED = 50, 1
LONGEST = 90
"""How long a robot may be read, in [s]."""

FARTHEST = 0.15
"""How far inputs are drawn from the pose, in [rad]; slides a tenth of it, in [m]."""

_HEAD = f"""\
# Robots as they are published

This page is made by `python -m campaigns.robots FOLDER --write`; do not edit it. The robots are
those of Gepetto/example-parallel-robots: URDFs of legs and arms with loops, which a YAML file
beside each closes. The files are as published, and this is all that was typed:

```sh no-test: needs a checkout of the robots
linkage check FOLDER/ROBOT/robot.yaml --near
```

{STATES} states are drawn within {FARTHEST} rad of the pose. At their joints yourdfpy, a library of
another make, places the links: "gap" is the farthest that frames which close a loop are apart
there, "turn" by how much the frames of welds differ in direction. "Load" is processor time, with
the search for the pose; "a state" is the mean of all, most of them where none was solved before.

| robot | loops | inputs | joints found | load | a state | closed | gap | turn |
| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: |
"""


def _welds(data: bytes) -> list[tuple[str, str, str]]:
    """Return what closes loops, by kind and the two links, of a URDF whose frames are links."""
    root = ET.fromstring(data)
    return [
        (loop.get('type', ''), *(end.get('link', '') for end in loop[:2]))
        for loop in root.findall('loop_joint')
    ]  # type: ignore[misc]


def measure(file: Path, draw: np.random.Generator) -> tuple[str, str]:
    """Return a row of the page, and '' or why the robot is refused."""
    name, begun = file.parent.name, process_time()
    signal.signal(signal.SIGALRM, _give_up)
    signal.alarm(LONGEST)
    try:
        closure: Any = load(file, {'near': True})
    except LinkageError as error:
        return '', f'* {name}: {error.reason}'
    except _TooLongError:
        return '', f'* {name}: read for more than {LONGEST} s'
    finally:
        signal.alarm(0)
    loading = process_time() - begun
    data = read_as_urdf(file)
    model = yourdfpy.URDF.load(io.BytesIO(data), load_meshes=False, load_collision_meshes=False)
    loops = _welds(data)
    driven = [given.joint for given in closure.linkage.inputs]
    start = np.array(closure.linkage.pose.inputs)
    scale = np.array([0.1 if given.slider else 1.0 for given in closure.linkage.inputs])
    closed, gap, turn, solving = 0, 0.0, 0.0, 0.0
    for _ in range(STATES):
        inputs = start + scale * draw.uniform(-FARTHEST, FARTHEST, len(driven))
        begun = process_time()
        position = closure.position(*inputs.tolist())
        solving += process_time() - begun
        if not position.joints:
            continue
        closed += 1
        values = dict(zip(closure.linkage.joints, position.joints, strict=True))
        values |= dict(zip(driven, inputs, strict=True))
        model.update_cfg({joint: values.get(joint, 0.0) for joint in model.actuated_joint_names})
        for kind, *links in loops:
            one, other = map(model.get_transform, links)
            gap = max(gap, float(np.linalg.norm(one[:3, 3] - other[:3, 3])))
            if kind == 'fixed':
                turn = max(turn, float(np.abs(one[:3, :3] - other[:3, :3]).max()))
    row = (
        f'| {name} | {len(loops)} | {", ".join(driven)} | {len(closure.linkage.joints)} | '
        f'{loading:.1f} s | {solving / STATES * 1e3:.1f} ms | {closed} of {STATES} | '
        f'{gap:.0e} m | {turn:.0e} |'
    )
    return row, ''


class _TooLongError(Exception):
    """A robot takes too long."""


def _give_up(_signal: int, _frame: object) -> None:
    raise _TooLongError


def main() -> int:
    """Measure all robots in a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('folder', type=Path)
    parser.add_argument('--write', action='store_true', help='write docs/robots.md')
    options = parser.parse_args()
    draw = np.random.default_rng(SEED)
    rows, refused = [], []
    for file in sorted(options.folder.glob('*/robot.yaml')):
        row, reason = measure(file, draw)
        print(row or reason, flush=True)
        (rows if row else refused).append(row or reason)
    page = '\n'.join([_HEAD + '\n'.join(rows), '', '## Refused, and why', '', *refused, ''])
    if options.write:
        PAGE.write_text(page, 'utf-8')
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
