"""The recorder keeps what led to a fault or a mark, though nobody records."""

import json
import resource
import time

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from recorded_session import DIAGNOSTICS, SERVO, STATE, RecordedSession
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from simulated_graph import SimulatedGraph
from std_msgs.msg import Header, String

from endoscope_bags import open_bag
from endoscope_bags.cdr import encode_joint_state
from endoscope_bags.event_bag import event_bags, events_of
from endoscope_bags.recording import kind_of_bag
from endoscope_bringup.cli import main
from endoscope_core.rig import Kind
from endoscope_nodes.names import MOTION_SESSION, MOTOR_MEASURED, RECORDER_MARK
from endoscope_nodes.nodes.instrument_model import InstrumentModelNode
from endoscope_nodes.nodes.recorder import RecorderNode
from endoscope_nodes.runtime.diagnostics import ERROR, OK
from endoscope_nodes.runtime.qos import EVENT, RESULT, SENSOR_OFFERED

CAUSE = 'tension of wire_x_pos is 41.2 N'
TOPICS = [SERVO, STATE, DIAGNOSTICS, f'/endoscope/{MOTION_SESSION}', f'/endoscope/{RECORDER_MARK}']


class WatchedSession(RecordedSession):
    """A recorder that records nothing, a stream it hears, and a supervisor's words."""

    def __init__(self, folder, **parameters):
        given = {'bag': str(folder / 'bag'), 'autostart': False, 'topics': TOPICS}
        super().__init__(**given | parameters)
        self.folder = folder
        self.stamps = []  # of what was sent
        self.servo = self.publisher(JointState, SERVO, SENSOR_OFFERED)
        self.state = self.publisher(String, STATE, RESULT)
        self.health = self.publisher(DiagnosticArray, DIAGNOSTICS, EVENT)
        self.session = self.publisher(Header, f'/endoscope/{MOTION_SESSION}', EVENT)
        self.marks = self.publisher(String, f'/endoscope/{RECORDER_MARK}', EVENT)
        self.probe.create_timer(0.002, self._stream)

    def _stream(self):
        stamp = time.time_ns()
        self.servo.publish(encode_joint_state(['motor_x'], stamp, position=[float(self.sent)]))
        self.stamps.append(stamp)

    @property
    def sent(self):
        return len(self.stamps)

    def say(self, state):
        self.state.publish(String(data=state))
        self.wait(lambda: self.recorder.bags.events.state == state)

    def fault(self, cause=CAUSE):
        self.say('ENABLED')
        self.say('FAULT')
        if cause:
            values = [KeyValue(key='cause', value=cause)]
            name = '/endoscope/supervisor: operating state'
            status = DiagnosticStatus(name=name, level=ERROR, message=cause, values=values)
            self.health.publish(DiagnosticArray(status=[status]))

    def kept(self):
        self.wait(lambda: self.recorder.bags.events.events)
        self.wait(lambda: not self.recorder.bags.events.events)
        return event_bags(self.folder)

    def said(self):
        level, message, _ = self.recorder._report_events()
        return level, message


def test_a_fault_is_kept_with_what_came_before_and_its_reason(tmp_path):
    with WatchedSession(tmp_path) as session:
        session.session.publish(Header(frame_id='session-17'))
        session.serve(1.0)
        session.fault()
        before = session.sent
        [path] = session.kept()
        # It lasts, and is told again and again: no second one.
        for _ in range(5):
            session.say('FAULT')
            session.serve(0.05)
        assert event_bags(tmp_path) == [path]
        assert session.said()[0] == OK
    assert session.runtime.exit_code == 0
    assert path.name.startswith('fault-')
    bag = open_bag(path)
    [event] = events_of(bag.metadata)
    assert (event.kind, event.reason) == ('fault', CAUSE)
    series = bag.joint_state('motor/servo_jp')
    assert series.position[:, 0].tolist() == list(range(len(series)))
    assert len(series) > before
    assert len(series) >= np.searchsorted(session.stamps, event.at_ns + 1.9e9)
    # Nothing came from a recording: nobody has begun one.
    assert not (tmp_path / 'bag').exists()
    with AnyReader([path]) as reader:
        assert {c.topic: c.msgcount for c in reader.connections}[SERVO] == len(series)


def test_two_faults_within_two_seconds_have_a_bag_each_and_a_mark_is_noted_in_one(tmp_path):
    second = 'motor_driver: device: overload'
    with WatchedSession(tmp_path, keep=0.5) as session:
        session.session.publish(Header(frame_id='session-17'))
        session.serve(1.0)
        session.fault()
        session.wait(lambda: session.recorder.bags.events.events[0].session)
        session.fault(second)
        session.wait(lambda: len(session.recorder.bags.events.events) == 2)
        # A third one is noted beside the second: no more than two are written at a time.
        session.fault(second)
        session.marks.publish(String(data='  the wire has slipped '))
        paths = session.kept()
    bags = [open_bag(path) for path in paths]
    told = [[e.reason for e in events_of(bag.metadata)] for bag in bags]
    assert sorted(told) == sorted([[CAUSE], [second, second, 'the wire has slipped']])
    for bag in bags:
        [*_, last] = events_of(bag.metadata)
        assert bag.times(f'/endoscope/{MOTION_SESSION}').log_ns[0] == bag.start_ns
        numbers = bag.joint_state('motor/servo_jp').position[:, 0]
        assert (np.diff(numbers) == 1).all()
        assert bag.end_ns - last.at_ns >= 1.9e9


