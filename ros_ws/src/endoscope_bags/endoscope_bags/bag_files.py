"""Which files make a recording."""

from pathlib import Path
from typing import Any

import yaml

from endoscope_bags.errors import (
    BagNotFoundError,
    NotABagError,
    UnsupportedBagError,
)

METADATA = 'metadata.yaml'


def bag_files(path: Path) -> list[Path]:
    """Return the ``.mcap`` files of a recording in their order.

    Parameters
    ----------
    path
        A ``.mcap`` file, or a rosbag2 folder. A folder without ``metadata.yaml`` (its recorder was
        killed) is taken with all the ``.mcap`` in it.

    Raises
    ------
    BagNotFoundError
        The path, or a file that the metadata lists, does not exist.
    NotABagError
        The folder holds no recording, or its metadata are not rosbag2's.
    UnsupportedBagError
        The recording is in sqlite3 or compressed as a whole.
    """
    if not path.exists():
        raise BagNotFoundError(f'{path}: no such file or folder')
    if path.is_file():
        return [path]
    if not (path / METADATA).is_file():
        found = sorted(path.glob('*.mcap'))
        if not found:
            raise NotABagError(f'{path}: a folder with neither metadata.yaml nor any .mcap in it')
        return found
    information = read_metadata(path / METADATA)
    storage = information.get('storage_identifier')
    if storage != 'mcap' or information.get('compression_mode', '').lower() in ('file', 'message'):
        raise UnsupportedBagError(
            f'{path}: storage {storage}, compression mode '
            f'{information.get("compression_mode") or "none"}; convert it to plain mcap first '
            '(ros2 bag convert)'
        )
    files = [path / Path(name).name for name in information['relative_file_paths']]
    for file in files:
        if not file.is_file():
            raise BagNotFoundError(f'{file}: missing, though {path / METADATA} lists it')
    return files


def read_metadata(path: Path) -> dict[str, Any]:
    """Return what is under `rosbag2_bagfile_information` in a ``metadata.yaml``.

    Raises
    ------
    NotABagError
        The file is not YAML or lacks it, or lacks the list of files.
    """
    try:
        document = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise NotABagError(
            f'{path}: not readable as YAML ({" ".join(str(error).split())})'
        ) from error
    information = (
        (document or {}).get('rosbag2_bagfile_information')
        if (isinstance(document, dict))
        else None
    )
    if not isinstance(information, dict) or not information.get('relative_file_paths'):
        raise NotABagError(f'{path}: not the metadata of a rosbag2 recording')
    return information
