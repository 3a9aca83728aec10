# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``metadata.yaml`` and the QoS in it, as rosbag2 of Jazzy writes them (metadata version 9)."""

from dataclasses import replace
from pathlib import Path

from linkage_ros.bag import (
    BagSummary,
    merge_summaries,
    metadata_text,
    NO_START,
    qos_text,
    QosProfile,
    write_metadata,
)
import pytest
import yaml

# rosbag2_storage's yaml.hpp and qos.cpp of Jazzy: the words are rmw's, without limit is
# RMW_DURATION_INFINITE.
NO_LIMIT = {'sec': 9223372036, 'nsec': 854775807}
QOS = {
    'history': 'keep_last',
    'depth': 10,
    'reliability': 'reliable',
    'durability': 'volatile',
    'deadline': NO_LIMIT,
    'lifespan': NO_LIMIT,
    'liveliness': 'automatic',
    'liveliness_lease_duration': NO_LIMIT,
    'avoid_ros_namespace_conventions': False,
}


@pytest.fixture
def summary(tmp_path, topics):
    return BagSummary(
        folder=tmp_path, file='run_0.mcap', topics=topics, counts=(3, 4),
        start=1_700_000_000_000_000_000, duration=2_000_000, size=1234
    )  # fmt: skip


def test_metadata_text_equals_that_of_rosbag2(summary, topics, monkeypatch):
    monkeypatch.delenv('ROS_DISTRO', raising=False)
    expected = {
        'rosbag2_bagfile_information': {
            'version': 9,
            'storage_identifier': 'mcap',
            'duration': {'nanoseconds': 2_000_000},
            'starting_time': {'nanoseconds_since_epoch': 1_700_000_000_000_000_000},
            'message_count': 7,
            'topics_with_message_count': [
                {
                    'topic_metadata': {
                        'name': '/crank',
                        'type': 'sensor_msgs/msg/JointState',
                        'serialization_format': 'cdr',
                        'offered_qos_profiles': [
                            {**QOS, 'depth': 5, 'reliability': 'best_effort'}
                        ],
                        'type_description_hash': topics[0].type_hash,
                    },
                    'message_count': 3,
                },
                {
                    'topic_metadata': {
                        'name': '/arm/joint_states',
                        'type': 'sensor_msgs/msg/JointState',
                        'serialization_format': 'cdr',
                        'offered_qos_profiles': [QOS],
                        'type_description_hash': topics[1].type_hash,
                    },
                    'message_count': 4,
                },
            ],
            'compression_format': '',
            'compression_mode': '',
            'relative_file_paths': ['run_0.mcap'],
            'files': [
                {
                    'path': 'run_0.mcap',
                    'duration': {'nanoseconds': 2_000_000},
                    'starting_time': {'nanoseconds_since_epoch': 1_700_000_000_000_000_000},
                    'message_count': 7,
                }
            ],
            'custom_data': {'seed': '7', 'note': 'zwei\nZeilen: ja'},
            'ros_distro': 'jazzy',
        }
    }
    text = metadata_text(summary, {'seed': '7', 'note': 'zwei\nZeilen: ja'})
    assert yaml.safe_load(text) == expected
    assert list(yaml.safe_load(text)['rosbag2_bagfile_information']) == list(
        expected['rosbag2_bagfile_information']
    )
    assert '&' not in text, 'an alias that yaml-cpp understands and people do not'


@pytest.mark.parametrize('root', [True, False])
@pytest.mark.parametrize('custom', [{}, {'seed': '7', 'note': 'zwei\n\nZeilen: ja\u2028 é'}])
@pytest.mark.parametrize('files', [0, 3])
@pytest.mark.parametrize('with_topics', [True, False])
def test_metadata_text_equals_that_of_a_yaml_library(summary, root, custom, files, with_topics):
    if not with_topics:
        summary = replace(summary, topics=(), counts=())
    parts = [replace(summary, file=f'run: {index}.mcap') for index in range(files)]
    text = metadata_text(replace(summary, parts=tuple(parts)), custom, root=root)
    content = yaml.safe_load(text)
    written = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=1000)
    # Lines without anything but indentation stand in texts of several lines only.
    assert [line.strip() for line in text.split('\n')] == [
        line.strip() for line in written.split('\n')
    ]
    inner = content['rosbag2_bagfile_information'] if root else content
    assert inner['custom_data'] == (custom or None)


