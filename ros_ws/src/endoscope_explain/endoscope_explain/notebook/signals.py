"""Everything that a recording measured or commanded, as arrays by name; and arrays as one."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from endoscope_bags import BagWriter, MessageStream, open_bag
from endoscope_bags.cdr import encode_joint_states
from endoscope_bags.errors import BagError
from endoscope_bags.message_types import JOINT_STATE
from endoscope_core.errors import EndoscopeError, InputError, nearest
from endoscope_core.names import JOINTS
from endoscope_explain.notebook.arguments import SCRATCH, checked
from endoscope_explain.recording import (
    BENDING,
    COMMAND,
    DESIRED,
    MOTOR,
    WIRES,
    Array,
    motor_name,
    wire_names,
)
from endoscope_explain.report.sentences import table

if TYPE_CHECKING:
    from pandas import DataFrame

UNITS = {'position': 'rad', 'velocity': 'rad/s', 'effort': 'N m'}


class UnknownSignalError(EndoscopeError, KeyError):
    """A name that no signal of the recording has; a KeyError, as a mapping's `in` needs one."""


@dataclass(frozen=True)
class RecordedSignal:
    """One quantity of one joint, motor or wire.

    Attributes
    ----------
    name : str
        As reports write it, such as `wires/measured_js:wire_x_pos`.
    unit : str
        SI.
    time : ndarray, shape (N,)
        Header stamps in s from the recording's first one.
    values : ndarray, shape (N,)
        NaN where the recording has no number.
    """

    name: str
    unit: str
    time: Array
    values: Array

    def __len__(self) -> int:
        return len(self.time)

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.values, dtype=dtype, copy=copy)


@dataclass(frozen=True)
class Signals(Mapping[str, RecordedSignal]):
    """The signals of a recording by name.

    Attributes
    ----------
    path : Path
        The bag.
    origin : float
        First stamp of all, in s of the recording's clock.
    by_name : mapping of str to Signal
    """

    path: Path
    origin: float
    by_name: Mapping[str, RecordedSignal]
    # A folder that goes when nobody looks at the recording in it any more.
    _kept: Any = field(default=None, compare=False)

    def __getitem__(self, name: str) -> RecordedSignal:
        try:
            return self.by_name[name]
        except KeyError:
            raise UnknownSignalError(
                f'{self.path.name}: no signal {name}: {nearest(str(name), self.by_name)}'
            ) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self.by_name)

    def __len__(self) -> int:
        return len(self.by_name)

    @property
    def duration(self) -> float:
        """Seconds from the first stamp to the last."""
        return max(float(signal.time[-1]) for signal in self.values())

    @checked
    def to_frame(self, names: Sequence[str] | None = None) -> 'DataFrame':
        """Return signals as the columns of a table, a row for each stamp that one of them has.

        Parameters
        ----------
        names : sequence of str, optional
            Which; all if not given.

        Returns
        -------
        pandas.DataFrame
            By `time` in s; NaN where a signal has no sample. Of samples with one stamp the last.

        Raises
        ------
        EndoscopeError
            This environment has no pandas.
        """
        try:
            from pandas import DataFrame, Index
        except ImportError as error:
            raise EndoscopeError(
                'to_frame needs pandas: `make -C ros_ws pandas` installs it'
            ) from error
        signals = [self[name] for name in (self if names is None else names)]
        time = np.unique(np.concatenate([signal.time for signal in signals]))
        columns = {signal.name: np.full(len(time), np.nan) for signal in signals}
        for signal in signals:
            columns[signal.name][np.searchsorted(time, signal.time)] = signal.values
        return DataFrame(columns, Index(time, name='time'))

    def __repr__(self) -> str:
        rows = [_cells(signal) for signal in self.values()]
        return f'{self.path.name}: {self.duration:.3f} s\n{table(_HEAD, rows)}'


_HEAD = ('signal', 'unit', 'samples', 'rate', 'range')


@checked
def read(bag: str | Path, *, namespace: str | None = None) -> Signals:
    """Read all joint states of a recording.

    Parameters
    ----------
    bag : str or Path
        rosbag2 folder or `.mcap`.
    namespace : str, optional
        Of the rig's topics, where a bag has several rigs.

    Returns
    -------
    Signals
        By names such as `wires/measured_js:wire_x_pos`.

    Raises
    ------
    BagError
        It cannot be read, has no joint states, or a topic is under several namespaces.
    """
    path, recorded = Path(bag), open_bag(bag)
    names = [n for n, t in recorded.topics.items() if t.type == JOINT_STATE and t.message_count]
    relative = sorted({'/'.join(name.split('/')[-2:]) for name in names})
    series = {
        topic: recorded.joint_state(topic, namespace=namespace, finite=())
        for topic in relative
        if recorded.has(topic, namespace)
    }
    if not series:
        raise BagError(f'{path}: holds no joint states; it has {", ".join(recorded.topics)}')
    origin_ns = min(int(one.stamp_ns[0]) for one in series.values())
    found = {}
    for topic, one in series.items():
        for quantity, unit in UNITS.items():
            values = getattr(one, quantity)
            for column, name in enumerate(one.names if values is not None else ()):
                signal = RecordedSignal(
                    name_of(topic, name, quantity),
                    'N' if (topic, quantity) == (WIRES, 'effort') else unit,
                    one.seconds(origin_ns),
                    np.ascontiguousarray(values[:, column]),
                )
                found[signal.name] = signal
    return Signals(path, origin_ns * 1e-9, found)


def name_of(topic: str, name: str, quantity: str) -> str:
    """Name of a signal as in `endoscope_explain.recording`, for topics of all kinds."""
    usual = {WIRES: 'effort', MOTOR: ''}.get(topic, 'position')
    return f'{topic}:{name}' + ('' if quantity == usual else f'.{quantity}')


def _cells(signal: RecordedSignal) -> tuple[str, ...]:
    steps = np.diff(signal.time)
    rate = f'{1.0 / np.median(steps):.4g} Hz' if len(steps) and np.median(steps) > 0.0 else '-'
    finite = signal.values[np.isfinite(signal.values)]
    span = f'{finite.min():.4g} to {finite.max():.4g}' if len(finite) else '-'
    return signal.name, signal.unit, str(len(signal)), rate, span


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
    values: dict[str, Any] = {
        quantity: np.stack([column.get(name, nothing) for name in names], axis=1)
        for quantity, column in columns.items()
    }
    stamps = np.round(time * 1e9).astype(np.int64)
    payloads = encode_joint_states(names, stamps, **values)
    return MessageStream(f'/endoscope/{topic}', JOINT_STATE, payloads, stamps)
