"""One parameter set for each hysteresis class: shipped, or from a file."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from endoscope_core.errors import FileError, InputError
from endoscope_core.identification.updated_table import (
    LawParameters,
    parameters_from_dict,
    shipped_table_path,
)
from endoscope_core.schema import read


def load_class_parameters(
    path: str | Path | None = None, model: str = 'bouc_wen'
) -> dict[int, LawParameters]:
    """Feed-forward parameters of a model by class (backlash size in deg); the shipped by default.

    FileError if the file is missing, holds something else or another model, or unsafe parameters.
    """
    path = shipped_table_path(model) if path is None else Path(path)
    if not path.is_file():
        raise FileError(
            f'{path} is missing: make parameter sets with `endoscope fit classes DATASET '
            f'--model {model}`'
        )
    try:
        file = read(_File, json.loads(path.read_text(encoding='utf-8')), path.name)
        sets = file.classes if file.model == model else {}
        parameters = {
            int(class_deg): parameters_from_dict(model, found.feedforward)
            for class_deg, found in sets.items()
        }
    except (ValueError, TypeError, RecursionError) as error:
        raise FileError(f'{path} holds no {model} parameter sets: {error}') from error
    if file.model != model:
        raise FileError(f'{path} holds parameters of {file.model}, not of {model}')
    return parameters


@dataclass(frozen=True)
class _Class:
    feedforward: Mapping[str, Any]
    model: Any = None
    model_rmse: Any = None


@dataclass(frozen=True)
class _File:
    model: str
    classes: Mapping[str, _Class]
    schema: Any = 1
    command: Any = None
    dataset_manifest_sha256: Any = None
    lead: Any = None


def parameters_for_class(sets: Mapping[int, LawParameters], class_deg: int) -> LawParameters:
    """The set of a class.

    InputError if there is none: parameters are never guessed.
    """
    if class_deg not in sets:
        known = ', '.join(str(c) for c in sorted(sets))
        raise InputError(f'no parameters for class {class_deg} deg (there are {known})')
    return sets[class_deg]
