# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: read_run, ReportedRun, LinkageRun, page_data, run_html, ReportHeader, EventTrack,
# Decimation, BoundedCurves.

from linkage_ros.tools.view.report.blocks import (
    Blocks as Blocks,
    Progress as Progress,
    RunClock as RunClock,
    times_of as times_of,
)
from linkage_ros.tools.view.report.curves import (
    BoundedCurves as BoundedCurves,
    Lateness as Lateness,
    LATER_PINS as LATER_PINS,
    MOST_LINKAGES as MOST_LINKAGES,
    PinForces as PinForces,
)
from linkage_ros.tools.view.report.data import (
    event_tracks as event_tracks,
    link_poses as link_poses,
    page_data as page_data,
    spatial_places as spatial_places,
    time_plots as time_plots,
    zero_plots as zero_plots,
)
from linkage_ros.tools.view.report.decimation import (
    DecimatedCurves as DecimatedCurves,
    Decimation as Decimation,
    DURATION_BYTES as DURATION_BYTES,
    FORCE_BYTES as FORCE_BYTES,
    FRAME_BYTES as FRAME_BYTES,
    Histogram as Histogram,
    interval_capacity as interval_capacity,
    most_columns as most_columns,
    MOST_FRAMES as MOST_FRAMES,
    PAGE_BYTES as PAGE_BYTES,
    SAMPLE_BYTES as SAMPLE_BYTES,
    SHAPE_BYTES as SHAPE_BYTES,
    STATE_BYTES as STATE_BYTES,
    TABLE_BYTES as TABLE_BYTES,
)
from linkage_ros.tools.view.report.diagnostics_summary import (
    DIAGNOSTIC_ARRAY as DIAGNOSTIC_ARRAY,
    read_statuses as read_statuses,
)
from linkage_ros.tools.view.report.html import (
    ReportHeader as ReportHeader,
    run_html as run_html,
)
from linkage_ros.tools.view.report.joint_states import (
    JointStates as JointStates,
    MOST_JOINTS as MOST_JOINTS,
)
from linkage_ros.tools.view.report.labels import (
    EVENT_TRACKS as EVENT_TRACKS,
    seconds_text as seconds_text,
    size_in_json as size_in_json,
)
from linkage_ros.tools.view.report.reading import read_run as read_run, SceneRun as SceneRun
from linkage_ros.tools.view.report.run import (
    CurveColumn as CurveColumn,
    EventTrack as EventTrack,
    Frames as Frames,
    LinkageRun as LinkageRun,
    MOST_SPANS as MOST_SPANS,
    MOST_TEXT as MOST_TEXT,
    ReportedRun as ReportedRun,
    Silences as Silences,
    Window as Window,
)
