"""Concealed cases for `endoscope bench explain`, independent of the plant that explains them."""

from endoscope_explain.generator.case_draw import MOTIONS, STRATA, Case, draw_case
from endoscope_explain.generator.case_files import write_case
from endoscope_explain.generator.case_plan import CaseRequest, plan_cases
from endoscope_explain.generator.effect_choice import EFFECTS, OUTSIDE

__all__ = [
    'EFFECTS',
    'MOTIONS',
    'OUTSIDE',
    'STRATA',
    'Case',
    'CaseRequest',
    'draw_case',
    'plan_cases',
    'write_case',
]
