"""What the launch file starts, by stand-ins that note: no package index has `launch`.

Each stand-in is a word and its arguments; the test evaluates those few that the file uses.
"""

import ast
import runpy
import sys
from types import ModuleType, SimpleNamespace

import pytest
from doc_pages import WORKSPACE

from endoscope_nodes.program import PROGRAMS
from endoscope_nodes.runtime.node_parameters import OF_NODE, BeatParameters
from endoscope_nodes.runtime.parameters import described

FILE = WORKSPACE / 'src/endoscope_bringup/launch/endoscope.launch.py'


def _noted(word: str):
    return lambda *args, **named: SimpleNamespace(word=word, args=args, named=named)


@pytest.fixture
def actions(monkeypatch):
    for node in ast.walk(ast.parse(FILE.read_text())):
        if isinstance(node, ast.ImportFrom):
            module = sys.modules.get(node.module, ModuleType(node.module))
            for name in node.names:
                setattr(module, name.name, _noted(name.name))
            monkeypatch.setitem(sys.modules, node.module, module)
    [actions] = runpy.run_path(str(FILE))['generate_launch_description']().args
    return actions


def _value(thing, given):
    if not isinstance(thing, SimpleNamespace):
        return thing
    values = [_value(arg, given) for arg in thing.args]
    match thing.word:
        case 'LaunchConfiguration':
            return given[values[0]]
        case 'EqualsSubstitution':
            return str(values[0] == values[1]).lower()
        case 'NotSubstitution':
            return str(values[0] != 'true').lower()
        case 'AndSubstitution':
            return str(values == ['true', 'true']).lower()
        case _:
            return values[0]


def _started(actions, **given):
    """What is started with these arguments: name, namespace and parameters of each program."""
    declared = {a.args[0]: a.named for a in actions if a.word == 'DeclareLaunchArgument'}
    given = {name: how['default_value'] for name, how in declared.items()} | given
    assert all(given[n] in how['choices'] for n, how in declared.items() if 'choices' in how)
    found = []

    def go(actions, parameters):
        for action in actions:
            condition = action.named.get('condition')
            if condition is not None and _value(condition, given) != 'true':
                continue
            if action.word == 'SetParameter':
                parameters[action.args[0]] = action.args[1]
            elif action.word == 'GroupAction':
                go(action.args[0], dict(parameters))
            elif action.word == 'Node':
                named = action.named
                own = {name: _value(v, given) for name, v in named['parameters'][1].items()}
                namespace = _value(named['namespace'], given)
                found.append((named['executable'], namespace, parameters | own))

    go(actions, {})
    return found


def test_namespace_rig_and_plant_reach_every_program(actions) -> None:
    nodes = {one.name: node for node, one in PROGRAMS.items() if node != 'replay'}
    given = {'namespace': 'left', 'rig_file': 'rig.yaml', 'plant_file': 'plant.yaml'}
    for processes, programs in (('one', {'graph'}), ('many', set(nodes))):
        started = _started(actions, processes=processes, **given)
        assert {name for name, _, _ in started} == programs
        for name, namespace, parameters in started:
            assert namespace == 'left'
            assert {
                'rig_file': 'rig.yaml',
                'plant_file': 'plant.yaml',
            }.items() <= parameters.items()
            kinds = (BeatParameters, *OF_NODE.get(nodes.get(name, name), ()))
            known = {one.name for kind in kinds for one in described(kind)}
            assert set(parameters) <= known | {'use_sim_time'}


def test_each_clock_can_be_asked_for_and_one_process_decides_for_itself(actions) -> None:
    [(_, namespace, parameters)] = _started(actions)
    assert namespace == 'endoscope'
    assert 'use_sim_time' not in parameters
    [(_, _, parameters)] = _started(actions, real_time='true')
    assert parameters['use_sim_time'] is False
    assert all(p['use_sim_time'] for _, _, p in _started(actions, processes='many'))
    started = _started(actions, processes='many', real_time='true')
    assert not any(p['use_sim_time'] for _, _, p in started)
    assert 'simulation_clock' not in {name for name, _, _ in started}
