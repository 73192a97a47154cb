"""Recordings in which people took something wrongly, and right ones of rigs with strong physics.

Run as a program it measures the audit on fresh seeds, and how its figures depend on `PRICE`:
`python mistaken_recordings.py --seed 7 --each 6 --sound 200`.
"""

import argparse
import time
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from endoscope_core.physics.description import EffectSpec, JointParameters, PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.family import MOST_BENT, shipped_family
from endoscope_core.physics.recording import recording_faults
from endoscope_core.physics.sensing import SensorModel
from endoscope_core.physics.simulator import TICK, simulate
from endoscope_core.rig import shipped_rig
from endoscope_core.signals import motion_by_name
from endoscope_explain.audit import audit_recording, plausibility
from endoscope_explain.recording import Recording, Series
from endoscope_explain.recording.signals import gear

COMMAND, MOTOR = 'motor/servo_jp', 'motor/measured_js'
WIRES, BENDING = 'wires/measured_js', 'slave/measured_js'
TRACKER_EVERY = 25
MOST_BENDING_RAD = 2.5
"""Beyond which the section would be torn."""
SCATTERED = (
    'pretension',
    'wire_stiffness',
    'capstan_exponent',
    'joint_stiffness',
    'joint_friction',
    'joint_presliding',
    'joint_damping',
    'motor_bandwidth',
)


@dataclass(frozen=True)
class Mistake:
    """What was done to a recording, and what the audit may say of it.

    Attributes
    ----------
    change : callable
        From a recording and a random generator to the recording as it was mistaken.
    said : tuple of tuple of (str, str, str)
        Id, topic and words of each finding; any one of the tuples will do.
    joints : int
        How many the recording must have.
    """

    change: object
    said: tuple
    joints: int = 1


def draw_rig(rng, joints, spread, strength, effects):
    """A rig of the family of tubes with other numbers and some effects of the catalogue.

    Numbers are scattered by `spread` (rms of the logarithm). Each effect's parameters lie between
    their typical value, at a `strength` of 0, and their bound, at 1.
    """
    drawn = {}
    for joint in joints:
        tube = shipped_family().joint(rng.uniform(0.0, MOST_BENT))
        scatter = {k: getattr(tube, k) * np.exp(spread * rng.standard_normal()) for k in SCATTERED}
        drawn[joint] = replace(tube, **scatter)
    ids = [i for i, effect in CATALOGUE.items() if not effect.traits.audited]
    chosen = rng.choice(ids, effects, replace=False)
    specs = [
        EffectSpec(str(i), str(rng.choice(joints)), draw_strength(rng, CATALOGUE[i], strength))
        for i in chosen
    ]
    return PlantDescription(joints=drawn, effects=tuple(specs))


def draw_strength(rng, effect, strength):
    share = rng.uniform(0.0, strength)
    values = {}
    for p in effect.parameters:
        if p.choices:
            values[p.name] = float(rng.choice(p.choices))
        elif np.isnan(p.off):
            values[p.name] = p.typical
        else:
            both = p.low < p.off < p.high
            bound = rng.choice([p.low, p.high]) if both else p.high if p.off <= p.low else p.low
            reach = abs(bound - p.off)
            least = abs(p.typical - p.off) or 0.2 * reach
            step = least ** (1.0 - share) * reach**share
            value = p.off + np.sign(bound - p.off) * step
            values[p.name] = float(np.clip(value, p.low, p.high))
    return values


def draw_motion(rng, joints):
    """Shaft commands (N, J) of a commissioning, a calibration, or a sweep beside steps."""
    kind = rng.choice(['commissioning', 'calibration', 'swept'])
    if kind == 'swept':
        at = np.arange(0.0, 12.0, TICK)
        stepped = np.where((at % 3.0) < 1.5, 0.5, -0.4)
        angle = np.stack([0.9 * np.sin(1.3 * at), stepped], axis=1)
    else:
        motion = motion_by_name(str(kind))
        at = np.arange(0.0, motion.duration, TICK)
        angle = np.array(motion.sample(at)[0])
        if kind == 'calibration':
            # Moved alike, two joints could not be told apart.
            angle[:, 1] = 0.7 * np.interp(np.maximum(at - 2.0, 0.0), at, angle[:, 0])
    return at, angle[:, : len(joints)] * gear()


