"""The message ``calibration/result``, how it is written and read, and its figures as numbers."""

import contextlib
import json
import math
from array import array
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState

from endoscope_core.calibration import with_zeros
from endoscope_core.control import MotorLimits, PhysicalParameters, bending_range
from endoscope_core.control.internal_model import PROFILE
from endoscope_core.identification.law_choice import CalibrationFindings
from endoscope_core.safety import BendingRange
from endoscope_nodes.names import JOINTS, WIRES
from endoscope_nodes.runtime.diagnostics import ERROR, OK, diagnostic_array, status

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
    """Say what was found; `backlash`, in rad, is None where the tracker could not measure it.

    `duration`, of the whole calibration, is in s; how far the plants can be bent follows from the
    rig's `limits`; `zeros` is what the zero of each load cell is off by, in N.
    """
    verdict, plants, lost = found.verdict, found.plants, found.lost
    values: dict[str, object] = {'class_deg': verdict.class_deg, 'probability': verdict.probability}
    values |= {f'probability_{size}_deg': p for size, p in verdict.probabilities.items()}
    size = verdict.expected_size if backlash is None else backlash
    source = 'cnn' if lost is None else 'plant'
    if backlash is not None:
        source = 'tracker'
    values |= {
        'backlash_size': size,
        'backlash_size_deg': math.degrees(size),
        'backlash_size_from': source,
    }
    if verdict.size is not None and verdict.interval is not None:
        values |= {
            'regressed_size': verdict.size,
            'regressed_size_low': verdict.interval[0],
            'regressed_size_high': verdict.interval[1],
        }
    values['duration'] = duration
    values |= _zero_values(zeros)
    values |= {f'pretension_lost.{joint}': x for joint, x in zip(JOINTS, lost or (), strict=False)}
    if plants:
        values |= plant_values(plants)
        for joint, plant in zip(JOINTS, plants, strict=True):
            tube = bending_range(plant.joint, limits)
            values |= {f'{REACH}{joint}.low': tube.low, f'{REACH}{joint}.high': tube.high}
    message = f'class {verdict.class_deg} deg with probability {verdict.probability:.3f}'
    message += found.lost_in_words()
    return _message(stamp_ns, OK, with_zeros(message, zeros), values)


def aborted_result(stamp_ns: int, reason: str, step: str, duration: float) -> DiagnosticArray:
    """Say that a calibration was aborted, where and why; ``duration`` in s."""
    return _message(
        stamp_ns,
        ERROR,
        f'aborted: {reason}',
        {'reason': reason, 'step': step, 'duration': duration},
    )


def refused_result(
    stamp_ns: int, reason: str, duration: float, zeros: 'NDArray[np.float64] | None' = None
) -> DiagnosticArray:
    """State that the tube is outside all known classes, and why; ``duration`` in s."""
    values: dict[str, object] = {
        'class_deg': NONE_OF_THEM,
        'reason': reason,
        'step': 'judging',
        'duration': duration,
        **_zero_values(zeros),
    }
    return _message(stamp_ns, ERROR, with_zeros(reason, zeros), values)


def _zero_values(zeros: 'NDArray[np.float64] | None') -> dict[str, object]:
    if zeros is None:
        return {}
    return {f'zero_error.{wire}': x for wire, x in zip(WIRES, zeros.tolist(), strict=True)}


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
        item.name == NAME
        and any(v.key == 'class_deg' and v.value == NONE_OF_THEM for v in item.values)
        for item in message.status
    )


def findings_of(message: DiagnosticArray) -> CalibrationFindings | None:
    """Read all that a compensator can use out of a result; None where it reports no success."""
    for item in message.status:
        if item.name != NAME or item.level != OK:
            continue
        values = {v.key: v.value for v in item.values}
        try:
            size = values.get('regressed_size', values.get('backlash_size'))
            return CalibrationFindings(
                int(values['class_deg']),
                None if size is None else float(size),
                _plants_of(values),
                _ranges_of(values),
            )
        except (KeyError, ValueError):
            return None
    return None


def plant_values(plants: Sequence[PhysicalParameters]) -> dict[str, object]:
    """Keys and values by which a result reports identified plants, one for each joint."""
    return {
        f'{joint}.{name}': value
        for joint, plant in zip(JOINTS, plants, strict=True)
        for name, value in plant.to_dict().items()
    }


def _plants_of(values: Mapping[str, str]) -> tuple[PhysicalParameters, ...]:
    plants = []
    for joint in JOINTS:
        prefix = f'{joint}.'
        own = {key.removeprefix(prefix): v for key, v in values.items() if key.startswith(prefix)}
        if own:
            profile = json.loads(own[PROFILE])
            plants.append(PhysicalParameters.from_dict(own | {PROFILE: profile}))
    return tuple(plants)


def _ranges_of(values: Mapping[str, str]) -> tuple[BendingRange, ...]:
    if not any(key.startswith(REACH) for key in values):
        return ()
    return tuple(
        BendingRange(*(float(values[f'{REACH}{joint}.{end}']) for end in ('low', 'high')))
        for joint in JOINTS
    )


def _message(stamp_ns: int, level: bytes, text: str, values: dict[str, object]) -> DiagnosticArray:
    return diagnostic_array(stamp_ns, status(NAME, level, text, values))
