"""Whether one term more is missing, or only bends as the recordings do, and what stands for what.

One recording is judged beside rigs in which nothing is missing; several of a rig by leaving each of
them out.
"""

from dataclasses import dataclass

import numpy as np

from endoscope_explain.search.left_out import chance
from endoscope_explain.search.null_rigs import Null
from endoscope_explain.search.refit import Candidate

FALSE_ALARMS = 0.025
"""Chance that rigs in which nothing is missing show as much, above which no term is added: 2 % are
wanted, and 39 rigs show no less."""


@dataclass(frozen=True)
class BesideNullRigs:
    """By what rigs show in which nothing is missing."""

    null: Null
    # Whether the best one predicts better than its parent what neither has seen.
    predicts: bool = True

    @property
    def form_is_worth(self) -> float:
        """Evidence by which an error of form as large as what is left may mislead."""
        return max(float(np.quantile(self.null.doubt, 1.0 - FALSE_ALARMS)), 0.0)

    def stands_for(self, one: Candidate, top: Candidate) -> bool:
        """Whether a candidate loses no more than form is worth."""
        return one.evidence >= top.evidence - self.form_is_worth

    def formula_stands(self, formula: Candidate, function: Candidate, parent: Candidate) -> bool:
        """Whether it loses no more than form is worth."""
        return self.stands_for(formula, function)

    def p_value(self, best: Candidate, parent: Candidate) -> float:
        """Share of rigs in which nothing is missing that show as much."""
        return self.null.p_value(best.evidence - parent.evidence)

    def confirms(self, best: Candidate, parent: Candidate) -> bool:
        """Whether hardly any of them shows as much, and the best one predicts."""
        # What every rig has needs no more than to be worth its numbers: that a rig has none of it
        # is no hypothesis.
        if best.adds_nominal:
            return best.evidence > parent.evidence and self.predicts
        return self.p_value(best, parent) <= FALSE_ALARMS and self.predicts

    def doubts(self, best: Candidate, parent: Candidate) -> str:
        """Which of both is wanting."""
        if not self.predicts:
            return 'not on what it was not fitted to'
        return f'{self.p_value(best, parent):.1%} of rigs without it show as much'


@dataclass(frozen=True)
class InRecordingsLeftOut:
    """By what the other recordings of a rig show of the one that is left out."""

    form_is_worth: float = 0.0

    def stands_for(self, one: Candidate, top: Candidate) -> bool:
        """Whether recordings that are left out confound a candidate with the best one."""
        return chance(top.foretold - one.foretold) > FALSE_ALARMS

    def formula_stands(self, formula: Candidate, function: Candidate, parent: Candidate) -> bool:
        """Whether it is confirmed by itself: by how much less shows how good a form it is."""
        return self.confirms(formula, parent)

    def p_value(self, best: Candidate, parent: Candidate) -> float:
        """Chance of such gains where what was added is worth nothing."""
        return chance(best.foretold - parent.foretold)

    def confirms(self, best: Candidate, parent: Candidate) -> bool:
        """Whether all of them together gain more than chance."""
        return self.p_value(best, parent) <= FALSE_ALARMS

    def doubts(self, best: Candidate, parent: Candidate) -> str:
        """That they do not."""
        return 'not in recordings that are left out'

    def ranked(self, found: tuple[Candidate, ...], parent: Candidate) -> tuple[Candidate, ...]:
        """Candidates in the order of what speaks for them."""
        # What is confirmed, and confounded with the one that foretells most, goes by its evidence:
        # leaving recordings out shows what is no effect of the instrument, with few recordings, and
        # not which of two effects it is.
        first = max(found, key=lambda c: (self.confirms(c, parent), float(np.sum(c.foretold))))

        def order(one: Candidate) -> tuple[bool, bool, float]:
            confirmed = self.confirms(one, parent)
            near = one is first or self.stands_for(one, first)
            worth = one.evidence if confirmed and near else float(np.sum(one.foretold))
            return not confirmed, not near, -worth

        return tuple(sorted(found, key=order))


Judge = BesideNullRigs | InRecordingsLeftOut
"""How candidates with one term more are judged."""
