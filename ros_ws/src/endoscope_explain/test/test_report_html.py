import dataclasses
import html
import json
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from chromium import LARGEST_PAGE, drawn

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.rig import Kind, RigKind
from endoscope_explain.audit import AuditReport
from endoscope_explain.case import NextExperiment, Provenance
from endoscope_explain.explanation import (
    Estimate,
    Fitting,
    NamedEffect,
    NominalEstimate,
    Tried,
    Verdict,
)
from endoscope_explain.fit.free_parameters import tolerance
from endoscope_explain.observe.predicted_signals import fits_by, view
from endoscope_explain.recording import Series
from endoscope_explain.report.html_page import html_page
from endoscope_explain.report.numbers import in_degrees, judged, moving_joints, shown
from endoscope_explain.report.sentences import (
    HEADLINES,
    before_and_after,
    next_step,
    physics_of,
    terminal_text,
    verdict_sentence,
)
from endoscope_explain.report.writing import report_mapping

PLANT = PlantDescription()


def with_explanation(case, **fields):
    """The case with another explanation; fields of the case itself by their names."""
    own = {f.name for f in dataclasses.fields(case)} - {'explanation'}
    explanation = dataclasses.replace(
        case.explanation, **{k: v for k, v in fields.items() if k not in own - {'effects'}}
    )
    mine = {k: v for k, v in fields.items() if k in own}
    return dataclasses.replace(case, explanation=explanation, **mine)


def with_recording(case, recording):
    """The case of another recording, with the same findings."""
    audit = dataclasses.replace(case.audit, recording=recording)
    return dataclasses.replace(case, inputs=dataclasses.replace(case.inputs, audit=audit))


def text_of(page):
    """What a reader sees at first: no drawings, no tables that are closed, no tags."""
    text = re.sub(r'<(svg|style|script|details).*?</\1>', ' ', page, flags=re.DOTALL)
    return html.unescape(' '.join(re.sub(r'<[^>]+>', ' ', text).split()))


def named(effect_id, **parameters):
    units = {p.name: p.unit for p in CATALOGUE[effect_id].parameters}
    return NamedEffect(
        effect_id,
        'bend_x',
        {n: Estimate(v, 0.9 * v, 1.1 * v, units[n]) for n, v in parameters.items()},
    )


@pytest.fixture(scope='module')
def consistent(stribeck_case, record):
    """A recording of the described plant whose refitted plant differs a little."""
    joint = dataclasses.replace(PLANT.joints['bend_x'], pretension=5.02)
    refitted = dataclasses.replace(PLANT, joints={**PLANT.joints, 'bend_x': joint})
    recording = record(PLANT, duration=8.0)
    seen = view(recording, {'nominal': PLANT, 'refitted': refitted})
    ladder = {name: fits_by(seen, name) for name in ('nominal', 'refitted')}
    ladder['augmented'] = dict(ladder['refitted'])
    return with_explanation(
        stribeck_case,
        verdict=Verdict.CONSISTENT,
        effects=(),
        nominal=PLANT,
        refitted=refitted,
        augmented=refitted,
        fit=ladder,
        ladder=ladder,
        inputs=dataclasses.replace(stribeck_case.inputs, audit=AuditReport(recording, ())),
        places=(),
        cuts=(),
    )


@pytest.fixture(scope='module')
def page(stribeck_case):
    ranked = (
        Tried('bend_x', ('stribeck_friction',), 10.0, 1.0),
        Tried('bend_x', (), 60.0, 6.0, True),
        *(Tried('bend_x', ('gravity', e), 70.0, 9.0) for e in ('contact', 'breathing')),
        Tried('bend_x', (), 90.0, 9.0),
    )
    made = Provenance('bags/rig', 'a1' * 32, 'plant.yaml', 'b2' * 32, '1.2', 'endoscope x', 'today')
    return html_page(with_explanation(stribeck_case, candidates=ranked, provenance=made))


def test_a_page_says_of_what_kind_of_rig_its_recording_is(page, stribeck_case):
    assert 'rig unknown' in text_of(page)
    rig = RigKind(Kind.EMULATED, 'endoscope 9')
    of_emulators = dataclasses.replace(stribeck_case.recording, rig_kind=rig)
    made = Provenance('bags/rig', 'a1' * 32, '', '', '1.2', '', 'today')
    case = dataclasses.replace(stribeck_case, provenance=made)
    told = html_page(with_recording(case, of_emulators))
    assert 'rig emulated (endoscope 9)' in text_of(told)


