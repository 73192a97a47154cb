"""Numbers as a person reads them: in degrees, without switches and settings that do nothing."""

import math
from dataclasses import dataclass

from endoscope_core.names import JOINTS
from endoscope_core.physics.effect import Parameter
from endoscope_explain.case import ExplainedCase, Ladder
from endoscope_explain.explanation import ChannelFit, Estimate, NamedEffect
from endoscope_explain.recording import MOVES_RAD, QUANTITY_UNITS, RigRecording, signal_name

PLANTS = {'nominal': 'described', 'refitted': 'refitted', 'augmented': 'improved'}
"""The one word for each plant of report.json."""


@dataclass(frozen=True)
class ShownNumber:
    """A number with its interval, as text."""

    name: str
    value: str
    low: str
    high: str
    unit: str

    def __str__(self) -> str:
        unit = f' {self.unit}' if self.unit else ''
        if self.low == self.high:
            return f'{self.name} {self.value}{unit}'
        return f'{self.name} {self.value}{unit} ({self.low} to {self.high})'


def digits(value: float, count: int = 3) -> str:
    """A number with so many digits, without a power of ten where it can be read without."""
    return f'{float(f"{value:.{count}g}"):.12g}'


def in_degrees(name: str, unit: str) -> tuple[str, str, float]:
    """Name, unit and factor with which a person reads a number: angles are in degrees."""
    if unit == 'rad':
        return f'{name.removesuffix("_rad")}_deg', 'deg', math.degrees(1.0)
    if unit == 'rad/s' and '_rad' in name:
        return name.replace('_rad', '_deg'), 'deg/s', math.degrees(1.0)
    return name, '' if unit == '-' else unit, 1.0


def shown(name: str, estimate: Estimate) -> ShownNumber:
    """An estimate as text."""
    name, unit, factor = in_degrees(name, estimate.unit)
    numbers = [factor * v for v in (estimate.value, estimate.low, estimate.high)]
    spread = numbers[2] - numbers[1]
    if 0.0 < spread < math.inf:
        # A hundredth of the interval means nothing.
        numbers[0] = round(numbers[0], 2 - math.ceil(math.log10(spread))) + 0.0
    # As many digits as distinguish the ends of the interval.
    count = next((n for n in range(3, 8) if len({digits(v, n) for v in numbers[1:]}) > 1), 3)
    value, low, high = (digits(v, count) for v in numbers)
    return ShownNumber(name, value, low, high, unit)


def measurable(effect: NamedEffect) -> dict[str, Estimate]:
    """Parameters of an effect that are numbers: no switches, and no settings left at nothing."""
    known = {p.name: p for p in effect.definition.parameters}
    return {name: e for name, e in effect.parameters.items() if _is_number(known[name], e)}


def numbers_of(effect: NamedEffect) -> list[ShownNumber]:
    """The measurable parameters of an effect as text."""
    return [shown(name, e) for name, e in measurable(effect).items()]


def form(effect: NamedEffect) -> tuple[str, ...]:
    """What the switches of an effect stand for, in words."""
    return tuple(
        parameter.in_words(effect.parameters[parameter.name].value)
        for parameter in effect.definition.parameters
        if parameter.is_switch and parameter.name in effect.parameters
    )


def moving_joints(recording: RigRecording) -> tuple[str, ...]:
    """Joints whose motor was commanded to move, or moved."""
    sources = [s for s in (recording.command, recording.shaft_position) if s is not None]
    return tuple(
        joint
        for j, joint in enumerate(recording.joints)
        if any(float(s.values[:, j].max() - s.values[:, j].min()) >= MOVES_RAD for s in sources)
    )


def models(ladder: Ladder) -> tuple[str, ...]:
    """Models of a ladder in their order; a plant that is the one before it comes once."""
    found = [name for name in PLANTS if ladder.get(name)]
    if 'augmented' in found and ladder['augmented'] == ladder.get('refitted'):
        found.remove('augmented')
    return tuple(found)


def judged(case: ExplainedCase, ladder: Ladder) -> dict[str, dict[str, ChannelFit]]:
    """What each model leaves, by model and signal, of the joints that moved or have an effect."""
    joints = {*moving_joints(case.recording), *(e.joint for e in case.effects)}
    signals = _units(tuple(joints) or case.recording.joints)
    return {
        name: {s: fit for s, fit in ladder[name].items() if s in signals} for name in models(ladder)
    }


def rmse(signal: str, fit: ChannelFit) -> tuple[str, str]:
    """Error of a signal and its unit, as text."""
    _, unit, factor = in_degrees('_rad', _units(JOINTS)[signal])
    return digits(factor * fit.rmse), unit


def _is_number(parameter: Parameter, estimate: Estimate) -> bool:
    idle = parameter.typical if parameter.typical in (parameter.low, parameter.high) else math.nan
    rests = math.isclose(estimate.value, idle, rel_tol=1e-3)
    return not (parameter.is_switch or parameter.is_duration or rests)


def _units(joints: tuple[str, ...]) -> dict[str, str]:
    return {
        signal_name(quantity, joint, wire): unit
        for joint in joints
        for quantity, unit in QUANTITY_UNITS.items()
        for wire in range(2 if quantity == 'tension' else 1)
    }
