"""What a page may say: a few orders, and nothing else."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from endoscope_console.orders import (
    Adopt,
    Claim,
    Consent,
    Explain,
    Investigate,
    MalformedOrderError,
    Mark,
    Set,
    StateOrder,
    read_hello,
    read_order,
)


def test_orders_are_read():
    assert read_order('{"op":"claim","id":1}') == Claim(1)
    assert read_order('{"op":"claim","id":2,"take":true}') == Claim(2, take=True)
    assert read_order('{"op":"state","id":3,"command":"home"}') == StateOrder(3, 'home')
    assert read_order('{"op":"set","id":4,"scale":0.5}') == Set(4, scale=0.5)
    assert read_order('{"op":"explain","id":5,"bag":"b","plant":null}') == Explain(5, 'b')
    assert read_order('{"op":"mark","id":6}') == Mark(6, reason='')
    assert read_order('{"op":"adopt","id":7,"plant":null}') == Adopt(7)
    assert read_order('{"op":"investigate","id":8,"experiments":0}') == Investigate(8, 0)
    assert read_order('{"op":"consent","id":9,"question":"q1","go":true}') == Consent(9, 'q1', True)
    assert read_hello('{"op":"hello","token":"x"}').token == 'x'


@pytest.mark.parametrize(
    'text',
    [
        '',
        'claim',
        '{}',
        '[]',
        '{"op":"claim"}',
        '{"op":"claim","id":-1}',
        '{"op":"claim","id":1,"take":1}',
        '{"op":"claim","id":1,"more":1}',
        '{"op":"shutdown","id":1}',
        '{"op":"hello","token":"x"}',
        '{"op":"state","id":1,"command":"fly"}',
        '{"op":"set","id":1}',
        '{"op":"set","id":1,"scale":0.5,"compensator":"none"}',
        '{"op":"set","id":1,"scale":NaN}',
        '{"op":"set","id":1,"scale":1e9}',
        '{"op":"set","id":1,"scale":"0.5"}',
        '{"op":"set","id":1,"compensator":"magic"}',
        '{"op":"record","id":1,"on":"yes"}',
        '{"op":"explain","id":1,"bag":""}',
        '{"op":"investigate","id":1,"experiments":-1}',
        '{"op":"consent","id":1,"question":"q1","go":"yes"}',
        '{"op":"claim","id":1' + '[' * 4000,
    ],
)
def test_anything_else_is_none(text):
    with pytest.raises(MalformedOrderError, match='no order'):
        read_order(text)


@given(st.text() | st.recursive(st.none() | st.integers() | st.text(), st.lists).map(json.dumps))
def test_no_text_gets_any_further(text):
    with pytest.raises(MalformedOrderError):
        read_order(text)
    with pytest.raises(MalformedOrderError):
        read_hello(text)