def read(plant, at, command, seed, noisy=True):
    """What the sensors of a rig record."""
    truth = simulate(plant, command)
    sensors = SensorModel(plant.sensors, seed)

    def series(topic, time, values, sense):
        return Series.of(topic, time, sense(values) if noisy else values.copy())

    slow = slice(None, None, TRACKER_EVERY)
    recording = Recording(
        'drawn',
        0.0,
        plant.joint_names(),
        Series.of(COMMAND, at, command.copy()),
        series(WIRES, at, truth.tension, sensors.tension),
        series(BENDING, at[slow], truth.bending[slow], sensors.bending),
        series(MOTOR, at, truth.shaft_position, sensors.shaft_position),
        series(MOTOR, at, truth.shaft_velocity, sensors.shaft_velocity),
        series(MOTOR, at, truth.shaft_effort, sensors.shaft_effort),
    )
    faults = recording_faults(plant)
    bending = recording.bending
    at_joint = faults.spoilt(bending.values, bending.time)
    survives = (
        np.isfinite(truth.tension).all()
        and truth.tension.max() < shipped_rig().tension.ceiling
        and np.abs(truth.bending).max() < MOST_BENDING_RAD
    )
    return recording.with_series({'bending': replace(bending, values=at_joint)}), survives


def draw_recording(rng, joints, spread, strength, effects, noisy=True):
    """A recording of a rig that survives it, and its plant."""
    while True:
        plant = draw_rig(rng, joints, spread, strength, effects)
        at, command = draw_motion(rng, joints)
        try:
            recording, survives = read(plant, at, command, int(rng.integers(2**31)), noisy)
        except ValueError:
            # An effect may be invalid at a bound beside another one's.
            continue
        if survives:
            return recording, plant


def described(recording):
    return PlantDescription(joints={joint: JointParameters() for joint in recording.joints})


def scaled(quantity, factor, columns=None):
    def change(recording, rng):
        series = getattr(recording, quantity)
        values = series.values.reshape(len(series.values), -1).copy()
        chosen = slice(None) if columns is None else columns(rng, values.shape[1])
        values[:, chosen] *= factor(rng) if callable(factor) else factor
        changed = replace(series, values=values.reshape(series.values.shape))
        return recording.with_series({quantity: changed})

    return change


def ordered(order, *quantities):
    def change(recording, _):
        changed = {}
        for quantity in quantities:
            series = getattr(recording, quantity)
            flat = series.values.reshape(len(series.values), -1)
            whole = [*order, *range(len(order), flat.shape[1])]
            changed[quantity] = replace(series, values=flat[:, whole].reshape(series.values.shape))
        return recording.with_series(changed)

    return change


def stamped(factor, *topics):
    def change(recording, _):
        every = {'command': recording.command, **recording.measured()}
        return recording.with_series(
            {
                name: replace(s, time=s.time * factor)
                for name, s in every.items()
                if not topics or s.topic in topics
            }
        )

    return change


def frozen(*quantities):
    def change(recording, _):
        every = {'command': recording.command, **recording.measured()}
        return recording.with_series(
            {
                q: replace(
                    every[q], values=np.broadcast_to(every[q].values[:1], every[q].values.shape)
                )
                for q in quantities
            }
        )

    return change


def together(*changes):
    def change(recording, rng):
        for one in changes:
            recording = one(recording, rng)
        return recording

    return change


def one_column(rng, columns):
    return [int(rng.integers(columns))]


DEG = 180.0 / np.pi
GRAVITY = 9.80665
MOTOR_QUANTITIES = ('shaft_position', 'shaft_velocity', 'shaft_effort')


def unit(topic, words):
    return (('wrong_unit', topic, words),)


