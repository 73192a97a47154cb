"""Table 4 of the first paper: how far each class is from the two colon shapes."""

from endoscope_benchmarks.benches.papers_tables.row import PapersBench, Row

TITLE = 'Table 4: RMSE of the actual angle, class against colon shape, deg'
_SHAPES = (
    (94.0, ('15.76', '12.40', '7.61', '7.20', '2.52', '1.79', '4.06')),
    (102.0, ('19.76', '17.14', '11.55', '12.60', '7.24', '6.00', '4.86')),
)


def rows(settings: PapersBench) -> list[Row]:
    """Compare the calibration of tubes of 94 and 102 deg with the mean plant of each class."""
    import numpy as np

    from endoscope_benchmarks.trials.never_seen_tube import never_seen_tube
    from endoscope_core.control import PhysicalParameters
    from endoscope_core.dataset import record_calibration
    from endoscope_core.identification import load_class_parameters
    from endoscope_core.physics import PlantDescription

    classes = {}
    for class_deg, plant in load_class_parameters(model='physical').items():
        if isinstance(plant, PhysicalParameters):
            tube = PlantDescription({'bend_x': plant.joint, 'bend_y': plant.joint})
            classes[class_deg] = record_calibration(tube, settings.seed).actual_angle
    found = []
    for size_deg, papers in _SHAPES:
        angles = []
        for number in range(settings.tubes):
            tube_seen = never_seen_tube(settings.seed, number, size_deg)
            angles.append(record_calibration(tube_seen.plant, tube_seen.noise).actual_angle)
        for (class_deg, reference), paper in zip(sorted(classes.items()), papers, strict=True):
            values = [
                float(np.rad2deg(np.sqrt(np.mean((angle - reference) ** 2)))) for angle in angles
            ]
            found.append(Row(f'backlash {size_deg:g} deg, class {class_deg} deg', values, paper))
        settings.report(f'table 4: {size_deg:g} deg simulated')
    return found
