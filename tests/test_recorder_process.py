"""`endoscope record` as a process: signals, a kill, a full disk, losses."""

import os
import re
import resource
import signal
import subprocess
import sys
import time

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState

from endoscope_bags import BagWriter, open_bag
from endoscope_bags.cdr import encode_joint_state
from endoscope_bags.copying import recover
from endoscope_bags.errors import CorruptBagError
from endoscope_bags.information import bag_information
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.qos import EVENT, SENSOR_OFFERED

TOPIC = '/endoscope/motor/measured_js'


class RecorderProcess:
    """`endoscope record` and a publisher that it hears."""

    def __init__(self, bag):
        domain = private_domain()
        self.sent = 0
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node('sender', context=self.context)
        self.publisher = self.node.create_publisher(JointState, TOPIC, SENSOR_OFFERED)
        self.process = subprocess.Popen(
            [sys.executable, '-m', 'endoscope_bringup.cli', 'record', '--out', str(bag)],
            env=os.environ | {'ROS_DOMAIN_ID': str(domain)},
            stderr=subprocess.PIPE,
            text=True,
        )
        deadline = time.monotonic() + 60
        while not self.publisher.get_subscription_count():
            assert self.process.poll() is None, self.process.stderr.read()
            assert time.monotonic() < deadline, 'the recorder does not listen'
            time.sleep(0.02)
        time.sleep(0.5)

    def send(self, n, period_s=0.001):
        for _ in range(n):
            stamp = time.time_ns()
            self.publisher.publish(encode_joint_state(['motor_x'], stamp, position=[self.sent]))
            self.sent += 1
            time.sleep(period_s)
        return stamp

    def diagnosed(self, level):
        """Wait until the recorder reports at a level; the values of that report."""
        reports = []
        self.node.create_subscription(DiagnosticArray, '/diagnostics', reports.append, EVENT)
        executor = SingleThreadedExecutor(context=self.context)
        executor.add_node(self.node)
        deadline = time.monotonic() + 60
        while True:
            assert time.monotonic() < deadline, 'the recorder does not say so'
            executor.spin_once(timeout_sec=0.1)
            for status in (status for report in reports for status in report.status):
                if status.name == '/endoscope/recorder: recording' and status.level == level:
                    executor.remove_node(self.node)
                    return {value.key: value.value for value in status.values}

    def end(self, number):
        self.process.send_signal(number)
        _, errors = self.process.communicate(timeout=60)
        return self.process.returncode, errors

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
            self.process.communicate()
        self.node.destroy_node()
        self.context.shutdown()


@pytest.mark.nightly
def test_a_signal_finishes_the_recording(tmp_path):
    with RecorderProcess(tmp_path / 'bag') as recorder:
        recorder.send(500)
        time.sleep(0.2)
        code, errors = recorder.end(signal.SIGINT)
    assert code == 0, errors
    assert 'Traceback' not in errors
    bag = open_bag(tmp_path / 'bag')
    assert bag.topics[TOPIC].message_count == 500
    with AnyReader([tmp_path / 'bag']) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
    assert counts[TOPIC] == 500


def test_a_killed_recorder_leaves_all_but_the_last_second(tmp_path):
    with RecorderProcess(tmp_path / 'bag') as recorder:
        last_stamp = recorder.send(3000)
        recorder.end(signal.SIGKILL)
    file = tmp_path / 'bag' / 'bag_0.mcap'
    before = file.read_bytes()
    with pytest.raises(CorruptBagError, match=r'bag_0\.mcap: ends in the middle'):
        open_bag(tmp_path / 'bag')
    assert open_bag(tmp_path / 'bag', salvage=True).message_count > 0
    report = recover(tmp_path / 'bag', tmp_path / 'saved')
    assert file.read_bytes() == before
    bag = open_bag(tmp_path / 'saved')
    series = bag.joint_state('motor/measured_js')
    assert report.counts[TOPIC] == len(series)
    assert series.position[:, 0].tolist() == list(range(len(series)))
    assert last_stamp - series.stamp_ns[-1] < 1e9
    with AnyReader([tmp_path / 'saved']) as reader:
        connections = [c for c in reader.connections if c.topic == TOPIC]
        assert sum(1 for _ in reader.messages(connections)) == len(series)


