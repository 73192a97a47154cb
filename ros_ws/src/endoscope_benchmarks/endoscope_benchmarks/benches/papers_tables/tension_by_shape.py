"""Table 1 of the first paper: tensions of tubes with like backlash, and with unlike."""

from itertools import combinations, product

from endoscope_benchmarks.benches.papers_tables.row import PapersBench, Row

TITLE = 'Table 1: RMSE of wire tension among shapes of like and of unlike hysteresis, N'
_CASES = ((54.0, '0.21 ± 0.02'), (85.5, '0.16 to 0.22'), (105.0, '0.18 to 0.25'))
_MOST_INSTRUMENTS = 300


def rows(settings: PapersBench) -> list[Row]:
    """Simulate `tubes` shapes of each case: one rig, its bends spread otherwise, of equal size."""
    import numpy as np

    from endoscope_core.dataset import configuration_of_size, random_instrument, record_calibration
    from endoscope_core.dataset.rig_variation import GREATEST_UNEVENNESS, TubeConfiguration

    generator = np.random.default_rng([settings.seed, 1])
    spread = np.linspace(-GREATEST_UNEVENNESS, GREATEST_UNEVENNESS, settings.tubes).tolist()

    def shapes_of(size: float) -> list[TubeConfiguration]:
        """Of the first instrument drawn that has this size in every shape."""
        for _ in range(_MOST_INSTRUMENTS):
            instrument = random_instrument(generator)
            shapes = []
            for unevenness in spread:
                shape = configuration_of_size(instrument, size, unevenness)
                if shape is None:
                    break
                shapes.append(shape)
            else:
                return shapes
        raise RuntimeError(f'no instrument of {_MOST_INSTRUMENTS} has {np.rad2deg(size):.0f} deg')

    tensions = []
    for size_deg, _ in _CASES:
        shapes = shapes_of(float(np.deg2rad(size_deg)))
        tensions.append(
            [
                record_calibration(shape.plant, settings.seed + k).tension
                for k, shape in enumerate(shapes)
            ]
        )
        settings.report(f'table 1: {size_deg:g} deg simulated')

    def rmse(first: np.ndarray, second: np.ndarray) -> float:
        return float(np.sqrt(np.mean((first - second) ** 2)))

    found = [
        Row(
            f'{size_deg:g} deg, among like shapes',
            [rmse(a, b) for a, b in combinations(shapes, 2)],
            paper,
            note='The same instrument in tubes whose bends are spread otherwise, simulated.',
        )
        for (size_deg, paper), shapes in zip(_CASES, tensions, strict=True)
    ]
    for first, second in combinations(range(len(_CASES)), 2):
        found.append(
            Row(
                f'{_CASES[first][0]:g} against {_CASES[second][0]:g} deg, unlike',
                [rmse(a, b) for a, b in product(tensions[first], tensions[second])],
            )
        )
    return found
