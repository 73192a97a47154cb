"""What stands on the wire in the results of the graph, key by key, and what is read from it."""

import math

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray

from endoscope_core.calibration.calibration_run import OrderCode, OrderFeedback, OrderState
from endoscope_core.classifier.classification import ClassificationResult
from endoscope_core.compensation.law_in_force import LawInForce, Selection
from endoscope_core.control import Feedforward, FeedforwardSettings, MotorLimits, PhysicalParameters
from endoscope_core.identification.law_choice import CalibrationFindings, LawChoice
from endoscope_core.judgement import Judgement
from endoscope_core.physics import JointParameters
from endoscope_core.rig import load_rig
from endoscope_core.safety import AdoptionCode, BendingRange
from endoscope_nodes.client.calibration_result import (
    aborted_result,
    findings_of,
    is_of_no_class,
    refused_result,
    successful_result,
)
from endoscope_nodes.client.graph_listener import feedback_message, feedback_of
from endoscope_nodes.client.plant_adoption import AdoptionRequest, PlantInForce, Reach
from endoscope_nodes.runtime.diagnostics import OK, diagnostic_array, status

STAMP = 12_345_678_901
LIMITS = MotorLimits.of(load_rig(None))
TUBES = (
    PhysicalParameters(JointParameters(capstan_exponent=1.0 / 3.0, friction_profile=(0.25, -1e-5))),
    PhysicalParameters(),
)
NOMINAL = [
    *(('pretension', '5'), ('pretension_profile', '0.75'), ('wire_stiffness', '3000')),
    *(('pulley_radius', '0.0024'), ('joint_radius', '0.0008'), ('capstan_exponent', '0.9')),
    *(('joint_stiffness', '0.0045'), ('joint_rest_angle', '0'), ('joint_friction', '0.0009')),
    *(('joint_presliding', '0.03'), ('joint_presliding_spread', '0'), ('section_friction', '0')),
    *(('section_straight_angle', '0'), ('joint_damping', '1e-05'), ('motor_bandwidth', '30')),
    *(('motor_damping_ratio', '0.9'), ('friction_profile', '[]')),
]


def wire(message):
    """A message but for its stamp, which is checked here."""
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(STAMP, 10**9)
    return [
        (part.name, part.level[0], part.message, [(item.key, item.value) for item in part.values])
        for part in message.status
    ]


def judgement(**others):
    return Judgement(
        ClassificationResult(70, 0.75, {40: 0.25, 70: 0.75}, 1.0 / 3.0, (0.3, 0.4)), TUBES, **others
    )


def test_a_calibration_that_succeeded():
    zeros = np.array([0.0, 0.01, -0.02, 1.0 / 3.0])
    message = successful_result(STAMP, judgement(lost=[0.5, 0.0]), 0.4, 12.5, LIMITS, zeros)
    [(name, level, words, values)] = wire(message)
    assert (name, level) == ('calibration: hysteresis class', 0)
    assert words.startswith('class 70 deg with probability 0.750, by the plant')
    assert values[:16] == [
        *(('class_deg', '70'), ('probability', '0.75')),
        *(('probability_40_deg', '0.25'), ('probability_70_deg', '0.75')),
        *(('backlash_size', '0.4'), ('backlash_size_deg', f'{math.degrees(0.4):.9g}')),
        *(('backlash_size_from', 'tracker'), ('regressed_size', '0.333333333')),
        *(('regressed_size_low', '0.3'), ('regressed_size_high', '0.4'), ('duration', '12.5')),
        *(('zero_error.wire_x_pos', '0'), ('zero_error.wire_x_neg', '0.01')),
        *(('zero_error.wire_y_pos', '-0.02'), ('zero_error.wire_y_neg', '0.333333333')),
        ('pretension_lost.bend_x', '0.5'),
    ]
    assert values[16] == ('pretension_lost.bend_y', '0')
    found = {'capstan_exponent': '0.333333333', 'friction_profile': '[0.25, -1e-05]'}
    joints = {'bend_x': [(key, found.get(key, text)) for key, text in NOMINAL], 'bend_y': NOMINAL}
    plants = [(f'{joint}.{key}', text) for joint, own in joints.items() for key, text in own]
    assert values[17:-4] == plants
    assert [key for key, _ in values[-4:]] == [
        f'reach.{joint}.{end}' for joint in joints for end in ('low', 'high')
    ]
    read = findings_of(message)
    assert (read.class_deg, read.size) == (70, 0.333333333)
    assert read.plants[0].joint.friction_profile == (0.25, -1e-5)
    assert read.plants[1] == TUBES[1]
    assert f'{read.ranges[1].high:.9g}' == values[-1][1]


