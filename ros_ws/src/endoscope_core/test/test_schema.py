"""Files are read as dataclasses, and what does not fit is told with file, key, value and remedy."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

import pytest

from endoscope_core.errors import FileError
from endoscope_core.schema import Before, Number, load, one_of, read, within


@dataclass(frozen=True)
class Wheel:
    radius: Annotated[float, within(0.1, 2.0, 'm')]
    spokes: Annotated[int, within(0)] = 32

    def __post_init__(self):
        if self.spokes == 1:
            raise ValueError('one spoke breaks it: give none or more')


@dataclass(frozen=True)
class Cart:
    wheels: Mapping[Literal['left', 'right'], Wheel]
    colour: Annotated[str, one_of(['red', 'dark green'])] = 'red'
    load: float = 0.0
    limit: Annotated[float, within(0.0)] = 1.0
    size: tuple[float, float] | None = None
    weights: tuple[Number, ...] = ()
    sprung: bool = False
    kind: Literal[1, 2] = 1
    name: Annotated[str, Before(lambda value: value.strip())] = ''
    spare: Wheel = field(default_factory=lambda: Wheel(1.0))


LEFT = {'left': {'radius': 1}}


def test_what_is_left_out_or_empty_is_as_by_default():
    given = {'wheels': LEFT, 'weights': None, 'spare': None, 'size': None}
    assert read(Cart, given, 'file') == Cart({'left': Wheel(1.0)})


def test_what_is_given_is_taken_with_its_type():
    given = {
        'wheels': LEFT,
        'colour': 'dark green',
        'load': -3,
        'limit': math.inf,
        'size': [1, 2.5],
        'weights': ['1e-4', 2],
        'sprung': True,
        'kind': 2,
        'name': ' a ',
        'spare': LEFT['left'],
    }
    cart = read(Cart, given, 'file')
    assert cart == Cart(
        *({'left': Wheel(1.0)}, 'dark green', -3.0, math.inf, (1.0, 2.5), (1e-4, 2.0), True),
        *(2, 'a', Wheel(1.0)),
    )
    assert type(cart.load) is type(cart.wheels['left'].radius) is float


@pytest.mark.parametrize(
    ('given', 'told'),
    [
        (None, 'file is None: give a mapping with wheels, colour'),
        ([], 'file is []: give a mapping with wheels, colour'),
        ({}, 'file: wheels is missing: give a mapping'),
        ({'wheels': None}, 'file: wheels is None: give a mapping'),
        ({'wheels': LEFT, 'color': 'red'}, 'file: unknown key color: did you mean colour?'),
        ({'wheels': LEFT, 3: 'red'}, 'file: unknown key 3: valid are wheels, colour'),
        ({'wheels': {'lefd': {}}}, 'file: wheels: unknown key lefd: did you mean left?'),
        (
            {'wheels': {'left': None}},
            'wheels.left.radius is missing: give a number from 0.1 to 2 m',
        ),
        ({'wheels': {'left': {'radius': 3}}}, 'wheels.left.radius is 3: give a number from 0.1'),
        (
            {'wheels': {'left': {'radius': math.nan}}},
            'radius is nan: give a number from 0.1 to 2 m',
        ),
        ({'wheels': {'left': {'radius': True}}}, 'radius is True: give a number from 0.1 to 2 m'),
        ({'wheels': {'left': {'radius': '1'}}}, "radius is '1': give a number from 0.1 to 2 m"),
        ({'wheels': {'left': {'radius': 1, 'spokes': 1}}}, 'wheels.left: one spoke breaks it'),
        ({'wheels': {'left': {'radius': 1, 'spokes': -1}}}, 'is -1: give a whole number from 0 on'),
        ({'wheels': {'left': {'radius': 1, 'spokes': 4.0}}}, 'spokes is 4.0: give a whole number'),
        ({'wheels': LEFT, 'colour': 'blue'}, "colour is 'blue': give one of red, dark green"),
        ({'wheels': LEFT, 'colour': 'red\n'}, 'give one of red, dark green'),
        ({'wheels': LEFT, 'load': math.inf}, 'load is inf: give a finite number'),
        ({'wheels': LEFT, 'load': math.nan}, 'load is nan: give a finite number'),
        ({'wheels': LEFT, 'load': None}, 'load is None: give a number'),
        ({'wheels': LEFT, 'load': 10**400}, '...: give a number'),
        ({'wheels': LEFT, 'limit': math.nan}, 'limit is nan: give a number from 0 on'),
        ({'wheels': LEFT, 'size': [1]}, 'size is [1]: give a list of 2'),
        ({'wheels': LEFT, 'size': [1, 'a']}, "size[1] is 'a': give a number"),
        ({'wheels': LEFT, 'weights': {}}, 'weights is {}: give a list'),
        ({'wheels': LEFT, 'weights': ['few']}, "weights[0] is 'few': give a number"),
        ({'wheels': LEFT, 'sprung': 1}, 'sprung is 1: give true or false'),
        ({'wheels': LEFT, 'kind': 3}, 'kind is 3: give one of 1, 2'),
        ({'wheels': LEFT, 'kind': True}, 'kind is True: give one of 1, 2'),
    ],
)
def test_what_does_not_fit_is_told_with_its_key_and_a_remedy(given, told):
    with pytest.raises(FileError) as refused:
        read(Cart, given, 'file')
    assert str(refused.value).startswith('file')
    assert told in str(refused.value)


def test_a_file_is_named_with_what_it_is(tmp_path):
    path = tmp_path / 'cart.yaml'
    path.write_text('wheels: {left: {radius: 0}}')
    with pytest.raises(FileError, match=rf'cart {path}: wheels\.left\.radius is 0: give a number'):
        load(Cart, path, 'cart')
    path.write_text('wheels: {left: {radius: 1, radius: 1}}')
    with pytest.raises(FileError, match=rf'cart: {path} is not YAML: line 1: .*given twice'):
        load(Cart, path, 'cart')
