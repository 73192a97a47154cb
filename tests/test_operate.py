"""`endoscope operate` and `endoscope topics` beside the whole graph: answers and exit statuses.

What all of it says where all is well is shown by pages that are run: `README.md`, `operating.md`.
"""

import json
import math
import signal
from pathlib import Path

import pytest
from operated_graph import OperatedGraph
from std_msgs.msg import String

from endoscope_bringup.cli import main
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.qos import EVENT


@pytest.fixture(scope='module')
def graph(tmp_path_factory):
    with OperatedGraph(tmp_path_factory.mktemp('operated')) as graph:
        yield graph


@pytest.fixture(autouse=True)
def disabled(request):
    yield
    if 'graph' in request.fixturenames:
        request.getfixturevalue('graph').command('disable')


def operate(graph, *words):
    status, out, errors = graph.run('operate', *words)
    assert 'Traceback' not in errors, errors
    return status, (out + errors).strip()


def test_what_the_supervisor_refuses_is_reported_with_its_reason(graph):
    possible = '; possible are enable, disable'
    assert operate(graph, 'pause') == (1, f"pause: 'pause' is not possible in DISABLED{possible}")
    assert operate(graph, 'home') == (1, f"home: 'home' is not possible in DISABLED{possible}")
    status, answer = operate(graph, 'calibrate')
    assert status == 1
    assert answer == 'calibrate: no motion session is open: the slave has to be ENABLED'


def test_enable_is_refused_while_a_cause_is_present(graph):
    graph.set('load_cells', connected=False)
    graph.advance(1.0)
    status, answer = operate(graph, 'enable')
    assert status == 1
    assert answer.startswith('enable: not enabled: ')
    assert 'wires/measured_js' in answer or 'load_cells' in answer
    status, answer = operate(graph, 'status')
    assert status == 0
    assert 'DISABLED: cannot be enabled: ' in answer
    graph.set('load_cells', connected=True)
    graph.advance(1.0)
    assert operate(graph, 'enable')[0] == 0


@pytest.mark.parametrize(
    'number', [signal.SIGINT, pytest.param(signal.SIGHUP, marks=pytest.mark.nightly)]
)
def test_whoever_interrupts_a_calibration_pauses_the_graph(graph, number):
    assert operate(graph, 'enable')[0] == 0
    process = graph.start('operate', 'calibrate', '--timeout', '60')
    graph.until(lambda: graph.nodes['calibration'].active)
    graph.advance(0.5)
    process.send_signal(number)
    status, _, errors = graph.finish(process)
    assert status == 128 + number
    assert {'returning to zero', 'resting'} & set(errors.splitlines()), 'it shows its progress'
    assert 'the graph is PAUSED' in errors
    assert graph.state == 'PAUSED'
    assert not graph.nodes['calibration'].active


@pytest.mark.parametrize(
    ('words', 'status', 'answer'),
    [
        (['get', 'compensator.mod'], 2, 'no parameter compensator.mod; did you mean mode?'),
        (
            ['set', 'mode', 'none'],
            2,
            "endoscope: 'mode': give NODE.PARAMETER, for example compensator.mode",
        ),
        (['set', 'master.scale', 'big'], 2, "endoscope: master.scale is a number, not 'big'"),
        (['set', 'controller.active', '1'], 2, 'controller.active is true or false'),
        (['set', 'master.scale', '100'], 1, "'scale' is 100.0; give a finite number, from 0.01"),
        (['set', 'compensator.mode', 'physicl'], 1, 'did you mean physical?'),
        (['set', 'motor_driver.tick_rate', '100'], 1, 'read-only'),
    ],
)
def test_wrong_names_and_values_are_distinguished_from_refused_ones(graph, words, status, answer):
    given, text = operate(graph, *words)
    assert given == status, text
    assert answer in text
    assert len(text.splitlines()) == 1


def test_the_parameters_of_a_node_are_listed_with_their_values_and_ranges(graph):
    status, out, _ = graph.run('operate', 'get', 'compensator')
    assert status == 0
    [mode] = [line for line in out.splitlines() if line.startswith('compensator.mode ')]
    assert '= bouc_wen' in mode
    assert 'physical' in mode
    status, out, _ = graph.run('operate', 'get', 'master', '--json')
    parameters = json.loads(out)['parameters']
    assert parameters['scale']['value'] == 1.0
    assert 'from 0.01' in parameters['scale']['description']
    assert not [name for name in parameters if name.startswith('qos_overrides')]
    status, _, errors = graph.run('operate', 'get', 'compensater.mode', timeout=1)
    assert status == 2
    assert errors.strip().endswith('; did you mean compensator?')


def test_parameters_are_set_by_their_own_type_and_can_be_read_again(graph):
    for name, text, value, before in (
        ('compensator.mode', 'physical', 'physical', 'bouc_wen'),
        ('master.scale', '1', 1.0, 0.5),
        ('master.joints', 'bend_x', ['bend_x'], ['bend_x', 'bend_y']),
        ('master.joints', '[bend_x, bend_y]', ['bend_x', 'bend_y'], ['bend_x']),
        ('controller.active', 'false', False, True),
    ):
        node, _, parameter = name.partition('.')
        graph.set(node, **{parameter: before})
        status, answer = operate(graph, 'set', name, text)
        assert status == 0, answer
        assert answer.startswith(f'{name} = ')
        status, out, _ = graph.run('operate', 'get', name, '--json')
        assert status == 0
        assert json.loads(out)['value'] == value
    graph.set('compensator', mode='bouc_wen')
    graph.set('controller', active=True)


