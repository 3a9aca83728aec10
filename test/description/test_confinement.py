# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a scene may name that another process asks for, and what an error repeats of a file."""

import os
from pathlib import Path

from linkage_ros.description import Confinement, load_scene
from linkage_ros.errors import FileError
from linkage_ros.resources import shipped_path
import pytest

from ..support.scenes import four_bar_text

SECRET = 'hunter2-a-secret-of-the-machine'

UNREADABLE = {
    'a text': SECRET,
    'a list': f'- {SECRET}',
    'a key and its value': f'password: {SECRET}',
    'a key': f'{SECRET}: 1',
    'two documents': f'a: 1\n---\n{SECRET}',
    'a tag': f'a: !{SECRET} 1',
    'a tag with a handle': f'a: !{SECRET}!x 1',
    'an anchor': f'a: &{SECRET} 1\nb: &{SECRET} 2',
    'an alias': f'a: *{SECRET}',
    'a directive': f'%{SECRET}\n---\na: 1',
    'a key twice': f'"{SECRET}": 1\n{SECRET}: 2',
    'a key that is a list': f'? [{SECRET}]\n: 1',
    'a key that is a number': '19283746: 1',
    'an escape': f'a: "\\{SECRET}"',
    'a key file': f'-----BEGIN KEY-----\n{SECRET}\n-----END KEY-----',
    'an environment': f'TOKEN={SECRET}\0HOME=/root\0',
    'XML': f'<{SECRET}>{SECRET}</{SECRET}>',
    'XML with an entity': f'<robot>&{SECRET};</robot>',
}


@pytest.mark.parametrize('kind', UNREADABLE)
@pytest.mark.parametrize('role', ['scene', 'linkage', 'urdf'])
def test_error_repeats_no_content_of_foreign_files(tmp_path, kind, role):
    named = tmp_path / ('x.urdf' if role == 'urdf' else 'x.yaml')
    named.write_text(UNREADABLE[kind], 'utf-8')
    scene = tmp_path / 'scene.yaml'
    scene.write_text('linkage: {urdf: x.urdf, input: m}' if role == 'urdf' else 'linkage: x.yaml')
    with pytest.raises(FileError) as caught:
        load_scene(named if role == 'scene' else scene)
    assert SECRET not in str(caught.value)
    assert '19283746' not in str(caught.value)


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """Return the folder of a node among the files of a machine; `load` loads a scene in it."""
    text = four_bar_text(0.04, 0.12, 0.08, 0.1)
    own = tmp_path / 'own'
    (own / 'deeper').mkdir(parents=True)
    for folder in (own, own / 'deeper', tmp_path):
        (folder / 'linkage.yaml').write_text(text)
        (folder / 'scene.yaml').write_text('linkage: linkage.yaml\nrate: 100\n')
    (own / 'leads_out.yaml').symlink_to(tmp_path / 'scene.yaml')
    (own / 'leads_on.yaml').symlink_to(own / 'deeper' / 'scene.yaml')
    (own / 'circle.yaml').symlink_to(own / 'circle.yaml')
    monkeypatch.chdir(own)  # as a node that was started there
    return own


def load(machine, scene, *settings, **changes):
    given = {'folder': machine, 'own_file': '', 'runs': machine, 'trusts_effects': False}
    return load_scene(scene, settings, Confinement(**given | changes))


ALLOWED = {
    'a shipped scene': ('demo', ()),
    'a shipped linkage': ('four_bar', ()),
    'a scene in the folder': ('OWN/scene.yaml', ()),
    'a scene further down': ('OWN/deeper/scene.yaml', ()),
    'a linkage in the folder': ('OWN/linkage.yaml', ()),
    'a link to a file in the folder': ('OWN/leads_on.yaml', ()),
    'another linkage of the folder': ('demo', ('linkage=OWN/linkage.yaml',)),
    'another value': ('OWN/scene.yaml', ('rate=500',)),
    'a bag of the folder as drive': ('OWN/scene.yaml', ('drive={bag: {file: OWN/run}}',)),
    'a recording in the folder': ('OWN/scene.yaml', ('record={directory: OWN/runs}',)),
}

REFUSED = {
    'a scene elsewhere': ('OWN/../scene.yaml', ()),
    'a linkage elsewhere': ('OWN/../linkage.yaml', ()),
    'a file of the system': ('/etc/hostname', ()),
    'the environment': ('/proc/self/environ', ()),
    'a device': ('/dev/zero', ()),
    'a folder': ('/root', ()),
    'a file that is not there': ('/nowhere/scene.yaml', ()),
    'a name with a NUL': ('/etc/host\0name.yaml', ()),
    'a link that leads out': ('OWN/leads_out.yaml', ()),
    'a link to itself': ('OWN/circle.yaml', ()),
    'a folder that begins with the same letters': ('OWN_too/scene.yaml', ()),
    'its linkage elsewhere': ('demo', ('linkage=OWN/../linkage.yaml',)),
    'its robot elsewhere': ('demo', ('linkage={urdf: OWN/../r.urdf, input: m}',)),
    'its bag elsewhere': ('OWN/scene.yaml', ('drive={bag: {file: OWN/../run}}',)),
    'the bag of a linkage alone': ('OWN/linkage.yaml', ('drive={bag: {file: /run}}',)),
    'a recording elsewhere': ('OWN/scene.yaml', ('record={directory: OWN/../runs}',)),
    'a module': ('OWN/scene.yaml', ('effects={"never_there.mod": {}}',)),
}  # fmt: skip


@pytest.mark.parametrize('kind', ALLOWED)
def test_node_accepts_files_of_folder_and_package(machine, kind):
    scene, settings = ALLOWED[kind]
    own = str(machine)
    assert load(machine, scene.replace('OWN', own), *(s.replace('OWN', own) for s in settings))


@pytest.mark.parametrize('kind', REFUSED)
def test_node_refuses_other_files_before_opening_them(machine, monkeypatch, kind):
    scene, settings = REFUSED[kind]
    own = str(machine)
    opened = []
    open_file = os.open

    def watched(path, *options):
        opened.append(Path(path))
        return open_file(path, *options)

    monkeypatch.setattr(os, 'open', watched)
    with pytest.raises(FileError) as caught:
        load(machine, scene.replace('OWN', own), *(s.replace('OWN', own) for s in settings))
    assert 'was named after the start of the node' in str(caught.value)
    assert 'start the node with' in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    places = [machine, shipped_path('')]
    assert all(any(file.is_relative_to(place) for place in places) for file in opened)


def test_node_keeps_accepting_its_start_scene(machine):
    scene = machine.parent / 'scene.yaml'
    assert load(machine, scene, 'rate=500', own_file=str(scene), folder=machine.parent)
    with pytest.raises(FileError, match='is not below'):  # its linkage is beside it
        load(machine, scene, 'rate=500', own_file=str(scene))


def test_node_start_options_allow_folders_and_effects(machine):
    elsewhere = str(machine.parent)
    assert load(machine, f'{elsewhere}/scene.yaml', folder=machine.parent)
    record = f'record={{directory: {elsewhere}/runs}}'
    assert load(machine, f'{machine}/scene.yaml', record, runs=None), 'it names the folder itself'
    effect = 'effects={"never_there.mod": {}}'
    with pytest.raises(FileError, match='there is no module never_there'):
        load(machine, f'{machine}/scene.yaml', effect, trusts_effects=True)
