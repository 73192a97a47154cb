"""The page that compares truths and explanations."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.report.figures import TIME, look
from endoscope_explain.report.numbers import digits
from endoscope_explain.report.sentences import plain
from endoscope_lab.proof import sentences
from endoscope_lab.proof.trial import TRUTH, Outcome, folder_of, report_of, worst_stretch
from endoscope_nodes.names import JOINTS
from endoscope_pages import Curve, Plot, figure_html, render_page

Array = NDArray[np.float64]

PLANTS = ('nominal', 'refitted', 'augmented')


def page(outcomes: Sequence[Outcome], facts: Mapping[str, str]) -> str:
    """HTML of the proof: a self-contained page with links to the reports."""
    return render_page(
        'endoscope_lab',
        'proof/templates/proof.html.j2',
        filters={'digits': digits},
        headline=sentences.headline(outcomes),
        summary=sentences.summary(outcomes),
        rigs=[_rig(outcome) for outcome in outcomes],
        facts=facts,
    )


def _rig(outcome: Outcome) -> dict:
    number, answer = outcome.rig.number, outcome.answer
    return {
        'number': number,
        'sha256': outcome.rig.sha256,
        'sealed': f'{folder_of(number)}/{TRUTH}',
        'report': report_of(number),
        'injected': sentences.injected(outcome),
        'reported': sentences.reported(answer.reported),
        'sentence': answer.sentence,
        'result': sentences.result(outcome),
        'right': outcome.judgement.exact,
        'why': sentences.why(outcome),
        'moved': outcome.rig.moved,
        'answer': answer,
        'figure': _figure(outcome),
        'tracking': sentences.tracking(outcome),
        'followed': _followed(outcome) if outcome.tracking else '',
    }


def _followed(outcome: Outcome) -> str:
    """Desired and measured angle of the joint with the first injected law, by either plant."""
    joints = [law.joint for law in outcome.rig.laws if law.joint] or list(JOINTS)
    j = JOINTS.index(joints[0])
    runs = outcome.tracking
    first = runs['nominal']
    wanted = Curve(x=first.time, y=np.degrees(first.desired[:, j]), width=2.4, **look('measured'))
    return _with_errors(
        f'{JOINTS[j]} (deg)',
        replace(wanted, label='desired'),
        {name: (run.time, np.degrees(run.tip[:, j])) for name, run in runs.items()},
        'measured - desired (deg)',
        {name: np.degrees(run.tip - run.desired)[:, j] for name, run in runs.items()},
    )


def _figure(outcome: Outcome) -> str:
    """The signal in which the missing physics shows most, and the error of each plant."""
    shown = worst_stretch(outcome.answer.passage)
    factor, unit = (180.0 / np.pi, 'deg') if shown.unit == 'rad' else (1.0, shown.unit)
    measured = factor * shown.measured
    predicted = {name: factor * shown.predicted[name] for name in PLANTS}
    return _with_errors(
        f'{plain(shown.signal)} ({unit})',
        Curve(x=shown.time, y=measured, width=2.4, **look('measured')),
        {name: (shown.time, y) for name, y in predicted.items()},
        f'measured - predicted ({unit})',
        {name: measured - y for name, y in predicted.items()},
    )


def _with_errors(
    title: str,
    reference: Curve,
    plants: Mapping[str, tuple[Array, Array]],
    errors_title: str,
    errors: Mapping[str, Array],
) -> str:
    """Plots of a reference with the curve (times and values) of each plant, and of their errors."""
    curves = [Curve(x=x, y=y, width=1.3, **look(name)) for name, (x, y) in plants.items()]
    missed = [Curve(x=plants[name][0], y=y, width=1.3, **look(name)) for name, y in errors.items()]
    return figure_html(
        [
            Plot(title, TIME, (reference, *curves), columns=7, height=140),
            Plot(errors_title, TIME, tuple(missed), columns=5, height=140),
        ]
    )
