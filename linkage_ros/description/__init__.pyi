# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: load, read_linkage, read_any_closure, read_urdf, read_as_urdf, write_linkage,
# load_scene, Scene, SceneLinkage, Section, Number, Name, Point, RowsOf, read_parameters,
# linkage_notes, Units, parse_yaml.

from linkage_ros.description.confinement import Confinement as Confinement
from linkage_ros.description.file_access import (
    atomic_write as atomic_write,
    check_new as check_new,
    check_output_name as check_output_name,
    read_regular as read_regular,
    remove_bag as remove_bag,
    write_folder as write_folder,
)
from linkage_ros.description.file_kinds import (
    BINARY as BINARY,
    kind_of_bytes as kind_of_bytes,
)
from linkage_ros.description.grammar import (
    name_or_names as name_or_names,
    NameOrNames as NameOrNames,
)
from linkage_ros.description.linkage_file import (
    checked_closure as checked_closure,
    find_closures as find_closures,
    is_planar_file as is_planar_file,
    linkage_content as linkage_content,
    load as load,
    read_any_closure as read_any_closure,
    read_closure as read_closure,
    read_content as read_content,
    read_linkage as read_linkage,
    urdf_content as urdf_content,
    written_linkage as written_linkage,
)
from linkage_ros.description.linkage_grammar import FARTHEST as FARTHEST
from linkage_ros.description.linkage_writer import (
    content_of as content_of,
    linkage_text as linkage_text,
    number_text as number_text,
    pose_text as pose_text,
    scene_text_for as scene_text_for,
    write_linkage as write_linkage,
)
from linkage_ros.description.notes import (
    linkage_notes as linkage_notes,
    scene_notes as scene_notes,
)
from linkage_ros.description.parameters import (
    choice as choice,
    ChoiceOf as ChoiceOf,
    Components as Components,
    components as components,
    declared_fields as declared_fields,
    default_of as default_of,
    Each as Each,
    each_part as each_part,
    File as File,
    file as file,
    first_docstring_line as first_docstring_line,
    Flag as Flag,
    flag as flag,
    is_required as is_required,
    KINDS as KINDS,
    Name as Name,
    NamesOf as NamesOf,
    Number as Number,
    number as number,
    number_list as number_list,
    number_rows as number_rows,
    NumberList as NumberList,
    optional_section as optional_section,
    own_parameters as own_parameters,
    parameter_rows as parameter_rows,
    parameter_section as parameter_section,
    ParameterGroup as ParameterGroup,
    parameters_schema as parameters_schema,
    part_name as part_name,
    part_names as part_names,
    Point as Point,
    point as point,
    read_parameters as read_parameters,
    RowsOf as RowsOf,
    text as text,
    TextOf as TextOf,
    whole_number as whole_number,
)
from linkage_ros.description.robot_formats import read_as_urdf as read_as_urdf
from linkage_ros.description.robot_pose import roll_pitch_yaw as roll_pitch_yaw
from linkage_ros.description.scene import (
    LEAST_FLUSH_PERIOD as LEAST_FLUSH_PERIOD,
    RecordParameters as RecordParameters,
    Scene as Scene,
    SceneLinkage as SceneLinkage,
    StorageParameters as StorageParameters,
)
from linkage_ros.description.scene_file import (
    files_of_scene as files_of_scene,
    kind_of as kind_of,
    LINKAGE_FILE as LINKAGE_FILE,
    load_scene as load_scene,
    parse_scene as parse_scene,
    SCENE_FILE as SCENE_FILE,
)
from linkage_ros.description.scene_grammar import (
    as_text as as_text,
    HIGHEST_RATE as HIGHEST_RATE,
    LOWEST_RATE as LOWEST_RATE,
    parameter_types as parameter_types,
    scene_schema as scene_schema,
)
from linkage_ros.description.scene_settings import apply_settings as apply_settings
from linkage_ros.description.section import Section as Section
from linkage_ros.description.space_grammar import linkage_schema as linkage_schema
from linkage_ros.description.tables import (
    block_rows as block_rows,
    check_kind as check_kind,
    csv_of as csv_of,
    FileTable as FileTable,
    numbers_of as numbers_of,
    table_file as table_file,
    TABLE_KINDS as TABLE_KINDS,
    write_tables as write_tables,
)
from linkage_ros.description.units import LENGTHS as LENGTHS, Units as Units
from linkage_ros.description.urdf_file import (
    read_urdf as read_urdf,
)
from linkage_ros.description.yaml_file import (
    bounded_yaml as bounded_yaml,
    DEEPEST as DEEPEST,
    LARGEST_FILE as LARGEST_FILE,
    MOST_VALUES as MOST_VALUES,
    parse_yaml as parse_yaml,
    read_yaml as read_yaml,
)