def test_a_recording_goes_on_beside_it_and_loses_nothing(tmp_path):
    with WatchedSession(tmp_path) as session:
        session.serve(0.5)
        session.recorder.start()
        first = session.sent
        session.fault()
        session.kept()
        report = session.recorder.stop()
    assert report.complete, report
    series = open_bag(tmp_path / 'bag').joint_state('motor/servo_jp')
    numbers = series.position[:, 0].tolist()
    assert numbers == [numbers[0] + k for k in range(len(numbers))]
    assert numbers[0] >= first - 2


def test_a_node_that_ends_finishes_what_it_writes(tmp_path):
    with WatchedSession(tmp_path) as session:
        session.serve(0.5)
        session.marks.publish(String())
        session.wait(lambda: session.recorder.bags.events.events)
    [path] = event_bags(tmp_path)
    bag = open_bag(path)
    assert [(e.kind, e.reason) for e in events_of(bag.metadata)] == [('mark', 'by the operator')]
    assert bag.topics[SERVO].message_count > 100


def test_no_more_than_allowed_or_than_the_disk_has_room_for_is_written_and_that_is_said(tmp_path):
    with WatchedSession(tmp_path, keep_bags=1) as session:
        session.fault(cause='')
        [path] = session.kept()
        # It is kept, though nobody tells a reason.
        [event] = events_of(open_bag(path).metadata)
        assert (event.kind, event.reason) == ('fault', '')
        session.fault()
        session.wait(lambda: session.said()[0] == ERROR)
        assert 'has 1 bags of faults and marks already: read them' in session.said()[1]
        assert event_bags(tmp_path) == [path]
        path.rename(tmp_path / 'read')
        session.serve(1.0)
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, hard))
        try:
            session.fault()
            [full] = session.kept()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        level, message = session.said()
        assert level == ERROR
        assert 'File too large; recording ended there' in message
        assert CAUSE in message
        assert [e.reason for e in events_of(open_bag(full).metadata)] == [CAUSE]
        # The next one has room again.
        full.rename(tmp_path / 'full')
        session.fault()
        session.kept()
        assert session.said()[0] == OK


def test_nothing_is_kept_where_nobody_wants_it(tmp_path):
    with WatchedSession(tmp_path, keep=0.0) as session:
        session.state.publish(String(data='ENABLED'))
        session.state.publish(String(data='FAULT'))
        session.serve(0.5)
        # A recording that is begun now still has what is in force.
        session.recorder.start()
        session.wait_for({STATE: 1})
    assert event_bags(tmp_path) == []
    bag = open_bag(tmp_path / 'bag')
    assert [m.data for _, m in bag.decoded(STATE)] == ['FAULT']


@pytest.fixture(scope='module')
def of_the_graph(tmp_path_factory):
    """Bags of a fault of the whole graph, long after what is latched was said, and of another."""
    folder = tmp_path_factory.mktemp('graph')
    overrides = {
        'recorder': {'bag': str(folder / 'bag'), 'autostart': False, 'keep': 3.0},
        # Load cells may fall silent.
        'simulation_clock': {'wait_for': [MOTOR_MEASURED]},
    }
    extra = (InstrumentModelNode, RecorderNode)
    with SimulatedGraph(extra=extra, overrides=overrides) as graph:
        graph.enable()
        graph.calibrate()
        graph.advance(5.0)
        graph.set('load_cells', connected=False)
        graph.advance(4.0)
        assert graph.state == 'FAULT'
        cause = graph.cause
        graph.set('load_cells', connected=True)
        graph.advance(0.5)
        graph.enable()
        # Between what the supervisor says of itself once a second.
        graph.advance(1.3)
        graph.set('load_cells', connected=False)
        while graph.state != 'FAULT':
            graph.advance(0.02)
        graph.set('load_cells', connected=True)
        graph.advance(0.1)
        graph.enable()
        graph.advance(3.0)
    return folder, cause


def test_a_fault_of_the_graph_tells_its_cause_though_it_is_left_at_once(of_the_graph, capsys):
    folder, cause = of_the_graph
    events = [events_of(open_bag(path).metadata) for path in event_bags(folder)]
    [[event], [left]] = sorted(events, key=lambda found: found[0].at_ns)
    assert (event.kind, event.reason) == ('fault', cause)
    assert left.reason.startswith('wires/measured_js'), left
    assert main(['bag', 'list', str(folder), '--json']) == 0
    told = [entry['events'][0] for entry in json.loads(capsys.readouterr().out)]
    assert [entry['kind'] for entry in told] == ['fault', 'fault']
    assert cause in [entry['reason'] for entry in told]


def test_what_was_latched_long_before_stands_at_its_beginning(of_the_graph):
    folder, _ = of_the_graph
    [path, _] = sorted(event_bags(folder), key=lambda path: open_bag(path).start_ns)
    [file] = path.glob('*.mcap')
    # The file alone.
    bag = open_bag(file)
    for topic in (
        *('rig/kind', 'calibration/result', 'calibration/numbers', 'compensator/state'),
        *('robot_description', 'slave/operating_state', 'slave/motion_session'),
    ):
        assert bag.times(bag.find(topic, 'endoscope')).log_ns[0] == bag.start_ns, topic
    assert kind_of_bag(bag).kind is Kind.SIMULATED
    session = next(m.frame_id for _, m in bag.decoded(bag.find('slave/motion_session')))
    assert session.startswith('session-')