def test_what_only_a_device_can_do_is_refused_by_the_simulated_slave(graph):
    status, answer = operate(graph, 'tare')
    assert (status, answer) == (1, 'tare: simulated cells have no zero to find')
    status, out, errors = graph.run('operate', 'reboot', timeout=1)
    assert (status, out) == (1, '')
    assert errors.startswith('reboot: nobody serves motor/reboot in ')


def test_a_recording_is_begun_and_ended(graph, tmp_path):
    bag = tmp_path / 'bag'
    assert operate(graph, 'record', 'stop') == (1, 'record stop: not recording')
    assert operate(graph, 'set', 'recorder.bag', str(bag))[0] == 0
    assert operate(graph, 'record', 'start') == (0, f'recording to {bag}')
    status, answer = operate(graph, 'record', 'start')
    assert status == 1
    ends = '`endoscope operate record stop` ends that'
    assert answer.startswith(f'record start: already recording to {bag}: {ends}')
    assert f'recording to {bag}' in operate(graph, 'status')[1]
    status, answer = operate(graph, 'record', 'stop')
    assert status == 0
    assert answer.startswith(f'{bag}: ')
    assert (bag / 'metadata.yaml').is_file()


def test_a_moment_is_marked_in_words(graph, tmp_path, capsys):
    assert operate(graph, 'set', 'recorder.bag', str(tmp_path / 'bag'))[0] == 0
    status, answer = operate(graph, 'record', 'mark', 'the wire has slipped')
    assert status == 0
    path = Path(answer.removeprefix('marked: what led to it goes to '))
    assert path.parent == tmp_path
    graph.until((path / 'metadata.yaml').is_file, 'the bag')
    assert main(['bag', 'list', str(tmp_path)]) == 0
    assert 'UTC: the wire has slipped' in capsys.readouterr().out
    status, answer = operate(graph, 'record', 'stop')
    assert (status, answer) == (1, 'record stop: not recording')
    assert main(['operate', 'record', 'stop', 'now']) == 2
    assert 'record stop takes no text; record mark does' in capsys.readouterr().err


def test_status_names_every_node_and_the_source_of_the_master(graph):
    status, out, _ = graph.run('operate', 'status')
    assert status == 0
    lines = {line.split()[0]: line for line in out.splitlines()}
    assert lines['state'].endswith('DISABLED; `endoscope operate enable` lets it move')
    assert lines['master'].split()[1:] == ['source', 'none'] or 'ok' in lines['master']
    for name in graph.nodes:
        assert name in out or name == 'simulation_clock'
    answer = json.loads(graph.run('operate', 'status', '--json')[1])
    assert answer['state'] == 'DISABLED'
    assert answer['master_source'] == 'none'
    assert answer['not_heard'] == []
    assert set(answer['nodes']) >= {'supervisor: operating state', 'calibration: procedure'}


@pytest.mark.parametrize('words', [['status'], ['get', 'master.scale'], ['calibrate']])
def test_without_a_graph_it_says_what_was_not_found(words, monkeypatch, capsys):
    domain = private_domain()
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
    assert main(['operate', *words, '--timeout', '0.5']) == 1
    assert capsys.readouterr().err == (
        f'{words[0]}: no graph answers in namespace /endoscope, ROS_DOMAIN_ID {domain}: '
        'start one with `graph`\n'
    )


# ---- topics


def test_topics_are_listed_with_senders_readers_and_what_is_missing(graph):
    status, out, errors = graph.run('topics')
    assert status == 0, errors
    rows = {line.split()[0]: line for line in out.splitlines()[1:]}
    assert 'sensor_msgs/msg/JointState' in rows['motor/servo_jp']
    assert 'compensator' in rows['motor/servo_jp']
    assert rows['slave/servo_jp'].endswith('master does not send it now')
    assert rows['master/measured_js'].endswith('no sender outside the graph')
    status, out, _ = graph.run('topics', '--json')
    rows = {row['topic']: row for row in json.loads(out)}
    assert rows['slave/operating_state']['senders'] == ['supervisor']
    assert {'motor_driver', 'recorder'} <= set(rows['motor/servo_jp']['readers'])
    status, _, errors = graph.run('topics', '--echo', 'wire/measured_js', timeout=1)
    assert status == 1
    assert errors.startswith('topics: nobody sends wire/measured_js in namespace /endoscope')
    assert 'did you mean wires/measured_js?' in errors


def test_what_a_topic_says_is_a_line_of_json_a_message(graph):
    status, out, errors = graph.run('topics', '--echo', 'wires/measured_js', '--count', '3')
    assert status == 0, errors
    tensions = [json.loads(line) for line in out.splitlines()]
    assert [len(tension['effort']) for tension in tensions] == [4, 4, 4]
    assert all(math.isfinite(n) for tension in tensions for n in tension['effort'])
    publisher = graph.speak(String, 'stranger', EVENT)
    process = graph.start('topics', '--echo', 'stranger', '--once', '--timeout', '60')
    while process.poll() is None:
        publisher.publish(String(data='\x1b]0;title\x07\u202egone\nforged: line'))
        graph.pace()
    out, _ = process.communicate()
    graph.probe.destroy_publisher(publisher)
    [line] = out.splitlines()
    assert line.isprintable()
    assert json.loads(line) == {'data': '\x1b]0;title\x07\u202egone\nforged: line'}
