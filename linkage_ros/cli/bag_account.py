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


"""What there is to say of a bag, as JSON has it: numbers in SI units or [ns], and named so."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from math import isfinite
from typing import Any

from linkage_ros.bag.contents import Contents, Layout
from linkage_ros.bag.reader import Bag, information_of, serialized_metadata
from linkage_ros.bag.recording_stats import counts_in, FAILURE
from linkage_ros.bag.run_events import lost_beginning, run_said
from linkage_ros.cli.bag_reading import run_or_blank, unfinished_text
from linkage_ros.kinematics.four_bars import four_bars
from linkage_ros.replay.worst_residuals import Examined, WorstStates
from linkage_ros.scene.scene import Member, Scene


def account_of(bag: Bag, layouts: list[Layout], contents: Contents) -> dict[str, Any]:
    """Return what any bag says of itself, ours or not."""
    begin, end = contents.begin, contents.end
    said: Mapping[str, Any] = information_of(bag.path) if bag.path.is_dir() else {}
    within = next((layout.rosbag2 for layout in layouts if layout.rosbag2), None)
    if not said and within is not None:
        said = serialized_metadata(within)
    run = run_said(bag)
    # What is let go of is only told where there is some.
    let_go = counts_in(bag.custom, 'let_go')
    counted = {word: counts_in(bag.custom, word) for word in ('received', 'dropped')}
    return {
        'bag': str(bag.path),
        'duration_ns': None if begin is None or end is None else end - begin,
        'begin_ns': begin,
        'begin': local(begin),
        'end_ns': end,
        'end': local(end),
        'size_bytes': sum(file.stat().st_size for file in bag.files),
        'files': [{'name': file.name, 'size_bytes': file.stat().st_size} for file in bag.files],
        'compressions': _compressions(layouts),
        'truncated': bag.truncated,
        'unfinished': unfinished_text(bag) if bag.truncated else None,
        'beginning_missing': lost_beginning(bag, run_or_blank(bag)) or None,
        'damage': contents.damage or None,
        'stopped': contents.stopped,
        'recording_failure': bag.custom.get(FAILURE),
        'messages': sum(topic.messages for topic in contents.topics),
        'topics': [
            {
                'name': topic.name,
                'type': topic.type,
                'messages': messages,
                'rate_hz': each.rate,
                'size_bytes': size,
                'reliability': topic.qos.reliability,
                'durability': topic.qos.durability,
                'qos_understood': topic.qos.understood,
                'received': counted['received'].get(topic.name),
                'dropped': counted['dropped'].get(topic.name),
                'let_go': let_go.get(topic.name, 0) if let_go or counted['received'] else None,
            }
            for each in contents.topics
            for topic, messages, size, _, _ in [each]
        ],
        'versions': {
            'linkage_ros': _text(run.get('linkage_ros')),
            'python': _text(run.get('python')),
            'machine': _text(run.get('machine')),
            'ros_distro': _text(said.get('ros_distro')),
            'rosbag2_metadata': _whole(said.get('version')),
            'written_by': ', '.join(dict.fromkeys(layout.library for layout in layouts)) or None,
        },
    }


def scene_account(scene: Scene) -> dict[str, Any]:
    """Return what there is to say of the scene that a bag carries."""
    return {
        'name': scene.name,
        'rate_hz': scene.rate,
        'seed': scene.seed,
        'faults': list(scene.faults),
        'linkages': [_linkage(member) for member in scene.members],
    }


def worst_account(worst: WorstStates) -> dict[str, Any]:
    """Return what there is to say of a linkage's states, to stand beside what its scene says."""
    account: dict[str, Any] = {
        'four_bars': [
            {'kind': bar.kind.name, 'lengths_m': list(bar.lengths)}
            for bar in four_bars(worst.closure.structure)
        ],
        'states': worst.states,
        'toggles': worst.toggles,
        'limited': worst.limited,
        'worst_residual': None,
        'nearest_to_toggle': None,
    }
    if worst.residual is not None:
        residual, place = worst.residual
        account['worst_residual'] = {
            'residual_m': residual, 'time_ns': place.time, 'inputs': list(place.inputs)
        }  # fmt: skip
    if worst.nearest is not None:
        near, place = worst.nearest
        distance = near.toggle_distance
        account['nearest_to_toggle'] = {
            'conditioning': near.conditioning,
            'transmission_angle_rad': near.transmission_angle,
            'input_to_toggle': distance if isfinite(distance) else None,
            'time_ns': place.time,
            'inputs': list(place.inputs),
        }
    return account


def replay_account(examined: Examined) -> dict[str, Any]:
    """Return how the scene, run once more, agrees with the bag."""
    return {'joint_states': examined.joint_states, 'same_bytes': examined.same}


def local(time: int | None) -> str | None:
    """Return a time in [ns] as date and time of this machine's zone, to the nanosecond."""
    if time is None:
        return None
    seconds, rest = divmod(time, 1_000_000_000)
    there = datetime.fromtimestamp(seconds).astimezone()
    return f'{there:%Y-%m-%d %H:%M:%S}.{rest:09d}{there:%z}'


def _linkage(member: Member) -> dict[str, Any]:
    linkage = member.linkage
    return {
        'name': member.name,
        'links': len(linkage.links),
        'inputs': [
            {'joint': name, 'unit': 'm' if given.slider else 'rad'}
            for name, given in zip(member.inputs, linkage.inputs, strict=True)
        ],
        'joints': list(member.joints),
        'drive': member.drive[0],
        'effects': list(member.effects),
        'effects_not_imported': list(member.not_imported),
    }


def _compressions(layouts: list[Layout]) -> list[dict[str, Any]]:
    sums: dict[str, tuple[int, int]] = {}
    for layout in layouts:
        for name, (stored, content) in layout.compressions.items():
            before = sums.get(name, (0, 0))
            sums[name] = before[0] + stored, before[1] + content
    return [
        {'name': name, 'stored_bytes': stored, 'content_bytes': content}
        for name, (stored, content) in sums.items()
    ]


def _text(value: Any) -> str | None:
    # Not of lists: in YAML, aliases make a small file's text as long as memory.
    return str(value) if isinstance(value, str | int | float) else None


def _whole(value: Any) -> int | None:
    return value if isinstance(value, int) else None
