"""Sentences and tables of an accuracy statement."""

from types import SimpleNamespace

import pytest

from elastocal.application.accuracy import Accuracy
from elastocal.application.frames import BASE, ROBOT
from elastocal.application.statements import (
    describe_left_out,
    format_accuracy,
    tabulate_errors,
)

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
    assert "0.100 mm (95 % bound 0.150 mm) RMS over some poses (7)" in sentence
    assert "0.200 mm at the worst of them" in sentence


def test_no_errors_are_tabulated_if_the_data_are_at_fault():
    verdict = SimpleNamespace(accuracy=None)
    assert tabulate_errors(verdict) == []


def make_verdict(with_gross_errors, *poses):
    gross_errors = [
        SimpleNamespace(rows=(row,), session=0, pose=pose, distance_m=1e-3 * (1 + row))
        for row, pose in enumerate(poses)
    ]
    heldout = SimpleNamespace(
        after=SimpleNamespace(rms_m=1e-4), with_gross_errors=with_gross_errors
    )
    return SimpleNamespace(gross_errors=gross_errors, heldout=heldout)


def test_without_gross_errors_nothing_is_stated_of_them():
    assert describe_left_out(make_verdict(None)) == ""


def test_rows_and_poses_that_are_left_out_are_counted_and_errors_with_them_stated():
    sentence = describe_left_out(make_verdict(None, 4, 4, 7))
    assert "3 rows of 2 poses" in sentence
    assert "off by up to 3.000 mm" in sentence
    assert "none of them at a validation pose" in sentence
    with_all = SimpleNamespace(after=SimpleNamespace(rms_m=2e-3))
    sentence = describe_left_out(make_verdict(with_all, 4))
    assert (
        "off by 2.000 mm RMS at validation poses, without them by 0.100 mm" in sentence
    )
