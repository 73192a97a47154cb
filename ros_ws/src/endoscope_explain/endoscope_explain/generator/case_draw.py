"""Draw a concealed case: a rig, what is hidden in it, and recordings of it."""

import zlib
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from endoscope_explain.generator.concealed_physics import Motion, move
from endoscope_explain.generator.concealment import Effect, Peaks, ReadingFaults, Setting
from endoscope_explain.generator.effect_choice import EFFECTS, OUTSIDE, choose, require_drawable
from endoscope_explain.generator.motions import GEAR, joint_command
from endoscope_explain.generator.rig import JOINTS, mistune, nominal_rig
from endoscope_explain.generator.sensor_readings import Stream, record

STRATA = ('single', 'pair', 'weak', 'null', 'outside', 'foreign')
MOTIONS = ('commissioning', 'calibration')
SPREAD = 0.15
WEAK = 0.1
FOREIGN_SEGMENTS = (20, 31)
COLOURED_SHARE = {
    'single': 0.15,
    'pair': 0.15,
    'weak': 0.0,
    'null': 0.1,
    'outside': 0.25,
    'foreign': 0.25,
}
FIRST_JOINT_SHARE = 0.75
MOVING = 0.05  # rad/s of the shaft

# The second joint's slow sinusoid never rings.
NEEDS_FAST_MOTION = frozenset({'joint_inertia', 'rate_limit'})
# Only one joint of the calibration sinusoid moves; this one is moved by the other.
SEEN_WHILE_AT_REST = frozenset({'cross_coupling'})


@dataclass(frozen=True)
class Case:
    """A drawn case.

    Attributes
    ----------
    name
        Of its files; it tells nothing of what is inside.
    recordings
        Streams by suffix of the file name: `''`, `'second'`, and for foreign rigs `'baseline'`.
    truth
        What was concealed, as written to the sealed file.
    """

    name: str
    recordings: dict[str, list[Stream]]
    truth: dict[str, object]


@dataclass
class _Draft:
    """A case in the making."""

    rng: np.random.Generator
    motion: str
    rig: npt.NDArray[np.void]
    shares: npt.NDArray[np.float64] | None = None
    faults: ReadingFaults = field(default_factory=ReadingFaults)
    concealed: list[tuple[Effect, int]] = field(default_factory=list)
    comparable: dict[str, dict[str, float]] = field(default_factory=dict)


def draw_case(
    seed: int,
    stratum: str,
    motion: str = 'commissioning',
    effects: tuple[str, ...] | None = None,
    joint: str | None = None,
) -> Case:
    """Draw one case; the same arguments give the same case to the last bit.

    Parameters
    ----------
    seed
        Of all chance.
    stratum
        `single` (one effect of the catalogue), `pair`, `weak` (a tenth of the usual strength),
        `null` (nothing concealed), `outside` (physics outside the catalogue) or `foreign` (a chain
        for a sheath, with a baseline recording).
    motion
        Of the first recording: `commissioning` (40 s) or `calibration` (9 s).
    effects
        Ids to conceal instead of drawing them.
    joint
        `bend_x` or `bend_y` instead of drawing it.

    Raises
    ------
    ValueError
        Unknown stratum, motion, effect or joint, or effects that cannot be concealed together.
    """
    _require_known(stratum, STRATA, 'stratum')
    _require_known(motion, MOTIONS, 'motion')
    if joint is not None:
        _require_known(joint, JOINTS, 'joint')
    known = OUTSIDE if stratum == 'outside' else EFFECTS
    for name in effects or ():
        _require_known(name, tuple(known), 'effect')
    require_drawable(effects or (), stratum)
    label = f'{stratum}/{motion}/{",".join(effects or ())}/{joint or ""}'
    rng = np.random.default_rng([seed, zlib.crc32(label.encode())])
    draft = _Draft(rng, motion, nominal_rig())
    exact = stratum == 'null' and rng.random() < 0.5
    if not exact:
        mistune(draft.rig, rng, SPREAD)
    if stratum == 'foreign':
        _make_foreign(draft)
    if rng.random() < COLOURED_SHARE[stratum]:
        draft.faults.colour = float(rng.uniform(0.2, 0.5))
    recordings = {}
    chosen = effects if effects is not None else choose(stratum, rng)
    command = joint_command(motion, rng)
    if chosen or stratum == 'foreign':
        healthy = move(draft.rig, _shaft(command), draft.shares)
        if stratum == 'foreign':
            recordings['baseline'] = record(command, GEAR, healthy, draft.faults, rng)
            command = joint_command(motion, rng)
        strength = WEAK if stratum == 'weak' else 1.0
        _conceal(draft, [known[name] for name in chosen], healthy, joint, strength)
    recordings[''] = _play(draft, command)
    # The recorder lost messages once, not in every recording.
    draft.faults.gap = None
    recordings['second'] = _play(draft, joint_command('second', rng))
    return Case(
        name=f'concealed_{zlib.crc32(f"{seed}/{label}".encode()):08x}',
        recordings=recordings,
        truth=_truth(draft, stratum, seed, exact),
    )


