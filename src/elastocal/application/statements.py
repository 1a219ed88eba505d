"""Sentences and tables that state the accuracy of a robot, the same in the terminal, the
report and the certificate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.application.frames import FRAMES, ROBOT
from elastocal.counting import format_count
from elastocal.effects.catalogue import list_effects
from elastocal.effects.protocol import effect_of

if TYPE_CHECKING:
    from elastocal.verdict import Accuracy, Verdict

_OFFSET = "of a constant offset at the end effector"


def format_millimetres(length_m: float) -> str:
    """Format a length to the micrometre, so that one error looks the same everywhere."""
    return f"{1e3 * length_m:.3f} mm"


def format_accuracy(accuracy: Accuracy) -> str:
    """Format an accuracy statement with all that belongs to it."""
    frame = format_frame(accuracy.frame, offset_removed=accuracy.offset_removed)
    if not accuracy.fitted and not accuracy.form_m:
        return (
            f"No position error is predicted {frame}: nothing of the robot was fitted."
        )
    rms = _format_bounded(accuracy, accuracy.rms_m, accuracy.rms_bound_m)
    worst = _format_bounded(accuracy, accuracy.worst_m, accuracy.worst_bound_m)
    text = (
        f"Predicted position error of the corrected robot {frame}: {rms} RMS over"
        f" {accuracy.region} ({accuracy.poses}), {worst} at the worst of them,"
        " without the noise of the measurements."
    )
    if accuracy.left_out:
        effects = list_effects()
        names = ", ".join(effects[effect_of(key)].words for key in accuracy.left_out)
        size = format_millimetres(accuracy.left_out_m)
        text += f" {size} of it are due to {names}, which commands cannot correct."
    # Do not mention a contribution that rounds to nothing.
    if round(accuracy.form_m, 6):
        size = format_millimetres(accuracy.form_m)
        reason = "other models fit equally well"
        if accuracy.contradicted:
            reason = "validation poses deviate more than the fit predicts"
        text += f" {size} of it are model-form uncertainty: {reason}."
    return text


def format_frame(frame: str, *, offset_removed: bool) -> str:
    """Say in which frame, a key of `FRAMES`, errors are stated, and which offset is
    subtracted."""
    description = FRAMES[frame]
    if not offset_removed:
        return description
    if frame == ROBOT:
        return f"{description.removesuffix(')')} and {_OFFSET})"
    return f"{description} (after the best choice {_OFFSET})"


def _format_bounded(accuracy: Accuracy, error_m: float, bound_m: float | None) -> str:
    """Format an error, with its one-sided confidence bound if there is one."""
    size = format_millimetres(error_m)
    if bound_m is None:
        return size
    bound = format_millimetres(bound_m)
    return f"{size} ({100 * accuracy.confidence:g} % bound {bound})"


def describe_left_out(verdict: Verdict) -> str:
    """Describe how many rows and poses were left out as gross errors, and how the error
    reads with them; empty if there are none."""
    gross_errors = verdict.gross_errors
    if not gross_errors:
        return ""
    rows = format_count(sum(len(error.rows) for error in gross_errors), "row")
    poses = {(error.session, error.pose) for error in gross_errors}
    farthest = format_millimetres(max(error.distance_m for error in gross_errors))
    sentence = (
        f"Left out as gross errors: {rows} of {format_count(len(poses), 'pose')},"
        f" off by up to {farthest}"
    )
    with_all = verdict.heldout.with_gross_errors
    if with_all is None:
        return f"{sentence}; none of them at a validation pose."
    return (
        f"{sentence}; with them the model is off by"
        f" {format_millimetres(with_all.after.rms_m)} RMS at validation poses, without"
        f" them by {format_millimetres(verdict.heldout.after.rms_m)}."
    )


def tabulate_errors(verdict: Verdict) -> list[list[str]]:
    """Tabulate the errors before and after the correction for report and certificate.

    Measured and predicted errors, over different poses and in different frames, are
    different quantities; each row says which one it states. The error before is the
    measured one alone, so that it has one value everywhere (`HeldOut.before`).

    Parameters
    ----------
    verdict : the verdict on a campaign.

    Returns
    -------
    Rows of three cells: name of the RMS error, its value before the correction, and
    after it. No rows if the data are at fault.
    """
    accuracy = verdict.accuracy
    if accuracy is None:
        return []
    measured = [
        "measured at validation poses, noise included,"
        " after the best placement of the base",
        format_millimetres(verdict.heldout.before.rms_m),
        format_millimetres(verdict.heldout.delivered.rms_m),
    ]
    predicted = [
        f"predicted over {accuracy.region}, {FRAMES[accuracy.frame]}",
        "",
        format_millimetres(accuracy.rms_m),
    ]
    return [measured, predicted]
