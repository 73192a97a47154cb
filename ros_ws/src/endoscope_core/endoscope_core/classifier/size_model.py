"""Backlash size of a tube, with its uncertainty, regressed from wire tensions."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from endoscope_core.classifier.classification import CellReadings
from endoscope_core.classifier.tension_features import (
    PERIOD,
    log_courses,
    roughness,
    variance_of_fewer_readings,
)

COMPONENTS = 16
STEPS = 120
_RATE = 0.08
_JITTER = 1e-9
_LEAST = 1e-6
_ROUNDING = 1e-6


@dataclass(frozen=True)
class SizeEstimate:
    """What the model makes of R recordings of J joints.

    Parameters
    ----------
    size, deviation : Tensor, shape (R,)
        Backlash size in rad, mean of the joints, and the standard deviation of its error as the
        model takes it, before calibration on recordings held out.
    strangeness : Tensor, shape (R, 3)
        Natural logarithms of how far the tensions are from those that the model knows, the worst
        joint or wire of each recording; see `STRANGENESS`.
    """

    size: Tensor
    deviation: Tensor
    strangeness: Tensor


STRANGENESS = (
    'the tensions do not take the course that they take in a known tube',
    'the tensions are too far from those of all known tubes',
    "a load cell's noise is not what it was in known tubes",
)
"""What each number of `SizeEstimate.strangeness` says when it is too large."""


class BacklashSizeModel(nn.Module):
    """Gaussian process on principal components of the tension courses of one joint.

    Friction acts on tension as a factor (Euler-Eytelwein), so that the courses are read as
    logarithms (`log_courses`). They lie near a surface of few dimensions: capstan exponent, its
    spread along the tube, pretension, stiffness and friction of the joint are all that varies. The
    first principal components, whitened, span it. The size is a Gaussian process of them with a
    linear and a squared-exponential covariance, a length for each component, and noise; all of
    these maximise the marginal likelihood (Rasmussen, Williams, Gaussian Processes for Machine
    Learning, 2006, sections 2.3, 5.1 and 5.4). All joints share one model, so that each recording
    teaches it twice. What the components leave out of a course, and how far out they are, tell
    tensions of another kind.

    Parameters
    ----------
    known : int
        Number M of courses that it is fitted to.
    course : int
        Length C of a joint's course.
    components : int
        Number K of principal components.
    """

    centre: Tensor
    basis: Tensor
    spread: Tensor
    scores: Tensor
    target: Tensor
    lengths: Tensor
    linear: Tensor
    height: Tensor
    noise: Tensor
    rest: Tensor
    quiet: Tensor

    def __init__(self, known: int, course: int, components: int = COMPONENTS) -> None:
        super().__init__()
        shapes: dict[str, tuple[int, ...]] = {
            'centre': (course,),
            'basis': (components, course),
            'spread': (components,),
            'scores': (known, components),
            'target': (known,),
            'lengths': (components,),
            'linear': (),
            'height': (),
            'noise': (),
            'rest': (),
            'quiet': (),
        }
        for name, shape in shapes.items():
            self.register_buffer(name, torch.ones(shape, dtype=torch.float64))
        self._conditioned: tuple[Tensor, Tensor, Tensor] | None = None

    def fit(self, tension: Tensor, joint_size: Tensor, steps: int = STEPS) -> None:
        """Take over what R recordings (R, N, 2 J) of known sizes (R, J) in rad teach.

        Parameters
        ----------
        tension, joint_size : Tensor
        steps : int
            Of the search for the greatest likelihood, by Adam.
        """
        course = log_courses(tension.double()).flatten(0, 1)
        self.target = joint_size.double().flatten()
        self.centre = course.mean(dim=0)
        _, strengths, directions = torch.linalg.svd(course - self.centre, full_matrices=False)
        components = len(self.spread)
        self.basis = directions[:components].contiguous()
        self.spread = strengths[:components] / len(course) ** 0.5
        self.scores, rest = self._components(course)
        self.rest = rest.square().mean().sqrt()
        self.quiet = roughness(tension.double()).log().mean().exp()
        self._conditioned = None
        self._maximise_likelihood(steps)

    def _maximise_likelihood(self, steps: int) -> None:
        target = self.target - self.target.mean()
        unit = target.std()
        logarithms = torch.cat(
            [
                torch.full((len(self.spread),), 1.5, dtype=torch.float64),
                torch.log(torch.tensor([0.5, 1.0, 0.02], dtype=torch.float64) * unit),
            ]
        ).requires_grad_()
        search = torch.optim.Adam([logarithms], lr=_RATE)
        for _ in range(steps):
            search.zero_grad()
            self._take(logarithms)
            factor, weights = self._solve(target)
            loss = 0.5 * target @ weights + factor.diagonal().log().sum()
            loss.backward()
            search.step()
        with torch.no_grad():
            self._take(logarithms)

    def require_fitted(self) -> None:
        """Refuse numbers that no fit gives.

        Directions of a singular value decomposition are orthonormal, and whitened scores have a
        mean square of one: to rounding, whatever the model was fitted to.

        Raises
        ------
        ValueError
            They are not, or a known size is no angle of a tube.
        """
        unit = torch.eye(len(self.basis), dtype=self.basis.dtype)
        squares = self.scores.square().mean(dim=0)
        if not torch.allclose(self.basis @ self.basis.T, unit, atol=_ROUNDING):
            raise ValueError('the components are not orthonormal')
        if not torch.allclose(squares, torch.ones_like(squares), atol=_ROUNDING):
            raise ValueError('the scores are not whitened')
        if not bool(((self.target >= 0.0) & (self.target <= 2.0 * torch.pi)).all()):
            raise ValueError('the known sizes are no angles')

    def _take(self, logarithms: Tensor) -> None:
        values = logarithms.exp()
        self.lengths = values[:-3]
        self.linear, self.height, self.noise = values[-3:]

    def _covariance(self, a: Tensor, b: Tensor) -> Tensor:
        """Covariance (A, B) in rad^2 of the sizes at whitened components (A, K) and (B, K)."""
        x, y = a / self.lengths, b / self.lengths
        square = x.square().sum(dim=1)[:, None] + y.square().sum(dim=1) - 2.0 * (x @ y.T)
        bump = (-0.5 * square.clamp(min=0.0)).exp()
        return self.height**2 * bump + self.linear**2 * (a @ b.T)

    def _solve(self, target: Tensor) -> tuple[Tensor, Tensor]:
        """Cholesky factor of the known sizes' covariance, and its solution for a target."""
        known = self._covariance(self.scores, self.scores)
        floor = self.noise**2 + _JITTER * known.diagonal().mean()
        factor = torch.linalg.cholesky(known + floor * torch.eye(len(known), dtype=known.dtype))
        return factor, torch.cholesky_solve(target[:, None], factor)[:, 0]

    def _components(self, course: Tensor) -> tuple[Tensor, Tensor]:
        """Whitened components of courses, and the rms of what they leave out."""
        deviation = course - self.centre
        raw = deviation @ self.basis.T
        rest = (deviation - raw @ self.basis).square().mean(dim=-1).sqrt()
        return raw / self.spread, rest

    def forward(self, tension: Tensor, cells: CellReadings | None = None) -> SizeEstimate:
        """Sizes of recordings (R, N, 2 J) in N at 1 kHz.

        Where the cells were read less often, their noise is that of the readings, and what fewer
        readings add to the noise of the courses is no strangeness of the tube.
        """
        if self._conditioned is None:
            middle = self.target.mean()
            self._conditioned = (middle, *self._solve(self.target - middle))
        middle, factor, weights = self._conditioned
        tension = tension.double()
        course = log_courses(tension)
        scores, rest = self._components(course)
        flat = scores.flatten(0, 1)
        known = self._covariance(flat, self.scores)
        told = torch.linalg.solve_triangular(factor, known.T, upper=False).square().sum(dim=0)
        alone = self.height**2 + self.linear**2 * flat.square().sum(dim=1)
        size = (known @ weights + middle).unflatten(0, scores.shape[:2])
        deviation = (alone - told).clamp(min=0.0).add(self.noise**2).sqrt()
        # The joints of a rig are alike, and so are the model's errors on them: they do not average.
        deviation = deviation.unflatten(0, scores.shape[:2]).mean(dim=1)
        return SizeEstimate(
            size.mean(dim=1), deviation, self._strangeness(tension, course, scores, rest, cells)
        )

    def _strangeness(
        self,
        tension: Tensor,
        course: Tensor,
        scores: Tensor,
        rest: Tensor,
        cells: CellReadings | None,
    ) -> Tensor:
        rms, interval = roughness(tension), PERIOD
        if cells is not None:
            rms = torch.tensor(cells.noise, dtype=rms.dtype).reshape(1, *rms.shape[1:])
            interval = cells.interval
        added = variance_of_fewer_readings(course, rms, interval)
        of_basis = self.basis.square()
        unknown = rest.square() - (added * (1.0 - of_basis.sum(dim=0))).mean(dim=-1)
        far = scores.square().mean(dim=-1) - (added @ of_basis.T / self.spread**2).mean(dim=-1)
        noise = (rms / self.quiet).clamp(min=_LEAST).log().abs().amax(dim=(1, 2))
        return torch.stack(
            [
                (unknown / self.rest**2).clamp(min=_LEAST).sqrt().log().amax(dim=1),
                far.clamp(min=_LEAST).sqrt().log().amax(dim=1),
                noise.expand(len(tension)),
            ],
            dim=1,
        )


def fitted_size_model(tension: Tensor, joint_size: Tensor, steps: int = STEPS) -> BacklashSizeModel:
    """A model fitted to recordings (R, N, 2 J) in N of known sizes (R, J) in rad."""
    known, course = log_courses(tension.double()).flatten(0, 1).shape
    model = BacklashSizeModel(known, course, min(COMPONENTS, known - 1))
    model.fit(tension, joint_size, steps)
    return model.eval()
