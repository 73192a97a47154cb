"""The tracker's driver over a real pseudo-terminal, with what goes wrong there."""

import contextlib
import math
import random
import time
from itertools import pairwise

import numpy as np
import pytest
import serial
from aurora_rig import Instrument, angle_between
from device_readings import collect, figure, until

from endoscope_core.errors import FileError
from endoscope_core.kinematics import (
    RegistrationError,
    StraightRegistration,
    bending_from_orientation,
)
from endoscope_devices.em_tracker import (
    AuroraTracker,
    RegistrationWindow,
    TrackerSettings,
    load_registration,
    save_registration,
)
from endoscope_devices.em_tracker.aurora_port import AuroraPort, TrackerReplyError
from endoscope_devices.em_tracker.aurora_tracker import TURN_NOISE, TURN_RATE
from endoscope_devices.em_tracker.tx_reply import MalformedReplyError, parse_tx
from endoscope_emulators.aurora import AuroraEmulator
from endoscope_emulators.aurora_unit import SensorView, sealed

LATENCY = 0.03


@pytest.fixture
def instrument():
    return Instrument()


@pytest.fixture
def emulator(tmp_path, instrument):
    with AuroraEmulator([instrument], tmp_path / 'ttyAurora', latency=LATENCY) as emulator:
        yield emulator


@pytest.fixture
def tracker(emulator):
    """A tracker that is tracked, and remembers how long its frames were waited for."""
    tracker = AuroraTracker(str(emulator.link), TrackerSettings(latency=LATENCY))
    ask, ended = tracker._port.ask, [time.monotonic()]
    tracker.waits = []

    def timed(command):
        try:
            return ask(command)
        finally:
            now = time.monotonic()
            if command.startswith('TX'):
                tracker.waits.append(now - ended[0])
            ended[0] = now

    tracker._port.ask = timed
    tracker.open()
    yield tracker
    tracker.close()


def are_well_timed(emulator, tracker, readings):
    """Whether stamps are when the frames were measured, whatever came late, early or again.

    What is stamped is when the promptest reply was asked for.  Its frame was the newest one when
    the emulator came to answer, which a busy machine delays: so a stamp is less than a frame late,
    and no earlier than the longest wait for a reply.
    """
    zero = emulator.unit.frame_zero
    late = np.array([r.time_ns * 1e-9 - zero - r.frame / 40.0 for r in readings])
    return bool((late < 0.025).all() and (late > -max(tracker.waits)).all())


def test_each_frame_comes_once_with_the_time_at_which_it_was_measured(tracker, emulator):
    readings = collect(tracker, 25)
    frames = [reading.frame for reading in readings]
    assert frames == sorted(set(frames))
    lost = frames[-1] - frames[0] + 1 - len(frames)
    # Those between two connections are not counted.
    assert figure(tracker, 'lost frames') >= lost or figure(tracker, 'connections') > 1
    assert are_well_timed(emulator, tracker, readings)
    # One that was not asked for is counted as lost.
    before, delays = figure(tracker, 'lost frames'), iter([0.15])
    emulator.tap = lambda data: [(next(delays, 0.0), data)]
    until(lambda: figure(tracker, 'lost frames') >= before + 3)


def test_what_it_cannot_see_is_no_reading_and_said_until_it_is_seen_again(
    tracker, emulator, instrument
):
    collect(tracker, 5)
    instrument.hidden = True
    until(lambda: figure(tracker, 'missing') > 0)
    tracker.take()
    before = figure(tracker, 'missing')
    until(lambda: figure(tracker, 'missing') > before + 10)
    assert tracker.take() == []
    until(lambda: 'out of the measurement volume' in tracker.health()[0])
    instrument.hidden, instrument.broken = False, True
    until(lambda: 'coil of the sensor is broken' in tracker.health()[0])
    instrument.broken = False
    collect(tracker, 5)
    until(lambda: tracker.health()[0] == '')
    emulator.unplug()
    until(lambda: 'ttyAurora cannot be opened' in tracker.health()[0])
    emulator.plug_in()
    tracker.take()
    collect(tracker, 5)
    assert figure(tracker, 'connections') >= 2
    until(lambda: tracker.health()[0] == '')


def says_that_there_is_one_sensor(tracker):
    until(lambda: '1 sensors, number 2 is asked for' in tracker.health()[0])


