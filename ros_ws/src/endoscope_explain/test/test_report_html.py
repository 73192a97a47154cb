import dataclasses
import html
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from endoscope_explain.case import NextExperiment
from endoscope_explain.explanation import (
    Candidate,
    NominalEstimate,
    Verdict,
)
from endoscope_explain.report.chain_drawing import STAGES, chain_svg
from endoscope_explain.report.figures.ladder import parameters_figure
from endoscope_explain.report.html_page import html_page
from endoscope_explain.report.sentences import HEADLINES, verdict_sentence


@pytest.fixture(scope='module')
def page(stribeck_case):
    ranked = (
        Candidate('bend_x', ('stribeck_friction',), 10.0, 1.0),
        Candidate('bend_x', (), 60.0, 6.0, True),
        Candidate('bend_x', (), 90.0, 9.0),
    )
    explanation = dataclasses.replace(stribeck_case.explanation, candidates=ranked)
    return html_page(dataclasses.replace(stribeck_case, explanation=explanation))


def test_a_page_needs_no_other_file(page):
    assert not re.findall(r'(?:src|href)\s*=\s*["\'](?!#)', page)
    assert '@import' not in page
    # Fragments of the same page, and namespaces, are not fetched.
    assert not re.findall(r'url\((?!#)', page)


def test_a_page_says_what_was_left_out_and_where(page):
    text = re.sub(r'<[^>]+>', ' ', page)
    assert 'The simulation leaves out physics' in text
    assert 'stribeck_friction on bend_x, 97 %' in text
    assert 'cannot tell it from viscous_friction' in ' '.join(text.split())
    assert 'nominal, refitted beyond the band 60.0 50.0' in ' '.join(text.split())


def test_every_drawing_is_whole(page):
    drawings = re.findall(r'<svg.*?</svg>', page, re.DOTALL)
    assert len(drawings) >= 6
    for drawing in drawings:
        ET.fromstring(drawing)


def test_only_the_guilty_stage_is_marked():
    drawing = chain_svg({'joint': ['joint_stop (bend_x)']})
    assert drawing.count('#8c1d18') == 1
    assert all(title in drawing for title in ('Servo', 'Bending joint', 'Recording'))
    assert chain_svg({}).count('#8c1d18') == 0
    assert len(STAGES) == 6


def test_findings_of_neighbouring_stages_do_not_overlap():
    drawing = chain_svg({s: ['parameters differ (bend_x)'] for s in ('transmission', 'joint')})
    assert drawing.count('>parameters differ<') == drawing.count('>(bend_x)<') == 2


def test_every_parameter_of_every_joint_is_within_its_figure():
    def estimate(value):
        return NominalEstimate(value, value, value, 'N', 1.0, value < 1.15)

    drawing = ET.fromstring(
        parameters_figure({'bend_x': {'a': estimate(1.1)}, 'bend_y': {'a': estimate(2.0)}})
    )
    text = ET.tostring(drawing, encoding='unicode')
    assert text.count('#b3261e') > 0
    width = float(drawing.get('viewBox').split()[2])
    markers = [e for e in drawing.iter() if e.tag.endswith('}use') and 'b3261e' in str(e.attrib)]
    assert markers
    assert all(0.0 < float(e.get('x')) < width for e in markers)


@pytest.mark.parametrize('verdict', list(Verdict))
def test_every_verdict_has_its_sentence(stribeck_case, verdict):
    case = dataclasses.replace(stribeck_case, verdict=verdict)
    assert verdict in HEADLINES
    assert verdict_sentence(case).endswith('.')


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


def test_unknown_physics_and_the_next_experiment_are_drawn(stribeck_case, missing_function):
    time = np.linspace(0.0, 10.0, 200)
    experiment = NextExperiment(
        'It tells gravity from contact.',
        ('gravity', 'contact'),
        'slow ramps',
        'bend_x',
        {'chirp': 1.0, 'slow ramps': 4.0},
        tuple(time),
        tuple((float(v), 0.0) for v in np.sin(time)),
        ('bend_x', 'bend_y'),
    )
    explanation = dataclasses.replace(stribeck_case.explanation, unknown=missing_function)
    page = html_page(
        dataclasses.replace(
            stribeck_case,
            explanation=explanation,
            verdict=Verdict.UNKNOWN_PHYSICS,
            next_experiment=experiment,
        )
    )
    assert missing_function.expression in page
    assert html.escape(missing_function.what) in page.replace('&#39;', '&#x27;')
    assert 'It tells gravity from contact.' in page
    assert page.index('slow ramps') < page.index('>chirp<')
