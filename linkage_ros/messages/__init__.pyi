# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: JointStateReader, JointStateWriter, CrankSample, Rejection, SampleRouter,
# parse_declaration, pack_message, parse_message, MessageContent, JointTrajectoryWriter,
# JointWrenchWriter, MarkerArrayWriter.

from linkage_ros.messages.input_samples import (
    input_reader as input_reader,
    SampleRouter as SampleRouter,
)
from linkage_ros.messages.joint_state import (
    arrays_of as arrays_of,
    CrankSample as CrankSample,
    EffortCommand as EffortCommand,
    head_of as head_of,
    JOINT_STATE as JOINT_STATE,
    JointEffortReader as JointEffortReader,
    JointStateReader as JointStateReader,
    JointStateWriter as JointStateWriter,
    OwnJointStates as OwnJointStates,
    Rejection as Rejection,
    with_every_number as with_every_number,
)
from linkage_ros.messages.joint_values import (
    ACCELERATION as ACCELERATION,
    EFFORT as EFFORT,
    FORCE_X as FORCE_X,
    IN_SPACE as IN_SPACE,
    JOINT_STATE_TYPE as JOINT_STATE_TYPE,
    JOINT_TRAJECTORY as JOINT_TRAJECTORY,
    JointTrajectoryWriter as JointTrajectoryWriter,
    JointWrenchWriter as JointWrenchWriter,
    Key as Key,
    MessageContent as MessageContent,
    MessageValues as MessageValues,
    MULTI_DOF_JOINT_STATE as MULTI_DOF_JOINT_STATE,
    POSITION as POSITION,
    QUANTITIES as QUANTITIES,
    RATE as RATE,
    TRAJECTORY as TRAJECTORY,
    TYPES as TYPES,
    unit_in_si as unit_in_si,
    UNITS as UNITS,
    WRENCHES as WRENCHES,
)
from linkage_ros.messages.layout import (
    MalformedError as MalformedError,
    NANOSECONDS as NANOSECONDS,
    pack_message as pack_message,
    parse_declaration as parse_declaration,
    parse_message as parse_message,
)
from linkage_ros.messages.marker_array import (
    ADD as ADD,
    ARROW as ARROW,
    Colour as Colour,
    CYLINDER as CYLINDER,
    DELETE as DELETE,
    LINE_LIST as LINE_LIST,
    LINE_STRIP as LINE_STRIP,
    Marker as Marker,
    MARKER_ARRAY as MARKER_ARRAY,
    MarkerArrayWriter as MarkerArrayWriter,
    Place as Place,
    SPHERE_LIST as SPHERE_LIST,
    TEXT_VIEW_FACING as TEXT_VIEW_FACING,
    TRIANGLE_LIST as TRIANGLE_LIST,
)
from linkage_ros.messages.single_values import (
    text_message as text_message,
    text_of as text_of,
    TIME_END as TIME_END,
    time_message as time_message,
)
from linkage_ros.messages.wrench import read_wrench as read_wrench
