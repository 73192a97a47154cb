"""Data sets of LeRobot (v3.0), written by its own library, which is installed only where wanted."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from endoscope_bags.episode import Channel, Episode
from endoscope_core.atomic_output import atomic_directory
from endoscope_core.errors import EndoscopeError

ROBOT_TYPE = 'endoscope'


def lerobot_dataset() -> Any:
    """Return LeRobot's class of data sets.

    Raises
    ------
    EndoscopeError
        This environment has no LeRobot.
    """
    try:
        from lerobot.datasets import LeRobotDataset
    except ImportError as error:
        raise EndoscopeError(
            'a data set of LeRobot needs its library: `make -C ros_ws lerobot` makes .venv-lerobot '
            f'with it, whose `endoscope bag export` writes one ({str(error).splitlines()[0]})'
        ) from error
    return LeRobotDataset


def write_lerobot(
    folder: Path,
    channels: Sequence[Channel],
    episodes: Sequence[Episode],
    fps: int,
    task: str,
    card: str,
) -> None:
    """Write a data set to a new or empty folder, whole or not at all.

    Parameters
    ----------
    folder
        Its name becomes that of the data set.
    channels
        Whose features the episodes have.
    episodes
        At `fps` frames a second.
    fps
        Of the data set.
    task
        What was done in all episodes, in words.
    card
        Becomes README.md.

    Raises
    ------
    EndoscopeError
        This environment has no LeRobot.
    OutputError
        The folder cannot be written, or has something in it.
    """
    library = lerobot_dataset()
    features = {
        c.source.feature: {
            'dtype': 'float32',
            'shape': (len(c.names),),
            'names': list(c.names),
            'info': {'unit': c.source.unit, 'topic': c.source.topic},
        }
        for c in channels
    }
    with atomic_directory(folder) as partial:
        # LeRobot makes the folder itself.
        partial.rmdir()
        data = library.create(
            f'{ROBOT_TYPE}/{folder.name}',
            fps,
            features,
            root=partial,
            robot_type=ROBOT_TYPE,
            use_videos=False,
            video_backend='pyav',  # looking for another one takes a page of warnings
        )
        for episode in episodes:
            for k in range(len(episode)):
                frame = {feature: values[k] for feature, values in episode.values.items()}
                data.add_frame({**frame, 'task': task})
            data.save_episode()
        data.finalize()
        (partial / 'README.md').write_text(card, encoding='utf-8')