def test_a_page_says_what_was_left_out_and_where(page):
    text = text_of(page)
    assert 'The simulation leaves out stribeck_friction or viscous_friction on bend_x.' in text
    assert 'cannot distinguish it from viscous_friction' in text
    assert 'gain 120 (log evidence that it adds, in nats)' in text


def test_every_drawing_is_whole(page):
    for drawing in re.findall(r'<svg.*?</svg>', page, re.DOTALL):
        ET.fromstring(drawing)
    assert len(page) < LARGEST_PAGE
    with drawn(page) as (seen, complaints):
        figures = [f.locator('.plot canvas').count() for f in seen.locator('.plots.is-drawn').all()]
        # The timeline, and the passage: three loops, three signals and what is missed of them.
        assert figures == [2, 9]
        assert seen.get_by_role('img', name='ladder of fits').is_visible()
    assert complaints == []


def stages(page):
    """The blocks of the chain, what is red with what was found in it."""
    (chain,) = re.findall(r'<ol class="chain">(.*?)</ol>', page, re.DOTALL)
    blocks = re.findall(r'<li( class="responsible")?>(.*?)</li>', chain, re.DOTALL)
    return [(text_of(block), bool(red)) for red, block in blocks]


def test_only_the_responsible_stage_is_marked(page, consistent):
    blocks = stages(page)
    assert [text for text, red in blocks if red] == [
        'transmission wires and sheath, wires/measured_js stribeck_friction (bend_x)'
    ]
    assert [text.split()[0] for text, _ in blocks] == [
        *('command', 'actuator', 'transmission', 'joint', 'sensing', 'recording')
    ]
    assert not any(red for _, red in stages(html_page(consistent)))


def test_the_numbers_of_the_plant_have_their_tolerance(stribeck_case):
    low = NominalEstimate(0.867 * 5.0, 4.2, 4.4, 'N', 5.0, False)
    within = NominalEstimate(0.871 * 5.0, 4.2, 4.5, 'N', 5.0, True)
    angle = NominalEstimate(0.02, 0.01, 0.03, 'rad', 0.0, True)
    parameters = {
        'bend_x': {'pretension': low, 'joint_rest_angle': angle},
        'bend_y': {'pretension': within},
    }
    page = html_page(with_explanation(stribeck_case, parameters=parameters))
    assert page.count('<td class="bad">') == 1
    assert '<td class="bad">4.33</td>' in page
    assert 'bend_x pretension N 5 4.33 4.2 … 4.4 4.35 … 5.75' in text_of(page)
    assert 'joint_rest_angle_deg deg 0 1.1 0.573 … 1.72' in text_of(page)
    assert 'divided, and multiplied, by 1.15' in text_of(page)
    assert tolerance('pretension', 5.0, 3.0) == (1.25, 20.0)


def test_a_number_that_the_recording_does_not_show_has_words_in_place_of_an_interval(stribeck_case):
    damping = NominalEstimate(0.003, 0.002, 0.004, 'N m s/rad', 0.003, True, False)
    bandwidth, ratio = (
        NominalEstimate(60.0, 54.0, 66.0, 'rad/s', 60.0, True, False, other)
        for other in ('motor_damping_ratio', 'motor_bandwidth')
    )
    numbers = {'motor_bandwidth': bandwidth, 'motor_damping_ratio': ratio}
    parameters = {'bend_x': {'joint_damping': damping, **numbers}}
    case = with_explanation(stribeck_case, parameters=parameters)
    page = text_of(html_page(case))
    assert 'joint_damping N m s/rad 0.003 this recording does not show it' in page
    assert 'motor_bandwidth rad/s 60 only together with motor_damping_ratio' in page
    text = terminal_text(case)
    assert 'This recording does not show joint_damping of bend_x.' in text
    said = 'It shows motor_bandwidth of bend_x only together with motor_damping_ratio.'
    assert text.count(said) == 1
    assert 'It shows motor_damping_ratio' not in text
    written = report_mapping(case)['parameters']['bend_x']
    assert [(e['shown'], e['together_with']) for e in written.values()] == [
        *((False, None), (False, 'motor_damping_ratio'), (False, 'motor_bandwidth'))
    ]


