"""The demonstration's report as one self-contained page."""

from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined

from endoscope_bringup.demo import sentences
from endoscope_bringup.demo.figures import (
    COLOUR,
    calibration_figure,
    loops_figure,
    tracking_figure,
)
from endoscope_bringup.demo.procedure import MEANING, MOTIONS, Method
from endoscope_bringup.demo.results import DemoResults
from endoscope_bringup.demo.table import ranking, table_rows
from endoscope_core.pages import zoomable


def endoscope_picture() -> str:
    """The drawing of an endoscope that stands at the top of the page, as SVG."""
    return (files('endoscope_bringup') / 'demo/templates/endoscope.svg').read_text()


def report_page(results: DemoResults, facts: dict[str, str]) -> str:
    """HTML of the whole report, in one file; `facts`, how it was made, stand at the foot."""
    environment = Environment(
        loader=PackageLoader('endoscope_bringup', 'demo/templates'),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    rows = table_rows(results)
    order = ranking(rows)
    best, shown = order[0], MOTIONS[0]
    tubes = [
        {
            'calibration': calibration,
            'title': calibration.facts.tube.capitalize(),
            'calibration_figure': calibration_figure(
                calibration, sentences.of_calibration(calibration.facts)
            ),
            'loops_figure': loops_figure(
                results,
                calibration.facts.tube,
                shown,
                best,
                sentences.of_loops(results, calibration.facts.tube, shown, best),
            ),
            'tracking': [
                tracking_figure(
                    results,
                    calibration.facts.tube,
                    m,
                    order,
                    sentences.of_tracking(results, calibration.facts.tube, m, order),
                )
                for m in MOTIONS
            ],
        }
        for calibration in results.calibrations
    ]
    return environment.get_template('report.html.j2').render(
        head=zoomable.head(),
        scripts=zoomable.scripts(),
        picture=endoscope_picture(),
        headline=sentences.headline(rows),
        wrong=sentences.what_is_wrong(rows),
        helps=[(m, sentences.what_helps(rows, m)) for m in order if m is not Method.NONE],
        paper=sentences.beside_the_paper(rows, Method.BOUC_WEN),
        left=sentences.what_is_left(results, best),
        cut=sentences.where_signals_were_cut(results, best),
        order=order,
        best=best,
        meaning=MEANING,
        colour=COLOUR,
        rows=rows,
        tubes=tubes,
        facts=facts,
        messages=results.messages,
        lost=results.lost,
    )
