"""Which law a compensator's feed-forward obeys: by a calibration, or by an adopted plant."""

from dataclasses import dataclass
from typing import NamedTuple

from endoscope_core.choices import BY_ADOPTED, BY_CLASS
from endoscope_core.control import AdoptedPlant, Feedforward, FeedforwardLaw
from endoscope_core.errors import EndoscopeError
from endoscope_core.identification.law_choice import CalibrationFindings, LawChoice
from endoscope_core.names import JOINTS
from endoscope_core.safety import BendingRange

_ANY_CLASS = CalibrationFindings(class_deg=70)


class Selection(NamedTuple):
    """What an operator selects the feed-forward by."""

    mode: str  # one of `MODES`
    selected_by: str  # one of `SELECTIONS`


@dataclass(frozen=True)
class BeforeAdoption:
    """What was in force before a plant was adopted."""

    plant: AdoptedPlant | None  # None where it was no adopted one
    selection: Selection
    for_session: bool  # whether that is so again when the session ends


class LawInForce:
    """A feed-forward, loaded at once, and what its law follows from; none where that is lacking."""

    def __init__(self, feedforward: Feedforward, choice: LawChoice, selection: Selection) -> None:
        self.feedforward = feedforward
        self.selection = selection
        self.findings: CalibrationFindings | None = None
        # A calibration that is put in force once nothing moves; empty for none.
        self.pending: tuple[CalibrationFindings | None, ...] = ()
        self.plant: AdoptedPlant | None = None  # in force while the selection is by it
        self.error = ''  # why the mode is not available
        self.changed = True  # whoever reports what is in force takes it back
        self._choice = choice
        self._before: list[BeforeAdoption] = []
        self._by_adopted = False
        try:
            feedforward.compile(choice.law(selection.mode, BY_CLASS, _ANY_CLASS))
        except EndoscopeError as error:
            self.error = str(error)

    @property
    def is_known(self) -> bool:
        """Whether what selects the feed-forward has been found: a calibration, but for a plant."""
        return self.findings is not None or self.selection.selected_by == BY_ADOPTED

    @property
    def ranges(self) -> tuple[BendingRange, ...]:
        """How far each joint may be bent now, in rad; empty where that is not known."""
        if self._by_adopted and self.plant is not None:
            return self.plant.ranges
        return () if self.findings is None else self.findings.ranges

    @property
    def before(self) -> BeforeAdoption | None:
        """What :meth:`undo` puts in force again; None where no plant has been adopted."""
        return self._before[-1] if self._before else None

    def select(self, selection: Selection) -> None:
        """Put a selection in force, by findings and plant; without these nothing is compensated."""
        self.selection = selection
        law, self.error = FeedforwardLaw(), ''
        if self.is_known:
            try:
                law = self._choice.law(
                    *selection,
                    self.findings or CalibrationFindings(),
                    () if self.plant is None else self.plant.parameters,
                )
            except EndoscopeError as error:
                self.error = str(error)
        if law != self.feedforward.law:
            self.feedforward.compile(law)
            self.feedforward.select(law)
        self._by_adopted = self.plant is not None and law == self.plant.law
        self.changed = True

    def take_pending(self) -> None:
        """Put a new calibration in force; to be called only where nothing moves."""
        if self.pending:
            (self.findings,), self.pending = self.pending, ()
            self.select(self.selection)

    def adopt(self, plant: AdoptedPlant, for_session: bool) -> None:
        """Have a plant for the next selection; `for_session` as the selection in force is."""
        self._before.append(BeforeAdoption(self.plant, self.selection, for_session))
        self.plant = plant

    def undo(self) -> None:
        """Have the plant from before the last one for the next selection."""
        self.plant = self._before.pop().plant

    def end_session(self) -> None:
        """Go back to the plant from before what was set for the session that has ended."""
        while self._before and self._before[-1].for_session:
            self.undo()

    def figures(self, lead: float, gear: float) -> dict[str, object]:
        """What is in force and what is selected, with the `lead` in s and the rig's `gear`."""
        law, found = self.feedforward.law, self.findings
        return {
            'mode': law.mode,
            'wanted_mode': self.selection.mode,
            'selected_by': self.selection.selected_by,
            'lead': lead,
            'gear': gear,
            'class_deg': None if found is None else found.class_deg,
            **{joint: p.to_dict() for joint, p in zip(JOINTS, law.parameters, strict=False)},
        }

    def in_words(self, remedy: str) -> str:
        """What is compensated by, or why nothing is; `remedy` is how to calibrate."""
        mode, selected_by = self.selection
        if mode == 'none':
            return 'no feed-forward'
        if self.error:
            return f'no feed-forward: {self.error}'
        if selected_by == BY_ADOPTED and self.plant is not None:
            return f'{mode} by adopted: plant {self.plant.hash}'
        if self.findings is None:
            return f'no feed-forward: {mode} waits for a calibration; {remedy}'
        return f'{mode} by {selected_by}: {self.findings}'
