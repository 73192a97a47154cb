"""What holds for the settings of every law that learns from the tracker."""

import math
from collections.abc import Sequence


def check_settings(settings: object, positive: Sequence[str]) -> None:
    """Refuse a setting that is not finite, or negative, or zero though among `positive`."""
    for name, value in vars(settings).items():
        if not (math.isfinite(value) and value >= 0.0):
            raise ValueError(f'{name} = {value} must be finite and not negative')
    for name in positive:
        if getattr(settings, name) == 0.0:
            raise ValueError(f'{name} must be positive')
