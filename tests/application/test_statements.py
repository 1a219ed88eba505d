"""Sentences and tables of an accuracy statement."""

from types import SimpleNamespace

import pytest

from elastocal.application.accuracy import Accuracy
from elastocal.application.frames import BASE, ROBOT
from elastocal.application.statements import format_accuracy, tabulate_errors

ACCURACY = Accuracy(BASE, 1e-4, 2e-4, 1.5e-4, None, 7, "some poses")
OFFSET = "of a constant offset at the end effector)"


@pytest.mark.parametrize(
    ("frame", "offset_removed", "stated"),
    [
        (BASE, False, "in the frame of the declared base:"),
        (
            BASE,
            True,
            f"in the frame of the declared base (after the best choice {OFFSET}:",
        ),
        (ROBOT, False, "(after the best placement of its base):"),
        (ROBOT, True, f"(after the best placement of its base and {OFFSET}:"),
    ],
)
def test_the_frame_says_what_is_subtracted(frame, offset_removed, stated):
    accuracy = Accuracy(
        frame, 1e-4, 2e-4, None, None, 7, "some poses", offset_removed=offset_removed
    )
    assert stated in format_accuracy(accuracy)


def test_a_bound_is_stated_if_there_is_one():
    sentence = format_accuracy(ACCURACY)
    assert "0.100 mm (95 % sure: below 0.150 mm) RMS over some poses (7)" in sentence
    assert "0.200 mm at the worst of them" in sentence


def test_no_errors_are_tabulated_if_the_data_are_at_fault():
    verdict = SimpleNamespace(accuracy=None)
    assert tabulate_errors(verdict) == []
