# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: COMMANDS, find_command, Parser, parser_of, read_inputs, Result, Table, Column,
# Quantity, DisplayUnits, BagReading, open_bag, show_progress.

from linkage_ros.cli.arguments import (
    add_at as add_at,
    add_bag as add_bag,
    add_file as add_file,
    add_output as add_output,
    add_radians as add_radians,
    add_robot as add_robot,
    add_set as add_set,
    angle_text as angle_text,
    bounded_number as bounded_number,
    DEGREES as DEGREES,
    DisplayUnits as DisplayUnits,
    finite_or_none as finite_or_none,
    fixed_text as fixed_text,
    LINKAGES as LINKAGES,
    output_or as output_or,
    output_path as output_path,
    PICTURES as PICTURES,
    read_inputs as read_inputs,
    RESULTS as RESULTS,
    robot_of as robot_of,
    SCENE_HELP as SCENE_HELP,
)
from linkage_ros.cli.bag_reading import (
    add_trust as add_trust,
    bag_json as bag_json,
    BagReading as BagReading,
    describe_gaps as describe_gaps,
    open_bag as open_bag,
    path_beside as path_beside,
    run_or_blank as run_or_blank,
    scene_json as scene_json,
    scene_of as scene_of,
)
from linkage_ros.cli.check import describe_groups as describe_groups
from linkage_ros.cli.completion import SHELLS as SHELLS
from linkage_ros.cli.echo import as_yaml as as_yaml, rate_text as rate_text
from linkage_ros.cli.info import bag_tables as bag_tables
from linkage_ros.cli.main import (
    COMMANDS as COMMANDS,
    EXIT_CODES as EXIT_CODES,
    find_command as find_command,
    Parser as Parser,
    parser_of as parser_of,
)
from linkage_ros.cli.proof import Beginning as Beginning, proof_of as proof_of
from linkage_ros.cli.replay import (
    deviations_account as deviations_account,
    joints_table as joints_table,
)
from linkage_ros.cli.result import (
    add_result as add_result,
    Result as Result,
    show_result as show_result,
)
from linkage_ros.cli.scene import (
    parameters_of as parameters_of,
    REGISTRIES as REGISTRIES,
    table_of as table_of,
)
from linkage_ros.cli.table import (
    Column as Column,
    facts_table as facts_table,
    Quantity as Quantity,
    Table as Table,
    table_of_rows as table_of_rows,
)
from linkage_ros.cli.terminal import (
    FIRST_LINE as FIRST_LINE,
    fold_table as fold_table,
    print_tables as print_tables,
    PrintableStream as PrintableStream,
    ProgressCallback as ProgressCallback,
    show_progress as show_progress,
    table_text as table_text,
)
