# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Read first: read_bag, Bag, BagMessage, Topic, QosProfile, BagWriter, Storage, Recorder,
# RecordingSummary, SnapshotMemory, recover_bag, Salvage, recorded_events, RunMetadata.

from linkage_ros.bag.bag_file import compression_type as compression_type
from linkage_ros.bag.contents import (
    Contents as Contents,
    contents_of as contents_of,
    Layout as Layout,
    layout_of as layout_of,
    RECORD_SIZE as RECORD_SIZE,
    REPORT_EVERY as REPORT_EVERY,
    Tallies as Tallies,
)
from linkage_ros.bag.disk import Reserve as Reserve
from linkage_ros.bag.mcap_records import Message as Message, RecordSource as RecordSource
from linkage_ros.bag.metadata import (
    BagSummary as BagSummary,
    counts_in as counts_in,
    DISCARDED as DISCARDED,
    FAILURE as FAILURE,
    merge_summaries as merge_summaries,
    METADATA_FILE as METADATA_FILE,
    metadata_text as metadata_text,
    NO_START as NO_START,
    qos_text as qos_text,
    ROOT_KEY as ROOT_KEY,
    STATS_RECORD as STATS_RECORD,
    TopicCounts as TopicCounts,
    UNFINISHED as UNFINISHED,
    UNFINISHED_DATA as UNFINISHED_DATA,
    write_metadata as write_metadata,
)
from linkage_ros.bag.other_formats import (
    is_bag_name as is_bag_name,
    MOST_UNPACKED as MOST_UNPACKED,
)
from linkage_ros.bag.reader import (
    Bag as Bag,
    BagMessage as BagMessage,
    information_of as information_of,
    is_in_use as is_in_use,
    MOST_ATTACHED as MOST_ATTACHED,
    read_bag as read_bag,
    serialized_metadata as serialized_metadata,
    topic_of as topic_of,
)
from linkage_ros.bag.recorder import (
    DirectRecorder as DirectRecorder,
    FLUSH_AFTER as FLUSH_AFTER,
    PLACE as PLACE,
    Recorder as Recorder,
    RecordingSummary as RecordingSummary,
)
from linkage_ros.bag.recover import (
    expected_counts as expected_counts,
    MOST_CHANNELS as MOST_CHANNELS,
    NOTHING_LOST as NOTHING_LOST,
    recover_bag as recover_bag,
    RECOVERED as RECOVERED,
    recovered_name as recovered_name,
    Recovery as Recovery,
)
from linkage_ros.bag.run_account import (
    BEGUN as BEGUN,
    MID_RUN as MID_RUN,
    RUN_FILE as RUN_FILE,
    SEED as SEED,
    USER_EFFECTS as USER_EFFECTS,
    VERSIONS as VERSIONS,
    WITH_THE_RUN as WITH_THE_RUN,
    WRENCH_TOPICS as WRENCH_TOPICS,
)
from linkage_ros.bag.run_events import (
    Event as Event,
    FaultEvent as FaultEvent,
    missing_start_reason as missing_start_reason,
    read_raw_metadata as read_raw_metadata,
    read_run_metadata as read_run_metadata,
    recorded_events as recorded_events,
    ResetEvent as ResetEvent,
    RunFiles as RunFiles,
    RunMetadata as RunMetadata,
    SampleEvent as SampleEvent,
    TickEvent as TickEvent,
    WrenchEvent as WrenchEvent,
)
from linkage_ros.bag.salvage import find_next_whole as find_next_whole, Salvage as Salvage
from linkage_ros.bag.snapshot import (
    LastSeconds as LastSeconds,
    SnapshotMemory as SnapshotMemory,
    SnapshotWriting as SnapshotWriting,
)
from linkage_ros.bag.storage import COMPRESSIONS as COMPRESSIONS, Storage as Storage
from linkage_ros.bag.topic import (
    CHANNELS_FILE as CHANNELS_FILE,
    INFINITE as INFINITE,
    MessageSink as MessageSink,
    QosProfile as QosProfile,
    Topic as Topic,
)
from linkage_ros.bag.writer import BagWriter as BagWriter