def of_gear(words):
    """The command's gear, or the shaft's: what differs is the same."""
    return (unit(COMMAND, words), (('wrong_gear', MOTOR, 'times as far as commanded'),))


MISTAKES = {
    'angle in deg': Mistake(scaled('bending', DEG), (unit(BENDING, 'in deg'),)),
    'angle in mrad': Mistake(scaled('bending', 1e3), (unit(BENDING, 'in mrad'),)),
    'shaft in deg': Mistake(scaled('shaft_position', DEG), (unit(MOTOR, 'in deg'),)),
    'shaft in counts': Mistake(
        scaled('shaft_position', 4096 / (2.0 * np.pi)), (unit(MOTOR, 'in counts'),)
    ),
    'command in deg': Mistake(scaled('command', DEG), (unit(COMMAND, 'in deg'),)),
    'command in mm of wire': Mistake(scaled('command', 2.4), of_gear('in mm of wire')),
    'command in joint rad': Mistake(scaled('command', 2.0), of_gear('of the bending joint')),
    'shaft in joint rad': Mistake(scaled('shaft_position', 2.0), of_gear('gear once more')),
    'another gear': Mistake(
        scaled('shaft_position', lambda rng: float(rng.choice([0.6, 0.8, 1.25, 1.5]))),
        ((('wrong_gear', MOTOR, 'times as far as commanded'),),),
    ),
    'all angles in deg': Mistake(
        together(*(scaled(q, DEG) for q in ('command', 'shaft_position', 'bending'))),
        (unit(COMMAND, 'in deg') + unit(MOTOR, 'in deg') + unit(BENDING, 'in deg'),),
    ),
    'speed in rpm': Mistake(scaled('shaft_velocity', 30.0 / np.pi), (unit(MOTOR, 'in rpm'),)),
    'effort in mN m': Mistake(scaled('shaft_effort', 1e3), (unit(MOTOR, 'in mN m'),)),
    'tension in mN': Mistake(scaled('tension', 1e3), (unit(WIRES, 'in mN'),)),
    'tension in g': Mistake(scaled('tension', 1e3 / GRAVITY), (unit(WIRES, 'in g'),)),
    'tension in kg': Mistake(scaled('tension', 1.0 / GRAVITY), (unit(WIRES, 'in kg'),)),
    'tension in counts': Mistake(
        scaled('tension', lambda rng: float(rng.choice([5e3, 2e4, 4e5]))),
        (unit(WIRES, 'counts of a converter'),),
    ),
    'tensions negative': Mistake(scaled('tension', -1.0), ((('wrong_sign', WIRES, 'negated'),),)),
    'one tension negative': Mistake(
        scaled('tension', -1.0, one_column), ((('wrong_sign', WIRES, 'negated'),),)
    ),
    'angle negative': Mistake(
        scaled('bending', -1.0, one_column), ((('wrong_sign', BENDING, 'negated'),),)
    ),
    'shaft negative': Mistake(
        scaled('shaft_position', -1.0, one_column), ((('wrong_sign', MOTOR, 'negated'),),)
    ),
    'command negative': Mistake(
        scaled('command', -1.0, one_column), ((('wrong_sign', COMMAND, 'negated'),),)
    ),
    'wires of a joint': Mistake(
        ordered((1, 0), 'tension'), ((('exchanged', WIRES, 'exchanged'),),)
    ),
    'wires of two joints': Mistake(
        ordered((2, 3, 0, 1), 'tension'), ((('exchanged', WIRES, 'exchanged'),),), 2
    ),
    'one wire of each joint': Mistake(
        ordered((2, 1, 0, 3), 'tension'), ((('exchanged', WIRES, 'exchanged'),),), 2
    ),
    'motors': Mistake(
        ordered((1, 0), *MOTOR_QUANTITIES), ((('exchanged', MOTOR, 'exchanged'),),), 2
    ),
    'commands': Mistake(ordered((1, 0), 'command'), ((('exchanged', COMMAND, 'exchanged'),),), 2),
    'tracker': Mistake(ordered((1, 0), 'bending'), ((('exchanged', BENDING, 'exchanged'),),), 2),
    'all stamps in ms': Mistake(stamped(1e3), (unit(COMMAND, 'in ms, not in s'),)),
    'all stamps in us': Mistake(stamped(1e6), (unit(COMMAND, 'in us, not in s'),)),
    'stamps taken for ms': Mistake(stamped(1e-3), (unit(COMMAND, 'were taken for ms'),)),
    "tracker's stamps in ms": Mistake(stamped(1e3, BENDING), (unit(BENDING, 'in ms, not in s'),)),
    "cells' stamps in us": Mistake(stamped(1e6, WIRES), (unit(WIRES, 'in us, not in s'),)),
    'frozen motor': Mistake(frozen(*MOTOR_QUANTITIES), ((('frozen', MOTOR, 'is frozen'),),)),
    'frozen cells': Mistake(frozen('tension'), ((('frozen', WIRES, 'is frozen'),),)),
    'frozen tracker': Mistake(frozen('bending'), ((('frozen', BENDING, 'is frozen'),),)),
    'frozen command': Mistake(frozen('command'), ((('frozen', COMMAND, 'is frozen'),),)),
}


