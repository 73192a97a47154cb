import numpy as np
import pytest

from endoscope_core.errors import EndoscopeError
from endoscope_explain.benchmark.figures_of_merit import (
    calibration_curve,
    confusions,
    figures,
    peers_named_first,
)
from endoscope_explain.benchmark.kept_outcomes import run_and_keep
from endoscope_explain.benchmark.outcome import Named, Outcome, from_line, to_line
from endoscope_explain.benchmark.peers.forward_selection import name_by_forward_selection
from endoscope_explain.benchmark.peers.sindy import name_by_sindy
from endoscope_explain.benchmark.peers.symbolic import name_by_symbolic_regression
from endoscope_explain.benchmark.peers.term_library import Problem, problem_of
from endoscope_explain.benchmark.printing import confusion_table, progress_line, table
from endoscope_explain.benchmark.running import Task, run_case, run_cases
from endoscope_explain.generator import CaseRequest
from endoscope_explain.predicted_signals import view


def outcome(
    concealed,
    named,
    stratum='single',
    motion='commissioning',
    probability=0.9,
    verdict='x',
    alternatives=(),
    parameters=None,
    comparable=None,
    second=None,
    stage='joint',
    peers=None,
):
    return Outcome(
        'case',
        stratum,
        motion,
        verdict,
        stage,
        tuple(
            Named(n, 'bend_x', stage, probability, alternatives, parameters or {}) for n in named
        ),
        {
            'effects': list(concealed),
            'comparable': comparable or {},
            'seed': 1,
            'concealed': [{'id': c, 'stage': 'joint'} for c in concealed],
        },
        second or {'slave/measured_js:bend_x': (0.1, 0.0044, 0.00436)},
        10.0,
        peers or {},
    )


def by_name(outcomes):
    return {f.name: f for f in figures(outcomes)}


def test_the_table_counts_what_is_right():
    found = by_name(
        [
            outcome(['gravity'], ['gravity']),
            outcome(['gravity'], ['contact'], alternatives=('gravity',), stage='sensing'),
            outcome(['gravity', 'contact'], ['contact', 'gravity'], 'pair'),
            outcome(['gravity', 'contact'], ['contact'], 'pair'),
            outcome([], [], 'null', verdict='consistent'),
            outcome([], [], 'outside', verdict='unknown_physics'),
            outcome(['gravity'], ['contact'], motion='calibration', alternatives=('gravity',)),
        ]
    )
    first = found['effect named first, single effect, commissioning motion']
    assert first.value == '50.0 % (1 of 2)'
    assert first.reached is False
    assert found['stage right'].value == '50.0 % (1 of 2)'
    assert found['both effects of a pair named'].value == '50.0 % (1 of 2)'
    assert found['nothing concealed: consistent or parameters_differ'].reached
    assert found['outside the catalogue: unknown_physics'].reached
    assert found['9 s sinusoid only: truth among first and alternatives'].reached
    assert found['9 s sinusoid only: ids listed on average'].value == '2.00'
    assert found['effects at a tenth of usual strength: named first'].reached is None


def test_parameters_are_compared_and_intervals_counted():
    cases = [
        outcome(
            ['contact'],
            ['contact'],
            parameters={'angle_rad': (0.42, low, 0.5)},
            comparable={'contact': {'angle_rad': 0.40}},
        )
        for low in (0.39, 0.41)
    ]
    found = by_name(cases)
    assert found['comparable parameters: median error'].value == '5.00 % of 2'
    assert found['comparable parameters: 90 % intervals that cover'].value == '50.0 % (1 of 2)'


def test_a_second_recording_is_judged_against_noise_and_nominal():
    good = {'slave/measured_js:bend_x': (0.1, 0.0049, 0.00436)}
    bad = {'slave/measured_js:bend_x': (0.1, 0.2, 0.00436)}
    found = by_name([outcome(['gravity'], ['gravity'], second=s) for s in (good, bad)])
    assert (
        found['second recording (of joints moved): angles within 1.15 x noise'].value
        == '50.0 % (1 of 2)'
    )
    assert found['second recording: worse than nominal'].value == '50.0 % (1 of 2)'


def test_probabilities_are_held_against_what_was_right():
    cases = [
        outcome(['gravity'], ['gravity' if k < 9 else 'contact'], probability=0.9)
        for k in range(10)
    ]
    (one,) = calibration_curve(cases)
    assert (one.count, one.mean, one.right) == (10, pytest.approx(0.9), pytest.approx(0.9))
    assert by_name(cases)['probability: mean distance from the share that is right'].reached


