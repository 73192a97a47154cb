import pytest

from endoscope_core.safety import OperatingState, OperatingStateMachine

NOW = 5_000_000_000


def machine_in(state):
    machine = OperatingStateMachine()
    paths = {
        OperatingState.DISABLED: [],
        OperatingState.ENABLED: ['enable'],
        OperatingState.PAUSED: ['enable', 'pause'],
        OperatingState.FAULT: ['enable'],
    }
    for command in paths[state]:
        assert machine.command(command, NOW).accepted
    if state is OperatingState.FAULT:
        machine.report_cause('heat', 'too hot')
        machine.clear_cause('heat')
    assert machine.state is state
    return machine


@pytest.mark.parametrize(
    ('start', 'command', 'end'),
    [
        (OperatingState.DISABLED, 'enable', OperatingState.ENABLED),
        (OperatingState.ENABLED, 'pause', OperatingState.PAUSED),
        (OperatingState.PAUSED, 'resume', OperatingState.ENABLED),
        (OperatingState.PAUSED, 'disable', OperatingState.DISABLED),
        (OperatingState.ENABLED, 'disable', OperatingState.DISABLED),
        (OperatingState.ENABLED, 'home', OperatingState.ENABLED),
        (OperatingState.FAULT, 'enable', OperatingState.ENABLED),
        (OperatingState.FAULT, 'disable', OperatingState.DISABLED),
    ],
)
def test_commands_that_are_carried_out(start, command, end):
    machine = machine_in(start)
    assert machine.command(command, NOW).accepted
    assert machine.state is end


@pytest.mark.parametrize(
    ('start', 'command'),
    [
        (OperatingState.DISABLED, 'pause'),
        (OperatingState.DISABLED, 'resume'),
        (OperatingState.DISABLED, 'home'),
        (OperatingState.PAUSED, 'enable'),
        (OperatingState.PAUSED, 'home'),
        (OperatingState.FAULT, 'resume'),
        (OperatingState.FAULT, 'pause'),
        (OperatingState.ENABLED, 'go'),
        (OperatingState.ENABLED, ''),
    ],
)
def test_commands_that_are_refused_change_nothing(start, command):
    machine = machine_in(start)
    answer = machine.command(command, NOW)
    assert not answer.accepted
    assert answer.reason
    assert machine.state is start


@pytest.mark.parametrize('start', [OperatingState.ENABLED, OperatingState.PAUSED])
def test_fault_latches_until_the_cause_is_gone_and_enable_is_given(start):
    machine = machine_in(start)
    assert machine.report_cause('wire', 'wire_x_pos is broken')
    assert machine.state is OperatingState.FAULT
    refused = machine.command('enable', NOW)
    assert not refused.accepted
    assert 'wire_x_pos is broken' in refused.reason
    machine.clear_cause('wire')
    assert machine.state is OperatingState.FAULT
    assert machine.cause == 'wire_x_pos is broken'
    assert machine.command('enable', NOW).accepted
    assert machine.cause == ''


def test_a_cause_forbids_enabling_from_the_start():
    machine = OperatingStateMachine()
    assert not machine.report_cause('motor', 'motor is silent')
    assert machine.state is OperatingState.DISABLED
    assert not machine.command('enable', NOW).accepted


def test_first_cause_is_kept():
    machine = machine_in(OperatingState.ENABLED)
    machine.report_cause('a', 'first')
    assert not machine.report_cause('b', 'second')
    assert machine.cause == 'first'
    assert set(machine.present_causes) == {'a', 'b'}


def test_every_enable_names_a_session_that_never_was():
    machine, names = OperatingStateMachine(), []
    for _ in range(3):
        machine.command('enable', 7_000_000_000)
        names.append(machine.session)
        machine.command('disable', 7_000_000_000)
        assert machine.session == ''
    later = OperatingStateMachine()
    later.command('enable', 7_010_000_000)
    assert [*names, later.session] == [f'session-{n}' for n in (7000, 7001, 7002, 7010)]


def test_enabling_again_keeps_the_session_and_a_fault_ends_it():
    machine = OperatingStateMachine()
    machine.command('enable', 1_000_000_000)
    machine.command('enable', 2_000_000_000)
    assert machine.session == 'session-1000'
    machine.report_cause('heat', 'too hot')
    assert machine.session == ''
