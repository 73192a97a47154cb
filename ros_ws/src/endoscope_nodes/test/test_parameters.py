import math
from dataclasses import dataclass

import pytest
from rclpy.context import Context
from rclpy.parameter import Parameter

from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.parameters import ParameterError, parameter
from endoscope_nodes.runtime.runtime import Runtime


@dataclass(frozen=True)
class Settings:
    gain: float = parameter(1.0, 'a number', unit='rad', low=0.0, high=3.0, dynamic=True)
    count: int = parameter(3, 'a whole number', low=1)
    on: bool = parameter(True, 'a switch')
    mode: str = parameter('none', 'a choice', choices=('none', 'bouc_wen'))
    names: tuple[str, ...] = parameter(('a', 'b'), 'texts')


class Example(EndoscopeNode):
    def __init__(self, runtime):
        super().__init__('example', runtime)
        self.changes = []
        self.settings = self.parameters(Settings, self.changes.append, self._check)

    def _check(self, settings):
        if settings.gain == 2.5:
            raise ParameterError('example: 2.5 is unlucky')


class Other(EndoscopeNode):
    def __init__(self, runtime):
        super().__init__('other', runtime)


def start(*factories, args=(), **overrides):
    runtime = Runtime(['--ros-args', *args], Context(), 230, overrides)
    try:
        nodes = [runtime.add(factory) for factory in factories]
        runtime.check_parameters()
    except ParameterError:
        runtime.close()
        raise
    return runtime, nodes


def test_overrides_reach_the_dataclass():
    runtime, (node,) = start(Example, example={'gain': 2, 'names': ['x'], 'mode': 'bouc_wen'})
    with runtime:
        assert node.settings == Settings(gain=2.0, names=('x',), mode='bouc_wen')
        assert node.describe_parameter('gain').description == 'a number [rad]'
        assert node.describe_parameter('gain').additional_constraints == 'from 0 to 3'


@pytest.mark.parametrize(
    ('overrides', 'words'),
    [
        ({'gain': math.nan}, "'gain' is nan; give a finite number, from 0 to 3"),
        ({'gain': math.inf}, "'gain' is inf"),
        ({'gain': -0.1}, "'gain' is -0.1"),
        ({'gain': 'much'}, "'gain' is 'much'; give a finite number"),
        ({'gain': True}, "'gain' is True"),
        ({'count': 1.5}, "'count' is 1.5; give a whole number"),
        ({'on': 1}, "'on' is 1; give true or false"),
        ({'mode': 'bouc_wem'}, 'did you mean bouc_wen'),
        ({'names': 'x'}, "'names' is 'x'; give a list"),
        ({'gian': 1.0}, "unknown parameter 'gian'; did you mean gain"),
    ],
)
def test_each_mistake_is_one_clear_error(overrides, words):
    with pytest.raises(ParameterError, match=r'^example: ') as caught:
        start(Example, example=overrides)
    assert words in str(caught.value)
    assert '\n' not in str(caught.value)


def test_parameters_for_a_node_that_is_not_there_are_an_error():
    with pytest.raises(ParameterError, match="'exampel', but only example"):
        start(Example, exampel={'gain': 1.0})


def test_one_for_all_must_be_known_to_one_only():
    runtime, nodes = start(Example, Other, args=['-p', 'gain:=2.0'])
    with runtime:
        assert nodes[0].settings.gain == 2.0
    with pytest.raises(ParameterError, match='gian'):
        start(Example, Other, args=['-p', 'gian:=2.0'])


def test_a_dynamic_parameter_changes_and_a_wrong_value_does_not():
    runtime, (node,) = start(Example)
    with runtime:
        assert node.set_parameters([Parameter('gain', value=2.0)])[0].successful
        assert node.changes == [Settings(gain=2.0)]
        for bad in (math.nan, 9.0, 2.5):
            assert not node.set_parameters([Parameter('gain', value=bad)])[0].successful
        assert not node.set_parameters([Parameter('count', value=5)])[0].successful
        assert node.changes == [Settings(gain=2.0)]
