# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: replay_ticks, ReplayedTick, verify_replay, ReplayVerification, Comparison,
# Deviation, Counterfactual, simulate_run, Study, ParameterSweep, Statistics.

from linkage_ros.replay.compare import (
    Comparison as Comparison,
    Deviation as Deviation,
    FirstDifference as FirstDifference,
    TickPlace as TickPlace,
    ulp_distance as ulp_distance,
)
from linkage_ros.replay.counterfactual import (
    check_drives as check_drives,
    Counterfactual as Counterfactual,
    CounterfactualTick as CounterfactualTick,
    find_crank_topic as find_crank_topic,
    ReplayEvent as ReplayEvent,
)
from linkage_ros.replay.finished_runs import FinishedRuns as FinishedRuns
from linkage_ros.replay.node_messages import (
    announced_text as announced_text,
    change_text as change_text,
    own_joint_states as own_joint_states,
    read_announced as read_announced,
    read_change as read_change,
)
from linkage_ros.replay.replay import (
    recorded_scene as recorded_scene,
    replay_all as replay_all,
    replay_ticks as replay_ticks,
    ReplayedTick as ReplayedTick,
    turn_fault as turn_fault,
    versions_here as versions_here,
)
from linkage_ros.replay.run_files import (
    scene_files as scene_files,
    to_attachments as to_attachments,
    user_effects_here as user_effects_here,
)
from linkage_ros.replay.simulate import (
    BEGIN as BEGIN,
    check_simulated as check_simulated,
    simulate_run as simulate_run,
)
from linkage_ros.replay.study import (
    instants_of as instants_of,
    Outcome as Outcome,
    ParameterSweep as ParameterSweep,
    run_one as run_one,
    run_outcomes as run_outcomes,
    runs_of as runs_of,
    Settings as Settings,
    Statistics as Statistics,
    Study as Study,
    sweep_of as sweep_of,
)
from linkage_ros.replay.topic_description import (
    describe_topic as describe_topic,
    message_type as message_type,
)
from linkage_ros.replay.verify import (
    beginning_text as beginning_text,
    DIFFERENT as DIFFERENT,
    examine_states as examine_states,
    IDENTICAL as IDENTICAL,
    ReplayVerification as ReplayVerification,
    turning_joints as turning_joints,
    UNDECIDED as UNDECIDED,
    verify_replay as verify_replay,
    WorstResiduals as WorstResiduals,
)
