"""The force at the tip in a picture: with the angles of its own time, and no others."""

import math
import time

import numpy as np
import pytest
from page_frames import decode_telemetry

from endoscope_console.pictures import SIGNALS, Pictures
from endoscope_nodes.names import BOUNDS, JOINTS, SLAVE_MEASURED, TIP_FORCE_BOUNDS
from endoscope_nodes.runtime.environment import joined_node
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.qos import SENSOR_OFFERED
from endoscope_nodes.runtime.streams import JointPublisher

MS = 1_000_000
BEGIN_NS = 1_000 * MS
LAST_S = (BEGIN_NS + 175 * MS) * 1e-9
PATIENCE_S = 30.0
OF_FORCE = [k for k, signal in enumerate(SIGNALS) if signal['name'].startswith('tip_force/')]
BOUND = -0.1, -0.2, 0.3, 0.4


@pytest.fixture
def graph():
    """Publishers of angles, which rise by 0.01 and 0.02 rad in each 25 ms, and of bounds."""
    with joined_node('probe', '/endoscope', private_domain()) as node:
        angles = JointPublisher(node, SLAVE_MEASURED, JOINTS, ('position',), SENSOR_OFFERED)
        forces = JointPublisher(node, TIP_FORCE_BOUNDS, BOUNDS, ('effort',), SENSOR_OFFERED)
        pictures = Pictures(node, 0.02)
        spoken = [p for p in node.publishers if p.topic_name.endswith((SLAVE_MEASURED, 'bounds'))]
        until(lambda: len(spoken) == 2 and all(p.get_subscription_count() for p in spoken))
        for k in range(8):
            angles.publish(BEGIN_NS + 25 * MS * k, 0.01 * k, 0.02 * k)
        until(lambda: picture(pictures)[0].stamp_s == LAST_S)
        assert math.isinf(pictures.force_age_s)
        yield forces, pictures
        pictures.close()


def until(condition):
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def picture(pictures):
    """The next picture, and of it what is of the force: last values (9,)."""
    made = decode_telemetry(pictures.make(time.monotonic_ns(), time.time_ns()))
    return made, made.ranges[OF_FORCE, 2]


def shown(pictures):
    """The first values that are of a force."""
    end = time.monotonic() + PATIENCE_S
    while np.isnan((found := picture(pictures))[1]).all():
        assert time.monotonic() < end
        time.sleep(0.01)
    return found


def test_it_comes_with_the_angles_of_its_own_time(graph):
    forces, pictures = graph
    # 0.1 s late, between two samples of the tracker.
    forces.publish(BEGIN_NS + 60 * MS, 0.3, -0.4, *BOUND, 1.0)
    made, values = shown(pictures)
    assert values == pytest.approx([0.3, -0.4, *BOUND, 1.0, 0.024, 0.048])
    assert made.stamp_s == LAST_S, 'what is newest is not the force'
    assert pictures.push == pytest.approx(0.5)
    assert pictures.force_age_s < PATIENCE_S
    picture(pictures)
    assert pictures.push == 0.0


def test_of_one_joint_or_an_unknown_time_only_what_is_known_is_shown(graph):
    forces, pictures = graph
    forces.publish(BEGIN_NS - MS, math.nan, 0.2, *BOUND, 1.0)
    _, values = shown(pictures)
    assert np.isnan(values[[0, 7, 8]]).all()
    assert values[1] == pytest.approx(0.2)
    assert pictures.push == pytest.approx(0.2)
    forces.publish(BEGIN_NS, 0.3, 0.2, *BOUND, 0.0)
    shown(pictures)
    assert pictures.push == 0.0, 'what is not seen pushes nothing'
