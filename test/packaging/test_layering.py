# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The imports of linkage_ros point one way, and the core knows nothing of ROS."""

import ast
from collections import defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
import re
import sys

from linkage_ros import workbench
from linkage_ros.faces import home_modules
import pytest

PACKAGE = 'linkage_ros'

# Packages by height: a package may import from lower ones, and from its neighbours as long as no
# two import each other.
HEIGHTS = (
    (
        'errors',
        'faces',
        'names',
        'signals',
        'generated_code',
        'progress',
        'before_imports',
        'dask_workers',
        'workbench',
        'domains',
    ),
    ('kinematics', 'resources', 'messages'),
    ('description',),
    ('bag', 'dynamics'),
    ('stages',),
    ('stages.drives',),
    ('stages.effects',),
    ('stages.faults',),
    # What a scene is: its keys are declared by what it brings.
    (
        'description.confinement',
        'description.scene',
        'description.scene_file',
        'description.notes',
        'description.scene_settings',
        'description.scene_grammar',
        'description.violations',
    ),
    ('tick',),
    ('replay',),
    ('node', 'cli'),
    ('tools',),
    ('tools.drawing',),
    ('tools.design', 'tools.models'),
    ('tools.view',),
    ('tools.study',),
    ('__main__',),
)
HEIGHT = {name: height for height, names in enumerate(HEIGHTS) for name in names}
WITH_ROS = ('node', 'cli', '__main__')
TOOLS_WITH_ROS = tuple(f'{PACKAGE}.tools.view.{name}' for name in ('live_bridge', 'followed_run'))
ROS = (
    'ament_index_python',
    'builtin_interfaces',
    'diagnostic_msgs',
    'geometry_msgs',
    'lifecycle_msgs',
    'rcl_interfaces',
    'rclpy',
    'rosgraph_msgs',
    'sensor_msgs',
    'std_msgs',
    'std_srvs',
    'trajectory_msgs',
    'visualization_msgs',
)

# The two halves: what runs on a robot, and the workbench. The core finds a tool by name, in
# linkage_ros.workbench.
TOOLS = ('tools',)

# Where the core names tools: the table of them, and the public API, which imports what is used.
NAMING_TOOLS = ('linkage_ros.workbench', 'linkage_ros.__init__')

# Imports of our own modules within functions: tick/pipeline.py imports only what a scene
# needs, and commands start fast. Elsewhere the line gives its reason.
LOCAL_IMPORTS = ('tick', 'cli')
MARK = '# local import: '

# Faces: what each folder shows to the others, by the stub beside its __init__.py.
ROOT = Path(__file__).parents[2]
FACES = {
    '.'.join(stub.parent.relative_to(ROOT).parts): home_modules(stub.read_text('utf-8'))
    for stub in (ROOT / PACKAGE).rglob('__init__.pyi')
}

# Files that others import by their path: the entry point, and plug-ins, which are alike.
BY_PATH = ('linkage_ros.cli.main', 'linkage_ros.stages.drives.')
# Tests of what lies within, by their file.
WITHIN = {
    'linkage_ros.dynamics.equation',
    'linkage_ros.kinematics.iterated.grid',
    'linkage_ros.kinematics.iterated.group',
    'linkage_ros.kinematics.analysis.monotonic_pieces',
    'linkage_ros.kinematics.space.joints',
    'linkage_ros.kinematics.space.steps',
    'linkage_ros.tools.design.motion',
    'linkage_ros.tools.design.pairs.freudenstein',
    'linkage_ros.tools.drawing.painting',
    'linkage_ros.tools.models.fmu.stepped_scene',
    'linkage_ros.tools.view.report.diagnostics_summary',
}


