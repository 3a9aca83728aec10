# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: LinkageNode, run_linkage_node, RunState, RunRecording, Warnings, make_statuses,
# CommandRelay, CrankSource.

from linkage_ros.node.conditions import (
    RunState as RunState,
    Warnings as Warnings,
)
from linkage_ros.node.demo_nodes import CrankSource as CrankSource, PDController as PDController
from linkage_ros.node.diagnostics import make_statuses as make_statuses
from linkage_ros.node.node import LinkageNode as LinkageNode
from linkage_ros.node.parameters import LINKAGE_NODE as LINKAGE_NODE
from linkage_ros.node.qos import recorded_qos as recorded_qos
from linkage_ros.node.real_time import (
    leave_out_shared_memory as leave_out_shared_memory,
    stay_on_this_machine as stay_on_this_machine,
)
from linkage_ros.node.relay import (
    CommandRelay as CommandRelay,
    PARAMETERS as PARAMETERS,
    RefusedError as RefusedError,
)
from linkage_ros.node.run import run_linkage_node as run_linkage_node
from linkage_ros.node.run_recording import RunRecording as RunRecording
from linkage_ros.node.scene_topics import (
    CHANGES_QOS as CHANGES_QOS,
    CRANK_QOS as CRANK_QOS,
    never_called as never_called,
    OUTPUT_QOS as OUTPUT_QOS,
    SCENE_QOS as SCENE_QOS,
    SCENE_TOPIC as SCENE_TOPIC,
    TakenByTick as TakenByTick,
)
