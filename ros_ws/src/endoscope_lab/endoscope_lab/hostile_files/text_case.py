"""Spoiled texts: descriptions in YAML, tables and command files."""

import math
import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.random import Generator

from endoscope_bags import BagWriter, open_bag
from endoscope_bags.cdr_encoding import encode_joint_state
from endoscope_bags.information import bag_information
from endoscope_bags.message_types import JOINT_STATE
from endoscope_bags.table_mapping import load_table_mapping
from endoscope_bags.text_table import convert_table
from endoscope_core.physics import (
    EffectSpec,
    JointParameters,
    PlantDescription,
    TermSpec,
    load_plant,
    save_plant,
)
from endoscope_core.physics.description import NUMBERS
from endoscope_core.signals.command_file import read_command_file, write_command_file
from endoscope_devices.load_cells.calibration_file import load_calibration
from endoscope_lab.hostile_files.spoiling import spoiled_table, spoiled_yaml

_WIRES = ('wire_x_pos', 'wire_x_neg', 'wire_y_pos', 'wire_y_neg')
_CELLS = """\
transmitter:
  unit: 1
  registers: input
  rate: 200.0
  serial: {baud: 115200, parity: none, stop_bits: 1}
wires:
  wire_x_pos: {register: 0, type: int32, newton_per_count: 0.001, sign: 1, zero: 120}
  wire_x_neg: {register: 2, type: int32, newton_per_count: 0.001}
  wire_y_pos: {register: 4, type: int32, newton_per_count: 0.001}
  wire_y_neg: {register: 6, type: int32, newton_per_count: 0.001}
faults:
  broken_below: -200000
  broken_above: 200000
  saturated_below: -20000
  saturated_above: 150000
tare: {noise: 0.1, drift: 0.05, largest: 2.0, shaft_speed: 0.02}
"""
_MAPPING = """\
time: {column: 1, unit: s}
delimiter: ','
header_lines: 1
namespace: /rig
start_s: 0.5
topics:
  slave/servo_jp:
    position: {bend_x: {column: 2, unit: deg}}
  wires/measured_js:
    effort: {wire_x_pos: {column: 3, unit: N}, wire_x_neg: {column: 4, unit: N, scale: 2.0}}
"""


@dataclass(frozen=True)
class TextCase:
    """A text that is damaged again for each case."""

    path: Path
    text: str
    damaged: Callable[[str, Generator], bytes]
    read: Callable[[], bool]  # whether what came out is right

    def spoil(self, rng: Generator) -> None:
        self.path.write_bytes(self.damaged(self.text, rng))


def _damaged_table(text: str, rng: Generator) -> bytes:
    return spoiled_table(text, rng, ',')


def metadata_case(folder: Path) -> TextCase:
    """The `metadata.yaml` of a sound recording, whose messages are what they were."""
    bag = folder / 'bag'
    with BagWriter(bag) as writer:
        for k in range(20):
            data = encode_joint_state(['bend_x'], k, position=[float(k)])
            writer.write_raw('/rig/slave/servo_jp', JOINT_STATE, data, k)

    def read() -> bool:
        recording = open_bag(bag)
        str(bag_information(recording)).encode()
        position = recording.joint_state('slave/servo_jp').require('position')
        return bool((position[:, 0] == np.arange(20)).all())

    path = bag / 'metadata.yaml'
    return TextCase(path, path.read_text(), spoiled_yaml, read)


def plant_case(folder: Path) -> TextCase:
    """A plant.yaml; every parameter has to be one that an instrument can have."""
    path = folder / 'plant.yaml'
    gravity = EffectSpec('gravity', 'bend_x', {'moment_nm': 0.01})
    joint = JointParameters(friction_profile=(0.3, -0.1))
    term = TermSpec('bend_x', 'load_of_angle', '0.01*tanh(q/0.5)', range=(-1.5, 1.5))
    save_plant(PlantDescription({'bend_x': joint}, effects=(gravity,), terms=(term,)), path)

    def read() -> bool:
        plant = load_plant(path)
        sets = [asdict(joint) for joint in plant.joints.values()] + [asdict(plant.sensors)]
        return all(
            NUMBERS[key].low <= number <= NUMBERS[key].high
            for parameters in sets
            for key, value in parameters.items()
            for number in np.atleast_1d(value)
        )

    return TextCase(path, path.read_text(), spoiled_yaml, read)


def cells_case(folder: Path) -> TextCase:
    """A calibration of load cells; counts have to become finite tensions."""
    path = folder / 'cells.yaml'

    def read() -> bool:
        cells = load_calibration(path, _WIRES).wires.values()
        return all(math.isfinite(cell.tension(1e5)) for cell in cells)

    return TextCase(path, _CELLS, spoiled_yaml, read)


def mapping_case(folder: Path) -> TextCase:
    """The mapping of a text table, by which a sound table is converted."""
    path, table = folder / 'mapping.yaml', folder / 'sound.csv'
    table.write_text(_table_text())
    return TextCase(path, _MAPPING, spoiled_yaml, partial(_convert, table, path, folder / 'out'))


def table_case(folder: Path) -> TextCase:
    path, mapping = folder / 'table.csv', folder / 'sound.yaml'
    mapping.write_text(_MAPPING)
    read = partial(_convert, path, mapping, folder / 'out')
    return TextCase(path, _table_text(), _damaged_table, read)


def command_case(folder: Path) -> TextCase:
    """A command file; time has to increase and angles to be finite."""
    path = folder / 'commands.csv'
    time = np.arange(0.0, 1.0, 0.01)
    write_command_file(path, time, np.sin(np.stack([time, 2.0 * time], axis=1)))

    def read() -> bool:
        table = read_command_file(path)
        increases = bool((table.time[1:] > table.time[:-1]).all())
        return increases and bool(np.isfinite(table.angle).all())

    return TextCase(path, path.read_text(), _damaged_table, read)


def _table_text() -> str:
    rows = [f'{k * 0.01:.3f},{math.sin(k):.4f},{5 + k % 3},{5 - k % 3}' for k in range(50)]
    return '\n'.join(['time,bend,pos,neg', *rows]) + '\n'


def _convert(table: Path, mapping: Path, out: Path) -> bool:
    try:
        converted = convert_table(table, load_table_mapping(mapping), out)
        recording = open_bag(out)
        return recording.message_count == converted.messages
    finally:
        shutil.rmtree(out, ignore_errors=True)
