"""The one optimiser, held against scipy's on small problems."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import least_squares

from endoscope_explain.fit.solver import Effort, Ended, Renewal, Secants, minimise

TIME = np.linspace(0.0, 3.0, 60)
FAR = 10.0


def decay(theta):
    """Amplitude, rate and offset of an exponential, less the one that was recorded."""
    wanted = 2.0 * np.exp(-1.3 * TIME) + 0.4
    return theta[0] * np.exp(-theta[1] * TIME) + theta[2] - wanted


def valley(theta):
    """The residuals of Rosenbrock's function."""
    return np.array([10.0 * (theta[1] - theta[0] ** 2), 1.0 - theta[0]])


@dataclass
class Curve:
    """Residuals of a function, counted."""

    function: object
    low: np.ndarray
    high: np.ndarray
    derivatives: int = 0
    evaluations: int = 0

    def bounds(self):
        return self.low, self.high

    def evaluate(self, theta):
        self.evaluations += 1
        residuals = self.function(theta)
        return residuals, 0.5 * float(residuals @ residuals)

    def derivative(self, theta, residuals, stride):
        self.derivatives += 1
        moved = np.eye(len(theta)) * stride
        return np.stack([(self.function(theta + m) - residuals) / stride for m in moved], axis=1)

    def normal_equations(self, theta, residuals, derivative):
        return derivative.T @ derivative, derivative.T @ residuals

    def updated(self, derivative, step, before, after):
        return derivative + np.outer((after - before - derivative @ step) / (step @ step), step)


def curve(function, count, low=-FAR, high=FAR):
    return Curve(function, np.full(count, float(low)), np.full(count, float(high)))


@pytest.mark.parametrize('renewal', [Renewal.WHEN_WRONG, Renewal.ALWAYS])
@pytest.mark.parametrize(('function', 'start'), [(decay, [0.5, 0.2, 0.0]), (valley, [-1.2, 1.0])])
def test_it_ends_where_scipy_ends(function, start, renewal):
    problem = curve(function, len(start))
    found = minimise(problem, np.array(start), Effort(200, 1e-12, renewal=renewal))
    expected = least_squares(function, start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert found.theta == pytest.approx(expected.x, abs=2e-3)
    assert found.cost == pytest.approx(0.5 * float(found.residuals @ found.residuals))


def test_it_ends_at_a_bound_where_scipy_ends():
    low, high = np.array([0.0, 0.0, -FAR]), np.array([1.5, FAR, FAR])
    problem = Curve(decay, low, high)
    found = minimise(problem, np.array([0.5, 0.2, 0.0]), Effort(200, 1e-12))
    expected = least_squares(decay, [0.5, 0.2, 0.0], bounds=(low, high))
    assert found.theta[0] == 1.5
    assert found.theta == pytest.approx(expected.x, abs=2e-3)


def test_why_it_went_no_further_is_told():
    start = np.array([0.5, 0.2, 0.0])
    there = minimise(curve(decay, 3), start, Effort(200, 1e-6))
    assert there.ended in (Ended.CONVERGED, Ended.NO_STEP)
    assert 1 < there.steps < 200
    spent = minimise(curve(decay, 3), start, Effort(2, 1e-12))
    assert spent.ended is Ended.SPENT
    assert 2 <= spent.steps < there.steps
    still = minimise(curve(decay, 3), np.array([2.0, 1.3, 0.4]), Effort())
    assert (still.ended, still.steps) == (Ended.NO_STEP, 1)


def test_without_renewal_every_step_costs_one_evaluation():
    problem = curve(decay, 3)
    start = np.array([1.5, 1.0, 0.2])
    residuals, cost = problem.evaluate(start)
    known = problem.derivative(start, residuals, 1e-4)
    problem.derivatives = problem.evaluations = 0
    found = minimise(problem, start, Effort(5, renewal=Renewal.NEVER), known)
    assert (problem.derivatives, problem.evaluations) == (0, 6)
    assert found.cost < 0.05 * cost


def test_a_longer_stride_looks_over_what_is_rough():
    def rough(theta):
        return np.array([theta[0] + 0.05 * np.sin(theta[0] / 1e-3)])

    start = np.array([2.0])
    fine = minimise(curve(rough, 1), start, Effort(40, 1e-6, (1e-4,), Renewal.ALWAYS))
    both = minimise(curve(rough, 1), start, Effort(40, 1e-6, (1e-4, 0.5), Renewal.ALWAYS))
    assert both.cost < 0.1 * fine.cost
    assert abs(both.theta[0]) < 0.1


def test_updates_kept_apart_are_those_of_the_whole_derivative():
    rng = np.random.default_rng(0)
    exact, weight = rng.normal(size=(50, 4)), rng.uniform(0.1, 1.0, 50)
    kept, whole = Secants.at(exact, weight), exact
    for _ in range(3):
        step, before, after = rng.normal(size=4), rng.normal(size=50), rng.normal(size=50)
        kept = kept.updated(step, before, after)
        whole = whole + np.outer((after - before - whole @ step) / (step @ step), step)
    assert kept.whole == pytest.approx(whole)
    weighted = weight[:, None] * whole
    assert kept.gram == pytest.approx(weighted.T @ weighted)
    assert kept.towards(after) == pytest.approx(weighted.T @ (weight * after))


def test_an_estimate_that_foretells_its_steps_is_not_renewed():
    def nearly_linear(theta):
        return np.append(theta + 0.01 * theta**2, 5.0)

    problem = curve(nearly_linear, 6)
    start = np.full(6, 3.0)
    residuals, _ = problem.evaluate(start)
    known = problem.derivative(start, residuals, 1e-4)
    problem.derivatives = 0
    found = minimise(problem, start, Effort(20, 1e-3), known)
    # One confirms the end.
    assert problem.derivatives == 1
    assert found.ended is Ended.CONVERGED
