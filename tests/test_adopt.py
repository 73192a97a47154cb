"""`endoscope operate adopt` through the real nodes: tracking, refusals, undo."""

import json

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from operated_graph import OperatedGraph

from endoscope_bags import open_bag
from endoscope_core.physics import EffectSpec, PlantDescription, save_plant
from endoscope_nodes.client.plant_adoption import AdoptionRequest, PlantInForce
from endoscope_nodes.names import (
    COMPENSATOR_ADOPT,
    COMPENSATOR_PLANT,
    JOINTS,
    SLAVE_MEASURED,
)
from endoscope_nodes.runtime.qos import EVENT, RESULT

STOPS = tuple(
    EffectSpec('joint_stop', joint, {'angle_rad': 0.1, 'stiffness': 0.5}) for joint in JOINTS
)
EFFECTS = tuple(EffectSpec('gear_backlash', joint, {'gap_rad': 0.3}) for joint in JOINTS)


@pytest.fixture
def plants(tmp_path):
    for name, effects in (('described', ()), ('true', EFFECTS), ('stiff', STOPS)):
        save_plant(PlantDescription(effects=effects), tmp_path / f'{name}.yaml')
    return tmp_path


def refused(graph, *words):
    status, out, errors = graph.run('operate', 'adopt', *map(str, words), '--json')
    assert status == 1, out + errors
    return json.loads(out)['code']


def error_of_a_motion(graph):
    """Rms error in rad of the tip over a motion that is played from its beginning."""
    tips = graph.tips
    graph.set('master', source='motion', motion='non_periodic')
    graph.advance(2.0)
    tips.clear()
    graph.wanted.clear()
    graph.advance(4.0)
    graph.set('master', source='none')
    graph.advance(0.6)
    at = [w.stamp_ns for w in graph.wanted]
    wanted = np.array([w.position for w in graph.wanted])
    inside = [t for t in tips if at[0] <= t.stamp_ns <= at[-1]]
    desired = [[np.interp(t.stamp_ns, at, wanted[:, j]) for j in range(2)] for t in inside]
    return float(np.sqrt(np.mean((np.array([t.position for t in inside]) - desired) ** 2)))


def test_the_true_plant_is_adopted_and_undone_and_a_bag_has_them_all(plants):
    overrides = {'motor_driver': {'plant_file': str(plants / 'true.yaml')}}
    overrides['controller'] = {'active': False}
    with OperatedGraph(plants, **overrides) as graph:
        graph.tips = graph.listen(SLAVE_MEASURED, JOINTS)
        assert refused(graph, plants / 'true.yaml') == 'no_session'
        graph.enable()
        assert refused(graph, '--undo') == 'nothing_to_undo'
        for words in (('adopt', str(plants / 'described.yaml')), ('record', 'start')):
            status, out, errors = graph.run('operate', *words)
            assert status == 0, out + errors
        before = error_of_a_motion(graph)
        sent = graph.goals[-1].position
        status, out, errors = graph.run('operate', 'adopt', str(plants / 'true.yaml'), '--json')
        assert status == 0, out + errors
        assert graph.goals[-1].position == sent
        after = error_of_a_motion(graph)
        assert after < 0.5 * before
        graph.set('master', source='motion', motion='non_periodic')
        graph.advance(2.0)
        assert refused(graph, '--undo') == 'moving'
        graph.set('master', source='none')
        graph.advance(0.6)
        status, out, errors = graph.run('operate', 'adopt', '--undo', '--json')
        assert status == 0, out + errors
        again = error_of_a_motion(graph)
        assert again == pytest.approx(before, rel=0.3)
        status, out, errors = graph.run('operate', 'record', 'stop')
        assert status == 0, out + errors
    bag = open_bag(plants / 'bag')
    decoded = bag.decoded(bag.find(COMPENSATOR_PLANT))
    told = [PlantInForce.of_message(message) for _, message in decoded]
    described, true = ((plants / f'{name}.yaml').read_text() for name in ('described', 'true'))
    texts = [each.plant for each in told]
    assert list(dict.fromkeys(texts)) == [described, true]
    assert texts[-1] == described
    assert told[texts.index(true)].before == told[0].hash


def test_strangers_narrow_plants_and_faults_are_refused(plants, monkeypatch):
    told = []
    with OperatedGraph(plants) as graph:
        graph.probe.create_subscription(DiagnosticArray, COMPENSATOR_PLANT, told.append, RESULT)
        graph.enable()
        graph.set('master', source='motion', motion='non_periodic')
        graph.advance(2.0)
        graph.set('master', source='none')
        graph.advance(0.6)
        assert refused(graph, plants / 'stiff.yaml') == 'beyond_range'
        graph.advance(0.2)
        stranger = graph.speak(DiagnosticArray, COMPENSATOR_ADOPT, EVENT)
        text = (plants / 'true.yaml').read_text()
        stranger.publish(AdoptionRequest('1', text, 'of_somebody').message(graph.clock.now_ns))
        graph.advance(0.2)
        assert PlantInForce.of_message(told[-1]).code == 'other_session'
        # Asked no more before it is in force.
        for asked in (text, ''):
            request = AdoptionRequest('2', asked, graph.session)
            stranger.publish(request.message(graph.clock.now_ns))
        graph.advance(0.2)
        assert PlantInForce.of_message(told[-1]).code == 'withdrawn'
        assert PlantInForce.of_message(told[-1]).hash == ''
        assert refused(graph, plants / 'true.yaml') == 'other_sender'
        graph.probe.destroy_publisher(stranger)
        graph.connect()
        with monkeypatch.context() as lost:
            lost.setattr(AdoptionRequest, 'of_message', lambda message: None)
            words = ('operate', 'adopt', str(plants / 'true.yaml'))
            status, _, errors = graph.run(*words, timeout=3)
        assert status == 1
        assert 'the plant may still come into force' in errors
        graph.nodes['compensator']._session.leave('the test ends it')  # noqa: SLF001
        graph.advance(0.3)
        assert refused(graph, plants / 'true.yaml') == 'fault'
