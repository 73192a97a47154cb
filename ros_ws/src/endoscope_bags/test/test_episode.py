"""Recordings at the frames of a data set, and its card."""

import numpy as np
import pytest

from endoscope_bags import BagError, BagWriter, MessageStream, open_bag
from endoscope_bags.cdr import encode_joint_states
from endoscope_bags.episode import channels_of, episodes_of, refuse_other_channels
from endoscope_bags.lerobot_dataset import ChannelDelay, dataset_card
from endoscope_bags.message_types import JOINT_STATE, WRENCH_STAMPED, typestore
from endoscope_core.rig import Kind

START = 1_790_000_000 * 10**9
JOINTS = ['bend_x', 'bend_y']
WIRES = ['wire_x_pos', 'wire_x_neg']


def stamps(rate, seconds=4.0, late=0.0):
    return START + np.round((late + np.arange(round(seconds * rate)) / rate) * 1e9).astype(np.int64)


def since(stamp_ns):
    return (stamp_ns - START) * 1e-9


def joint_states(topic, names, stamp_ns, quantity='position', scale=1.0):
    values = scale * np.stack([since(stamp_ns) + k for k in range(len(names))], axis=1)
    payloads = encode_joint_states(names, stamp_ns, **{quantity: values})
    return MessageStream(f'/rig/{topic}', JOINT_STATE, payloads, stamp_ns)


def forces(stamp_ns, along=-2.0):
    types = typestore().types
    header, time = types['std_msgs/msg/Header'], types['builtin_interfaces/msg/Time']
    vector, wrench = types['geometry_msgs/msg/Vector3'], types['geometry_msgs/msg/Wrench']
    payloads = []
    for stamp in stamp_ns.tolist():
        force = vector(x=1e-9 * (stamp - START), y=0.5, z=along)
        message = types[WRENCH_STAMPED](
            header=header(stamp=time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id='body'),
            wrench=wrench(force=force, torque=vector(x=0.0, y=0.0, z=0.0)),
        )
        payloads.append(bytes(typestore().serialize_cdr(message, WRENCH_STAMPED)))
    return MessageStream('/rig/slave/body/measured_cf', WRENCH_STAMPED, payloads, stamp_ns)


def written(path, *streams):
    with BagWriter(path) as writer:
        writer.write_streams(list(streams))
    return channels_of(open_bag(path))


@pytest.fixture
def recorded(tmp_path):
    return written(
        tmp_path / 'run.mcap',
        joint_states('slave/servo_jp', JOINTS, stamps(4.0)),
        joint_states('slave/measured_js', JOINTS, stamps(40.0, late=0.01)),
        joint_states('wires/measured_js', WIRES, stamps(300.0), 'effort', 0.1),
        forces(stamps(100.0)),
    )


def test_a_command_holds_and_what_was_measured_goes_on(recorded):
    assert recorded.tracker_rate == 40
    [episode] = episodes_of(recorded, 40)
    time = 0.01 + np.arange(len(episode)) / 40.0
    assert episode.start_ns == START + 10_000_000
    in_force = np.floor(time * 4.0) / 4.0
    assert episode.values['action'] == pytest.approx(np.stack([in_force, in_force + 1], 1))
    for name, scale in (('observation.state', 1.0), ('observation.meta.wire_tension', 0.1)):
        values = episode.values[name]
        assert values.dtype == np.float32
        assert values == pytest.approx(scale * np.stack([time, time + 1.0], 1), abs=1e-6)
    force = episode.values['observation.meta.tip_force']
    assert force == pytest.approx(np.stack([time, 0 * time + 0.5, 0 * time - 2.0], 1), abs=1e-6)


def test_a_component_of_the_force_that_is_never_known_is_left_out(tmp_path):
    streams = (
        joint_states('slave/servo_jp', JOINTS, stamps(4.0)),
        joint_states('slave/measured_js', JOINTS, stamps(40.0)),
    )
    recorded = written(tmp_path / 'a.mcap', *streams, forces(stamps(40.0), along=np.nan))
    [episode] = episodes_of(recorded, 40)
    [channel] = [c for c in recorded.channels if c.source.quantity == 'force']
    assert channel.names == ('force_x', 'force_y')
    assert episode.values['observation.meta.tip_force'][:, 1] == pytest.approx(0.5)
    with pytest.raises(BagError, match='forces that are not finite'):
        written(tmp_path / 'b.mcap', *streams, forces(stamps(40.0), along=np.inf))


