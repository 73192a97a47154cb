"""Laws to inject: drawn expression trees of one state, and effects with drawn parameters."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics import EffectSpec, PlantDescription, TermSpec
from endoscope_core.physics.effect import Effect, Parameter
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.effects.laws import ONSETS
from endoscope_core.physics.functions import FUNCTIONS, places
from endoscope_core.physics.functions.places import OTHER_ANGLE, Argument, Place, Shape
from endoscope_core.physics.functions.term import evaluate, tabulated
from endoscope_core.physics.kernel import run_joints
from endoscope_core.physics.layout import (
    IN_COMMAND,
    IN_MOTOR,
    INPUTS,
    JOINT,
    JOINT_STEP,
    MEAN_TENSION,
    MOTOR,
    MOTOR_SPEED,
    OTHER,
    OUT_TENSION_A,
    OUT_TENSION_B,
    OUTPUTS,
    PATH,
    SLIDING_SPEED,
    TENSION_DIFFERENCE,
)
from endoscope_core.physics.packing import pack, rest_state
from endoscope_core.physics.simulator import TICK

Array = NDArray[np.float64]
Tree = Callable[[str], str]
"""Maps the text of the argument, of about -1 to 1, to that of the formula."""
Form = Callable[[float], TermSpec]
"""Maps the strength of a law to the law."""

DEPTH = 3
LONGEST = 150
"""Characters of a tree, which occurs twice at a place of odd functions."""
LIKE_A_LINE = 0.8
"""Largest share of a form that a line explains: lines are stiffness and gain."""
GRID = 400
_TRIES = 1000
PERIODS_S = (1.5, 6.0)
CYCLES = (3.0, 10.0)
"""Periods, over the shaft's range, of a law that is periodic in the shaft's angle."""
LAGS_S = (0.3, 6.0)
"""Range of time constants of lagging arguments."""
EVERY = 10
"""Ticks between samples of the states."""
_EDGE = 0.005
"""Quantile that bounds the range of a speed."""


def drawn_tree(generator: np.random.Generator, depth: int = DEPTH) -> Tree:
    """Draw from + - *, tanh, exp(-x^2), powers of |x|, a rational function and a sine."""

    def leaf() -> Tree:
        slope = generator.choice([-1.0, 1.0]) * np.exp(generator.uniform(-0.4, 1.1))
        shift = generator.uniform(-0.7, 0.7)
        return lambda u: f'({slope:.3g}*{u} + {shift:.3g})'

    if depth == 0:
        return leaf()
    kind = generator.choice(['sum', 'difference', 'product', 'tanh', 'bell', 'power', 'rational',
                             'sine'])  # fmt: skip
    inner = drawn_tree(generator, 0 if generator.random() < 0.4 else depth - 1)
    if kind in ('sum', 'difference', 'product'):
        sign = {'sum': '+', 'difference': '-', 'product': '*'}[str(kind)]
        other = drawn_tree(generator, 0 if generator.random() < 0.4 else depth - 1)
        return lambda u: f'({inner(u)} {sign} {other(u)})'
    power, wave = generator.uniform(0.5, 3.0), generator.uniform(1.0, 4.0)
    texts = {'tanh': 'tanh({})', 'bell': 'exp(-({})**2)', 'power': f'abs({{}})**{power:.3g}',
             'rational': '1/(1 + ({})**2)', 'sine': f'sin({wave:.3g}*{{}})'}  # fmt: skip
    return lambda u: texts[str(kind)].format(inner(u))


def drawn_form(
    generator: np.random.Generator, place_id: str, joint: str, visited: tuple[float, float]
) -> tuple[Form, float]:
    """Draw a law by its strength (rms in the unit of the place), and its largest strength."""
    # It is not a line over the visited range of the place's argument; for a periodic argument, the
    # period is drawn within that range.
    place = FUNCTIONS[place_id]
    for _ in range(_TRIES):
        low, high = _range(generator, place, visited)
        lag = float(np.exp(generator.uniform(*np.log(LAGS_S)))) if place.argument.lags else None
        text = _text(generator, place, low, high)
        try:
            grid = np.linspace(low, high, GRID)
            values = evaluate(text, place.argument.symbol, grid)
            rms = float(np.sqrt(np.mean(values**2)))
            if not 1e-3 < rms < 1e3 or _share_of_a_line(grid, values) > LIKE_A_LINE:
                continue
            largest = 0.99 * place.largest / float(np.abs(values).max())
            tabulated(_law(place, joint, text, 1e-6 * largest, (low, high), lag))
        except ValueError:
            continue

        def form(
            strength: float,
            text: str = text,
            rms: float = rms,
            ends: tuple[float, float] = (low, high),
            lag: float | None = lag,
        ) -> TermSpec:
            return _law(place, joint, text, strength / rms, ends, lag)

        return form, largest * rms
    raise RuntimeError(f'none of {_TRIES} forms is valid at {place_id}')


def _law(
    place: Place, joint: str, text: str, factor: float, ends: tuple[float, float], lag: float | None
) -> TermSpec:
    return TermSpec(joint, place.id, f'{factor:.6g}*({text})', range=ends, lag_s=lag)


def _range(
    generator: np.random.Generator, place: Place, visited: tuple[float, float]
) -> tuple[float, float]:
    low, high = visited
    if place.shape is Shape.PERIODIC:
        return 0.0, float(np.exp(generator.uniform(np.log(low), np.log(high))))
    if place.shape in (Shape.ODD, Shape.EVEN):
        high = max(abs(low), abs(high))
        low = -high
    return low, high


def _text(generator: np.random.Generator, place: Place, low: float, high: float) -> str:
    tree = drawn_tree(generator)
    while len(tree('u')) > LONGEST:
        tree = drawn_tree(generator)
    symbol, middle, half = place.argument.symbol, 0.5 * (low + high), 0.5 * (high - low)
    if place.shape is Shape.PERIODIC:
        phase = generator.uniform(-np.pi, np.pi)
        return _centred(tree(f'sin({np.pi / half:.9g}*{symbol} + {phase:.3g})'), place, low, high)
    if place.shape is Shape.ODD:
        return f'{tree(f"({symbol}/{half:.4g})")} - {tree(f"(-{symbol}/{half:.4g})")}'
    if place.shape is Shape.EVEN:
        return _centred(tree(f'(abs({symbol})/{half:.4g})'), place, low, high)
    text = tree(f'(({symbol} - {middle:.4g})/{half:.4g})')
    if place.never_negative:
        return f'({text})**2'
    return _centred(text, place, low, high)


def _centred(text: str, place: Place, low: float, high: float) -> str:
    """A formula minus its mean, which is the exponent, the rest angle or the offset itself."""
    mean = float(np.mean(evaluate(text, place.argument.symbol, np.linspace(low, high, GRID))))
    return f'{text} - {mean:.9g}'


def _share_of_a_line(grid: Array, values: Array) -> float:
    spread = float(np.std(values))
    if spread < 1e-9:
        return 1.0
    return float(np.corrcoef(grid, values)[0, 1]) ** 2


def visited(
    plant: PlantDescription, command: Array, joint: str
) -> dict[Argument, tuple[float, float]]:
    """Range of every place's argument, or its period, under a command (N, J) in rad, every ms."""
    names = plant.joint_names()
    distance = TermSpec(joint, 'exponent_of_distance', '0*d')
    if all((term.joint, term.place) != (joint, distance.place) for term in plant.terms):
        # Some states are simulated only if a function depends on one of them.
        plant = replace(plant, terms=(*plant.terms, distance))
    parameters, flags = pack(plant)
    inputs = np.zeros((len(names), len(command), INPUTS))
    inputs[:, :, IN_COMMAND] = command.T
    inputs[:, :, IN_MOTOR] = np.nan
    states, histories, sheaths = rest_state(parameters, flags, TICK)
    out = np.empty((len(names), EVERY, OUTPUTS))
    j, rows = names.index(joint), []
    for k in range(0, len(command) - EVERY + 1, EVERY):
        now = np.ascontiguousarray(inputs[:, k : k + EVERY])
        run_joints(states, histories, sheaths, parameters, flags, now, True, TICK, out)
        rows.append(np.r_[states[j], out[j, -1], command[k, j]])
    x = np.array(rows).T
    outputs, asked = x[len(states[j]) : -1], x[-1]
    angle, speed = x[JOINT], x[MOTOR_SPEED]
    wound = plant.joints[joint].pulley_radius * x[MOTOR]
    mean, half = x[MEAN_TENSION], 0.5 * x[TENSION_DIFFERENCE]
    readings = outputs[[OUT_TENSION_A, OUT_TENSION_B]]
    found = {
        places.TIME: np.array([0.0, len(command) * TICK]),
        places.SPEED: np.array([0.0, np.quantile(np.abs(x[SLIDING_SPEED]), 1.0 - _EDGE)]),
        places.DISTANCE: x[PATH],
        places.TENSION: np.concatenate([mean + half, mean - half]),
        places.BOTH_TENSIONS: mean,
        places.DIFFERENCE: 2.0 * half,
        places.ANGLE: angle,
        places.OTHER_ANGLE: x[OTHER],
        places.ANGULAR_SPEED: np.quantile(x[JOINT_STEP] / TICK, [_EDGE, 1.0 - _EDGE]),
        places.SHAFT: x[MOTOR],
        places.SHAFT_SPEED: np.quantile(speed, [_EDGE, 1.0 - _EDGE]),
        places.COMMANDED: asked,
        places.SERVO: asked - x[MOTOR],
        places.WOUND: np.concatenate([wound, -wound]),
        places.LAGGED_TENSION: np.concatenate([mean + half, mean - half]) - mean[0],
        places.LAGGED_SLIDING: np.array([0.0, np.quantile(np.abs(x[SLIDING_SPEED]), 1.0 - _EDGE)]),
        places.RELAXING: 0.5 * np.ptp(angle) * np.array([-1.0, 1.0]),
        places.READING: readings,
        places.NEIGHBOUR: readings,
        places.CYCLE: np.array(PERIODS_S),
        places.CYCLE_OF_SHAFT: np.ptp(x[MOTOR]) / np.array(CYCLES),
    }
    return {key: (float(values.min()), float(values.max())) for key, values in found.items()}


