"""The plant's answer to recorded commands at recorded stamps."""

import numpy as np
import pytest

from endoscope_core.physics import PlantDescription, simulate
from endoscope_core.physics.on_stamps import AnswerStamps, answer_commands, hold_on_ticks

START_NS = 1_700_000_000_123_456_789


def test_commands_on_the_ticks_give_what_the_simulator_gives():
    stamps = START_NS + np.arange(1500) * 1_000_000
    command = np.column_stack([0.4 * np.sin(0.003 * np.arange(1500)), np.zeros(1500)])
    answer = answer_commands(
        PlantDescription(), stamps, command, AnswerStamps(stamps, stamps, stamps[::25])
    )
    straight = simulate(PlantDescription(), command)
    np.testing.assert_allclose(answer.shaft_position, straight.shaft_position, atol=1e-9)
    np.testing.assert_allclose(answer.tension, straight.tension, atol=1e-9)
    np.testing.assert_allclose(answer.bending, straight.bending[::25], atol=1e-9)


def test_a_command_is_in_force_until_the_next_one():
    held = hold_on_ticks(np.array([0.0, 0.0005, 0.0015]), np.array([[0.0], [1.0], [3.0]]), 4)
    np.testing.assert_allclose(held[:, 0], [0.5, 2.0, 3.0, 3.0])


def test_answers_between_ticks_lie_between_the_neighbouring_ticks():
    stamps = START_NS + np.arange(300) * 1_000_000
    command = np.column_stack([np.linspace(0, 0.3, 300), np.zeros(300)])
    between = stamps[100:102] + 500_000
    answer = answer_commands(
        PlantDescription(), stamps, command, AnswerStamps(stamps, stamps, between)
    )
    whole = simulate(PlantDescription(), command).bending
    np.testing.assert_allclose(answer.bending, 0.5 * (whole[100:102] + whole[101:103]), atol=1e-12)


def test_decreasing_stamps_are_refused():
    with pytest.raises(ValueError, match='decrease'):
        hold_on_ticks(np.array([0.0, 0.002, 0.001]), np.zeros((3, 1)), 4)
