"""Joints simulated on their recorded commands, and what that predicts beside what was measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.kernel import run_joints, turn_to
from endoscope_core.physics.layout import MOTOR_SPEED, OUTPUTS
from endoscope_core.physics.packing import pack, recording_faults, rest_state
from endoscope_explain.explanation import ChannelFit
from endoscope_explain.observe.observation import JointObservation, observe
from endoscope_explain.recording import Array, Mask, RigRecording


@dataclass(frozen=True)
class SignalView:
    """One signal on the analysis grid."""

    signal: str  # as the report writes it
    joint: str
    quantity: str  # series of the recording
    unit: str  # SI
    time: Array  # (M,), in s from the recording's first stamp
    measured: Array  # (M,)
    noise: Array  # (M,), known noise (rms) of each sample
    predicted: Mapping[str, Array]  # (M,) by the plant's name

    def residual(self, name: str) -> Array:
        """Return measured minus predicted in noise units."""
        return np.asarray((self.measured - self.predicted[name]) / self.noise)


@dataclass(frozen=True)
class RecordedView:
    """A recording and its predictions."""

    observations: tuple[JointObservation, ...]
    signals: Mapping[str, SignalView]  # by name, joint after joint
    # (N, OUTPUTS): what the last plant given predicts on 1 ms ticks, by joint.
    outputs: Mapping[str, Array]
    begin: float  # first command's stamp in s from the recording's first stamp

    @property
    def joints(self) -> tuple[str, ...]:
        """Return the names of the joints."""
        return tuple(o.joint for o in self.observations)

    def of_joint(self, joint: str) -> tuple[SignalView, ...]:
        """Return the signals of one joint."""
        return tuple(s for s in self.signals.values() if s.joint == joint)


def packed_rig(
    observations: tuple[JointObservation, ...], plant: PlantDescription
) -> tuple[Array, Mask]:
    """Parameters (J, parameters) and flags (J, flags) of the recorded joints."""
    parameters, flags = pack(plant)
    rows = [plant.joint_names().index(o.joint) for o in observations]
    return parameters[rows], flags[rows]


def simulate_rig(observations: tuple[JointObservation, ...], plant: PlantDescription) -> Array:
    """Simulate all joints of a recording, in the plant's order, side by side: (J, N, OUTPUTS)."""
    return simulate_joints(observations, *packed_rig(observations, plant))


def reading_lead(observations: tuple[JointObservation, ...], outputs: Array) -> float:
    """Estimate by how much of a tick readings are younger than their stamps."""
    # From the angle of a motor, which moves fast and is read without noise: of that one which is
    # predicted best, as another one's parameters may never have been learnt; 0 where none was
    # recorded.
    best, lead = np.inf, 0.0
    for observation, out in zip(observations, outputs, strict=True):
        for channel in observation.channels:
            if channel.quantity != 'shaft_position':
                continue
            late, early = channel.predicted(out, 0.0), channel.predicted(out, 1.0)
            weight = 1.0 / channel.noise**2
            denominator = float(np.sum(weight * (early - late) ** 2))
            if denominator == 0.0:
                continue
            share = float(np.sum(weight * (early - late) * (channel.value - late))) / denominator
            share = min(max(share, 0.0), 1.0)
            left = channel.value - late - share * (early - late)
            misfit = float(np.mean(weight * left**2))
            if misfit < best:
                best, lead = misfit, share
    return lead


def view(recording: RigRecording, plants: Mapping[str, PlantDescription]) -> RecordedView:
    """Predict every signal of a recording by several plants."""
    # The last one is taken for the best one: its motor shows when readings were taken.
    best = list(plants.values())[-1]
    observations = observe(recording, best)
    begin = float(recording.command.time[0])
    simulated = {name: simulate_rig(observations, plant) for name, plant in plants.items()}
    skews = {name: recording_faults(plant).skew for name, plant in plants.items()}
    outputs = simulated[list(plants)[-1]]
    lead = reading_lead(observations, outputs)
    signals = {}
    for j, observation in enumerate(observations):
        for channel in observation.channels:
            signals[channel.signal] = SignalView(
                channel.signal,
                observation.joint,
                channel.quantity,
                channel.unit,
                channel.time + begin,
                channel.value,
                channel.noise,
                {
                    name: channel.predicted(
                        out[j], lead, skews[name] if channel.quantity == 'bending' else 0.0
                    )
                    for name, out in simulated.items()
                },
            )
    by_joint = {o.joint: outputs[j] for j, o in enumerate(observations)}
    return RecordedView(observations, signals, by_joint, begin)


def fits_by(recorded: RecordedView, name: str) -> dict[str, ChannelFit]:
    """Return rmse and noise of every signal, on all samples, under one of a view's plants."""
    return {
        signal: ChannelFit.of(v.measured - v.predicted[name], v.noise)
        for signal, v in recorded.signals.items()
    }


def simulate_joints(
    observations: Sequence[JointObservation],
    parameters: Array,
    flags: Mask,
    inputs: Array | None = None,
) -> Array:
    """Noise-free readings (J, N, OUTPUTS) of joints side by side, by recorded or other inputs."""
    # Recording after recording where there are several; `parameters` are (J, parameters), `flags`
    # (J, flags), `inputs` (J, N, INPUTS).
    inputs = np.concatenate([o.inputs for o in observations]) if inputs is None else inputs
    tick, coupled = observations[0].tick, len(observations) > 1
    ways = np.stack([o.start for o in observations])
    speeds = np.array([o.start_speed for o in observations])
    states, histories, sheaths = rest_state(parameters, flags, tick, ways, speeds)
    restarts = [o.restarts for o in observations]
    ends = [0, *(each.tick for each in restarts[0]), inputs.shape[1]]
    taken = []
    for part, (begin, end) in enumerate(pairwise(ends)):
        for j, own in enumerate(restarts if part else ()):
            # Time, and what has crept or worn, goes on; the motor comes as this recording has it.
            for angle in own[part - 1].way:
                turn_to(states[j], histories[j], sheaths[j], parameters[j], flags[j], angle)
            states[j, MOTOR_SPEED] = own[part - 1].speed
        out = np.empty((len(observations), end - begin, OUTPUTS))
        commands = np.ascontiguousarray(inputs[:, begin:end])
        run_joints(states, histories, sheaths, parameters, flags, commands, coupled, tick, out)
        taken.append(out)
    return taken[0] if len(taken) == 1 else np.concatenate(taken, axis=1)