def test_summaries_of_files_merge_into_one_bag(summary):
    empty = replace(summary, file='run_1.mcap', counts=(0, 0), start=NO_START, duration=0, size=5)
    early = replace(
        summary, file='run_2.mcap', counts=(1, 0), start=summary.start - 10, duration=11, size=6
    )
    whole = merge_summaries([summary, empty, early], (3, 4))
    assert (whole.counts, whole.discarded) == ((4, 4), (3, 4))
    assert (whole.start, whole.duration) == (summary.start - 10, summary.duration + 10)
    assert (whole.size, whole.file) == (1234 + 5 + 6, 'run_2.mcap')
    information = yaml.safe_load(metadata_text(whole, {}, root=False))
    assert information['relative_file_paths'] == ['run_0.mcap', 'run_1.mcap', 'run_2.mcap']
    assert [each['message_count'] for each in information['files']] == [7, 0, 1]
    assert merge_summaries([empty], (0, 0)) == replace(empty, discarded=(0, 0))


def test_metadata_record_in_the_file_has_no_root_key(summary):
    whole = yaml.safe_load(metadata_text(summary, {'a': 'b'}))
    record = yaml.safe_load(metadata_text(summary, {'a': 'b'}, root=False))
    assert record == whole['rosbag2_bagfile_information']


def test_missing_custom_data_are_written_as_null(summary):
    record = yaml.safe_load(metadata_text(summary, {}, root=False))
    assert record['custom_data'] is None


def test_metadata_hold_ros_distro_of_the_environment(summary, monkeypatch):
    monkeypatch.setenv('ROS_DISTRO', 'kilted')
    assert yaml.safe_load(metadata_text(summary, {}, root=False))['ros_distro'] == 'kilted'


@pytest.mark.parametrize(
    'change',
    [
        {},
        {'history': 'keep_all', 'depth': 0},
        {'reliability': 'best_effort', 'durability': 'transient_local'},
        {'deadline': 1_500_000_000, 'lifespan': 0, 'liveliness_lease_duration': 7},
        {'liveliness': 'manual_by_topic', 'avoid_ros_namespace_conventions': True},
    ],
)
def test_qos_profile_survives_writing_and_reading(change):
    profile = replace(QosProfile(), **change)
    assert QosProfile.from_mapping(yaml.safe_load(qos_text(profile))[0]) == profile


def test_numeric_qos_of_older_bags_is_read():
    numbers = {'history': 1, 'reliability': 2, 'durability': 1, 'liveliness': 1}
    assert QosProfile.from_mapping({**QOS, **numbers}) == QosProfile(
        reliability='best_effort', durability='transient_local'
    )


def test_old_metadata_stay_whole_on_a_full_disk(summary, monkeypatch):
    write_metadata(summary, {})
    before = (summary.folder / 'metadata.yaml').read_bytes()

    def full(descriptor):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr('os.fsync', full)
    with pytest.raises(OSError, match='No space left'):
        write_metadata(replace(summary, start=NO_START), {})
    assert [path.name for path in summary.folder.iterdir()] == ['metadata.yaml']
    assert (summary.folder / 'metadata.yaml').read_bytes() == before
    assert Path(summary.folder, 'metadata.yaml').stat().st_size == len(before)


def test_metadata_keys_stand_in_the_order_of_rosbag2(summary):
    # rosbag2_storage's yaml.hpp: of a file first when it begins, of the whole bag first how long.
    information = yaml.safe_load(metadata_text(summary, {}))['rosbag2_bagfile_information']
    assert list(information)[:5] == [
        'version', 'storage_identifier', 'duration', 'starting_time', 'message_count',
    ]  # fmt: skip
    (file,) = information['files']
    assert list(file) == ['path', 'starting_time', 'duration', 'message_count']