Formula = Callable[[float], EffectSpec]
"""Maps the strength to the effect, which vanishes at zero."""

DRAWN = tuple(each.id for each in CATALOGUE.values() if not each.traits.audited)
"""Effects that are drawn: all except those that only an audit of a bag detects."""
OF_THE_OTHER = frozenset(
    each.id
    for each in CATALOGUE.values()
    if any(FUNCTIONS[place].argument is OTHER_ANGLE for place in each.traits.families)
)
"""Effects caused by the other joint."""
_WIDEST = 1e3
"""Ratio of a parameter's starting values above which none is drawn between them."""
WIDER = 1.5
"""Factor by which drawn values exceed the starting values of a search, on either side."""
_WITHIN = (0.25, 0.7)
"""Range of onsets, as shares of the recording."""


def drawn_formula(
    generator: np.random.Generator, effect_id: str, joint: str, duration: float
) -> Formula:
    """Draw an effect except for its strength, for a recording of a duration in s."""
    effect = CATALOGUE[effect_id]
    # Parameters that can make the effect vanish set its strength: some are drawn, and grow
    # together. The limit of an effect that is a limit becomes smaller with the strength.
    sizes = [p for p in effect.parameters if math.isfinite(p.off) and p.off < p.high]
    limits = [] if sizes else [p for p in effect.parameters if p.off == p.high]
    chosen = [p for p in sizes if generator.random() < 0.5] or sizes[:1]
    growth = {p.name: _growth(generator, p) for p in chosen}
    fixed = _settings(generator, effect, {p.name for p in (*sizes, *limits)}, duration)

    def formula(strength: float) -> EffectSpec:
        grown = {p.name: p.off + strength * growth.get(p.name, 0.0) for p in sizes}
        nearer = {p.name: p.off / (1.0 + strength) for p in limits}
        return EffectSpec(effect_id, joint, {**fixed, **grown, **nearer})

    return formula


