"""The formula nearest to a fitted function, in the metric of what the data show of it."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.stats import chi2

from endoscope_core.physics.description import TermSpec
from endoscope_core.physics.functions.places import Shape
from endoscope_core.physics.functions.term import evaluate, tabulated
from endoscope_explain.fit.family import Family
from endoscope_explain.fit.free_parameters import COORDINATE
from endoscope_explain.fit.intervals import covariance
from endoscope_explain.fit.model import Fit
from endoscope_explain.recording import Array

AS_GOOD = 0.95
"""Part of the function's posterior within which a formula is as good as the function."""
_ANY = (
    ('{x}',), ('{x}**2',), ('{x}', '{x}**2'), ('{x}', '{x}**2', '{x}**3'),
    ('tanh(({x} - {c})/{s})',), ('exp(-(({x} - {c})/{s})**2)',), ('exp(-({x} - {low})/{s})',),
    ('max(0, {x} - {c})',), ('max(0, {c} - {x})',), ('abs({x} - {c})',),
    ('sin({x}/{s})', 'cos({x}/{s})'),
)  # fmt: skip
_ODD = (('{x}',), ('{x}', '{x}**3'), ('tanh({x}/{s})',), ('sin({x}/{s})',), ('{x}*abs({x})',))
_EVEN = (
    ('{x}**2',), ('{x}**2', '{x}**4'), ('abs({x})',), ('exp(-({x}/{s})**2)',), ('cos({x}/{s})',),
)  # fmt: skip
_HARMONICS = ('sin({w}*{x})', 'cos({w}*{x})', 'sin(2*{w}*{x})', 'cos(2*{w}*{x})',
              'sin(3*{w}*{x})', 'cos(3*{w}*{x})')  # fmt: skip
_PERIODIC = tuple(_HARMONICS[: 2 * count] for count in (1, 2, 3))
_FORMS = {Shape.ODD: _ODD, Shape.EVEN: _EVEN, Shape.PERIODIC: _PERIODIC}
_CENTRES = np.linspace(0.05, 0.95, 13)
_WIDTHS = (0.03, 0.05, 0.08, 0.12, 0.2, 0.35, 0.6)
"""Shares of the range."""


@dataclass(frozen=True)
class FittedFunction:
    """A function as a fit has it."""

    joint: str
    family: Family
    coefficients: Array  # (K,)
    covariance: Array  # (K, K), of the coefficients, the other numbers free
    samples: int  # that the fit has seen

    @property
    def values(self) -> Array:
        """The function at the family's nodes (NODES,)."""
        return self.family.values(self.coefficients)

    @property
    def deviation(self) -> Array:
        """Standard deviation of the function at its nodes (NODES,)."""
        basis = self.family.basis
        spread = np.einsum('nk,kl,nl->n', basis, self.covariance, basis)
        return np.sqrt(np.maximum(spread, 0.0))


def fitted_function(found: Fit, place_id: str) -> FittedFunction:
    """The function that a fit has at a place."""
    model = found.model
    which = [family.place.id for family in model.families].index(place_id)
    own = model.places_of_coefficients()[which]
    spread = covariance(found)[np.ix_(own, own)] * COORDINATE**2
    return FittedFunction(
        model.observation.joint,
        model.family_at(which, found.theta),
        model.coefficients(found.theta)[which],
        spread,
        len(found.residuals),
    )


@dataclass(frozen=True)
class Formula:
    """A formula for a function."""

    expression: str  # of the place's symbol
    values: Array  # (NODES,), at the family's nodes
    share: float  # of what the function does, so much does the formula
    as_good: bool  # whether the data cannot distinguish it from the function, and a plant takes it


def nearest_formula(found: FittedFunction) -> Formula:
    """The formula that costs least: what it misses, and half a logarithm for each number in it."""
    family = found.family
    inverse = np.linalg.pinv(family.basis)
    metric = np.linalg.inv(found.covariance)
    root = np.linalg.cholesky(metric).T @ inverse
    wanted = root @ found.values
    whole = float(wanted @ wanted)
    price = np.log(found.samples)
    odd = family.place.shape is Shape.ODD
    best: tuple[float, float, str, Array] | None = None
    for terms, shapes in _candidates(found):
        columns = [evaluate(term, family.place.argument.symbol, family.nodes) for term in terms]
        design = np.stack(columns if odd else [np.ones_like(family.nodes), *columns], axis=1)
        factors, *_ = np.linalg.lstsq(root @ design, wanted, rcond=None)
        values = design @ factors
        missed = wanted - root @ values
        loss = float(missed @ missed)
        cost = loss + price * (len(factors) + shapes)
        if best is None or cost < best[0]:
            names = terms if odd else ('1', *terms)
            best = cost, loss, _written(factors, names), values
    assert best is not None
    _, loss, expression, values = best
    limit = float(chi2.ppf(AS_GOOD, len(wanted)))
    as_good = loss <= limit and _can_be_run(found, expression)
    return Formula(expression, values, max(0.0, 1.0 - loss / max(whole, 1e-300)), as_good)


def _can_be_run(found: FittedFunction, expression: str) -> bool:
    """Whether a plant takes a formula: one may be too fine for its table, or go too far."""
    joint, family = found.joint, found.family
    try:
        ends = (family.low, family.high)
        term = TermSpec(joint, family.place.id, expression, (), ends, family.multiplies, family.lag)
        tabulated(term)
    except ValueError:
        return False
    return True


def _candidates(found: FittedFunction) -> Iterator[tuple[tuple[str, ...], int]]:
    """Terms of each formula with its shape's numbers written in, and how many those are."""
    family = found.family
    extent = family.high - family.low
    for form in _FORMS.get(family.place.shape, _ANY):
        centred, wide = (any(number in term for term in form) for number in ('{c}', '{s}'))
        for centre, width in product(_CENTRES if centred else (0.0,), _WIDTHS if wide else (1.0,)):
            numbers = {
                'x': family.place.argument.symbol,
                'c': f'{family.low + centre * extent:.4g}',
                's': f'{width * extent:.4g}',
                'low': f'{family.low:.4g}',
                'w': f'{2.0 * np.pi / extent:.12g}',
            }
            yield tuple(term.format_map(numbers) for term in form), centred + wide


def _written(factors: Array, names: tuple[str, ...]) -> str:
    parts = [
        f'{factor:.5g}' if name == '1' else f'{factor:.5g}*{name}'
        for factor, name in zip(factors, names, strict=True)
    ]
    return ' + '.join(parts).replace('+ -', '- ')
