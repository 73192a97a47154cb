"""What a reversal costs at the least, if the dead zone is crossed at the turning point."""

from endoscope_bringup.benches.papers_tables.row import PapersBench, Row

TITLE = 'Error left around the reversals of 60 sin t on the exact plant, % of the uncompensated'
_EXPONENTS = (0.3, 1.8)


def rows(settings: PapersBench) -> list[Row]:
    """Nominal joints in tubes of capstan exponents from 0.3 to 1.8."""
    import numpy as np

    from endoscope_core.control import PhysicalParameters
    from endoscope_core.physics import JointParameters
    from endoscope_core.trials.crossing_bound import crossing_bound

    bounds = []
    exponents = np.linspace(*_EXPONENTS, settings.tubes).tolist()
    for exponent in exponents:
        joint = JointParameters(capstan_exponent=exponent)
        bounds.append(crossing_bound(PhysicalParameters(joint), settings.seed))
        settings.report(f'crossing: capstan exponent {exponent:.2f}')
    note = (
        'The spread is over the exponents. The best command is what a search over 0.6 s found, '
        f'at 80 rad/s and 3 rad at the most; at {exponents[-1]:.1f} it leaves '
        f'{100.0 * bounds[-1].best:.1f} %.'
    )
    return [
        Row('crossed at the turning point', [100.0 * b.crossing for b in bounds], digits=1),
        Row('best command found, 0.3 s either side', [100.0 * b.best for b in bounds], digits=1),
        Row('released before', [100.0 * b.releasing for b in bounds], digits=1, note=note),
    ]
