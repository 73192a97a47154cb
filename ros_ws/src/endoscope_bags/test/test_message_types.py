"""Definitions and hashes of message types."""

import json
import sys
from pathlib import Path

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from endoscope_bags.message_types import (
    CLOCK,
    DIAGNOSTIC_ARRAY,
    JOINT_STATE,
    JOY,
    POSE_STAMPED,
    STRING,
    TF_MESSAGE,
    begins_with_header,
    message_type,
)

INTERFACE_TYPES = (JOINT_STATE, POSE_STAMPED, JOY, STRING, DIAGNOSTIC_ARRAY, CLOCK, TF_MESSAGE)


@pytest.mark.parametrize('name', INTERFACE_TYPES)
def test_the_definition_is_complete(name):
    parsed = get_types_from_msg(message_type(name).definition, name)
    store = get_typestore(Stores.EMPTY)
    store.register(parsed)
    assert store.hash_rihs01(name) == message_type(name).type_hash


def test_the_hash_of_joint_state_is_the_one_that_jazzy_announces():
    assert message_type(JOINT_STATE).type_hash == (
        'RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e'
    )


def test_installed_types_beyond_the_common_ones_are_found():
    folder = Path(sys.prefix) / 'share' / 'rmw_dds_common' / 'msg'
    if not folder.is_dir():
        pytest.skip('the messages of rmw_dds_common are not installed')
    kind = message_type('rmw_dds_common/msg/ParticipantEntitiesInfo')
    assert 'MSG: rmw_dds_common/NodeEntitiesInfo' in kind.definition
    hashes = json.loads((folder / 'ParticipantEntitiesInfo.json').read_text())['type_hashes']
    assert kind.type_hash in {entry['hash_string'] for entry in hashes}


@pytest.mark.parametrize(
    ('name', 'expected'), [(JOINT_STATE, True), (JOY, True), (STRING, False), (CLOCK, False)]
)
def test_types_with_a_header_are_recognised(name, expected):
    assert begins_with_header(message_type(name).definition) is expected


def test_comments_and_constants_before_the_header_are_passed_over():
    assert begins_with_header('# text\n\nuint8 OK=0\nstd_msgs/Header header\n')