def test_how_the_fits_ended_is_said_beside_their_numbers(stribeck_case):
    fitting = {
        'bend_x': Fitting(True, 'no step lowers the misfit', 7, ()),
        'bend_y': Fitting(False, 'its steps were spent', 25, ('motor_bandwidth', 'pretension')),
    }
    text = text_of(html_page(with_explanation(stribeck_case, fitting=fitting)))
    assert 'The fit of bend_x converged (7 steps; no step lowers the misfit).' in text
    assert 'The fit of bend_y did not converge: its numbers are not final' in text
    assert 'At a bound: motor_bandwidth and pretension.' in text


@pytest.mark.parametrize('verdict', list(Verdict))
def test_every_verdict_has_its_sentence(stribeck_case, verdict):
    effects = tuple(named(e) for e in ('stribeck_friction', 'contact', 'gravity'))
    for some in (effects[:1], effects):
        case = dataclasses.replace(stribeck_case, verdict=verdict, effects=some)
        assert verdict in HEADLINES
        for text in (verdict_sentence(case), next_step(case), before_and_after(case)):
            assert text.endswith('.')
            assert is_short(text)


def is_short(text):
    return all(len(sentence.split()) <= 20 for sentence in re.split(r'(?<=[.;])\s', text))


@pytest.mark.parametrize('effect_id', list(CATALOGUE))
def test_what_an_effect_does_is_said_in_twenty_words(effect_id):
    typical = {p.name: p.typical for p in CATALOGUE[effect_id].parameters}
    assert is_short(physics_of(named(effect_id, **typical)))


@pytest.mark.parametrize(('explained', 'offered'), [(0.9, True), (1e-4, False)])
def test_a_function_that_explains_nothing_is_not_offered(
    stribeck_case, missing_function, explained, offered
):
    term = dataclasses.replace(missing_function, explained=explained)
    explanation = dataclasses.replace(stribeck_case.explanation, unknown=term)
    case = dataclasses.replace(
        stribeck_case, explanation=explanation, verdict=Verdict.UNKNOWN_PHYSICS
    )
    assert ("function of the joint's angle" in verdict_sentence(case)) == offered
    assert (term.expression in text_of(html_page(case))) == offered


@pytest.mark.parametrize(('share', 'offered'), [(0.9, True), (0.01, False)])
def test_a_formula_that_explains_little_is_not_offered(
    stribeck_case, missing_function, share, offered
):
    term = dataclasses.replace(missing_function, formula_share=share, formula_is_as_good=False)
    distances = {'chirp': 1.0, 'slow ramps': 4.0}
    asked = NextExperiment(
        *('It tells gravity from contact.', ('gravity', 'contact'), 'slow ramps', 'bend_x'),
        *(distances, (0.0, 1.0), ((0.0, 0.0), (0.1, 0.0)), ('bend_x', 'bend_y')),
    )
    case = with_explanation(
        stribeck_case,
        effects=(),
        unknown=term,
        verdict=Verdict.UNKNOWN_PHYSICS,
        next_experiment=asked,
    )
    page = html_page(case)
    assert (term.expression in page) == offered
    first = page[page.index('<figure') : page.index('</figure>')]
    assert ('>formula<' in first) == offered
    assert 'function, with 90 % band' in first
    assert 'It tells gravity from contact.' in page
    assert page.index('slow ramps') < page.index('>chirp<')


def test_a_formula_lies_on_its_function_in_a_unit_that_can_be_read(stribeck_case, missing_function):
    small = 1e-4 * np.sin(3.0 * missing_function.nodes)
    term = dataclasses.replace(
        missing_function, values=small, formula=small + 2e-4, deviation=np.full(41, 1e-6)
    )
    page = html_page(with_explanation(stribeck_case, unknown=term, verdict=Verdict.UNKNOWN_PHYSICS))
    data = json.loads(re.search(r'class="plot-data">(.*?)</script>', page, re.DOTALL)[1])
    function, formula = (curve['y'] for curve in data['plots'][0]['curves'])
    assert max(function) == pytest.approx(100.0, rel=0.01)
    assert formula == pytest.approx(function, abs=0.01)
    assert 'load_of_angle of bend_x (µN m)' in page


"""Whether what is drawn or written is no wider than the room that it has."""


def test_sections_and_curves_fit_a_consistent_verdict(consistent):
    page = html_page(consistent)
    assert 'What was left out' not in page
    assert 'When it shows' not in page
    # The refitted plant is the improved one: it is drawn once, by its own name.
    assert 'improved' not in text_of(page)
    assert '>refitted<' in page
    assert '>improved<' not in page
    assert list(judged(consistent, consistent.ladder)) == ['nominal', 'refitted']
    assert next_step(consistent) == 'Continue with the described plant.'