def test_a_tracker_left_at_another_rate_is_reset_by_a_break(emulator):
    with serial.Serial(str(emulator.link), 9600, timeout=5.0) as line:
        line.write(b'COMM 50000\r')
        assert line.read_until(b'\r').startswith(b'OKAY')
    assert emulator.unit.baud == 115200
    for settings, judge in (
        (TrackerSettings(), lambda tracker: collect(tracker, 5)),
        (TrackerSettings(tool=2), says_that_there_is_one_sensor),
    ):
        tracker = AuroraTracker(str(emulator.link), settings)
        tracker.open()
        try:
            judge(tracker)
        finally:
            tracker.close()
        assert emulator.unit.baud == 9600


@pytest.mark.nightly
def test_a_tracker_whose_frames_come_late_for_good_is_timed_anew(tracker, emulator):
    collect(tracker, 20)
    begun = time.monotonic()
    # The tracker stops for a third of a second and counts on from where it was.
    emulator.unit.now = lambda: max(begun, time.monotonic() - 0.3)
    tracker.take()
    until(lambda: figure(tracker, 'late') > 20)
    collect(tracker, 5)
    until(lambda: tracker.health()[0] == '')


@pytest.mark.nightly
def test_old_replies_are_told_by_their_frame_and_left_out(tracker, emulator, instrument):
    """The instrument turns all the while; every fourth reply is an earlier one again."""
    instrument._bent.bending = lambda seconds: (0.5 * math.sin(seconds), 0.0)
    kept, number = [], [0]

    def replay(data):
        if not data.startswith(b'010A'):
            return [(0.0, data)]
        if len(kept) < 100:
            kept.append(data)
            return [(0.0, data)]
        number[0] += 1
        return [(0.0, kept[number[0] % 100] if number[0] % 4 == 0 else data)]

    emulator.tap = replay
    until(lambda: figure(tracker, 'old frames') > 100)
    readings = tracker.take()
    frames = [reading.frame for reading in readings]
    assert frames == sorted(set(frames))
    assert are_well_timed(emulator, tracker, readings)
    # Nothing but silence makes it connect again.
    assert figure(tracker, 'connections') == 1 or figure(tracker, 'silences') >= 5


@pytest.mark.nightly
def test_a_tracker_that_counts_its_frames_anew_is_opened_again(tracker, emulator):
    unit = emulator.unit
    until(lambda: [r for r in tracker.take() if r.frame > 20])
    # It counts on so slowly that it does not come to where it was before that is noticed.
    begun, now = unit.frame_zero + 0.1, time.monotonic()
    unit.now = lambda: begun + 1e-3 * (time.monotonic() - now)
    until(lambda: figure(tracker, 'connections') >= 2)
    assert figure(tracker, 'old frames') >= 3
    counted = unit.now() - unit.frame_zero
    unit.now, unit.frame_zero = time.monotonic, time.monotonic() - counted
    tracker.take()
    collect(tracker, 5)
    until(lambda: tracker.health()[0] == '')


def test_frames_ahead_of_their_time_and_poses_that_no_tip_reaches_are_left_out(
    tracker, emulator, instrument
):
    before = collect(tracker, 20)
    number = [0]

    def seen(seconds):
        number[0] += 1
        return (1.5, 0.0) if number[0] % 10 == 0 else (0.0, 0.0)

    instrument._bent.bending = seen
    until(lambda: figure(tracker, 'jumps') >= 5)
    tracker.take()
    readings = collect(tracker, 20)
    for earlier, later in pairwise(readings):
        turned = angle_between(earlier.orientation, later.orientation)
        assert turned <= TURN_NOISE + TURN_RATE * (later.frame - earlier.frame) / 40.0
    straight = before[-1].orientation
    assert sum(angle_between(r.orientation, straight) < 0.01 for r in readings) > 10

    def early(data):
        head, frame, tail = data[:-18], data[-18:-10], data[-10:-5]
        number[0] += 1
        if not data.startswith(b'010A') or number[0] % 10:
            return [(0.0, data)]
        return [(0.0, sealed((head + b'%08X' % (int(frame, 16) + 40) + tail).decode()))]

    emulator.tap = early
    until(lambda: figure(tracker, 'frames ahead of time') >= 5)
    assert are_well_timed(emulator, tracker, collect(tracker, 20))


