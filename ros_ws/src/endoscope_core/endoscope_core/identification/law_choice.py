"""Which feed-forward law follows from a calibration."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from endoscope_core.choices import (
    ADAPTIVE_PHYSICAL,
    BY_ADOPTED,
    BY_CLASS,
    BY_PLANT,
    BY_SIZE,
    PHYSICAL,
    SELECTIONS,
)
from endoscope_core.control import FeedforwardLaw, PhysicalParameters
from endoscope_core.errors import FileError, InputError
from endoscope_core.identification.updated_table import (
    LawParameters,
    UpdatedTable,
    load_class_parameters,
    parameters_for_class,
)
from endoscope_core.safety import BendingRange


@dataclass(frozen=True)
class CalibrationFindings:
    """What a calibration found out about the tube."""

    class_deg: int | None = None  # hysteresis class: backlash size in deg
    size: float | None = None  # backlash size in rad
    plants: tuple[PhysicalParameters, ...] = ()  # of each joint; empty where not identified
    # How far each joint can be bent in this tube; empty where that is not known.
    ranges: tuple[BendingRange, ...] = ()

    def __str__(self) -> str:
        parts = [] if self.class_deg is None else [f'class {self.class_deg} deg']
        if self.size is not None:
            parts.append(f'size {math.degrees(self.size):.1f} deg')
        return ', '.join([*parts, *(['plant identified'] if self.plants else [])])


class LawChoice:
    """Finds the parameters of a mode, by default the shipped ones, and keeps the files it read."""

    def __init__(self, joints: int, parameter_sets: str = '', table: str = '') -> None:
        self._joints = joints
        self._parameter_sets = parameter_sets
        self._table = table
        self._sets: dict[str, dict[int, LawParameters]] = {}
        self._tables: dict[str, UpdatedTable] = {}

    def law(
        self,
        mode: str,
        selected_by: str,
        findings: CalibrationFindings,
        adopted: tuple[PhysicalParameters, ...] = (),
    ) -> FeedforwardLaw:
        """The law of a mode after a calibration.

        By 'class' it takes the class's set (first paper), by 'size' the updated table at the
        regressed backlash size, by 'plant' and by 'adopted' a plant of each joint. InputError if
        something needed was not found, since nothing is guessed; FileError for a bad file.
        """
        if mode == 'none':
            return FeedforwardLaw()
        model = PHYSICAL if mode == ADAPTIVE_PHYSICAL else mode
        if selected_by == BY_PLANT:
            if model != PHYSICAL:
                raise InputError(f'mode {mode} is not selected by plant: take class or size')
            if len(findings.plants) != self._joints:
                raise InputError('the calibration did not identify the plant')
            return FeedforwardLaw(mode, findings.plants)
        if selected_by == BY_ADOPTED:
            if mode != PHYSICAL:
                raise InputError(f'mode {mode} is not selected by adopted: take {PHYSICAL}')
            if len(adopted) != self._joints:
                raise InputError('no plant has been adopted')
            return FeedforwardLaw(mode, adopted)
        if selected_by == BY_SIZE:
            if findings.size is None or not math.isfinite(findings.size):
                raise InputError('the calibration did not find a backlash size')
            parameters = self._table_of(model).parameters_for(findings.size)
        elif selected_by == BY_CLASS:
            if findings.class_deg is None:
                raise InputError('the calibration did not find a class')
            parameters = parameters_for_class(self._sets_of(model), findings.class_deg)
        else:
            raise InputError(
                f'unknown selection {selected_by!r}: choose one of {", ".join(SELECTIONS)}'
            )
        return FeedforwardLaw(mode, (parameters,) * self._joints)

    def _sets_of(self, model: str) -> dict[int, LawParameters]:
        if model not in self._sets:
            path = Path(self._parameter_sets) if self._parameter_sets else None
            self._sets[model] = load_class_parameters(path, model)
        return self._sets[model]

    def _table_of(self, model: str) -> UpdatedTable:
        if model in self._tables:
            return self._tables[model]
        if self._table:
            table = UpdatedTable.load(self._table)
            if table.model != model:
                raise FileError(f'{self._table} is a table of {table.model}, not of {model}')
        else:
            table = UpdatedTable.of_classes(model, self._sets_of(model))
        self._tables[model] = table
        return table
