"""What a recorder makes of messages, faults and marks as they come, without ROS."""

import pytest

from endoscope_bags import open_bag
from endoscope_bags.cdr import encode_joint_state
from endoscope_bags.errors import BagError
from endoscope_bags.event_bag import event_bags, events_of
from endoscope_bags.recent_messages import RecentMessages
from endoscope_bags.recorder import Recorder
from endoscope_bags.recording_session import Arrival
from endoscope_core.rig import shipped_rig

MS = 1_000_000
TOPIC = '/endoscope/motor/servo_jp'


class Graph:
    """A recorder, and one topic of which a message comes every 10 ms."""

    def __init__(self, folder, most=10, keep=5.0):
        self.folder, self.now_ns, self.sent, self.waiting = folder, 1_000 * MS, 0, []
        self.notes = []
        recent = RecentMessages(keep, 1_000_000)
        self.recorder = Recorder(
            shipped_rig(), recent, str(folder / 'bag'), most, self.collect, self.note
        )
        self.events = self.recorder.events
        self.add_topic(TOPIC)

    def add_topic(self, name):
        return self.recorder.add_topic(name, 'sensor_msgs/msg/JointState', tuple, lambda: 1)

    def note(self, words, failed):
        self.notes.append((words, failed))

    def collect(self):
        arrivals, self.waiting = self.waiting, []
        self.recorder.take(arrivals, (), self.now_ns, self.now_ns, stale=False)

    def go_on(self, seconds):
        for _ in range(round(100 * seconds)):
            self.now_ns += 10 * MS
            self.sent += 1
            data = encode_joint_state(['motor_x'], self.now_ns, position=[float(self.sent)])
            self.waiting.append(Arrival(self.now_ns, 0, self.sent, self.now_ns, data))
            if self.sent % 2:
                self.collect()

    def says(self, state):
        self.events.take_state(state, self.now_ns, self.now_ns)

    def reasons(self):
        return [
            [event.reason for event in events_of(open_bag(path).metadata)]
            for path in event_bags(self.folder)
        ]


@pytest.fixture
def graph(tmp_path):
    return Graph(tmp_path)


def test_a_fault_is_kept_with_what_came_before_and_after_and_its_cause(graph):
    graph.go_on(1.0)
    graph.says('ENABLED')
    graph.says('FAULT')
    graph.go_on(0.5)
    graph.events.explain('a wire')
    graph.says('FAULT')
    graph.go_on(3.0)
    assert graph.reasons() == [['a wire']]
    assert graph.events.last == str(event_bags(graph.folder)[0])
    positions = open_bag(graph.events.last).joint_state('motor/servo_jp').position[:, 0]
    assert positions[0] == 1.0
    assert len(positions) == pytest.approx(300, abs=4)
    assert [failed for _, failed in graph.notes] == [False, False]


def test_a_cause_may_come_before_its_fault_and_does_not_outlive_it(graph):
    graph.says('ENABLED')
    graph.events.explain('a wire')
    for _ in range(2):
        graph.says('FAULT')
        graph.go_on(2.5)
        graph.says('ENABLED')
    assert sorted(graph.reasons()) == [[''], ['a wire']]


def test_a_fault_that_was_there_from_the_start_is_no_event(graph):
    graph.says('FAULT')
    graph.go_on(3.0)
    assert graph.reasons() == []


def test_marks_are_noted_in_what_is_being_written(graph):
    graph.go_on(0.1)
    graph.events.mark('  here ', graph.now_ns, graph.now_ns)
    graph.go_on(1.5)
    graph.events.mark('', graph.now_ns, graph.now_ns)
    graph.go_on(1.5)
    assert graph.events.events
    graph.go_on(1.0)
    assert graph.reasons() == [['here', 'by the operator']]
    assert graph.events.marks == 2


def test_no_more_bags_than_allowed_are_written_and_that_is_an_error(tmp_path):
    graph = Graph(tmp_path, most=0)
    graph.events.mark('here', graph.now_ns, graph.now_ns)
    assert 'has 0 bags of faults and marks already' in graph.events.error
    assert [failed for _, failed in graph.notes] == [True]
    assert not graph.events.events


def test_what_is_being_written_is_finished_at_the_end(graph):
    graph.go_on(0.3)
    graph.says('ENABLED')
    graph.says('FAULT')
    graph.go_on(0.1)
    graph.events.close()
    assert graph.reasons() == [['']]
    assert open_bag(graph.events.last).message_count == 40


def test_a_recording_has_what_comes_between_start_and_stop(graph):
    graph.go_on(0.5)
    path = graph.recorder.start(graph.now_ns, 'stop')
    graph.go_on(0.5)
    late = graph.add_topic('/endoscope/late')
    assert late == 1
    with pytest.raises(BagError, match=f'already recording to {path}: `stop` ends that'):
        graph.recorder.start(graph.now_ns, 'stop')
    report = graph.recorder.stop()
    assert report.counts == {TOPIC: 50, '/endoscope/late': 0}
    assert report is graph.recorder.last_report
    with pytest.raises(BagError, match='not recording'):
        graph.recorder.stop()


def test_losses_are_reported_as_they_grow(graph):
    graph.recorder.start(graph.now_ns, 'stop')
    graph.go_on(0.1)
    assert graph.recorder.new_losses() == ''
    graph.sent += 3
    graph.go_on(0.1)
    assert '3 lost' in graph.recorder.new_losses()
    assert graph.recorder.new_losses() == ''
    assert graph.recorder.stop().lost_count == 3
