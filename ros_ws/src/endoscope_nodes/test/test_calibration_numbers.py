"""The figures of a calibration as numbers."""

import pytest

from endoscope_nodes.client.calibration_result import aborted_result, numbers_of, refused_result


def test_whoever_shows_the_numbers_sees_that_a_later_calibration_failed() -> None:
    for result in (
        aborted_result(1_500_000_000, 'too tight', 'the motion', 2.5),
        refused_result(1_500_000_000, 'none of the classes', 2.5),
    ):
        message = numbers_of(result)
        assert message.header.stamp.sec == 1
        assert dict(zip(message.name, message.position, strict=True)) == pytest.approx(
            {'success': 0.0, 'duration': 2.5}
        )