def _require_known(value: str, known: tuple[str, ...], what: str) -> None:
    if value not in known:
        raise ValueError(f'unknown {what} {value!r}: one of {", ".join(known)}')


def _make_foreign(draft: _Draft) -> None:
    count = int(draft.rng.integers(*FOREIGN_SEGMENTS))
    draft.rig['segments'] = float(count)
    # Uneven, as the bends of a tube are.
    draft.shares = draft.rng.dirichlet(np.full(count, 2.0), size=len(JOINTS))


def _conceal(
    draft: _Draft, effects: list[Effect], before: Motion, joint: str | None, strength: float
) -> None:
    """Hide the effects one after the other, each drawn for the rig without any of them."""
    for effect in effects:
        index = _joint_of(effect, draft, joint)
        moving = np.abs(before.shaft_speed[:, index]) > MOVING
        torque = np.abs(before.torque[moving, index]) if moving.any() else np.zeros(1)
        cells = before.tension[:, 2 * index : 2 * index + 2].max(axis=0)
        peaks = Peaks(
            shaft_speed=float(np.abs(before.shaft_speed[:, index]).max()),
            torque=float(np.quantile(torque, 0.98)),
            tension=(float(cells[0]), float(cells[1])),
            lowest=float(before.bending[:, index].min()),
            highest=float(before.bending[:, index].max()),
        )
        setting = Setting(draft.rng, strength, index, draft.motion, draft.rig, draft.faults, peaks)
        comparable = effect.conceal(setting)
        draft.concealed.append((effect, index))
        if effect.id in EFFECTS:
            draft.comparable[effect.id] = comparable


def _joint_of(effect: Effect, draft: _Draft, joint: str | None) -> int:
    if joint is not None:
        return JOINTS.index(joint)
    if draft.motion == 'calibration':
        return 1 if effect.id in SEEN_WHILE_AT_REST else 0
    if effect.id in NEEDS_FAST_MOTION:
        return 0
    return 0 if draft.rng.random() < FIRST_JOINT_SHARE else 1


def _shaft(command: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Shaft commands of the motion, and one tick more for the last answer."""
    shaft = command * GEAR
    return np.vstack([shaft, shaft[-1:]])


def _play(draft: _Draft, command: npt.NDArray[np.float64]) -> list[Stream]:
    motion = move(draft.rig, _shaft(command), draft.shares)
    return record(command, GEAR, motion, draft.faults, draft.rng)


def _truth(draft: _Draft, stratum: str, seed: int, exact: bool) -> dict[str, object]:
    verdict = None
    if exact:
        verdict = 'consistent'
    elif stratum == 'outside':
        verdict = 'unknown_physics'
    inside = [effect for effect, _ in draft.concealed if effect.id in EFFECTS]
    return {
        'effects': [effect.id for effect in inside],
        'comparable': draft.comparable,
        'excitation': draft.motion,
        'verdict': verdict,
        'stratum': stratum,
        'seed': seed,
        'concealed': [
            {
                'id': e.id,
                'joint': None if e.of_a_device else JOINTS[j],
                'stage': e.stage,
                'form': e.source,
            }
            for e, j in draft.concealed
        ],
        'noise_colour': draft.faults.colour,
        'rig': {
            JOINTS[j]: {
                n: float(draft.rig[n][j])
                for n in draft.rig.dtype.names or ()
                if draft.rig[n][j] != 0.0
            }
            for j in range(len(JOINTS))
        },
    }
