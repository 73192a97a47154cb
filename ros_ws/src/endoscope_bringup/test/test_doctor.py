"""`endoscope doctor` on emulated servos."""

import json

import pytest

from endoscope_bringup.cli import main
from endoscope_emulators.dynamixel.process import EmulatorProcess

SPEEDS = ['--baud', '57600', '1000000']


@pytest.fixture
def emulator():
    with EmulatorProcess() as emulator:
        yield emulator


def test_healthy_servos_need_no_change(emulator, capsys):
    assert main(['doctor', '--port', emulator.port, *SPEEDS]) == 0
    output = capsys.readouterr().out
    assert '2 servos' in output
    assert 'servo 1: XM430-W350, firmware 45, 1000000 baud, 12.0 V, 30 °C' in output
    assert 'latency timer none' in output
    assert 'change:' not in output


def test_errors_are_reported_with_advice(capsys):
    with EmulatorProcess(baud=57_600) as emulator:
        emulator.do('overload', 2)
        emulator.do('supply', 1, 9.0)
        assert main(['doctor', '--port', emulator.port, *SPEEDS]) == 1
        output = capsys.readouterr().out
        assert 'servo 1: supply of 9.0 V: give 10 to 14.8 V' in output
        assert 'servo 2: overload: remove the cause' in output
        assert 'set Baud Rate(8) to 3 (1 Mbaud)' in output
        arguments = ['--port', emulator.port, '--baud', '57600']
        assert main(['doctor', *arguments, '--reboot', '2']) == 0
        while emulator.state(2)['hardware']:
            pass


def test_a_line_without_servos_and_a_port_that_is_none(capsys, emulator):
    assert main(['doctor', '--port', emulator.port, '--baud', '57600']) == 1
    assert 'no servo answers' in capsys.readouterr().out
    assert main(['doctor', '--port', '/dev/ttyNone']) == 1
    assert 'there is no such port' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [(['--baud', '1234'], 'do not know 1234 baud'), (['--reboot', '1'], 'needs one --port')],
)
def test_wrong_usage_is_one_line(arguments, words, capsys):
    assert main(['doctor', '--port', '/dev/ttyNone', *arguments]) == 2
    assert words in capsys.readouterr().err


def test_findings_as_json(emulator, capsys):
    assert main(['doctor', '--json', '--port', emulator.port, *SPEEDS]) == 0
    [port] = json.loads(capsys.readouterr().out)
    servo = port['servos'][0]
    assert (servo['device'], servo['baud'], servo['model']) == (1, 1_000_000, 'XM430-W350')
    assert servo['voltage'] == 12.0
