# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A remedy that names a key or a command helps: it is followed, and not refused in turn."""

from pathlib import Path
import re

from linkage_ros.cli.main import main
from linkage_ros.description import load_scene
from linkage_ros.errors import LinkageError
from linkage_ros.stages.drives import DRIVES
from linkage_ros.stages.effects import EFFECTS
from linkage_ros.stages.faults import FAULTS
from linkage_ros.tick import Pipeline
import pytest

ROOT = Path(__file__).parents[2]
GENERAL = (ROOT / 'config/linkages/four_bar.yaml').read_text().partition('masses:')[0]
MAPPINGS = [
    *(f'drive={name}' for name in DRIVES),
    *(f'drive={{{name}: 3}}' for name in DRIVES),
    *(f'effects=[{name}]' for name in EFFECTS),
    *(f'effects={{{name}: 3}}' for name in EFFECTS),
    *(f'faults={{hung: {name}}}' for name in FAULTS),
    *(f'faults={{hung: {{{name}: 3}}}}' for name in FAULTS),
    'drive=3', 'effects=3', 'faults=3', 'faults=[hung]', 'loads=3', 'record=3',
    'effects=[delay, velocity]', 'drive={torque: {motor: 3}}', 'drive={torque: {play: 3}}',
    'loads={springs: 3}', 'loads={springs: [one]}', 'loads={forces: 3}', 'loads={stops: 3}',
    'effects={noise: {joints: 3}}', 'effects={noise: {joints: [rocker_joint]}}',
    'effects={noise: {joints: {rocker_joint: 3}}}',
    'effects={friction: {joints: [B]}}', 'effects={compliance: {links: 3}}',
]  # fmt: skip


def refusal(setting: str) -> str:
    """Return why a setting of the four-bar is refused; '' if it is not."""
    try:
        load_scene('four_bar', [setting])
    except LinkageError as error:
        return str(error)
    return ''


@pytest.mark.sample(10)
@pytest.mark.parametrize('setting', MAPPINGS)
def test_example_mapping_of_an_error_can_be_pasted(setting):
    text = refusal(setting)
    found = re.search(r"is not a mapping; write (?:--set ')?(\w+)(?:: |=)(\{.*\})'?$", text)
    assert found, text
    key, mapping = found.groups()
    assert '…' not in mapping
    # The setting with the key's value as the error writes it.
    path = re.search(r': ([\w.]+): .* is not a mapping', text)[1]
    again = refusal(f'{path}={mapping}')
    # What is not the grammar's, as a linkage without masses, may still be missing.
    assert not re.search(rf'{key}.*(is missing|is not a mapping|unknown key|below|above)', again)


def test_masses_of_the_error_message_complete_the_linkage(tmp_path):
    scene, linkage = tmp_path / 's.yaml', tmp_path / 'l.yaml'
    scene.write_text(
        'linkage: l.yaml\nrate: 100\ndrive: {torque: {}}\nloads: {gravity: [0, -9.81]}\n'
    )
    masses: dict[str, str] = {}
    for _ in range(3):
        written = ', '.join(f'{link}: {of}' for link, of in masses.items())
        linkage.write_text(f'{GENERAL}masses: {{{written}}}\n' if masses else GENERAL)
        with pytest.raises(LinkageError) as raised:
            Pipeline(load_scene(scene))
        link, mass, massless = re.search(
            r'add masses: \{(\w+): (\{.*?\})\} in .*; for a massless link write (.*)$',
            str(raised.value),
        ).groups()
        # One link as a massless one.
        masses[link] = massless if link == 'coupler' else mass
    written = ', '.join(f'{link}: {of}' for link, of in masses.items())
    linkage.write_text(f'{GENERAL}masses: {{{written}}}\n')
    Pipeline(load_scene(scene))


def test_drive_joint_of_two_inputs_asks_for_two_joints():
    text = refusal_of('five_bar', 'drive={topic: {joint: left_elbow}}')
    assert '1 for 2 inputs; name 2 different joints' in text
    load_scene('five_bar', ['drive={topic: {}}'])


def refusal_of(linkage: str, setting: str) -> str:
    with pytest.raises(LinkageError) as raised:
        Pipeline(load_scene(linkage, [setting]))
    return str(raised.value)


@pytest.mark.parametrize('options', [[], ['--assemblies']])
def test_spatial_linkage_is_drawn_to_the_suggested_file(tmp_path, capsys, options):
    assert main(['draw', 'rssr', '-o', str(tmp_path / 'x.dxf'), *options]) == 2
    told = capsys.readouterr().err.strip()
    assert ('--assemblies' in told) == bool(options)
    (file,) = re.findall(r'write -o (\S+)$', told)
    assert main(['draw', 'rssr', '-o', file]) == 0
