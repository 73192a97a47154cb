"""Data sets of LeRobot (v3.0), written by its own library where that is installed, and their card.

The card states what Open-H asks of a contribution: how channels were brought to one time, and by
how much each is late.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from endoscope_bags.episode import Channel, Channels, Episode
from endoscope_bags.information import SILENT_PERIODS
from endoscope_core.atomic_output import atomic_directory
from endoscope_core.errors import EndoscopeError, printable
from endoscope_core.rig import Kind

ROBOT_TYPE = 'endoscope'


def lerobot_dataset() -> Any:
    """LeRobot's class of data sets; EndoscopeError where this environment has none."""
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
    """Write episodes at `fps` frames a second to a new or empty folder, whole or not at all.

    `task` says what was done in all of them, `card` becomes README.md. EndoscopeError without
    LeRobot, OutputError if the folder cannot be written or has something in it.
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


DATA_TYPES = {
    Kind.SIMULATED: 'digital simulation',
    Kind.EMULATED: 'emulated servos',
    Kind.REAL: 'table-top rig',
    Kind.UNKNOWN: 'not recorded',
}


@dataclass(frozen=True)
class ChannelDelay:
    """By how much a channel is late, in s, or why that is unknown."""

    channel: str  # topic and name, for example `slave/measured_js:bend_x`
    against: str  # what it is late against
    value: float | None = None
    low: float = 0.0  # of the 90 % interval
    high: float = 0.0
    unknown: str = ''  # the reason, where there is no value

    def __str__(self) -> str:
        if self.value is None:
            return f'unknown: {self.unknown}'
        return f'{self.value:.4f} ({self.low:.4f} to {self.high:.4f})'


_CARD = """---
task_categories:
- robotics
tags:
- LeRobot
- healthcare
configs:
- config_name: default
  data_files: data/*/*.parquet
---

# {title}

A flexible endoscope whose bending section is pulled by wires in sheaths, recorded at the slave.

| episodes | frames | s | frames/s | rig |
|---|---|---|---|---|
| {episodes} | {frames} | {seconds:.1f} | {fps} | {kind} |

## Features

| feature | values | unit | topic | at a frame |
|---|---|---|---|---|
{features}
{lacking}
`action` is in joint space, absolute.

## Episodes

Frame k of an episode is at the stamp of its first frame plus k / {fps} s.

| episode | recording | frames | first frame, ns since 1970 | UTC |
|---|---|---|---|---|
{rows}

## Data synchronization

All devices stamp by one clock, and values stand at the stamps of their messages: no delay was
taken off. A command is in force from its stamp until the next one; what was measured is
interpolated between the readings on both sides of a frame. Where a topic is silent for more than
{silent:g} of its periods there is no frame, and another episode begins.

Delays in s, with 90 % intervals, positive where a channel is late:

| recording | channel | late against | delay |
|---|---|---|---|
{delays}

{method}
"""
_METHOD = """A sensor's delay was fitted together with the numbers of the rig's plant, simulated
from the first command on, so that the lag of friction and slack is not taken for its delay. A
shaft's is the shift at which it follows its command best. Both see the motion begin from rest,
which has no period by which a delay could be mistaken."""


def dataset_card(
    title: str,
    recordings: Sequence[Channels],
    episodes: Sequence[Episode],
    fps: int,
    kind: Kind,
    delays: Sequence[Sequence[ChannelDelay]],
) -> str:
    """The card of a data set as Markdown; a channel that `delays` lack is of unknown delay."""
    frames = sum(map(len, episodes))
    lacking = recordings[0].lacking
    rows = [
        (
            index,
            episode.recording,
            len(episode),
            episode.start_ns,
            datetime.fromtimestamp(episode.start_ns * 1e-9, UTC).isoformat(timespec='milliseconds'),
        )
        for index, episode in enumerate(episodes)
    ]
    late = [
        (one.name, delay.channel, delay.against, delay)
        for one, known in zip(recordings, delays, strict=True)
        for delay in _delays(one, known)
    ]
    return (
        _CARD.format(
            title=printable(title),
            episodes=len(episodes),
            frames=frames,
            seconds=frames / fps,
            fps=fps,
            kind=DATA_TYPES[kind],
            features=_table([_feature(c) for c in recordings[0].channels]),
            lacking=''.join(f'\n`{name}` is left out: {why}.\n' for name, why in lacking.items()),
            rows=_table(rows),
            silent=SILENT_PERIODS,
            delays=_table(late),
            method=_METHOD if any(each.value is not None for *_, each in late) else '',
        ).rstrip()
        + '\n'
    )


def _feature(channel: Channel) -> tuple[str, ...]:
    source = channel.source
    return (
        f'`{source.feature}`',
        ', '.join(channel.names),
        source.unit,
        f'`{source.topic}`, {source.quantity}',
        'the last one' if source.held else 'interpolated',
    )


def _delays(recorded: Channels, known: Sequence[ChannelDelay]) -> list[ChannelDelay]:
    """The known delays, and the measured channels that have none."""
    measured = dict.fromkeys(
        f'{c.source.topic}:{name}'
        for c in recorded.channels
        if not c.source.held
        for name in c.names
    )
    found = {delay.channel: delay for delay in known}
    return [
        found.get(name) or ChannelDelay(name, 'its stamp', unknown='not calibrated')
        for name in measured
    ]


def _table(rows: Sequence[Sequence[object]]) -> str:
    def cell(value: object) -> str:
        return printable(str(value)).replace('|', '\\|')

    return '\n'.join('| ' + ' | '.join(map(cell, row)) + ' |' for row in rows)
