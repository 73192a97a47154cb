"""Response of the slave to faults of motors and master, and its time."""

import math
import re
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rclpy.parameter import Parameter

from endoscope_bags import open_bag
from endoscope_lab.bench import chosen, table_head, table_row
from endoscope_lab.faults.motor_rig import MotorRig
from endoscope_nodes.nodes.supervisor import SupervisorNode

_COLUMNS = (
    'fault',
    'state',
    'to FAULT [ms]',
    'to standstill [ms]',
    'longest gap of motor/measured_js [ms]',
    'largest error in the bag [mrad]',
    'FAULT in the bag',
    'cause',
)


def run(only: Sequence[str] | None) -> int:
    """Print a row for each fault; return 1 if the slave did not reach the required state."""
    faults = chosen('fault', only, MOTOR_FAULTS)
    wrong = 0
    print(table_head(*_COLUMNS))
    for fault in faults.values():
        with tempfile.TemporaryDirectory() as folder:
            outcome = undergo(fault, Path(folder))
        print(outcome, flush=True)
        ended = outcome.state == fault.ends_in and bool(re.search(fault.cause, outcome.cause))
        wrong += not ended or (fault.stops and outcome.stopped_s is None)
    return 1 if wrong else 0


AFTERMATH_S = 2.0


@dataclass(frozen=True)
class MotorFault:
    """A fault that is injected in motion."""

    what: str  # in words
    inject: Callable[[MotorRig], object]
    # Operating state that must follow; ``ENABLED`` for a fault that motion survives, or that only
    # ends the motion.
    ends_in: str = 'FAULT'
    stops: bool = True  # the shafts stand still afterwards
    cause: str = ''  # pattern that the cause of the FAULT must match
    apart: tuple[str, ...] = ()  # nodes that must be processes of their own


@dataclass(frozen=True)
class FaultOutcome:
    """Response to a fault."""

    what: str  # the fault
    state: str  # operating state at the end
    cause: str  # of the FAULT; empty without one
    # Seconds from the fault to FAULT, and to standstill of the shafts; None if never reached.
    fault_s: float | None
    stopped_s: float | None
    longest_gap_s: float  # longest silence of `motor/measured_js` in the bag after the fault
    faults_in_bag: int  # FAULT messages in the bag after the fault
    # Largest difference in rad between a reading in the bag and the true angle at its stamp.
    largest_error: float

    def __str__(self) -> str:
        def ms(seconds: float | None) -> str:
            return '-' if seconds is None else f'{seconds * 1e3:.0f}'

        times = (ms(each) for each in (self.fault_s, self.stopped_s, self.longest_gap_s))
        error = f'{self.largest_error * 1e3:.1f}'
        return table_row(self.what, self.state, *times, error, self.faults_in_bag, self.cause)


def _set(action: str, *arguments: float) -> Callable[[MotorRig], object]:
    return lambda rig: rig.emulator.do(action, *arguments)


def _late(rig: MotorRig) -> None:
    rig.emulator.do('delay_s', 0.006)
    rig.emulator.do('delayed', 4)


def _disturb(rig: MotorRig) -> None:
    rig.emulator.do('damage_rate', 0.01)
    rig.emulator.do('repeated', 400)
    _late(rig)


def _overpull(rig: MotorRig) -> None:
    rig.tension = 80.0


def _stop_weighing(rig: MotorRig) -> None:
    rig.weighing = False


def _let_go(rig: MotorRig) -> None:
    rig.node('master').set_parameters([Parameter('source', value='none')])


MOTOR_FAULTS: dict[str, MotorFault] = {
    'servo cable out': MotorFault(
        'cable of a servo pulled out', _set('silence', 1), cause='servo 1 does not answer'
    ),
    'adapter out': MotorFault(
        'USB adapter pulled out', _set('hang_up'), cause='the adapter is gone'
    ),
    'flipped bits': MotorFault(
        'bits flipped in 1 % of packets', _set('damage_rate', 0.01), 'ENABLED', stops=False
    ),
    'late': MotorFault('4 answers late by 6 ms', _late, 'ENABLED', stops=False),
    'twice': MotorFault('400 answers sent twice', _set('repeated', 400), 'ENABLED', stops=False),
    'disturbed': MotorFault('the three at once', _disturb, 'ENABLED', stops=False),
    'overload': MotorFault('a servo shuts down', _set('overload', 1), cause='overload'),
    'brown-out': MotorFault('supply falls to 9 V', _set('supply', 1, 9.0), cause='input voltage'),
    'restart': MotorFault('a servo restarts', _set('restart', 2), cause='servo 2'),
    'node hangs': MotorFault('executor of the nodes hangs for 0.5 s', lambda rig: rig.block(0.5)),
    'over-tension': MotorFault('a wire at 80 N', _overpull, cause='over the ceiling'),
    'load cells silent': MotorFault('load cells fall silent', _stop_weighing, cause='silent'),
    'clutch released': MotorFault('operator lets go of the clutch', _let_go, 'ENABLED'),
    'master killed': MotorFault(
        'master killed (SIGKILL)',
        lambda rig: rig.kill('master'),
        cause='slave/servo_jp ended while the clutch was held',
        apart=('master',),
    ),
    'motor driver killed': MotorFault(
        'motor driver killed (SIGKILL)',
        lambda rig: rig.kill('motor_driver'),
        # Reported by whichever node misses it first.
        cause='motor/measured_js has been silent|no measured position',
        apart=('motor_driver',),
    ),
}


def undergo(
    fault: MotorFault,
    folder: Path,
    aftermath: float = AFTERMATH_S,
    patience: float | None = None,
    domain: int | None = None,
) -> FaultOutcome:
    """Inject a fault in motion, and observe the response for at least `aftermath` s."""
    with MotorRig(folder, fault.apart, patience, domain) as rig:
        rig.enable_and_move()
        began, began_ns = time.monotonic(), time.time_ns()
        fault.inject(rig)
        if fault.ends_in == 'FAULT':
            rig.wait(lambda: rig.state == 'FAULT')
        rig.wait(lambda: time.monotonic() > began + aftermath)
        if fault.stops:
            rig.wait(lambda: rig.stopped_after(began) is not None)
        stopped_s = rig.stopped_after(began)
        state = rig.state
        fault_s = next((t - began for t, s in rig.states if s == 'FAULT' and t >= began), None)
        supervisor = rig.node('supervisor')
        cause = supervisor.machine.cause if isinstance(supervisor, SupervisorNode) else ''
        traces = [np.array(rig.emulator.do('trace', device, 0.0)) for device in (1, 2)]
        to_stamps = time.time() - time.monotonic()
        bag = rig.bag
    recording = open_bag(bag)
    measured = recording.joint_state('motor/measured_js')
    stamps = measured.stamp_ns
    after = np.append(stamps[stamps >= began_ns], recording.end_ns)
    gaps = np.diff(np.concatenate([stamps[stamps < began_ns][-1:], after]))
    topic = recording.find('slave/operating_state')
    states = [m.data for raw, m in recording.decoded(topic) if raw.log_ns >= began_ns]
    positions = np.array(measured.position).T
    errors = [
        np.abs(position + math.pi - np.interp(stamps * 1e-9, trace[:, 0] + to_stamps, trace[:, 1]))
        for position, trace in zip(positions, traces, strict=True)
    ]
    return FaultOutcome(
        fault.what,
        state,
        cause,
        fault_s,
        stopped_s,
        float(gaps.max()) * 1e-9,
        states.count('FAULT'),
        float(np.max(errors)),
    )
