from endoscope_explain.compare import ladders


def test_plants_are_judged_on_a_second_recording(stribeck_case, record):
    explanation = stribeck_case.explanation
    second = record(explanation.augmented, duration=8.0, seed=9)
    for ladder in ladders(explanation, second):
        assert set(ladder) == {'nominal', 'refitted', 'augmented'}
        left = {name: fits['wires/measured_js:wire_x_pos'].ratio for name, fits in ladder.items()}
        assert left['augmented'] < 1.5 < left['refitted']