def test_a_calibration_without_tracker_zeros_and_plants():
    verdict = ClassificationResult(40, 1.0, {40: 1.0})
    message = successful_result(STAMP, Judgement(verdict), None, 9.0, LIMITS)
    size = math.radians(40)
    values = [
        *(('class_deg', '40'), ('probability', '1'), ('probability_40_deg', '1')),
        *(('backlash_size', f'{size:.9g}'), ('backlash_size_deg', '40')),
        *(('backlash_size_from', 'cnn'), ('duration', '9')),
    ]
    words = 'class 40 deg with probability 1.000'
    assert wire(message) == [('calibration: hysteresis class', 0, words, values)]
    assert findings_of(message) == CalibrationFindings(40, float(f'{size:.9g}'))


def test_calibrations_that_failed():
    refused = refused_result(STAMP, 'unlike any', 9.5, np.array([0.0, 0.0, 0.0, 2.5]))
    aborted = aborted_result(STAMP, 'too tight', 'moving', 2.5)
    reasons = [('reason', 'too tight'), ('step', 'moving'), ('duration', '2.5')]
    assert wire(aborted) == [('calibration: hysteresis class', 2, 'aborted: too tight', reasons)]
    [(_, level, words, values)] = wire(refused)
    assert level == 2
    assert words.startswith('unlike any; ')
    assert values == [
        *(('class_deg', 'none'), ('reason', 'unlike any'), ('step', 'judging')),
        *(('duration', '9.5'), ('zero_error.wire_x_pos', '0'), ('zero_error.wire_x_neg', '0')),
        *(('zero_error.wire_y_pos', '0'), ('zero_error.wire_y_neg', '2.5')),
    ]
    assert findings_of(aborted) is findings_of(refused) is None
    assert [is_of_no_class(one) for one in (aborted, refused)] == [False, True]


@pytest.mark.parametrize(
    'broken',
    [
        *({}, {'class_deg': 'many'}, {'class_deg': 70, 'regressed_size': 'wide'}),
        {'class_deg': 70, 'regressed_size.low': 0.1},
        {'class_deg': 70, 'reach.bend_x.low': 0.0},
        {'class_deg': 70, 'reach.bend_x.low': 0.0, 'reach.bend_x.high': 1.0},
        {'class_deg': 70, 'bend_x.pretension': 5.0},
        {'class_deg': 70, **{f'bend_x.{k}': t for k, t in NOMINAL}, 'bend_x.charm': 1.0},
        {'class_deg': 70, **{f'bend_x.{k}': t for k, t in NOMINAL}, 'bend_x.friction_profile': '['},
        {'class_deg': 70, **{f'bend_x.{k}': t for k, t in NOMINAL}, 'bend_x.pretension': -1.0},
    ],
)
def test_a_result_that_cannot_be_read_whole_is_none(broken):
    message = diagnostic_array(STAMP, status('calibration: hysteresis class', OK, '', broken))
    assert findings_of(message) is None


def test_of_a_result_of_another_program_the_class_is_enough():
    values = {'class_deg': 70, 'their own': 'word'}
    message = diagnostic_array(STAMP, status('calibration: hysteresis class', OK, '', values))
    assert findings_of(message) == CalibrationFindings(70)


@pytest.mark.parametrize(
    ('state', 'level'), [(OrderState.WAITING, 0), (OrderState.ABORTED, 2), (OrderState.REJECTED, 2)]
)
def test_the_feedback_of_an_order(state, level):
    fed = OrderFeedback('home', 10**18 + 1, state, 'resting', 0.25, OrderCode.BUSY, 'it is busy')
    message = feedback_message(fed, STAMP)
    values = [
        *(('order', 'home'), ('id', '1000000000000000001'), ('state', str(state))),
        *(('phase', 'resting'), ('progress', '0.25'), ('code', 'busy')),
    ]
    assert wire(message) == [('calibration: order', level, 'it is busy', values)]
    assert feedback_of(message) == fed
    assert wire(feedback_message(OrderFeedback(), STAMP))[0][3] == [
        *(('order', ''), ('id', '0'), ('state', 'waiting')),
        *(('phase', ''), ('progress', '0'), ('code', '')),
    ]