def test_what_did_not_move_is_left_out(consistent):
    still = consistent.recording.command.values.copy()
    still[:, 1] = 0.0
    command = dataclasses.replace(consistent.recording.command, values=still)
    shaft = consistent.recording.shaft_position
    held = Series.of(shaft.topic, shaft.time, shaft.values * [1.0, 0.0])
    recording = dataclasses.replace(consistent.recording, command=command, shaft_position=held)
    case = with_recording(consistent, recording)
    assert moving_joints(recording) == ('bend_x',)
    signals = judged(case, case.ladder)['nominal']
    assert signals
    assert all('_x' in signal for signal in signals)
    assert 'wire_y_pos' not in terminal_text(case)
    tables = html_page(case)
    assert 'wires:wire_x_pos' in tables
    assert 'wires:wire_y_pos' not in tables


def test_angles_are_in_degrees(page):
    assert re.search(r'slave:bend_x deg [\d.]+ \(', text_of(page))
    assert ' rad ' not in text_of(page[page.index('The ladder of fits') :].split('<footer>')[0])
    assert in_degrees('angle_rad', 'rad')[:2] == ('angle_deg', 'deg')
    assert in_degrees('rate_rad_per_s', 'rad/s') == ('rate_deg_per_s', 'deg/s', np.degrees(1.0))
    assert in_degrees('motor_bandwidth', 'rad/s') == ('motor_bandwidth', 'rad/s', 1.0)


def test_switches_are_said_in_words(stribeck_case):
    effect = named('load_cell_gain', gain=1.2, wire=1.0)
    case = dataclasses.replace(stribeck_case, effects=(effect,))
    for text in (text_of(html_page(case)), terminal_text(case)):
        assert 'the cell of the negative wire' in text
        assert 'gain' in text
        assert not re.search(r'\bwire 1\b', text)


def test_what_does_nothing_is_no_number(stribeck_case):
    effect = named('contact', angle_rad=0.2, stiffness=0.01, exponent=1.0, loss_s=0.0)
    text = terminal_text(dataclasses.replace(stribeck_case, effects=(effect,)))
    assert 'angle_deg 11.5 deg (10.3 to 12.6)' in text
    assert 'exponent' not in text
    assert 'loss_s' not in text


def test_the_terminal_says_it_all(stribeck_case):
    lines = terminal_text(stribeck_case).splitlines()
    assert lines[0] == 'The simulation leaves out stribeck_friction or viscous_friction on bend_x.'
    assert '    rise 0.8 (0.72 to 0.88)' in lines
    assert any(line.startswith('Where: transmission of bend_x, ') for line in lines)
    (head,) = [k for k, line in enumerate(lines) if line.startswith('rmse / noise')]
    assert lines[head].split()[3:] == ['described', 'refitted', 'improved']
    wire = next(line.split() for line in lines if line.startswith('wires:wire_x_pos'))
    before, _, after = map(float, wire[1:])
    assert before > 2.0 * after
    assert lines[-1].startswith('Next: ')


def test_slips_that_nothing_predicts_are_said(consistent):
    assert 'stick and slip' not in text_of(html_page(consistent))
    spiky = consistent.recording.tension.values.copy()
    rng = np.random.default_rng(1)
    burst = (np.arange(len(spiky)) // 1000) % 3 == 0
    spiky[burst, 0] += 0.4 * rng.standard_normal((int(burst.sum()), 2))
    tension = dataclasses.replace(consistent.recording.tension, values=spiky)
    recording = dataclasses.replace(consistent.recording, tension=tension)
    text = text_of(html_page(with_recording(consistent, recording)))
    assert re.search(r'bend_x: wires stick and slip.*their scatter of [\d.]+ N', text)


@pytest.mark.parametrize(
    ('estimate', 'said'),
    [
        (Estimate(1.2, 1.1996, 1.2004, '-'), 'gain 1.2 (1.1996 to 1.2004)'),
        (Estimate(-1.08e-5, -0.00366, 0.00363, '-'), 'gain 0 (-0.00366 to 0.00363)'),
    ],
)
def test_a_number_has_the_digits_that_its_interval_knows(estimate, said):
    assert str(shown('gain', estimate)) == said
