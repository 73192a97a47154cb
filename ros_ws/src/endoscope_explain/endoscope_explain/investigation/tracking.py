"""How well the tip follows what is asked for, by the described and by the improved plant."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import open_bag
from endoscope_core.errors import NotPlayedError
from endoscope_core.metrics import tracking_rmse
from endoscope_core.names import JOINTS
from endoscope_core.physics.description import PlantDescription
from endoscope_core.rig import Rig
from endoscope_core.signals import move, non_periodic_signal, sequence
from endoscope_core.signals.sampled_motion import (
    CommandTable,
    read_command_file,
    write_command_file,
)
from endoscope_explain.experiment_motions import SAMPLE_S, as_played
from endoscope_explain.investigation import log as logs
from endoscope_explain.investigation.log import Log, Tracking
from endoscope_explain.investigation.motions import RigMotion, commissioning, require_allowed
from endoscope_explain.recording import BENDING, DESIRED

Array = NDArray[np.float64]

HELD_OUT = 'held-out motion'
FILE = 'held_out.csv'
DURATION_S = 15.0
LEAD_S = 4.0
"""Before errors count, the tip goes as far to either side as it will, so that play and friction are
where the same way has led them, whatever was before and whichever plant is inverted."""
SHARE = 0.5
"""Of the largest angle of the commissioning motion: what compensation adds to it stays within what
the rig has been through."""

PlayThrough = Callable[[RigMotion, Path, Path, Path], None]
"""Plays a motion, which a file holds, to a bag, through the inverse of the plant of another."""


@dataclass(frozen=True)
class Tracked:
    """A motion as it was asked for and as the tip made it."""

    time: Array  # (N,), s since the motion began, which is led into for `LEAD_S`
    desired: Array  # (N, J), rad
    tip: Array  # (N, J), rad

    @property
    def rmse(self) -> float:
        """In rad, over all joints."""
        return tracking_rmse(self.desired, self.tip)


def held_out(plant: PlantDescription, rig: Rig) -> RigMotion:
    """A motion of both joints that is among no experiments."""
    first = commissioning(plant, rig)
    signal = non_periodic_signal(DURATION_S)
    time = np.arange(0.0, LEAD_S + signal.duration, SAMPLE_S)
    lead = time < LEAD_S
    angle = np.asarray(signal(time[~lead] - LEAD_S)[0])
    largest = SHARE * first.largest
    angle *= largest / float(np.abs(angle).max())
    parts = [move(0.0, 1.0, 1.0), move(1.0, -1.0, 2.0), move(-1.0, angle[0] / largest, 1.0)]
    aside = sequence('to either side', parts)
    angle = np.concatenate([largest * aside(time[lead])[0], angle])
    columns = [angle if joint in plant.joints else 0.0 * angle for joint in JOINTS]
    table = CommandTable(JOINTS, *as_played(time, np.stack(columns, axis=1), rig))
    why = 'It is among no experiments: it shows what the improved plant is good for.'
    return RigMotion(HELD_OUT, first.joint, why, table)


def with_tracking(
    log: Log, folder: Path, plant_file: Path, motion: RigMotion, rig: Rig, play: PlayThrough
) -> Log:
    """The log with how the tip follows a motion by the described and by the improved plant.

    Where that was not wanted or refused, the log notes it. RigStoppedError if the rig stops.
    """
    require_allowed(motion, rig)
    write_command_file(folder / FILE, motion.table.time, motion.table.angle, JOINTS)
    found: tuple[Tracking, ...] = ()
    for by, file in (('described', plant_file), ('improved', folder / logs.PLANT)):
        bag = f'tracking_{by}_{1 + sum(1 for _ in folder.glob(f"tracking_{by}_*"))}'
        try:
            play(motion, folder / FILE, folder / bag, file)
        except NotPlayedError as error:
            return replace(log, tracking=(), untracked=str(error))
        rmse = math.degrees(tracked(folder / bag, folder / FILE).rmse)
        found = (*found, Tracking(by, bag, rmse))
    return replace(log, tracking=found, untracked='')


def tracked(bag: Path, file: Path) -> Tracked:
    """What a bag has of a motion that a file asks for, by the time of the file, once led into.

    BagError if it cannot be read.
    """
    opened, table = open_bag(bag), read_command_file(file)
    stream, tip = (opened.joint_state(topic).select(JOINTS) for topic in (DESIRED, BENDING))
    stamp_s = 1e-9 * (stream.stamp_ns - stream.stamp_ns[0])
    columns = stream.require('position').T

    def desired(time: Array) -> Array:
        return np.stack([np.interp(time, stamp_s, column) for column in columns], axis=1)

    # The way to the beginning of a motion takes as long as it takes.
    spare = max(0.0, stamp_s[-1] - table.time[-1])
    begins = np.arange(0.0, spare + SAMPLE_S, SAMPLE_S)
    off = [tracking_rmse(table.angle, desired(table.time + begin)) for begin in begins]
    begin = float(begins[np.argmin(off)])
    since = 1e-9 * (tip.stamp_ns - stream.stamp_ns[0]) - begin
    inside = (since >= LEAD_S) & (since <= stamp_s[-1] - begin)
    return Tracked(since[inside], desired(since[inside] + begin), tip.require('position')[inside])