def test_confusions_name_the_verdict_where_nothing_was_named():
    cases = [outcome(['gravity'], ['gravity']), outcome(['gravity'], [], verdict='consistent')]
    assert confusions(cases) == {('gravity', 'gravity'): 1, ('gravity', 'consistent'): 1}
    assert '1 of   2  1 consistent' in confusion_table(cases)


def test_peers_are_counted_on_the_cases_they_were_asked():
    cases = [
        outcome(['gravity'], ['gravity'], peers={'peer': 'contact'}),
        outcome(['gravity'], ['contact']),
    ]
    assert peers_named_first(cases) == {'explain': (1, 1), 'peer': (0, 1)}


def test_an_outcome_survives_a_file():
    one = outcome(
        ['contact'],
        ['contact'],
        parameters={'angle_rad': (0.4, 0.3, 0.5)},
        alternatives=('joint_stop',),
        peers={'peer': 'gravity'},
    )
    assert from_line(to_line(one)) == one
    assert 'contact  ->  x: contact (0.90)' in progress_line(1, 2, one)


def test_a_file_of_something_else_is_refused(tmp_path):
    path = tmp_path / 'kept.jsonl'
    path.write_text('{"no": "outcome"}\n')
    with pytest.raises(EndoscopeError, match='something else than outcomes'):
        run_and_keep(1, 1, 1, False, path)
    with pytest.raises(EndoscopeError, match='at least one'):
        run_and_keep(0, 1, 1, False)


def test_a_kept_case_is_not_run_again(tmp_path):
    kept = outcome(['gravity'], ['gravity'])
    line = to_line(kept).replace('"seed": 1', '"seed": 7000000')
    (tmp_path / 'kept.jsonl').write_text(line + '\n')
    (again,) = run_and_keep(1, 7, 1, False, tmp_path / 'kept.jsonl')
    assert again == from_line(line)


def test_a_case_is_drawn_explained_and_only_then_opened():
    done = run_case(Task(CaseRequest(3, 'null', 'calibration', None), peers=True))
    assert done.verdict in ('consistent', 'parameters_differ')
    assert done.truth['seed'] == 3
    assert set(done.peers) == {'pysindy', 'pyoperon', 'forward selection'}
    nominal, augmented, noise = done.second['slave/measured_js:bend_x']
    assert augmented < 1.15 * noise
    assert augmented <= 1.05 * nominal
    assert 'calibration' in table(figures([done])) or done.named == ()


@pytest.fixture(scope='module')
def library(stribeck_case):
    recorded = view(stribeck_case.recording, {'refitted': stribeck_case.explanation.refitted})
    return problem_of(recorded, 'bend_x', 'refitted')


def with_residual(library, effect, size=10.0):
    """A residual that is one term of the library and noise."""
    term = next(t for t in library.terms if t.effect == effect)
    residuals = np.random.default_rng(4).standard_normal(library.residuals.shape)
    for channel in term.signals:
        residuals[:, channel] += size * term.values
    return Problem(residuals, library.terms, library.states)


@pytest.mark.parametrize('effect', ['gravity', 'load_cell_gain', 'tracker_delay'])
def test_forward_selection_finds_a_trace_that_is_in_its_library(library, effect):
    assert name_by_forward_selection(with_residual(library, effect)) == effect


def test_forward_selection_finds_nothing_in_noise(library):
    residuals = np.random.default_rng(5).standard_normal(library.residuals.shape)
    noise = Problem(residuals, library.terms, library.states)
    assert name_by_forward_selection(noise) == 'nothing'


def test_sindy_names_an_effect_of_the_library_and_leaves_other_generators_alone(library):
    np.random.seed(3)  # noqa: NPY002
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    name = name_by_sindy(with_residual(library, 'tracker_drift'))
    assert name in {t.effect for t in library.terms}
    assert np.array_equal(before, np.random.get_state()[1])  # noqa: NPY002


def test_symbolic_regression_names_the_state_that_the_residual_follows(library):
    residuals = 0.01 * np.random.default_rng(6).standard_normal(library.residuals.shape)
    residuals[:, 0] += library.states['lagging']
    problem = Problem(
        residuals,
        library.terms,
        {k: library.states[k] for k in ('lagging', 'other', 't') if k in library.states},
    )
    assert name_by_symbolic_regression(problem) == 'wire_creep'


def test_an_error_in_a_case_is_said_at_once_and_with_the_case():
    wrong = Task(CaseRequest(7, 'single', 'calibration', ('no_such_effect',)), False)
    right = Task(CaseRequest(8, 'null', 'calibration', None), False)
    told = []
    with pytest.raises(ValueError, match='no_such_effect') as error:
        list(run_cases([wrong, *[right] * 50], 1, lambda *done: told.append(done)))
    assert error.value.__notes__ == ['in the case of seed 7']
    assert len(told) < 5
