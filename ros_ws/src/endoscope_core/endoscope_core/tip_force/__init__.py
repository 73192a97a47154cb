"""Force on the tip from wire tensions, motors and tracker, by the plant in force."""

from endoscope_core.tip_force.estimator import State, TipForce, TipForceEstimator

__all__ = ['State', 'TipForce', 'TipForceEstimator']
