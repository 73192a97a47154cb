"""The demonstration's report as one self-contained page."""

from dataclasses import dataclass

from jinja2 import Environment, PackageLoader, StrictUndefined

from endoscope_bringup.demo.figures import (
    MOTION_TITLE,
    calibration_figure,
    loops_figure,
    tracking_figure,
)
from endoscope_bringup.demo.procedure import MOTIONS, TABLE_5, Mode, PaperFigure
from endoscope_bringup.demo.results import DemoResults


@dataclass(frozen=True)
class TableRow:
    """One line of the table beside the paper's Table 5; degrees."""

    tube: str
    motion: str
    figure: str
    paper_none: PaperFigure
    paper_proposed: PaperFigure
    none: float
    feed_forward: float
    adaptive: float

    @property
    def paper_left(self) -> float:
        """Share of the uncompensated figure that the paper's compensator leaves."""
        return self.paper_proposed.mean / self.paper_none.mean

    @property
    def feed_forward_left(self) -> float:
        """Share of the uncompensated figure that feed-forward leaves."""
        return self.feed_forward / self.none

    @property
    def adaptive_left(self) -> float:
        """Share of the uncompensated figure that feed-forward and feedback leave."""
        return self.adaptive / self.none


def table_rows(results: DemoResults) -> list[TableRow]:
    """RMSE and backlash of each tube and motion, ours beside the paper's."""
    rows = []
    for calibration in results.calibrations:
        tube = calibration.tube
        for motion in MOTIONS:
            none, forward, adaptive = (results.run(tube, motion, mode) for mode in Mode)
            paper = TABLE_5[tube, motion]
            rows.append(
                TableRow(
                    tube,
                    MOTION_TITLE[motion],
                    'RMSE',
                    paper[0],
                    paper[1],
                    none.rmse_deg,
                    forward.rmse_deg,
                    adaptive.rmse_deg,
                )
            )
            rows.append(
                TableRow(
                    tube,
                    MOTION_TITLE[motion],
                    'backlash size',
                    paper[2],
                    paper[3],
                    none.backlash_deg,
                    forward.backlash_deg,
                    adaptive.backlash_deg,
                )
            )
    return rows


def report_page(results: DemoResults, facts: dict[str, str]) -> str:
    """HTML of the whole report.

    Parameters
    ----------
    results : DemoResults
    facts : dict of str to str
        How it was made (date, seed, command, clock), shown at the foot.

    Returns
    -------
    str
        A page that needs no other file.
    """
    environment = Environment(
        loader=PackageLoader('endoscope_bringup', 'demo/templates'),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    rows = table_rows(results)
    rmse = [row for row in rows if row.figure == 'RMSE']
    tubes = [
        {
            'calibration': calibration,
            'calibration_svg': calibration_figure(calibration),
            'loops_svg': loops_figure(results, calibration.tube),
            'tracking_svg': [tracking_figure(results, calibration.tube, m) for m in MOTIONS],
        }
        for calibration in results.calibrations
    ]
    return environment.get_template('report.html.j2').render(
        tubes=tubes,
        rows=rows,
        facts=facts,
        messages=results.messages,
        lost=results.lost,
        worst_forward=max(row.feed_forward_left for row in rmse),
        worst_adaptive=max(row.adaptive_left for row in rmse),
        worst_paper=max(row.paper_left for row in rmse),
    )
