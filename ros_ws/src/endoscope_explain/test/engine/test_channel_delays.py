"""Delays of the channels of a recording, from a motion that begins from rest."""

import dataclasses

import numpy as np
import pytest

from endoscope_core.physics import EffectSpec
from endoscope_core.signals import calibration_sinusoid
from endoscope_explain.fit.channel_delays import channel_delays, shift_after

TRACKER, CELLS = 'slave/measured_js:bend_x', 'wires/measured_js:wire_x_neg'
SHAFT = 'motor/measured_js:motor_x'


def delay(effect, seconds):
    return EffectSpec(effect, 'bend_x', {'delay_s': seconds})


@pytest.fixture(scope='module')
def calibration():
    return calibration_sinusoid()(np.arange(10_000) * 1e-3)[0]


@pytest.mark.engine
def test_the_delays_of_tracker_and_load_cells_are_within_their_intervals(one_joint, calibration):
    late = (delay('tracker_delay', 0.04), delay('load_cell_delay', 0.015))
    recording = one_joint.record(one_joint.rig(*late, capstan_exponent=0.85), calibration)
    found = {each.channel: each for each in channel_delays(recording, one_joint.rig(), jobs=1)}
    for channel, true, width in ((TRACKER, 0.04, 0.005), (CELLS, 0.015, 0.001)):
        assert found[channel].low <= true <= found[channel].high
        assert found[channel].high - found[channel].low < width
        assert found[channel].against == 'its stamp'
    assert found[SHAFT].against == 'its command'
    assert 0.05 < found[SHAFT].low < found[SHAFT].high < 0.07


@pytest.mark.engine
def test_sensors_that_are_in_time_have_a_delay_of_about_none(one_joint, calibration):
    recording = one_joint.record(one_joint.rig(), calibration)
    # What the plant is described to have is fitted too, and not added to.
    described = one_joint.rig(delay('tracker_delay', 0.03))
    found = {each.channel: each for each in channel_delays(recording, described, jobs=1)}
    for channel in (TRACKER, CELLS):
        assert found[channel].low == pytest.approx(0.0, abs=1e-9)
        assert found[channel].high < 0.005


@pytest.mark.engine
def test_with_the_plant_of_another_rig_delays_of_sensors_are_unknown(one_joint, calibration):
    rig = one_joint.rig(delay('tracker_delay', 0.04), capstan_exponent=1.8, joint_stiffness=0.02)
    recording = one_joint.record(rig, calibration)
    found = {each.channel: each for each in channel_delays(recording, one_joint.rig(), jobs=1)}
    assert {found[c].unknown for c in (TRACKER, CELLS)} == {
        'the plant does not explain this recording'
    }
    assert found[SHAFT].value is not None


def test_a_joint_that_rests_and_a_sine_without_a_beginning_leave_delays_unknown(one_joint):
    rests = one_joint.record(one_joint.rig(), np.zeros(4000))
    found = {each.channel: each for each in channel_delays(rests, one_joint.rig())}
    assert found[TRACKER].value is None
    assert found[TRACKER].unknown == 'the joint was not moved'
    time = np.arange(4000) * 1e-3
    fast = one_joint.record(one_joint.rig(), 0.3 * np.sin(2.0 * np.pi * 4.0 * time))
    command = fast.command
    middle = dataclasses.replace(fast, command=command.taken(command.time >= 1.0))
    found = {each.channel: each for each in channel_delays(middle, one_joint.rig())}
    assert found[SHAFT].unknown == 'several shifts fit as well'
    assert found[CELLS].unknown == 'the motion repeats itself: it must begin from rest'


def test_a_shift_is_found_where_the_motion_begins_and_not_in_the_middle_of_a_sine():
    time = np.arange(0.0, 4.0, 1e-3)
    sine = np.sin(2.0 * np.pi * 5.0 * time)
    noise = 1e-3 * np.random.default_rng(1).normal(size=len(time))
    late = 0.07
    begun = np.clip((time - 1.0) / 0.5, 0.0, 1.0) * sine
    followed = np.interp(time - late, time, begun) + noise
    shift, low, high = shift_after(time, begun, time, followed)
    assert shift == pytest.approx(late, abs=1.1e-3)
    assert low <= late <= high <= low + 0.005
    assert shift_after(time, sine, time, np.interp(time - late, time, sine) + noise) is None