def test_a_request_to_adopt():
    request = AdoptionRequest('17', '[joints: {}]', 'session-3')
    message = request.message(STAMP)
    assert wire(message) == [('adopt', 0, '', [('id', '17'), ('plant', '[joints: {}]')])]
    assert message.header.frame_id == 'session-3'
    assert AdoptionRequest.of_message(message) == request
    for other in ({'id': '17'}, {'id': '17', 'plant': '', 'unless': 'moving'}):
        assert AdoptionRequest.of_message(
            diagnostic_array(STAMP, status('adopt', OK, '', other))
        ) is None  # fmt: skip
    assert AdoptionRequest.of_message(DiagnosticArray()) is None


def test_the_plant_in_force():
    plant = PlantInForce(
        plant='joints: {}\n',
        hash='abc',
        before='def',
        left_out=('breathing of bend_y', 'a "b"'),
        reach=Reach(BendingRange(-0.25, 0.5), BendingRange(0, 1)),
        words='plant abc adopted',
        id='17',
        state=OrderState.REJECTED,
        code=AdoptionCode.BUSY,
        answer='busy',
    )
    message = plant.message(STAMP, 'session-3')
    assert message.header.frame_id == 'session-3'
    in_force = [
        *(('hash', 'abc'), ('before', 'def'), ('left_out', r'["breathing of bend_y", "a \"b\""]')),
        *(('reach.bend_x.low', '-0.25'), ('reach.bend_x.high', '0.5')),
        *(('reach.bend_y.low', '0'), ('reach.bend_y.high', '1'), ('plant', 'joints: {}\n')),
    ]
    asked = [('id', '17'), ('state', 'rejected'), ('code', 'busy')]
    assert wire(message) == [
        ('compensator: adopted plant', 0, 'plant abc adopted', in_force),
        ('compensator: adoption', 2, 'busy', asked),
    ]
    assert PlantInForce.of_message(message) == plant
    for key, odd in (('reach.bend_y.high', 'far'), ('left_out', 'all'), ('left_out', '[[1]]')):
        told = plant.message(STAMP, 'session-3')
        next(item for item in told.status[0].values if item.key == key).value = odd
        assert PlantInForce.of_message(told) is None
    for k in range(8):
        told = plant.message(STAMP, 'session-3')
        told.status[0].values.pop(k)
        assert PlantInForce.of_message(told) is None
    message.status[0].values[2].key = 'left_out.first'
    assert PlantInForce.of_message(message) is None
    del message.status[0]
    assert PlantInForce.of_message(message) is None


def test_no_plant_in_force():
    message = PlantInForce().message(STAMP, '')
    assert wire(message) == [
        *(('compensator: adopted plant', 0, '', [
            ('hash', ''), ('before', ''), ('left_out', '[]'), ('plant', ''),
        ]),),
        ('compensator: adoption', 0, '', [('id', ''), ('state', 'waiting'), ('code', '')]),
    ]  # fmt: skip
    assert PlantInForce.of_message(message) == PlantInForce()


def test_the_model_in_force():
    settings = FeedforwardSettings(LIMITS, lead=0.06, speed_limit=LIMITS.speed / LIMITS.gear)
    law = LawInForce(Feedforward(2, settings), LawChoice(2), Selection('physical', 'plant'))
    bare = [
        *(('mode', 'none'), ('wanted_mode', 'physical'), ('selected_by', 'plant')),
        *(('lead', '0.06'), ('gear', '6')),
    ]
    assert values_of(law) == bare
    law.pending = (CalibrationFindings(70, 1.0, TUBES),)
    law.take_pending()
    assert values_of(law)[:8] == [
        ('mode', 'physical'), *bare[1:], ('class_deg', '70'),
        ('bend_x.pretension', '5'), ('bend_x.pretension_profile', '0.75'),
    ]  # fmt: skip
    assert ('bend_x.friction_profile', '[0.25, -1e-05]') in values_of(law)
    assert values_of(law)[-1] == ('bend_y.friction_profile', '[]')


def values_of(law):
    """What is said of a model on the wire."""
    made = status('compensator: model', OK, '', law.figures(0.06, 6))
    return [(item.key, item.value) for item in made.values]