def _growth(generator: np.random.Generator, parameter: Parameter) -> float:
    values = [abs(v - parameter.off) for v in (*parameter.starts, parameter.typical)]
    size = next((v for v in values if v > 0.0), 0.1 * (parameter.high - parameter.low))
    sign = generator.choice([-1.0, 1.0]) if parameter.low < parameter.off else 1.0
    return float(sign * size * generator.uniform(0.3, 1.0))


def _settings(
    generator: np.random.Generator, effect: Effect, but: set[str], duration: float
) -> dict[str, float]:
    return {
        p.name: duration if p.is_duration else _setting(generator, p, duration)
        for p in effect.parameters
        if p.name not in but
    }


def _setting(generator: np.random.Generator, parameter: Parameter, duration: float) -> float:
    if parameter.choices:
        return float(generator.choice(parameter.choices))
    if parameter.counted:
        return float(generator.integers(int(parameter.low), int(parameter.high) + 1))
    if parameter.phase:
        return float(generator.uniform(-math.pi, math.pi))
    if parameter.starts == ONSETS:
        return float(generator.uniform(*_WITHIN) * duration)
    values = np.array([*parameter.starts, parameter.typical])
    sizes = np.abs(values)
    if sizes.min() == 0.0:
        drawn = generator.uniform(min(values.min(), 0.0), WIDER * values.max())
    elif sizes.max() / sizes.min() > _WIDEST:
        drawn = generator.choice(values) * WIDER ** generator.uniform(-1.0, 1.0)
    else:
        ends = np.log([sizes.min() / WIDER, sizes.max() * WIDER])
        drawn = generator.choice(np.sign(values)) * np.exp(generator.uniform(*ends))
    return float(np.clip(drawn, parameter.low, parameter.high))