def test_a_full_disk_is_reported_and_survived(tmp_path):
    with RecorderProcess(tmp_path / 'bag') as recorder:
        recorder.send(300)
        limit = (200_000, resource.RLIM_INFINITY)
        resource.prlimit(recorder.process.pid, resource.RLIMIT_FSIZE, limit)
        recorder.send(6000, 0.0003)
        assert recorder.process.poll() is None
        code, errors = recorder.end(signal.SIGTERM)
    assert code == 1
    assert 'File too large; recording ended there' in errors
    assert 'Traceback' not in errors
    bag = open_bag(tmp_path / 'bag')
    series = bag.joint_state('motor/measured_js')
    assert 300 <= len(series) < recorder.sent
    assert series.position[:, 0].tolist() == list(range(len(series)))
    assert (tmp_path / 'bag' / 'bag_0.mcap').stat().st_size <= 200_000
    assert 'File too large' in bag_information(bag).notes['ended']


def test_losses_are_counted_exactly_and_exit_1(tmp_path):
    with RecorderProcess(tmp_path / 'bag') as recorder:
        recorder.send(200)
        time.sleep(0.5)
        # A recorder that stands still for longer than its queues last has to lose messages.
        recorder.process.send_signal(signal.SIGSTOP)
        recorder.send(6000, 0.0001)
        recorder.process.send_signal(signal.SIGCONT)
        time.sleep(1.0)
        recorder.send(200)
        time.sleep(0.5)
        diagnosed = recorder.diagnosed(DiagnosticStatus.ERROR)
        code, errors = recorder.end(signal.SIGTERM)
    bag = open_bag(tmp_path / 'bag')
    topic = next(t for t in bag_information(bag).topics if t.name == TOPIC)
    assert topic.lost > 0
    assert topic.message_count + topic.lost == recorder.sent
    assert code == 1
    assert f'{topic.lost} lost ({TOPIC} {topic.lost})' in errors
    assert diagnosed['lost'] == str(topic.lost)
    assert diagnosed[TOPIC] == f'{topic.message_count} recorded, {topic.lost} lost'


def _ended_after_a_while(argv, words):
    """Run a program until its first matching line, interrupt it, and return all its output."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'endoscope_bringup.cli', *argv],
        env=os.environ | {'ROS_DOMAIN_ID': str(private_domain())},
        stderr=subprocess.PIPE,
        text=True,
    )
    output = ''
    try:
        for line in process.stderr:
            output += line
            if words in line:
                break
        process.send_signal(signal.SIGTERM)
        output += process.communicate(timeout=60)[1]
    finally:
        process.kill()
        process.communicate()
    return process.returncode, output


def test_topics_on_which_nothing_comes_are_reported_at_once_and_at_the_end(tmp_path):
    argv = ['record', '--out', str(tmp_path / 'bag'), '--topics', 'foo', 'wires/measured_js']
    code, output = _ended_after_a_while(argv, 'nobody publishes /endoscope/foo')
    assert code == 0
    assert 'no message came on /endoscope/wires/measured_js, foo' in output


@pytest.mark.nightly
def test_a_replay_says_how_far_it_came(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        for k in range(2000):
            stamp = 10**18 + k * 10**7
            cdr = encode_joint_state(['motor_x'], stamp, position=[0.0])
            writer.write_raw(TOPIC, 'sensor_msgs/msg/JointState', cdr, stamp)
    bag = str(tmp_path / 'bag')
    code, output = _ended_after_a_while(['replay', bag, '--delay', '0'], 'times its pace')
    assert code == 0
    assert re.search(rf'stopped: {bag}: \d+ messages, \d+\.\d s of 2000 replayed', output)
    code, output = _ended_after_a_while(['replay', bag, '--speed', '100'], 'replayed')
    assert code == 0
    assert f'{bag}: 2000 messages, 20.0 s replayed' in output.splitlines()[-1]
