# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Install linkage_ros with pip as well as with colcon."""

from pathlib import Path
import re

from setuptools import find_packages, setup

NAME = 'linkage_ros'
HERE = Path(__file__).parent

# Read, not imported: pip builds in an environment without the dependencies.
VERSION = re.search(
    r"^__version__ = '(.+)'$", (HERE / NAME / '__init__.py').read_text('utf-8'), re.MULTILINE
).group(1)


def shared(folder):
    """Return data_files entries that keep the tree below a folder as it is."""
    return [
        (
            f'share/{NAME}/{parent.as_posix()}',
            sorted(
                f'{parent.as_posix()}/{file.name}'
                for file in (HERE / parent).iterdir()
                if file.is_file() and not file.name.startswith('.')
            ),
        )
        for parent in sorted(
            {
                file.relative_to(HERE).parent
                for file in (HERE / folder).rglob('*')
                if file.is_file() and '__pycache__' not in file.parts
            }
        )
    ]


# ROS is an extra: on a robot rclpy comes from apt and pip must leave it alone.
ROS = ['ros-jazzy-rclpy[fastrtps]>=7.1,<7.2', 'ros-jazzy-common-interfaces>=5.3,<5.4']
# From 70.1 it builds wheels by itself; 80 took the develop command that --symlink-install needs.
SETUPTOOLS = 'setuptools>=70.1,<80'
# Reports: pictures, tables, pages; exact solutions for the study of accuracy.
REPORT = [
    'matplotlib>=3.6,<4',
    'plotly>=6,<8',
    'python-flint>=0.6,<1',
    'rich>=13,<16',
    'scipy>=1.11,<2',
]
# Synthesis by fitting and searching; exact synthesis needs numpy only.
DESIGN = ['scipy>=1.11,<2']
# Export of bags as Parquet; CSV needs no package. From 26 on pyarrow refuses numpy 1.x, which
# Ubuntu 24.04 has, but does not declare it to pip.
EXPORT = ['pyarrow>=14,<26']
# `linkage view`: a server for this machine, edits that keep a file's comments, DXF files.
VIEW = ['aiohttp>=3.9,<4', 'ezdxf>=1.1,<2', 'plotly>=6,<8', 'ruamel.yaml>=0.18,<1']
# `make demo`: a node, tables, a picture, the page of the run, and the installer.
DEMO = [*ROS, *VIEW, 'matplotlib>=3.6,<4', 'rich>=13,<16', SETUPTOOLS, 'uv']
# `linkage fmu`: the wrapper between FMI and Python.
FMU = ['pythonfmu3>=0.3.4,<0.4']
# Robots in MJCF.
MJCF = ['mujoco>=3,<5']
# Completion of the command line in bash, zsh and fish.
COMPLETION = ['argcomplete>=3.1,<4']
# Linkages as functions of arrays; PyTorch's wheel for Linux on PyPI brings gigabytes of CUDA.
ARRAYS = ['array-api-compat>=1.11,<2', 'jax>=0.4.36,<1', 'torch>=2.4,<3']
# For studies on several machines.
DASK = ['distributed>=2023.12,<2027']
# The documentation site, in the theme Furo.
DOCS = ['sphinx>=8', 'myst-parser>=4', 'furo', *REPORT]
# The name `test` matters: colcon runs pytest only when it finds it in this extra.
TEST = [
    'pytest',
    'pytest-timeout',
    # Runs the tests without nodes on all processors.
    'pytest-xdist>=3',
    'hypothesis',
    'jsonschema>=4',
    *REPORT,
    'rosbags',
    # With npm packages: a bag reader in another language, and a browser.
    'playwright',
    'markdown-it-py',
    # Expands the xacro of config/ros2_control.
    'xacro',
    # Checks the robot models.
    'yourdfpy',
    # Checks and runs FMUs.
    'fmpy>=0.3.22,<0.4',
    # References: fifty digits, and a rigid-body engine.
    'mpmath>=1.2,<2',
    # `make arrays` adds PyTorch.
    *ARRAYS[:2],
    *COMPLETION,
    *DASK,
    *EXPORT,
    *FMU,
    *MJCF,
    *VIEW,
]
# `make bench`: another implementation, to compare the speed, and Pinocchio, which then reads robot
# models in the tests too.
BENCH = ['pylinkage[numba]>=1.3,<1.4; python_version >= "3.11"', 'pin']
# The bill of materials of a release.
RELEASE = ['cyclonedx-bom>=7']
STYLE = [
    'mypy',
    'ruff',
    'types-PyYAML',
    'types-jsonschema',
    # ament's linters as Jazzy has them. The wheels leave flake8 and its plugins out.
    'ros-ament-flake8>=0.17,<0.18',
    'ros-ament-pep257>=0.17,<0.18',
    'flake8',
    # As Ubuntu 24.04 has it: 2.2 and later refuse modules named as one of the standard library.
    'flake8-builtins>=2.1,<2.2',
    'flake8-comprehensions',
    'flake8-docstrings',
    'flake8-import-order',
    'flake8-quotes',
    'pydocstyle',
]
COLCON = [
    'colcon-bash',
    'colcon-core',
    'colcon-output',
    'colcon-package-selection',
    'colcon-ros',
    'colcon-test-result',
]

setup(
    name=NAME,
    version=VERSION,
    description='Linkages for ROS 2: crank angle in, joint states out, runs recorded.',
    author='The linkage_ros authors',
    author_email='maintainers@linkage-ros.example',
    maintainer='The linkage_ros authors',
    maintainer_email='maintainers@linkage-ros.example',
    license='Apache-2.0',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={
        NAME: ['py.typed', '*.pyi'],
        f'{NAME}.tools.models.ros2_control': ['CMakeLists.txt', '*.cpp', '*.xml'],
        f'{NAME}.tools.study': ['*.css', '*.js'],
        f'{NAME}.tools.view': ['*.css', '*.js'],
        f'{NAME}.tools.view.pages': ['*.css', '*.js'],
        f'{NAME}.tools.view.report': ['*.css', '*.js'],
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        *shared('config'),
        *shared('launch'),
    ],
    python_requires='>=3.10',
    # Bounded above too: another major version may behave differently.
    install_requires=['numpy>=1.26,<3', 'mcap>=1.2,<2', 'PyYAML>=6,<7'],
    extras_require={
        'arrays': ARRAYS,
        'bench': BENCH,
        'ros': ROS,
        'demo': DEMO,
        'report': REPORT,
        'design': DESIGN,
        'completion': COMPLETION,
        'dask': DASK,
        'docs': DOCS,
        'export': EXPORT,
        'fmu': FMU,
        'mjcf': MJCF,
        'test': TEST,
        'view': VIEW,
        'dev': [
            *(*DEMO, *REPORT, *DESIGN, *DASK, *DOCS, *EXPORT, *TEST, *STYLE, *COLCON),
            *RELEASE,
        ],
    },
    zip_safe=True,
    entry_points={
        'console_scripts': [
            'linkage_node = linkage_ros.node.linkage_node:main',
            'crank_source = linkage_ros.node.crank_source:main',
            'linkage_relay = linkage_ros.node.linkage_relay:main',
            'pd_controller = linkage_ros.node.pd_controller:main',
            'linkage = linkage_ros.__main__:main',
        ],
    },
)
