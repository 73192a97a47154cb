"""index.html: what is known of a rig, and the motions that it was asked for."""

from importlib.metadata import version
from pathlib import Path

import numpy as np

from endoscope_core.names import JOINTS
from endoscope_core.signals.sampled_motion import read_command_file
from endoscope_explain.investigation.log import (
    CUT_SHORT,
    PLANT,
    Log,
    RigAnswer,
    answered,
    asked,
    recorded,
    times,
    tracking,
)
from endoscope_explain.investigation.motions import FILE, tracked
from endoscope_pages import Curve, Plot, figure_html, html_table, render_page

COLOURS = ('actual', 'wanted')
"""Of the curves of the joints, names of look.css."""
COLUMNS = ('effect', 'joint', 'left open, with probability', 'strength, 90 % interval')


def page(log: Log, folder: Path) -> str:
    """The page of an investigation whose motions are in a folder."""
    answer = log.last_answer
    return render_page(
        'endoscope_explain',
        'report/templates/investigation.html.j2',
        log=log,
        headline='Nothing is known yet' if answer is None else answer.sentence,
        mood='quiet' if log.stopped is None else 'finding' if log.stopped in CUT_SHORT else 'good',
        version=version('endoscope_explain'),
        improved=folder / PLANT,
        answer=answer,
        names='' if answer is None else _names(answer),
        lines=[] if answer is None else answered(answer)[1 + len(answer.names) :],
        rounds=[
            {
                'round': each,
                'asked': asked(each),
                'recorded': recorded(each).replace('`', ''),
                'answered': [] if each.answer is None else answered(each.answer)[1:-1],
                'figure': _figure(folder / each.file),
            }
            for each in log.rounds
        ],
        tracking=tracking(log),
        tracking_figure=_tracking(log, folder) if log.tracking else '',
        times=times(log),
    )


def _names(answer: RigAnswer) -> str:
    rows = [
        (name.id, name.joint, name.left_open or ', '.join(name.rivals) or 'none', name.strength)
        for name in answer.names
    ]
    return html_table(COLUMNS, rows, words=len(COLUMNS))


def _figure(file: Path) -> str:
    table = read_command_file(file)
    curves = tuple(
        Curve(joint, table.time, np.degrees(table.angle[:, k]), COLOURS[k])
        for k, joint in enumerate(JOINTS)
        if table.angle[:, k].any()
    )
    return figure_html((Plot('Desired angle (deg)', 'time (s)', curves, height=110),))


def _tracking(log: Log, folder: Path) -> str:
    """What was asked for, and what the tip did by either plant, a plot a joint."""
    of = {each.by: tracked(folder / each.bag, folder / FILE) for each in log.tracking}
    plots = []
    for k, joint in enumerate(JOINTS):
        wanted = next(iter(of.values()))
        curves = [Curve('desired', wanted.time, np.degrees(wanted.desired[:, k]), 'wanted')]
        curves += [
            Curve(f'by the {by} plant', one.time, np.degrees(one.tip[:, k]), colour)
            for (by, one), colour in zip(of.items(), ('curve-2', 'curve-1'), strict=True)
        ]
        plots.append(Plot(f'{joint} (deg)', 'time (s)', tuple(curves), height=150))
    return figure_html(tuple(plots))
