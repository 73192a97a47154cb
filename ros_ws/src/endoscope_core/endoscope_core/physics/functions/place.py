"""What a place is at which a smooth function of one state can be added to the nominal plant."""

from dataclasses import KW_ONLY, dataclass
from enum import StrEnum

from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.functions.interpolation import NODES
from endoscope_core.physics.hooks import Fold, Hook

LAGS_S = (0.05, 60.0)
"""Time constants in s of arguments that lag: from ten long ticks to a minute."""
LARGEST_SHARE = 3.0
"""By how many times itself a function may be larger, or smaller, by one that multiplies it."""
SOURCE = (
    'Missing physics as a smooth function within the simulator: Heiden et al., NeuralSim, IEEE '
    'ICRA 2021; Kennedy, OHagan, J. R. Stat. Soc. B 63, 2001'
)


class Shape(StrEnum):
    """What kind of function of its argument a place takes."""

    ANY = 'any'
    ODD = 'odd'
    EVEN = 'even'
    PERIODIC = 'periodic'


@dataclass(frozen=True)
class Argument:
    """The state that a function depends on."""

    symbol: str  # in an expression
    words: str
    unit: str
    # Range of the table where nobody gives one.
    low: float
    high: float
    # It follows a state of the plant as a first-order lag does, with a time constant of its own:
    # what nobody sees (Kelvin-Voigt: Findley, Lai, Onaran, Creep and Relaxation, 1976).
    lags: bool = False


@dataclass(frozen=True)
class Place(Effect):
    """A smooth function of one state at a place of the chain; no effect of the catalogue.

    Attributes
    ----------
    hook : Hook
        Where it acts. A factor is the exponential of the function; all else is added.
    argument : Argument
    at : str
        The argument in the names of the hook and of the compiled physics.
    unit : str
        Of the function.
    largest : float
        Largest absolute value that the function may have.
    shape : Shape
    from_zero : bool
        Whether its value at the argument zero is taken away: the wires are tightened there.
    never_negative : bool
        Whether a value below zero would give energy to the plant without end.
    only : str
        Condition under which it acts, as `at`.
    sign : str
        Factor on it, as `at`.
    by_step : str
        Slope of the argument by the joint's step, as `at`, where the hook wants it.
    """

    _: KW_ONLY
    hook: Hook
    argument: Argument
    at: str
    unit: str
    largest: float
    shape: Shape = Shape.ANY
    from_zero: bool = False
    never_negative: bool = False
    only: str = ''
    sign: str = ''
    by_step: str = ''

    def largest_of(self, multiplies: bool) -> float:
        """Largest absolute value of a function that is added, or of one that multiplies."""
        return LARGEST_SHARE if multiplies else self.largest

    @property
    def point(self) -> tuple[str, str]:
        """Point of the chain whose functions multiply one another: the hook, and which sensor."""
        return self.hook.name, self.only

    @property
    def is_factor(self) -> bool:
        """Whether the plant takes the exponential of the function as a factor."""
        return self.hook.fold is Fold.FACTORS


def place(
    place_id: str,
    stage: Stage,
    hook: Hook,
    what: str,
    argument: Argument,
    unit: str,
    largest: float,
    *,
    at: str,
    shape: Shape = Shape.ANY,
    depends_on_time: bool = False,
    **more: str | bool,
) -> Place:
    """A place, whose flag and parameters follow from its shape; `more` are fields of `Place`."""
    f = f'f({argument.symbol})'
    enters = f'exp({f})' if hook.fold is Fold.FACTORS else f
    kind = '' if shape is Shape.ANY else f', {shape}'
    return Place(
        place_id,
        stage,
        order=0,
        physics=f'{what}, a function of {argument.words}.',
        equation=f'{enters}{kind}, {argument.symbol} = {argument.words}',
        source=SOURCE,
        parameters=_parameters(argument, unit, largest),
        traits=Traits(depends_on_time=depends_on_time),
        hook=hook,
        argument=argument,
        at=at,
        unit=unit,
        largest=largest,
        shape=shape,
        **more,  # type: ignore[arg-type]
    )


def _parameters(argument: Argument, unit: str, largest: float) -> tuple[Parameter, ...]:
    def value(name: str) -> Parameter:
        return Parameter(name, unit, -largest, largest, 0.0, off=0.0)

    ends = [(name, getattr(argument, name)) for name in ('low', 'high')]
    lag = (Parameter('lag_s', 's', *LAGS_S, typical=1.0),) if argument.lags else ()
    return (
        *(Parameter(name, argument.unit, -1e9, 1e9, end) for name, end in ends),
        *(value(f'value_{i}') for i in range(NODES)),
        *lag,
    )
