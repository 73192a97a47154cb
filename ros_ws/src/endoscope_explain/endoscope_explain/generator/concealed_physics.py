"""The concealed rig in motion: shaft commands in, what its sensors would see without noise out."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from endoscope_explain.generator.compiled_physics import compiled
from endoscope_explain.generator.lumped_joint import (
    DRUM,
    STATES,
    TIP,
    advance_lumped,
    joint_rates,
)
from endoscope_explain.generator.servo_motor import (
    ANGLE,
    SERVO_STATES,
    SPEED,
    advance_servo,
    pulley_angle,
    servo_transition,
)
from endoscope_explain.generator.sheath_chain import advance_chain

TICK = 1e-3
SUBSTEPS = 4
CHAIN_EVERY = 2


@dataclass(frozen=True)
class Motion:
    """What happened in the rig, sampled at every tick before its command acts.

    Attributes
    ----------
    shaft_angle, shaft_speed
        Motor shafts, rad and rad/s, shape (N, 2).
    torque
        Moment of the wires on the motor shafts, N m, shape (N, 2).
    tension
        At the load cells, N, shape (N, 4): x positive, x negative, y positive, y negative.
    bending
        Of the tip, rad, shape (N, 2).
    """

    shaft_angle: npt.NDArray[np.float64]
    shaft_speed: npt.NDArray[np.float64]
    torque: npt.NDArray[np.float64]
    tension: npt.NDArray[np.float64]
    bending: npt.NDArray[np.float64]


def move(
    rig: npt.NDArray[np.void],
    shaft_command: npt.NDArray[np.float64],
    shares: npt.NDArray[np.float64] | None = None,
) -> Motion:
    """Run the rig from rest through 1 kHz shaft commands.

    Parameters
    ----------
    rig
        Shape (2,), see `rig.RIG_TYPE`.
    shaft_command
        rad, shape (N, 2), each held for one tick.
    shares
        Share of the capstan exponent at each node of the sheath, shape (2, M), for rigs of more
        than one segment; even if not given.
    """
    segments = int(rig['segments'].max())
    if shares is None:
        shares = np.full((2, segments), 0.0)
        for joint in range(2):
            count = int(rig['segments'][joint])
            shares[joint, :count] = 1.0 / count
    transition = np.stack(
        [
            servo_transition(r['motor_bandwidth'], r['motor_damping_ratio'], TICK / SUBSTEPS)
            for r in rig
        ]
    )
    ticks = shaft_command.shape[0]
    out = np.zeros((ticks, 2, 6))
    readings = np.repeat(rig['pretension'][:, None], 2, axis=1)
    _run(
        rig,
        np.ascontiguousarray(shaft_command),
        transition,
        shares,
        out,
        np.zeros((2, SERVO_STATES)),
        np.zeros((2, STATES)),
        np.zeros((2, 5, STATES)),
        np.zeros((2, 2, segments)),
        np.zeros((2, 2, segments)),
        np.zeros((2, 8, 2 * segments + 1)),
        readings,
        np.zeros(2),
    )
    return Motion(
        shaft_angle=out[:, :, 0],
        shaft_speed=out[:, :, 1],
        torque=out[:, :, 2],
        tension=out[:, :, 3:5].reshape(ticks, 4),
        bending=out[:, :, 5],
    )


@compiled
def _run(
    rig: Any,
    command: Any,
    transition: Any,
    shares: Any,
    out: Any,
    servo: Any,
    y: Any,
    work: Any,
    nodes: Any,
    node_states: Any,
    chain_work: Any,
    readings: Any,
    tip: Any,
) -> None:
    step = TICK / SUBSTEPS
    for tick in range(command.shape[0]):
        for joint in range(2):
            r = rig[joint]
            angle = pulley_angle(servo[joint], r)
            if r.segments <= 1.0:
                joint_rates(
                    y[joint],
                    work[joint, 0],
                    readings[joint],
                    r.pulley_radius * angle,
                    r.pulley_radius * servo[joint, SPEED],
                    tip[1 - joint],
                    tick * TICK,
                    r,
                )
            out[tick, joint, 0] = servo[joint, ANGLE]
            out[tick, joint, 1] = servo[joint, SPEED]
            out[tick, joint, 2] = r.pulley_radius * (readings[joint, 0] - readings[joint, 1])
            out[tick, joint, 3] = readings[joint, 0]
            out[tick, joint, 4] = readings[joint, 1]
            out[tick, joint, 5] = tip[joint]
        for substep in range(SUBSTEPS):
            time = tick * TICK + substep * step
            for joint in range(2):
                r = rig[joint]
                late = math.floor((time - r.transport_delay) / TICK + 1e-6)
                wanted = command[late, joint] if late >= 0 else 0.0
                torque = r.pulley_radius * (readings[joint, 0] - readings[joint, 1])
                before = r.pulley_radius * pulley_angle(servo[joint], r)
                advance_servo(servo[joint], transition[joint], wanted, torque, step, r)
                after = r.pulley_radius * pulley_angle(servo[joint], r)
                other = tip[1 - joint]
                if r.segments > 1.0:
                    if (substep + 1) % CHAIN_EVERY == 0:
                        count = int(r.segments)
                        advance_chain(
                            y[joint],
                            nodes[joint, :, :count],
                            node_states[joint, :, :count],
                            shares[joint, :count],
                            chain_work[joint, :, : 2 * count + 1],
                            readings[joint],
                            after,
                            other,
                            time + step,
                            CHAIN_EVERY * step,
                            r,
                        )
                else:
                    advance_lumped(
                        y[joint],
                        work[joint],
                        readings[joint],
                        before,
                        (after - before) / step,
                        other,
                        time,
                        step,
                        r,
                    )
            for joint in range(2):
                r = rig[joint]
                if r.flank_gap > 0.0:
                    tip[joint] = y[joint, TIP]
                elif r.output_gap > 0.0:
                    half = 0.5 * r.output_gap
                    drum = y[joint, DRUM]
                    tip[joint] = min(drum + half, max(drum - half, tip[joint]))
                else:
                    tip[joint] = y[joint, DRUM]
