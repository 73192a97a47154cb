"""Arrays that are in no bag yet: measurements of one's own, and commands."""

import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from endoscope_bags import BagWriter, MessageStream
from endoscope_bags.cdr import encode_joint_states
from endoscope_bags.message_types import JOINT_STATE
from endoscope_core.errors import InputError, nearest
from endoscope_core.names import JOINTS
from endoscope_explain.notebook.arguments import SCRATCH, checked
from endoscope_explain.notebook.signals import UNITS, Array, RecordedSignal, Signals, name_of, read
from endoscope_explain.recording import (
    BENDING,
    COMMAND,
    DESIRED,
    MOTOR,
    WIRES,
    motor_name,
    wire_names,
)

TIME = 'time'
LATEST_S = 2.0**31
"""Of a stamp."""


@checked
def from_arrays(
    signals: Mapping[str, RecordedSignal | tuple[ArrayLike, ArrayLike]],
    *,
    out: str | Path | None = None,
) -> Signals:
    """Make a recording of arrays, which `explain` and `simulate` take.

    Parameters
    ----------
    signals : mapping of str to (array, array) or Signal
        By name as `read` gives them, such as `wires/measured_js:wire_x_pos`: times (N,) in s and
        values (N,) in SI, angles in rad. Signals of one topic, which is what stands before the
        colon, share their times.
    out : str or Path, optional
        Where to write it as a bag; without it, it is kept as long as the result is.

    Returns
    -------
    Signals
        As `read` gives them.

    Raises
    ------
    EndoscopeError
        A name is unknown, times run back, a value is not finite, or `out` exists.
    """
    known = _known()
    times: dict[str, tuple[str, Array]] = {}
    columns: dict[str, dict[str, dict[str, Array]]] = {}
    for name, given in signals.items():
        if name not in known:
            raise InputError(f'{name} is not a signal: {nearest(name, known)}')
        topic, of, quantity = known[name]
        pair = (given.time, given.values) if isinstance(given, RecordedSignal) else given
        time, values = _checked(name, pair)
        first, shared = times.setdefault(topic, (name, time))
        if not np.array_equal(shared, time):
            raise InputError(f'{name}: give it the times of {first}, as both are of {topic}')
        columns.setdefault(topic, {}).setdefault(quantity, {})[of] = values
    if not columns:
        raise InputError(f'no signals: give some of {", ".join(known)}')
    scratch = None if out is not None else tempfile.TemporaryDirectory(prefix=SCRATCH)
    path = Path(scratch.name) / 'arrays.mcap' if scratch is not None else Path(str(out))
    with BagWriter(path) as bag:
        bag.write_streams([_stream(topic, times[topic][1], of) for topic, of in columns.items()])
    return replace(read(path), _kept=scratch)


def commands_from(commands: Mapping[str, ArrayLike]) -> Signals:
    """Make a recording of `time` in s and angles in rad of joints or of motor shafts, each (N,)."""
    angles = [name for name in commands if name != TIME]
    motors = {name.startswith('motor_') for name in angles}
    if TIME not in commands or len(motors) != 1:
        raise InputError(
            f'{", ".join(commands) or "nothing"}: give {TIME}, and angles of joints '
            '(bend_x, bend_y) or of motor shafts (motor_x, motor_y)'
        )
    topic = COMMAND if motors.pop() else DESIRED
    return from_arrays({f'{topic}:{name}': (commands[TIME], commands[name]) for name in angles})


def _known() -> dict[str, tuple[str, str, str]]:
    """Topic, name in it, and quantity of every signal that an analysis uses, by its name."""
    known = []
    for joint in JOINTS:
        motor = motor_name(joint)
        known += [(COMMAND, motor, 'position'), (DESIRED, joint, 'position')]
        known += [(MOTOR, motor, quantity) for quantity in UNITS]
        known += [(WIRES, wire, 'effort') for wire in wire_names(joint)]
        known += [(BENDING, joint, 'position')]
    return {name_of(*parts): parts for parts in known}


def _checked(name: str, pair: tuple[ArrayLike, ArrayLike]) -> tuple[Array, Array]:
    """Times and values of a signal."""
    try:
        time, values = (np.asarray(array, dtype=np.float64) for array in pair)
    except (TypeError, ValueError) as error:
        raise InputError(f'{name}: give an array of times and one of values') from error
    if time.ndim != 1 or len(time) < 2 or not (np.diff(time) >= 0.0).all() or time[0] == time[-1]:
        raise InputError(f'{name}: give two or more times in s that increase')
    if not 0.0 <= time[0] <= time[-1] < LATEST_S:
        raise InputError(f'{name}: times are in s from 0 or later, not {time[0]:g} to {time[-1]:g}')
    if values.shape != time.shape:
        raise InputError(f'{name}: give {len(time)} values, one for each time, not {values.shape}')
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        raise InputError(
            f'{name}: {len(wrong)} of {len(values)} values are not finite, first at '
            f'{time[wrong[0]]:g} s: leave these samples out'
        )
    return time, values


def _stream(topic: str, time: Array, columns: Mapping[str, Mapping[str, Array]]) -> MessageStream:
    """One topic's messages; columns by quantity, then by name."""
    names = list(dict.fromkeys(name for column in columns.values() for name in column))
    nothing = np.full(len(time), np.nan)
    values = {
        quantity: np.stack([column.get(name, nothing) for name in names], axis=1)
        for quantity, column in columns.items()
    }
    stamps = np.round(time * 1e9).astype(np.int64)
    payloads = encode_joint_states(
        names,
        stamps,
        position=values.get('position'),
        velocity=values.get('velocity'),
        effort=values.get('effort'),
    )
    return MessageStream(f'/endoscope/{topic}', JOINT_STATE, payloads, stamps)
