"""Runs the whole procedure for one shape of the tube and records it."""

import math
import struct
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

from rclpy.context import Context
from rclpy.task import Future
from sensor_msgs.msg import JointState

from endoscope_bringup.demo.procedure import (
    COMPENSATOR,
    MOTION_TITLE,
    MOTIONS,
    CalibrationFacts,
    Method,
    Segment,
    Tube,
    TubeRecording,
)
from endoscope_core.physics import PlantDescription, save_plant
from endoscope_core.physics.family import shipped_family
from endoscope_core.signals import calibration_sinusoid, motion_by_name
from endoscope_nodes.client.calibration_result import REACH
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import GraphError
from endoscope_nodes.client.graph_parameters import set_parameters
from endoscope_nodes.graph import CONTROL_NODES, SHOWING_NODES, SLAVE_NODES
from endoscope_nodes.names import CALIBRATION_COMMAND, CLOCK_NODE, JOINTS, MASTER_NODE
from endoscope_nodes.nodes.recorder import RecorderNode
from endoscope_nodes.nodes.simulation_clock import SimulationClockNode
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.runtime import FOREVER_S, Runtime

Progress = Callable[[str], None]

POLL_S = 0.05
TICK_RATE = 500
"""Hz: that of a bus of servos at 4 Mbaud, and of nodes in processes of their own."""
PATIENCE_S = 20.0
SETTLING_S = 1.0
_STAMP = struct.Struct('<iI')
APPROACH_S = 0.5
"""To the motion's start from wherever the tip is; its last second is no longer steady."""

STEPS = 2 + len(MOTIONS) * len(Method)
PATIENCE_OF_TIME_S = 120.0


def run_tube(
    tube: Tube, folder: Path, *, domain: int, seed: int, real_time: bool, progress: Progress
) -> TubeRecording:
    """Enable, calibrate, and track every motion by every method on one simulated tube."""
    name = tube.name.replace(' ', '_')
    plant_file = folder / f'{name}.plant.yaml'
    joint = shipped_family().joint(tube.bend)
    save_plant(PlantDescription(dict.fromkeys(JOINTS, joint)), plant_file)
    bag = folder / name
    steps = count(1)

    def say(what: str) -> None:
        progress(f'{tube.name}, {next(steps)} of {STEPS}: {what}')

    say('starting the nodes (compiles for half a minute the first time)')
    with _GraphSession(plant_file, bag, domain, seed, real_time) as session:
        session.start()
        say('calibrating')
        calibration = session.calibrate(tube, progress)
        segments = tuple(
            session.track(tube, motion, method, say) for motion in MOTIONS for method in Method
        )
        lost = session.stop()
    return TubeRecording(bag, segments, calibration, lost)


class _GraphSession:
    """The node graph in this process, and an operator at its topics."""

    def __init__(
        self, plant_file: Path, bag: Path, domain: int, seed: int, real_time: bool
    ) -> None:
        arguments = ['--ros-args', '-p', f'use_sim_time:={str(not real_time).lower()}']
        arguments += ['-p', f'tick_rate:={TICK_RATE}']
        self._runtime = Runtime(
            arguments,
            context=Context(),
            domain_id=domain,
            overrides={
                'motor_driver': {'plant_file': str(plant_file), 'seed': seed},
                'recorder': {'bag': str(bag)},
                # What feed-forward alone does is shown.
                'controller': {'active': False},
                # Identifying a plant compiles on a machine's first run, in one tick.
                CLOCK_NODE: {'timeout': PATIENCE_OF_TIME_S},
            },
        )
        for factory in (*SLAVE_NODES, *CONTROL_NODES, *SHOWING_NODES):
            self._runtime.add(factory)
        self._recorder = self._runtime.add(RecorderNode)
        self._node = self._runtime.add(lambda runtime: EndoscopeNode('operator', runtime))
        self._client = GraphClient(self._node, self._advance, self._now)
        self._last_calibration_ns = 0
        self._client.listen(JointState, CALIBRATION_COMMAND, self._note_calibration)
        self._clock = None if real_time else self._runtime.add(SimulationClockNode)
        self._runtime.prepare()

    def __enter__(self) -> '_GraphSession':
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._client.close()
        finally:
            self._runtime.close()

    def _note_calibration(self, data: bytes, received_ns: int) -> None:
        seconds, nanoseconds = _STAMP.unpack_from(data, 4)
        self._last_calibration_ns = seconds * 1_000_000_000 + nanoseconds

    def _advance(self, seconds: float) -> None:
        if self._clock is None:
            self._runtime.spin_until(Future(), seconds)
            return
        done = self._clock.advance(seconds)
        self._runtime.spin_until(done, FOREVER_S)
        done.result()

    def _set(self, node: str, **values: Any) -> None:
        set_parameters(self._client, node, values)

    def start(self) -> None:
        """Wait for discovery, then enable the slave."""
        limit = time.monotonic() + PATIENCE_S
        while not (self._client.is_connected() and self._runtime.connected()):
            if time.monotonic() > limit:
                raise GraphError('the nodes did not find each other: is multicast allowed?')
            self._runtime.spin_until(Future(), POLL_S)
        self._advance(0.5)
        self._client.ask('enable')

    def calibrate(self, tube: Tube, progress: Progress) -> CalibrationFacts:
        """Run the calibration and wait for its result."""
        values = self._client.calibrate().values
        facts = CalibrationFacts(
            tube.name,
            self._last_calibration_ns * 1e-9 - calibration_sinusoid().duration,
            float(values['class_deg']),
            {
                round(float(key.removeprefix('probability_').removesuffix('_deg'))): float(value)
                for key, value in values.items()
                if key.startswith('probability_') and key.endswith('_deg')
            },
            float(values['duration']),
            tuple(
                (
                    math.degrees(float(values[f'{REACH}{joint}.low'])),
                    math.degrees(float(values[f'{REACH}{joint}.high'])),
                )
                for joint in JOINTS
            ),
        )
        progress(
            f'{tube.name}: class {facts.class_deg:.0f} deg with probability '
            f'{facts.probabilities[round(facts.class_deg)]:.2f}, plant identified, '
            f'{facts.duration:.1f} s after the request'
        )
        return facts

    def track(self, tube: Tube, motion: str, method: Method, progress: Progress) -> Segment:
        """Track one motion by one method."""
        progress(f'tracking {MOTION_TITLE[motion]}, {method}')
        self._set('compensator', **COMPENSATOR[method])
        self._advance(SETTLING_S)
        self._set(MASTER_NODE, source='motion', motion=motion)
        start = self._now()
        self._advance(APPROACH_S + motion_by_name(motion).duration)
        end = self._now()
        self._set(MASTER_NODE, source='none')
        return Segment(tube.name, motion, method, start, end)

    def _now(self) -> float:
        return self._node.ticker.now_ns() * 1e-9

    def stop(self) -> dict[str, int]:
        """Disable the slave, end the recording, and say what it missed by topic."""
        self._client.ask('disable')
        return dict(self._recorder.stop().lost)
