import math

import pytest
from page_in_virtual_time import MS, Page

from endoscope_console.teleop.frames import MalformedFrameError, Source
from endoscope_console.teleop.joy_mapping import JoyMapping
from endoscope_console.teleop.operator import DeadManState, Reason
from endoscope_core.errors import EndoscopeError

AXES = [0.0] * 6
NOTHING = [0] * 11


def pressed(*numbers):
    return [int(k in numbers) for k in range(11)]


def test_either_dead_man_is_a_grip_and_each_press_is_a_new_one():
    joy = JoyMapping()
    says = [NOTHING, pressed(5), pressed(5), NOTHING, pressed(4), pressed(4, 5), NOTHING]
    frames = [joy.frame(AXES, buttons, 0.1 * k) for k, buttons in enumerate(says)]
    assert [frame.pressed for frame in frames] == [False, True, True, False, True, True, False]
    assert [frame.turbo for frame in frames] == [False, False, False, False, True, True, False]
    assert [frame.grip for frame in frames] == [0, 1, 1, 1, 2, 2, 2]
    assert [frame.seq for frame in frames] == [1, 2, 3, 4, 5, 6, 7]
    assert {frame.source for frame in frames} == {Source.JOY}
    assert frames[3].t == pytest.approx(0.3)


def test_axes_are_those_of_the_parameters_and_speeds_may_turn_them_round():
    joy = JoyMapping(
        {
            'axis_angular.bend_x': 3,
            'axis_angular.bend_y': 2,
            'scale_angular.bend_x': -0.25,
            'scale_angular_turbo.bend_y': 2,
        }
    )
    frame = joy.frame([0.1, 0.2, 0.3, 0.4], NOTHING, 0.0)
    assert (frame.x, frame.y) == (0.4, 0.3)
    assert joy.speeds == ((-0.25, 1.0), (0.5, 2.0))


def test_the_pause_button_asks_once_a_press():
    joy = JoyMapping({'pause_button': 1})
    asked = []
    for buttons in (NOTHING, pressed(1), pressed(1), NOTHING, pressed(1)):
        joy.frame(AXES, buttons, 0.0)
        asked.append(joy.pause)
    assert asked == [False, True, False, False, True]


def test_a_device_without_turbo_and_pause_needs_no_buttons_for_them():
    joy = JoyMapping({'enable_button': 0, 'enable_turbo_button': -1, 'pause_button': -1})
    frame = joy.frame([0.0, 0.0], [1], 0.0)
    assert (frame.pressed, frame.turbo, joy.pause) == (True, False, False)


@pytest.mark.parametrize(
    ('axes', 'buttons', 'said'),
    [
        (AXES, [0] * 5, '5 buttons'),
        ([0.0], NOTHING, '1 axes'),
        ([math.nan, 0.0], NOTHING, 'nan'),
        ([0.0, math.inf], NOTHING, 'inf'),
    ],
)
def test_a_message_of_another_device_is_refused(axes, buttons, said):
    with pytest.raises(MalformedFrameError, match=said):
        JoyMapping().frame(axes, buttons, 0.0)


@pytest.mark.parametrize(
    ('parameters', 'said'),
    [
        ({'require_enable_button': False}, 'require_enable_button: false is refused'),
        ({'enable_buton': 1}, 'did you mean enable_button'),
        ({'enable_button': -1}, 'enable_button = -1'),
        ({'enable_button': 4}, 'enable_button 4 has another meaning too'),
        ({'enable_button': 8}, 'enable_button 8 has another meaning too'),
        ({'enable_button': True}, 'enable_button = True'),
        ({'enable_button': 1.5}, 'enable_button = 1.5'),
        ({'axis_angular.bend_x': -1}, 'axis_angular.bend_x = -1'),
        ({'scale_angular.bend_y': 0.0}, 'scale_angular.bend_y = 0.0'),
        ({'scale_angular.bend_y': math.nan}, 'scale_angular.bend_y = nan'),
        ({'scale_angular.bend_y': '1e-1'}, 'scale_angular.bend_y = 1e-1'),
        ({'require_enable_button': 1}, 'require_enable_button = 1'),
    ],
)
def test_parameters_that_cannot_be_used_are_named(parameters, said):
    with pytest.raises(EndoscopeError, match=said):
        JoyMapping(parameters)


def test_the_rules_of_a_page_hold_for_it():
    page, joy = Page(), JoyMapping()

    def says(buttons):
        frame = joy.frame(AXES, buttons, page.now * 1e-9)
        page.dead_man.hear(frame, page.now, 'c1')
        page.turn(20)

    says(pressed(5))
    assert page.dead_man.missing is Reason.HANDS_ON
    says(NOTHING)
    assert page.dead_man.state is DeadManState.READY
    for _ in range(30):
        says(pressed(5))
        assert page.dead_man.engaged
    page.turn(90)
    assert page.dead_man.reason is Reason.SILENT
    says(NOTHING)
    page.learns(state_age_ns=4000 * MS)
    says(pressed(5))
    assert not page.dead_man.engaged
