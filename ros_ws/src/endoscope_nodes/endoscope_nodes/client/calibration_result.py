"""The message ``calibration/result``, how it is written and read, and its figures as numbers."""

import contextlib
import math
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState

from endoscope_core.calibration import with_zeros
from endoscope_core.control import MotorLimits, PhysicalParameters, bending_range
from endoscope_core.identification.law_choice import CalibrationFindings
from endoscope_core.physics import JointParameters
from endoscope_nodes.client.plant_adoption import Reach
from endoscope_nodes.names import JOINTS, WIRES
from endoscope_nodes.runtime.diagnostics import (
    ERROR,
    OK,
    diagnostic_array,
    from_status,
    status,
    texts_of,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from endoscope_core.judgement import Judgement

NAME = 'calibration: hysteresis class'
NONE_OF_THEM = 'none'
REACH = 'reach.'


def successful_result(
    stamp_ns: int,
    found: 'Judgement',
    backlash: float | None,
    duration: float,
    limits: MotorLimits,
    zeros: 'NDArray[np.float64] | None' = None,
) -> DiagnosticArray:
    """Say what was found; `backlash` (rad) is None where the tracker could not measure it.

    `duration` is in s, `zeros` what the zero of each load cell is off by in N.
    """
    verdict, lost = found.verdict, found.lost
    low, high = verdict.interval or (None, None)
    size = verdict.expected_size if backlash is None else backlash
    source = 'cnn' if lost is None else 'plant'
    values = {
        'class_deg': verdict.class_deg,
        'probability': verdict.probability,
        **{f'probability_{size}_deg': p for size, p in verdict.probabilities.items()},
        'backlash_size': size,
        'backlash_size_deg': math.degrees(size),
        'backlash_size_from': source if backlash is None else 'tracker',
        'regressed_size': verdict.size,
        'regressed_size_low': low,
        'regressed_size_high': high,
        'duration': duration,
        'zero_error': _by(WIRES, zeros),
        'pretension_lost': _by(JOINTS, lost),
        **{joint: plant.joint for joint, plant in zip(JOINTS, found.plants, strict=False)},
        'reach': _by(JOINTS, [bending_range(plant.joint, limits) for plant in found.plants]),
    }
    message = f'class {verdict.class_deg} deg with probability {verdict.probability:.3f}'
    message += found.lost_in_words()
    return diagnostic_array(stamp_ns, status(NAME, OK, with_zeros(message, zeros), values))


def aborted_result(stamp_ns: int, reason: str, step: str, duration: float) -> DiagnosticArray:
    """Say that a calibration was aborted, where and why; ``duration`` in s."""
    values = {'reason': reason, 'step': step, 'duration': duration}
    return diagnostic_array(stamp_ns, status(NAME, ERROR, f'aborted: {reason}', values))


def refused_result(
    stamp_ns: int, reason: str, duration: float, zeros: 'NDArray[np.float64] | None' = None
) -> DiagnosticArray:
    """State that the tube is outside all known classes, and why; ``duration`` in s."""
    values = {
        'class_deg': NONE_OF_THEM,
        'reason': reason,
        'step': 'judging',
        'duration': duration,
        'zero_error': _by(WIRES, zeros),
    }
    return diagnostic_array(stamp_ns, status(NAME, ERROR, with_zeros(reason, zeros), values))


def _by[T](names: Sequence[str], values: 'Iterable[T] | None') -> dict[str, T]:
    return dict(zip(names, () if values is None else values, strict=False))


def numbers_of(result: DiagnosticArray) -> JointState:
    """Return the figures of a result as numbers in SI, which programs that plot can show."""
    [status] = result.status
    numbers = {'success': float(status.level == OK)}
    for item in status.values:
        with contextlib.suppress(ValueError):
            if item.key == 'class_deg':
                numbers['class'] = math.radians(float(item.value))
            # What is there in degrees once more, and what is no number, is left out.
            elif item.key != 'backlash_size_deg':
                numbers[item.key] = float(item.value)
    return JointState(
        header=result.header, name=list(numbers), position=array('d', numbers.values())
    )


def is_of_no_class(message: DiagnosticArray) -> bool:
    """Whether a result says that the tube is of no known class: what was known of it is void."""
    return any(
        item.name == NAME and texts_of(item).get('class_deg') == NONE_OF_THEM
        for item in message.status
    )


@dataclass(frozen=True)
class _Usable:
    """What a compensator can use of a result."""

    class_deg: int
    regressed_size: float | None = None
    backlash_size: float | None = None
    bend_x: JointParameters | None = None
    bend_y: JointParameters | None = None
    reach: Reach | None = None


def findings_of(message: DiagnosticArray) -> CalibrationFindings | None:
    """Read all that a compensator can use out of a result; None where it reports no success."""
    for item in message.status:
        if item.name != NAME or item.level != OK:
            continue
        try:
            found = from_status(_Usable, item)
            size = found.backlash_size if found.regressed_size is None else found.regressed_size
            plants = [joint for joint in (found.bend_x, found.bend_y) if joint is not None]
            return CalibrationFindings(
                found.class_deg,
                size,
                tuple(map(PhysicalParameters, plants)),
                () if found.reach is None else (found.reach.bend_x, found.reach.bend_y),
            )
        except ValueError:
            return None
    return None
