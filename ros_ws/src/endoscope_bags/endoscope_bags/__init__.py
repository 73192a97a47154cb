"""Reading, writing, checking and recovering rosbag2 recordings, free of ROS."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from endoscope_bags.bag_writer import BagWriter, MessageStream
    from endoscope_bags.errors import BagError
    from endoscope_bags.joint_state_series import JointStateSeries, PoseSeries
    from endoscope_bags.recording import Recording, open_bag
    from endoscope_bags.topic import RawMessage, Topic

_HOME = {
    'BagError': 'errors',
    'BagWriter': 'bag_writer',
    'JointStateSeries': 'joint_state_series',
    'MessageStream': 'bag_writer',
    'PoseSeries': 'joint_state_series',
    'RawMessage': 'topic',
    'Recording': 'recording',
    'Topic': 'topic',
    'open_bag': 'recording',
}

__all__ = [
    'BagError',
    'BagWriter',
    'JointStateSeries',
    'MessageStream',
    'PoseSeries',
    'RawMessage',
    'Recording',
    'Topic',
    'open_bag',
]


def __getattr__(name: str) -> Any:
    # Importing one module does not load numpy and mcap for the others.
    if name in _HOME:
        return getattr(import_module(f'endoscope_bags.{_HOME[name]}'), name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
