"""Runs the whole procedure for one shape of the tube and records it."""

import math
import struct
from collections.abc import Callable
from itertools import count
from pathlib import Path

from sensor_msgs.msg import JointState

from endoscope_bringup.demo.live_graph import NODES, LiveGraph
from endoscope_bringup.demo.procedure import (
    COMPENSATOR,
    MOTION_TITLE,
    MOTIONS,
    CalibrationFacts,
    Method,
    RecordedRun,
    RecordedTube,
    Tube,
)
from endoscope_core.physics import PlantDescription, save_plant
from endoscope_core.physics.family import shipped_family
from endoscope_core.signals import calibration_sinusoid, motion_by_name
from endoscope_nodes.client.calibration_result import REACH
from endoscope_nodes.client.graph_listener import GraphError
from endoscope_nodes.graph import SHOWING_NODES
from endoscope_nodes.names import CALIBRATION_COMMAND, CLOCK_NODE, JOINTS, MASTER_NODE

Progress = Callable[[str], None]

TICK_RATE = 500
"""Hz: that of a bus of servos at 4 Mbaud, and of nodes in processes of their own."""
SETTLING_S = 1.0
_STAMP = struct.Struct('<iI')
APPROACH_S = 0.5
"""To the motion's start from wherever the tip is; its last second is no longer steady."""

STEPS = 2 + len(MOTIONS) * len(Method)
PATIENCE_OF_TIME_S = 120.0


def run_tube(
    tube: Tube, folder: Path, *, domain: int, seed: int, real_time: bool, progress: Progress
) -> RecordedTube:
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
    overrides: dict[str, dict[str, object]] = {
        'motor_driver': {'plant_file': str(plant_file), 'seed': seed},
        # What feed-forward alone does is shown.
        'controller': {'active': False},
    }
    if not real_time:
        # Identifying a plant compiles on a machine's first run, in one tick.
        overrides[CLOCK_NODE] = {'timeout': PATIENCE_OF_TIME_S}
    with LiveGraph(
        bag,
        domain,
        lock_step=not real_time,
        overrides=overrides,
        rate=TICK_RATE,
        nodes=(*NODES, *SHOWING_NODES),
        log_level='info',
    ) as graph:
        graph.client.ask('enable')
        say('calibrating')
        calibration = _calibrate(graph, tube, progress)
        segments = tuple(
            _track(graph, tube, motion, method, say) for motion in MOTIONS for method in Method
        )
        graph.client.ask('disable')
        return RecordedTube(bag, segments, calibration, graph.stop())


def _calibrate(graph: LiveGraph, tube: Tube, progress: Progress) -> CalibrationFacts:
    """Run the calibration and wait for its result."""
    last_stamp = 0.0

    def note(data: bytes, received_ns: int) -> None:
        nonlocal last_stamp
        seconds, nanoseconds = _STAMP.unpack_from(data, 4)
        last_stamp = seconds + nanoseconds * 1e-9

    graph.client.listen(JointState, CALIBRATION_COMMAND, note)
    values = graph.client.calibrate().values
    facts = CalibrationFacts(
        tube.name,
        last_stamp - calibration_sinusoid().duration,
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


def _track(
    graph: LiveGraph, tube: Tube, motion: str, method: Method, progress: Progress
) -> RecordedRun:
    """Track one motion by one method."""
    progress(f'tracking {MOTION_TITLE[motion]}, {method}')
    graph.set('compensator', **COMPENSATOR[method])
    graph.advance(SETTLING_S)
    graph.set(MASTER_NODE, source='motion', motion=motion)
    start = graph.now()
    graph.advance(APPROACH_S + motion_by_name(motion).duration)
    end = graph.now()
    graph.set(MASTER_NODE, source='none')
    if graph.client.state != 'ENABLED':
        raise GraphError(f'{tube.name}, {motion}: {graph.client.state}: {graph.client.why}')
    return RecordedRun(tube.name, motion, method, start, end)