def test_frames_on_the_stamps_of_the_tracker_are_its_readings(recorded):
    [episode] = episodes_of(recorded, 40)
    [state] = [c for c in recorded.channels if c.source.feature == 'observation.state']
    assert np.array_equal(
        episode.values['observation.state'],
        state.value[: len(episode)].astype(np.float32),
    )


def test_a_silence_ends_an_episode_and_has_no_frame(tmp_path):
    tracker = stamps(40.0)
    silent = (since(tracker) > 1.5) & (since(tracker) < 1.9)
    recorded = written(
        tmp_path / 'run.mcap',
        joint_states('slave/servo_jp', JOINTS, stamps(1000.0)),
        joint_states('slave/measured_js', JOINTS, tracker[~silent]),
    )
    before, after = episodes_of(recorded, 20)
    assert (before.start_ns, after.start_ns) == (START, START + 1_900_000_000)
    assert (len(before), len(after)) == (31, 42)


def test_what_a_recording_lacks_is_named(recorded, tmp_path):
    assert recorded.lacking == {
        'observation.meta.motor_command': 'motor/servo_jp was not recorded',
        'observation.meta.motor_position': 'motor/measured_js was not recorded',
        'observation.meta.motor_effort': 'motor/measured_js was not recorded',
    }
    without_effort = written(
        tmp_path / 'motors.mcap',
        joint_states('motor/servo_jp', ['motor_x'], stamps(1000.0)),
        joint_states('motor/measured_js', ['motor_x'], stamps(1000.0)),
    )
    assert without_effort.lacking['observation.meta.motor_effort'] == (
        'motor/measured_js has no effort'
    )
    assert without_effort.channels[0].names == ('motor_x',)
    with pytest.raises(BagError, match='give --fps'):
        _ = without_effort.tracker_rate
    with pytest.raises(BagError, match='motors and run differ in action'):
        refuse_other_channels([recorded, without_effort])


def test_a_recording_without_a_command_or_a_second_in_common_is_refused(tmp_path):
    measured = joint_states('slave/measured_js', JOINTS, stamps(40.0))
    with pytest.raises(BagError, match=r'slave/servo_jp.*motor/servo_jp'):
        written(tmp_path / 'none.mcap', measured)
    apart = written(
        tmp_path / 'apart.mcap',
        measured,
        joint_states('slave/servo_jp', JOINTS, stamps(40.0, late=3.5)),
    )
    with pytest.raises(BagError, match=r'no 1 s in which none of slave/servo_jp'):
        episodes_of(apart, 40)


def test_the_card_has_delays_with_intervals_and_says_what_is_unknown(recorded):
    episodes = episodes_of(recorded, 40)
    known = ChannelDelay('slave/measured_js:bend_x', 'its stamp', 0.0402, 0.0391, 0.0413)
    unknown = ChannelDelay('slave/measured_js:bend_y', 'its stamp', unknown='it was not moved')
    card = dataset_card('tubes', [recorded], episodes, 40, Kind.SIMULATED, [(known, unknown)])
    for line in (
        '# tubes',
        '| 1 | 160 | 4.0 | 40 | digital simulation |',
        '| run | slave/measured_js:bend_x | its stamp | 0.0402 (0.0391 to 0.0413) |',
        '| run | slave/measured_js:bend_y | its stamp | unknown: it was not moved |',
        '| run | wires/measured_js:wire_x_pos | its stamp | unknown: not calibrated |',
        '`observation.meta.motor_effort` is left out: motor/measured_js was not recorded.',
        '| `action` | bend_x, bend_y | rad | `slave/servo_jp`, position | the last one |',
    ):
        assert line in card.splitlines()
    assert 'fitted together with' in card
    bare = dataset_card('tubes', [recorded], episodes, 40, Kind.UNKNOWN, [()])
    assert 'fitted together with' not in bare