def test_registered_straight_it_gives_both_bending_angles(tracker, instrument, tmp_path):
    window = RegistrationWindow()
    registered = []

    def registers():
        """Where the machine lets the tracker be read often enough within a second."""
        for reading in collect(tracker, 1):
            window.add(reading)
        with contextlib.suppress(RegistrationError):
            registered.append(window.register(time.monotonic_ns()))
        return registered

    until(registers)
    (registration,) = registered
    save_registration(tmp_path / 'straight.yaml', registration)
    again = load_registration(tmp_path / 'straight.yaml')
    assert again.position == registration.position
    assert again.orientation == pytest.approx(registration.orientation)
    for bending in ((0.9, 0.0), (0.0, -0.7), (-0.5, 0.6)):
        instrument.bending = bending

        def is_read(bending=bending):
            reading = collect(tracker, 1)[-1]
            _, orientation = again.in_base(
                reading.position, reading.orientation, roll=0.4, length=0.02
            )
            return bending_from_orientation(orientation) == pytest.approx(bending, abs=5e-4)

        until(is_read)


@pytest.mark.parametrize('orientation', [[0.0] * 4, [1e308] * 4])
def test_a_registration_that_turns_nowhere_is_refused(tmp_path, orientation):
    path = tmp_path / 'straight.yaml'
    save_registration(path, StraightRegistration((0.0, 0.0, 0.0), tuple(orientation)))
    with pytest.raises(FileError, match=r'straight.yaml: .* is not an orientation'):
        load_registration(path)


def spoilt(data, rng):
    """What a bad line makes of a reply; one in two hundred may lose its end and is waited for."""
    bad = bytearray(data)
    last = len(bad) - (0 if rng.random() < 0.005 else 1)
    kind, at = rng.randrange(6), rng.randrange(last)
    if kind == 0:
        for _ in range(rng.randint(1, 3)):
            bad[rng.randrange(last)] ^= 1 << rng.randrange(8)
    elif kind == 1:
        bad[at : min(at + 2, last)] = rng.randbytes(min(at + 2, last) - at)
    elif kind == 2:
        del bad[at : min(at + rng.randint(1, 4), last)]
    elif kind == 3:
        bad[at:at] = rng.randbytes(rng.randint(1, 4))
    elif kind == 4:
        bad[at:at] = bad[at : min(at + rng.randint(1, 4), last)]
    else:
        # Two digits change places, as no flipped bit does.
        other = rng.randrange(last)
        bad[at], bad[other] = bad[other], bad[at]
    return bytes(bad)


@pytest.mark.nightly
def test_no_wrong_value_in_10000_spoilt_replies(tmp_path):
    rng = random.Random(20261121)
    asked = [0]

    def source(_):
        asked[0] += 1
        angle = 0.001 * (asked[0] % 1500)
        return SensorView(
            (0.001 * (asked[0] % 97), 0.0, -0.2),
            (math.sin(angle), 0.0, 0.0, math.cos(angle)),
        )

    # By frame: on a busy machine a reply may come after its question was given up.
    sent = {}

    def spoil(data):
        if data.startswith(b'010A'):
            sent[parse_tx(data[:-5].decode())[0].frame] = data
        return [(0.0, spoilt(data, rng) if data.startswith(b'010A') else data)]

    refused = same = 0
    with AuroraEmulator([source], tmp_path / 'tty', line_speed=False) as emulator:
        port = AuroraPort(str(emulator.link))
        port.open()
        for command in ('PINIT:0A', 'PENA:0AD', 'TSTART:'):
            port.ask(command)
        # A fresh frame each time, so that an earlier reply cannot pass for this one.
        ticks = iter(range(10**6))
        emulator.unit.now = lambda: emulator.unit.frame_zero + next(ticks) / 40.0 + 0.01
        emulator.tap = spoil
        while refused + same < 10_000:
            try:
                tools = parse_tx(port.ask('TX:0001'))
            except (TrackerReplyError, MalformedReplyError):
                refused += 1
                continue
            same += 1
            assert tools == parse_tx(sent[tools[0].frame][:-5].decode())
        emulator.tap = lambda data: [(0.0, data)]
        port.close()
    assert refused > 9_000
