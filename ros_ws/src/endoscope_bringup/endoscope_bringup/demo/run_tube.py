"""Runs the whole procedure for one shape of the tube and records it."""

import math
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

from rclpy.context import Context
from rclpy.task import Future

from endoscope_bringup.demo.director_node import (
    DirectorNode,
    GraphRefusedError,
    check_parameters_taken,
    values_of,
)
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
from endoscope_nodes.calibration_result import REACH
from endoscope_nodes.conductor_node import ConductorNode
from endoscope_nodes.graph import CONTROL_NODES, SLAVE_NODES
from endoscope_nodes.names import JOINTS
from endoscope_nodes.recorder_node import RecorderNode
from endoscope_nodes.runtime import FOREVER_S, Runtime

Progress = Callable[[str], None]

POLL_S = 0.05
PATIENCE_S = 20.0
SETTLING_S = 1.0
APPROACH_S = 0.5
"""To the motion's start from wherever the tip is; its last second is no longer steady."""

STEPS = 2 + len(MOTIONS) * len(Method)
PATIENCE_OF_TIME_S = 120.0


def run_tube(
    tube: Tube, folder: Path, *, domain: int, seed: int, real_time: bool, progress: Progress
) -> TubeRecording:
    """Enable, calibrate, and track every motion by every method on one simulated tube.

    Parameters
    ----------
    tube : Tube
    folder : Path
        Gets the bag, and the plant file of the slave.
    domain : int
        ROS domain of the graph.
    seed : int
        Of the sensors' noise.
    real_time : bool
        Whether to run by the wall clock instead of in lock-step on /clock.
    progress : callable
        Told, in a line, what happens.

    Returns
    -------
    TubeRecording

    Raises
    ------
    EndoscopeError
        If a node refuses, or the graph stands still.
    """
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
        self._runtime = Runtime(
            arguments,
            context=Context(),
            domain_id=domain,
            overrides={
                'motor_driver': {'plant_file': str(plant_file), 'seed': seed},
                'recorder': {'bag': str(bag)},
                # Identifying a plant compiles on a machine's first run, in one tick.
                'conductor': {'timeout': PATIENCE_OF_TIME_S},
            },
        )
        for factory in (*SLAVE_NODES, *CONTROL_NODES):
            self._runtime.add(factory)
        self._recorder = self._runtime.add(RecorderNode)
        self._director = self._runtime.add(DirectorNode)
        self._conductor = None if real_time else self._runtime.add(ConductorNode)
        self._runtime.prepare()

    def __enter__(self) -> '_GraphSession':
        return self

    def __exit__(self, *_: object) -> None:
        self._runtime.close()

    def _advance(self, seconds: float) -> None:
        if self._conductor is None:
            self._runtime.spin_until(Future(), seconds)
            return
        done = self._conductor.advance(seconds)
        self._runtime.spin_until(done, FOREVER_S)
        done.result()

    def _wait_until(self, condition: Callable[[], bool], what: str) -> None:
        waited = 0.0
        while not condition():
            if waited > PATIENCE_S:
                raise GraphRefusedError(f'waited {PATIENCE_S:g} s in vain for {what}')
            self._advance(POLL_S)
            waited += POLL_S

    def _answer_of(self, future: Future, what: str) -> Any:
        self._wait_until(future.done, what)
        return future.result()

    def _set(self, node: str, **values: Any) -> None:
        answer = self._answer_of(
            self._director.request_parameters(node, **values), f'the parameters of {node}'
        )
        check_parameters_taken(node, answer)

    def start(self) -> None:
        """Wait for discovery, then enable the slave."""
        limit = time.monotonic() + PATIENCE_S
        while not (self._director.ready() and self._runtime.connected()):
            if time.monotonic() > limit:
                raise GraphRefusedError('the nodes did not find each other: is multicast allowed?')
            self._runtime.spin_until(Future(), POLL_S)
        self._advance(0.5)
        self._director.command_state('enable')
        self._wait_until(lambda: self._director.operating_state == 'ENABLED', 'ENABLED')

    def calibrate(self, tube: Tube, progress: Progress) -> CalibrationFacts:
        """Run the calibration and wait for its result."""
        answer = self._answer_of(self._director.request_calibration(), 'calibration/run')
        if not answer.success:
            raise GraphRefusedError(f'calibration/run: {answer.message}')
        self._wait_until(
            lambda: self._director.calibration_result is not None, 'calibration/result'
        )
        assert self._director.calibration_result is not None
        values = values_of(self._director.calibration_result)
        facts = CalibrationFacts(
            tube.name,
            self._director.last_calibration_ns * 1e-9 - calibration_sinusoid().duration,
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
        self._set('controller', active=method is Method.FEEDBACK)
        self._advance(SETTLING_S)
        self._set('console', source='motion', motion=motion)
        start = self._now()
        self._advance(APPROACH_S + motion_by_name(motion).duration)
        end = self._now()
        self._set('console', source='none')
        return Segment(tube.name, motion, method, start, end)

    def _now(self) -> float:
        return self._director.ticker.now_ns() * 1e-9

    def stop(self) -> dict[str, int]:
        """Disable the slave, end the recording, and say what it missed by topic."""
        self._director.command_state('disable')
        self._wait_until(lambda: self._director.operating_state == 'DISABLED', 'DISABLED')
        return dict(self._recorder.stop().lost)