def _imported(module, node):
    """Yield the dotted names that an import statement of a module names, made absolute."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
        return
    base = node.module or ''
    if node.level:
        parents = module.split('.')[: -node.level]
        base = '.'.join([*parents, base] if base else parents)
    # `from linkage_ros import errors` imports the module errors, not the package; the face of a
    # folder imports the module of each name.
    for alias in node.names:
        if base == PACKAGE:
            yield f'{base}.{alias.name}'
        else:
            yield FACES.get(base, {}).get(alias.name, base)


def _imports(root):
    """Yield (module, imported name, line, whether within a function) of all of linkage_ros."""
    for path in sorted((root / PACKAGE).rglob('*.py')):
        module = '.'.join(path.relative_to(root).with_suffix('').parts)
        text = path.read_text('utf-8')
        lines = text.splitlines()
        tree = ast.parse(text, str(path))
        within = {
            id(inner)
            for outer in ast.walk(tree)
            if isinstance(outer, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
            for inner in ast.walk(outer)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.Import | ast.ImportFrom):
                first, last = node.lineno - 1, node.end_lineno
                for name in _imported(module, node):
                    line = ' '.join(lines[first:last])
                    yield module, name, line, id(node) in within


def _package(name):
    """Return the package or module of HEIGHTS that a name of ours lies in; '' for none."""
    parts = name.split('.')[1:]
    ends = range(len(parts), 0, -1)
    return next((p for p in ('.'.join(parts[:end]) for end in ends) if p in HEIGHT), '')


def _trees(root):
    """Yield (module, syntax tree) of all of linkage_ros."""
    for path in sorted((root / PACKAGE).rglob('*.py')):
        module = '.'.join(path.relative_to(root).with_suffix('').parts)
        yield module, ast.parse(path.read_text('utf-8'), str(path))


@cache
def _from_imports(path):
    nodes = ast.walk(ast.parse(path.read_text('utf-8')))
    return [node for node in nodes if isinstance(node, ast.ImportFrom)]


def _named(module, node):
    """Yield what a node of a module imports, or may import later: names and texts of ours."""
    if isinstance(node, ast.Import | ast.ImportFrom):
        for name in _imported(module, node):
            yield name
            yield from (f'{name}.{alias.name}' for alias in node.names)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value


def _is_tool(name):
    """Return whether a name of ours lies in the workbench."""
    return any(f'{name}.'.startswith(f'{PACKAGE}.{tool}.') for tool in TOOLS)


@pytest.fixture(scope='module')
def imports(root):
    return list(_imports(root))


@pytest.fixture(scope='module')
def our_imports(imports):
    faces = f'{PACKAGE}.faces'  # what every folder starts with
    return [found for found in imports if found[1].split('.')[0] == PACKAGE and found[1] != faces]


def test_every_package_has_a_layer(root):
    packages = {
        path.stem
        for path in (root / PACKAGE).iterdir()
        if path.suffix == '.py' or (path / '__init__.py').exists()
    }
    assert packages - {'__init__'} <= set(HEIGHT)


def test_imports_point_to_lower_layers(our_imports):
    up = [
        f'{module} imports {name}'
        for module, name, _, _ in our_imports
        if HEIGHT.get(_package(name), -1) > HEIGHT.get(_package(module), -1)
    ]
    assert not up


def _face_beyond(module, importer):
    """Return the face that a module lies behind, for an importer outside of its folder."""
    if module in FACES:
        return ''
    parts = module.split('.')
    for end in range(len(parts) - 1, 1, -1):
        face = '.'.join(parts[:end])
        if face in FACES and not f'{importer}.'.startswith(f'{face}.'):
            return face
    return ''


def test_imports_from_other_folders_use_package_faces():
    beyond = defaultdict(list)
    for folder in (PACKAGE, 'test'):
        for path in sorted((ROOT / folder).rglob('*.py')):
            file = path.relative_to(ROOT)
            importer = '.'.join(file.with_suffix('').parts)
            for node in _from_imports(path):
                if node.level:
                    continue
                face = _face_beyond(node.module, importer)
                if face and not node.module.startswith(BY_PATH):
                    beyond[node.module].append(str(file))
    assert {module: files for module, files in beyond.items() if module not in WITHIN} == {}
    assert all(len(beyond[module]) == 1 for module in WITHIN)


def test_package_faces_list_only_imported_names(root):
    """No name stands in a face for nobody."""
    used = defaultdict(set)
    for folder in (PACKAGE, 'test', 'campaigns', 'bench', 'docs', 'examples'):
        for path in (root / folder).rglob('*.py'):
            for node in _from_imports(path):
                if node.module in FACES:
                    used[node.module] |= {alias.name for alias in node.names}
    public = {face: {*names} for face, names in FACES.items() if face != PACKAGE}
    assert {face: names - used[face] for face, names in public.items() if names - used[face]} == {}


def test_a_long_face_says_what_to_read_first(root):
    for face, names in FACES.items():
        stub = root.joinpath(*face.split('.'), '__init__.pyi').read_text('utf-8')
        first = re.search(r'^# Read first: (.*?)\.$', stub, re.MULTILINE | re.DOTALL)
        assert first or len(names) <= 20, face
        if first:
            told = first[1].replace('\n#', '').split(', ')
            assert len(told) <= 20
            assert {*told} <= {*names}


def test_modules_have_no_circular_imports(our_imports):
    graph = defaultdict(set)
    for module, name, line, is_local in our_imports:
        # What a type checker alone imports runs nowhere: a function names the type that uses it.
        runs = is_local or not line.startswith(' ')
        if runs and name not in (module, PACKAGE):  # the public API imports what is asked for
            graph[module].add(name)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(' imports '.join(reversed(error.args[1])), pytrace=False)


def test_packages_have_no_circular_imports(our_imports):
    graph = defaultdict(set)
    for module, name, _, _ in our_imports:
        if _package(name) and _package(name) != _package(module):
            graph[_package(module)].add(_package(name))
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(' imports '.join(reversed(error.args[1])), pytrace=False)


def test_core_imports_no_tool(root):
    found = [
        f'{module} imports {name}'
        for module, tree in _trees(root)
        for node in ast.walk(tree)
        for name in _named(module, node)
        if _is_tool(name) and not _is_tool(module) and module not in NAMING_TOOLS
    ]
    assert not found


def test_every_listed_tool_exists(root):
    modules = [f'{module}.' for module, _ in _trees(root)]
    assert not [
        tool
        for tool in TOOLS
        if not any(module.startswith(f'{PACKAGE}.{tool}.') for module in modules)
    ]
    assert all(map(_is_tool, workbench.TOOLS.values()))


def test_bag_package_imports_only_errors_and_description(our_imports):
    known = ('', 'bag', 'errors', 'description')
    strangers = [
        f'{module} imports {name}'
        for module, name, _, _ in our_imports
        if _package(module) == 'bag' and _package(name) not in known
    ]
    assert not strangers


def test_kinematics_package_imports_only_numpy(imports):
    strangers = [
        f'{module} imports {name}'
        for module, name, _, _ in imports
        if _package(module) == 'kinematics'
        and name.split('.')[0] not in {*sys.stdlib_module_names, 'numpy', PACKAGE}
    ]
    assert not strangers


def test_core_imports_no_ros_package(imports):
    strangers = [
        f'{module} imports {name}'
        for module, name, _, _ in imports
        if _package(module) not in WITH_ROS
        and module not in TOOLS_WITH_ROS
        and name.split('.')[0] in ROS
    ]
    assert not strangers


def test_local_imports_have_a_reason(our_imports):
    unmarked = [
        f'{module}: {line.strip()}'
        for module, _, line, within in our_imports
        if within
        and _package(module) not in LOCAL_IMPORTS
        and not module.endswith(('_command', '.synthesis_tasks'))
        and not line.partition(MARK)[2].strip()
    ]
    assert not unmarked


def test_core_imports_without_ros(root, import_core):
    file, count = import_core(sys.executable, skip=(*WITH_ROS, 'tools'), refuse=ROS, cwd=root)
    assert file == root / PACKAGE / '__init__.py'
    assert count > len(HEIGHTS)