def is_said(mistake, report):
    """Whether a report says all that is wrong, and nothing else."""
    found = [(f.id, f.signals[0].partition(':')[0], f.text) for f in report.findings]
    for wanted in mistake.said:
        left = list(found)
        for identity, topic, words in wanted:
            match = [f for f in left if f[:2] == (identity, topic) and words in f[2]]
            left = [f for f in left if f not in match[:1]]
            if not match:
                break
        else:
            if not left:
                return report.unusable
    return False


def names_of(rng, count=1):
    return ('bend_x', 'bend_y')[: max(count, int(rng.integers(1, 3)))]


def measure(seed, each, sound, spread, strength):
    rng = np.random.default_rng(seed)
    said, slowest, counts = [], 0.0, Counter()
    for name, mistake in MISTAKES.items():
        for _ in range(each):
            effects = int(rng.integers(0, 2))
            joints = names_of(rng, mistake.joints)
            recording, plant = draw_recording(rng, joints, spread, strength, effects)
            mistaken = mistake.change(recording, rng)
            begun = time.perf_counter()
            report = audit_recording(mistaken, described(recording))
            slowest = max(slowest, time.perf_counter() - begun)
            said.append(is_said(mistake, report))
            counts[said[-1], report.unusable] += 1
            if not said[-1]:
                texts = [f.text for f in report.findings]
                print(f'{name}: {texts} ({[e.id for e in plant.effects]})', flush=True)
    print(
        f'{sum(said)} of {len(said)} mistakes said rightly, {counts[False, False]} missed, '
        f'{counts[False, True]} said otherwise; slowest {slowest:.1f} s'
    )
    alarms, slowest = 0, 0.0
    for _ in range(sound):
        recording, plant = draw_recording(
            rng, names_of(rng), 0.3, 1.0, int(rng.integers(1, 3)), bool(rng.random() < 0.9)
        )
        begun = time.perf_counter()
        report = audit_recording(recording, described(recording))
        slowest = max(slowest, time.perf_counter() - begun)
        alarms += report.unusable
        if report.unusable:
            print([f.text for f in report.faults()], plant.effects, flush=True)
    print(f'{alarms} false alarms in {sound} sound recordings; slowest {slowest:.1f} s')


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seed', type=int, required=True)
    parser.add_argument('--each', type=int, default=6, help='recordings of each mistake')
    parser.add_argument('--sound', type=int, default=200, help='sound recordings')
    parser.add_argument('--spread', type=float, default=0.15, help='of the numbers of a rig')
    parser.add_argument('--strength', type=float, default=0.5, help='of effects beside a mistake')
    parser.add_argument('--price', type=float, default=plausibility.PRICE)
    given = parser.parse_args()
    plausibility.PRICE = given.price
    measure(given.seed, given.each, given.sound, given.spread, given.strength)


if __name__ == '__main__':
    main()
