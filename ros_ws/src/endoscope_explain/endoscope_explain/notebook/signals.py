"""Everything that a recording measured or commanded, as arrays by name."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from endoscope_bags import open_bag
from endoscope_bags.errors import BagError
from endoscope_bags.message_types import JOINT_STATE
from endoscope_core.errors import EndoscopeError, nearest
from endoscope_explain.notebook.arguments import checked
from endoscope_explain.recording import MOTOR, WIRES, Array
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
