"""Fits of several recordings brought to agree on what the devices of their rig are like.

The shape of the tube changes friction and stiffness, but no sensor and no gear: an effect of a
device must have the same parameters in every recording of a rig. The separate estimates are
combined by their precisions (Hartung, Knapp, Sinha, Statistical Meta-Analysis, Wiley 2008, ch. 10).
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.effects import CATALOGUE, Stage
from endoscope_explain.fit import Fit, JointModel
from endoscope_explain.intervals import covariance

Array = NDArray[np.float64]

OF_A_DEVICE = frozenset({Stage.ACTUATOR, Stage.SENSING})


def must_agree(effect_id: str) -> bool:
    """Whether an effect is one of a device."""
    return CATALOGUE[effect_id].stage in OF_A_DEVICE


def agreed_parameters(fits: Sequence[Fit], effect_id: str) -> dict[str, float]:
    """Parameters of an effect that separate fits come nearest to.

    Parameters
    ----------
    fits : sequence of Fit
        Each has the effect.
    effect_id : str

    Returns
    -------
    dict of str to float
        All parameters; of a number without a scale, such as a wire's, the most frequent one.
    """
    definition = CATALOGUE[effect_id]
    columns = [
        [k for k, item in enumerate(f.model.free) if item.index in definition.places] for f in fits
    ]
    precisions = [
        np.linalg.inv(covariance(f)[np.ix_(own, own)]) for f, own in zip(fits, columns, strict=True)
    ]
    weighted = sum(
        (p @ f.theta[own] for p, f, own in zip(precisions, fits, columns, strict=True)),
        start=np.zeros(len(columns[0])),
    )
    mean = np.linalg.solve(np.sum(precisions, axis=0), weighted)
    parameters = {}
    for i, parameter in enumerate(definition.parameters):
        found = [float(f.model.base[definition.first_parameter + i]) for f in fits]
        parameters[parameter.name] = Counter(found).most_common(1)[0][0]
    for coordinate, item in zip(mean, (fits[0].model.free[k] for k in columns[0]), strict=True):
        value = item.value(float(coordinate))
        parameters[item.name] = min(max(value, item.low), item.high)
    return parameters


def in_line(separate: Fit, effect_id: str, agreed: Mapping[str, float]) -> tuple[JointModel, Array]:
    """Set an effect's parameters to what all recordings agree on; they are not free any more.

    Parameters
    ----------
    separate : Fit
        Has the effect, with its own parameters.
    effect_id : str
    agreed : mapping of str to float

    Returns
    -------
    model : JointModel
    theta : array (n,)
        Where to begin its fit.
    """
    definition = CATALOGUE[effect_id]
    model = separate.model
    base = model.base.copy()
    for i, parameter in enumerate(definition.parameters):
        if not parameter.is_duration:
            base[definition.first_parameter + i] = agreed[parameter.name]
    return replace(model, base=base).holding(definition.places, separate.theta)
