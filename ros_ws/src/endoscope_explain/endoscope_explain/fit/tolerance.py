"""By how much a rig may differ from its description: one definition for verdict, page and file."""

from endoscope_explain.fit.free_parameters import BAND, nominal_number

NINETY_PERCENT = 1.645
"""Standard deviations that hold 90 % of a normal distribution, either way."""


def tolerance(name: str, described: float, band: float = BAND) -> tuple[float, float]:
    """Lowest and highest value of a nominal parameter that needs no explanation.

    `described`: its value in the plant file.
    `band`: share by which parameters may differ: they may be larger, and smaller, by the factor `1
        + band`. What describes a form may differ by 90 % of what healthy rigs do.
    """
    spread = nominal_number(name).spread
    if spread:
        reach = NINETY_PERCENT * spread
        return described - reach, described + reach
    return described / (1.0 + band), described * (1.0 + band)
