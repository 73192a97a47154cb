"""The second paper's adaptive law in the loop with a slow tracker."""

from __future__ import annotations

from endoscope_core.control.adaptive_backlash_law import (
    AdaptationState,
    AdaptiveBacklashSettings,
    adapt,
    learnt_term,
    robust_term,
)
from endoscope_core.control.tracker_feedback import FADE_TIME, STALE_AFTER, TrackerFeedback


class AdaptiveBacklashJoint:
    """`adapt` with its state and the filter of the robust term."""

    def __init__(self, settings: AdaptiveBacklashSettings) -> None:
        self.settings = settings
        self.state = AdaptationState()
        self._robust = 0.0

    def learn(
        self, error: float, correction: float, desired: float, direction: float, dt: float
    ) -> None:
        """One step of the adaptive laws; see `JointLaw`."""
        self.state = adapt(self.settings, self.state, error, desired, direction, dt)

    def correction(self, desired: float, direction: float, dt: float) -> float:
        """``g theta + D s`` and the filtered robust term, rad."""
        blend = min(1.0, dt / self.settings.filter_time)
        self._robust += blend * (robust_term(self.settings, self.state) - self._robust)
        return learnt_term(self.state, desired, direction) + self._robust


class AdaptiveBacklashController(TrackerFeedback[AdaptiveBacklashJoint]):
    """Adaptive backlash law of the second paper (section 2.4) on every joint.

    Parameters
    ----------
    joints : int
        Number of joints.
    settings : AdaptiveBacklashSettings, optional
    stale_after, fade_time : float
        s; see `TrackerFeedback`.
    """

    def __init__(
        self,
        joints: int,
        settings: AdaptiveBacklashSettings | None = None,
        stale_after: float = STALE_AFTER,
        fade_time: float = FADE_TIME,
    ) -> None:
        chosen = settings or AdaptiveBacklashSettings()
        super().__init__(
            joints, chosen, lambda: AdaptiveBacklashJoint(chosen), stale_after, fade_time
        )

    @property
    def estimates(self) -> tuple[AdaptationState, ...]:
        """What has been learnt, for each joint."""
        return tuple(law.state for law in self.laws)

    @property
    def learnt(self) -> tuple[tuple[float, float], ...]:
        """Gain and backlash (rad) that the correction adds, for each joint."""
        return tuple((law.state.gain, law.state.backlash) for law in self.laws)
