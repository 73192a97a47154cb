"""Motors and console fail in the running graph, over a real terminal; see doc/device_faults.md."""

import pytest
from endoscope_bringup.device_faults.motor_faults import MOTOR_FAULTS, undergo
from endoscope_bringup.device_faults.motor_rig import MotorRig
from std_srvs.srv import Trigger


@pytest.mark.parametrize("name", MOTOR_FAULTS)
def test_what_the_slave_makes_of(name, tmp_path):
    fault = MOTOR_FAULTS[name]
    outcome = undergo(fault, tmp_path, aftermath=0.7)
    assert outcome.state == fault.ends_in, outcome
    assert fault.cause in outcome.cause
    assert (outcome.faults_in_bag > 0) == (fault.ends_in == "FAULT")
    assert (outcome.stopped_s is not None) == fault.stops
    assert outcome.largest_error < 0.03


def test_after_a_fault_nothing_moves_before_enable_is_given(tmp_path):
    with MotorRig(tmp_path) as rig:
        rig.enable_and_move()
        rig.emulator.do("silence", 1)
        assert rig.wait(lambda: rig.state == "FAULT")
        rig.order("enable")
        assert rig.wait(lambda: "not enabled" in rig.node("supervisor")._last_refusal)
        rig.emulator.do("silence")
        count = len(rig.shafts)
        assert rig.wait(lambda: len(rig.shafts) > count + 200)
        assert rig.state == "FAULT"
        still = [s.position for _, s in rig.shafts[-100:]]
        assert max(still) == pytest.approx(min(still), abs=2e-3)
        rig.enable_and_move()
        assert rig.wait(
            lambda: abs(rig.shafts[-1][1].position[0] - still[-1][0]) > 0.02
        )


def test_a_servo_that_shut_down_is_restarted_by_a_service(tmp_path):
    with MotorRig(tmp_path) as rig:
        client = rig.probe.create_client(Trigger, "motor/reboot")
        rig.enable_and_move()
        refused = client.call_async(Trigger.Request())
        assert rig.wait(refused.done)
        assert not refused.result().success
        rig.emulator.do("overload", 2)
        assert rig.wait(lambda: rig.state == "FAULT")
        answer = client.call_async(Trigger.Request())
        assert rig.wait(answer.done)
        assert answer.result().success
        assert rig.wait(lambda: rig.emulator.state(2)["hardware"] == 0)
        held = rig.shafts[-1][1].position
        rig.enable_and_move()
        assert rig.wait(lambda: abs(rig.shafts[-1][1].position[0] - held[0]) > 0.02)
