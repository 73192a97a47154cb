"""Terms that a missing push on a joint may be made of, as formulas in its states."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.joint_states import JointStates

Array = NDArray[np.float64]

NODES = {'command': 'rad', 'stretch': 'm', 'moment': 'N m', 'reading': 'rad'}
"""Where a term may act, with its unit: the command, the wires' stretch, the joint's moment, and
the tracker's reading."""
JOINT_SIGN = 'tanh(dq/0.05)'
WIRE_SIGN = 'tanh(v/1e-4)'

_FUNCTIONS = {'tanh': np.tanh, 'exp': np.exp, 'sin': np.sin, 'cos': np.cos, 'abs': np.abs}


@dataclass(frozen=True)
class Term:
    """A formula at a node.

    Attributes
    ----------
    node : str
        Of `NODES`.
    expression : str
        In the names of `STATE_NAMES` and tanh, exp, sin, cos, abs.
    """

    node: str
    expression: str

    def along(self, states: JointStates) -> Array:
        """Return the formula's values (N,) along a simulation."""
        code = compile(self.expression, '<term>', 'eval')
        # The expressions are this module's own; no input of a user gets here.
        value = eval(code, {'__builtins__': {}}, {**_FUNCTIONS, **states.values})
        return np.broadcast_to(np.asarray(value, dtype=float), states['t'].shape)


def library(states: JointStates) -> tuple[Term, ...]:
    """All terms worth a try over the ranges that the states cover."""
    terms = [Term('moment', e) for e in _of_angle('q', states['q'])]
    terms += [
        Term('moment', e)
        for e in (
            'q',
            'q**2',
            'q**3',
            'dq',
            'dq*abs(dq)',
            't*q',
            'lag_q',
            'T*q',
            'q_other',
            'q_other**2',
            'q*q_other',
            'q*q_other**2',
            'q*exp(-t/5)',
            'q*exp(-t/20)',
        )
    ]
    terms += [Term('moment', f'{JOINT_SIGN}*{e}') for e in _friction('q')]
    terms += [Term('stretch', f'{WIRE_SIGN}*{e}') for e in (*_friction('q'), *_friction('m'))]
    terms += [
        Term('stretch', e)
        for e in (
            *_of_angle('m', states['m']),
            *_of_time(states['t']),
            'q**2',
            'm**2',
            'm**3',
            'lag_T',
            'T',
            '(m - q)*t',
            '(m - q)*exp(-t/5)',
            '(m - q)*exp(-t/20)',
            '(m - q)*T',
            'q_other',
            'q_other**2',
        )
    ]
    terms += [Term('command', e) for e in ('m**2', 'm**3', 'tanh(dm/0.05)', 't', *_waves('m'))]
    terms += [
        Term('reading', e)
        for e in (
            'tau',
            'abs(tau)',
            'dm',
            'T',
            'tau*q',
            'q**2',
            'q_other',
            'q_other**2',
            'q*q_other',
            'lag_q',
            *_waves('q'),
        )
    ]
    return tuple(dict.fromkeys(terms))


def _friction(position: str) -> tuple[str, ...]:
    return (
        '1',
        f'abs({position})',
        f'{position}**2',
        'T',
        'dwell',
        't',
        'exp(-t/5)',
        'q_other**2',
        'abs(q_other)',
        *_waves(position),
    )


def _waves(position: str) -> tuple[str, ...]:
    return tuple(
        f'{wave}({n}*{position})' for n in (3, 5, 8, 12, 16, 20, 26) for wave in ('sin', 'cos')
    )


def _of_angle(name: str, values: Array) -> tuple[str, ...]:
    low, high = float(np.min(values)), float(np.max(values))
    centres = np.linspace(low, high, 11)[1:-1]
    width = max((high - low) / 10.0, 1e-3)
    bumps = tuple(
        f'exp(-(({name} - {c:.3f})/{w:.3f})**2)' for c in centres for w in (width, 0.5 * width)
    )
    return (*bumps, *_waves(name))


def _of_time(values: Array) -> tuple[str, ...]:
    return tuple(f'tanh((t - {c:.1f})/0.1)' for c in np.linspace(0.0, values[-1], 17)[1:-1])
