# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: Pipeline, Tick, LinkagePipeline, LinkageState, InterpretedTick, TickLoop,
# TakeMessage, Counts, RunTopic.

from linkage_ros.tick.interpreted_tick import InterpretedTick as InterpretedTick, Tick as Tick
from linkage_ros.tick.linkage_pipeline import LinkagePipeline as LinkagePipeline
from linkage_ros.tick.linkage_state import LinkageState as LinkageState
from linkage_ros.tick.pipeline import Pipeline as Pipeline
from linkage_ros.tick.run_topics import (
    CRANK as CRANK,
    DESCRIPTION as DESCRIPTION,
    DIAGNOSTICS as DIAGNOSTICS,
    EXTRA as EXTRA,
    FAULTS as FAULTS,
    FAULTS_QOS as FAULTS_QOS,
    find_handles as find_handles,
    JOINT_STATES as JOINT_STATES,
    LATCHED_QOS as LATCHED_QOS,
    list_run_topics as list_run_topics,
    name_topics as name_topics,
    RESETS as RESETS,
    RunTopic as RunTopic,
    SENSOR_QOS as SENSOR_QOS,
    WITHHELD as WITHHELD,
)
from linkage_ros.tick.tick_loop import (
    Counts as Counts,
    DurationHistogram as DurationHistogram,
    Pace as Pace,
    Stall as Stall,
    TakeMessage as TakeMessage,
    TickLoop as TickLoop,
)
