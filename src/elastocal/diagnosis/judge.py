"""The last step: every model on poses that no step has seen."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.campaigns.campaign import NO_REMAINDER, Measurements, tabulate_residuals
from elastocal.counting import format_count
from elastocal.diagnosis.gross_errors import (
    OutlierTest,
    describe_gross_errors,
    find_held_out_gross_errors,
    format_gross_error_warnings,
)
from elastocal.diagnosis.studentized_residuals import estimate_prediction_uncertainty
from elastocal.fitting.model import (
    Case,
    compute_residuals,
    evaluate_conditions,
    transform_to_base,
)
from elastocal.fitting.noise import parse_noise
from elastocal.fitting.observations import index_poses, separate_measurements
from elastocal.io.typed_json import from_document, to_document
from elastocal.random_streams import open_stream
from elastocal.residual_model.selection import (
    CorrectedResiduals,
    summarize_residual_model,
    validate_residual_model,
)
from elastocal.validation import held_out as figures
from elastocal.validation.conformity import count_configurations, find_joint_ranges
from elastocal.validation.transfer import (
    find_extrapolated_poses,
    transfer_fit,
    warn_of_repeated_poses,
)
from elastocal.verdict import (
    BeforeAfter,
    Effect,
    ErrorsByRange,
    ErrorSummary,
    HeldOut,
    JointRange,
    Remainder,
    TrainingVerdict,
    UncalibratedErrors,
    Verdict,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.diagnosis.diagnose import Diagnosis, Step
    from elastocal.fitting.model import Estimate, Model

_REPLICATES = 1000
# What warnings of errors that grew are known by.
ABOUT_ERRORS = "of the validation poses"
_ERRORS = {
    "mean_m": "mean error",
    "rms_m": "RMS error",
    "p95_m": "95th percentile of the errors",
    "max_m": "largest error",
}


@dataclass(frozen=True)
class Judgement:
    """A diagnosis with what held-out poses say of it.

    `verdict`: the whole verdict. `rows`: of before_after.csv. `held_out`: what
    was held out, without its gross errors. `left_out`: these. `outside` (P,) of bool:
    poses held out that lie outside the range of the fitted ones. `delivered`: what the
    final model and a regression leave of the held-out poses; None where there is none.
    """

    verdict: Verdict
    rows: list[dict[str, Any]]
    held_out: Case
    left_out: Measurements
    outside: np.ndarray
    delivered: CorrectedResiduals | None

    @cached_property
    def document(self) -> dict[str, Any]:
        """The verdict as a JSON document."""
        document: dict[str, Any] = to_document(self.verdict)
        return document


def judge(diagnosis: Diagnosis, held_out: Case, seed: int) -> Judgement:
    """Open the held-out poses and state the verdict.

    `held_out`: the held-out measurements; of another campaign, whose frames and targets
    are then fitted to them. `seed`: of the bootstrap over poses.
    """
    case = diagnosis.case
    steps = diagnosis.steps
    errors, part, outside = remove_gross_errors(diagnosis, held_out)
    left_out = describe_gross_errors(errors, held_out.campaign, held_out=True)
    rows, heldout, warnings = compare_held_out_errors(steps, case, part, outside, seed)
    whole = (
        [
            ErrorSummary(**figures.summarize_errors(error.distance))
            for error in _errors(steps, case, held_out)[1]
        ]
        if left_out
        else []
    )
    of_all = [error.rms_m for error in whole] or [row["heldout_rms_m"] for row in rows]
    rows = [
        row | {"heldout_rms_all_rows_m": rms}
        for row, rms in zip(rows, of_all, strict=True)
    ]
    if left_out:
        both = BeforeAfter(before=whole[_declared(steps)], after=whole[-1])
        heldout = replace(heldout, with_gross_errors=both)
        gross = format_count(len(left_out), "gross error")
        sizes = [1e3 * each.rms_m for each in (whole[-1], heldout.after)]
        words = "with all rows the RMS is {:.3g} mm instead of {:.3g} mm".format(*sizes)
        warnings.append(f"held-out errors are without {gross}: {words}")
    # By what share each step lowers the held-out RMS.
    pairs = [(last, row) for last, row in pairwise(rows) if row["kind"] == "effect"]
    gains = {
        row["step"].removeprefix("with "): float(
            1 - row["heldout_rms_m"] / last["heldout_rms_m"]
        )
        for last, row in pairs
    }
    found = diagnosis.verdict
    remainder = None
    delivered = apply_regression(diagnosis, part, seed)
    if delivered is not None:
        draws = open_stream(seed, case.campaign.name, "remainder", 0)
        facts = summarize_residual_model(
            delivered, diagnosis.declared, diagnosis.final, case, part, draws
        )
        remainder = from_document(Remainder, facts, "regression on the remainder")
        heldout = replace(heldout, delivered=remainder.errors)
    inherited = {
        entry.name: getattr(found, entry.name) for entry in fields(TrainingVerdict)
    }
    verdict = Verdict(
        **inherited
        | {
            "effects": tuple(
                replace(effect, heldout_gain=gains.get(effect.name))
                if isinstance(effect, Effect)
                else effect
                for effect in found.effects
            ),
            "heldout": heldout,
            "remainder": remainder,
            "gross_errors": (*found.gross_errors, *left_out),
            "warnings": (
                *found.warnings,
                *format_gross_error_warnings(left_out),
                *warnings,
            ),
        }
    )
    return Judgement(
        verdict,
        rows,
        part,
        held_out.campaign.measurements.select(errors.gross),
        outside,
        delivered,
    )


def apply_regression(
    diagnosis: Diagnosis, held_out: Case, seed: int
) -> CorrectedResiduals | None:
    """The final model with the regression that a campaign asks for, on held-out poses
    without gross errors; None for none."""
    campaign = diagnosis.case.campaign
    if campaign.remainder == NO_REMAINDER or diagnosis.verdict.faults:
        return None
    # Poses held out at random have neighbours among those fitted; others have none, nor
    # may those that set the intervals.
    final = diagnosis.final
    case = diagnosis.case
    blocks = "fraction" not in campaign.holdout
    return validate_residual_model(
        final,
        case,
        held_out,
        campaign.remainder,
        blocks=blocks,
        within_range=True,
        seed=seed,
    )


def remove_gross_errors(
    diagnosis: Diagnosis, held_out: Case
) -> tuple[OutlierTest, Case, np.ndarray]:
    """Held-out rows that the final model does not explain, by the rule of the training
    rows; the case without; and which of its poses lie outside the range of the fitted
    ones, (P,)."""
    final = diagnosis.final
    measurements = held_out.campaign.measurements
    poses = find_extrapolated_poses(final, diagnosis.case, held_out)
    part = held_out
    errors = OutlierTest.none(len(measurements), held_out.model.rows)
    if diagnosis.verdict.faults:
        return errors, part, poses
    settings = diagnosis.settings
    noise = parse_noise(diagnosis.document).without_pose_error
    fitted_uncertainty = estimate_prediction_uncertainty(
        final, noise, diagnosis.case.campaign.measurements
    )
    outside = poses[index_poses(measurements)]
    for _ in range(settings.gross_error_rounds):
        # Frames of another campaign are fitted to what is kept of it.
        model, estimate = transfer_fit(final, diagnosis.case, part)
        uncertainty = fitted_uncertainty
        if model is not final.model or estimate is not final.estimate:
            uncertainty = replace(fitted_uncertainty, parameter_covariance=None)
        last = errors.gross
        errors = find_held_out_gross_errors(
            model, estimate, uncertainty, held_out, outside, settings
        )
        part = held_out.select(~errors.gross) if errors.gross.any() else held_out
        if (errors.gross == last).all():
            break
    return (
        errors,
        part,
        np.bincount(index_poses(part.campaign.measurements), outside[~errors.gross])
        > 0,
    )


def compare_held_out_errors(
    steps: Sequence[Step], case: Case, held_out: Case, outside: np.ndarray, seed: int
) -> tuple[list[dict[str, Any]], HeldOut, list[str]]:
    """Errors of every step on training and held-out poses.

    `held_out`, `seed`: as in `judge`. `outside` (P,): as of `Verdict`. Returns `rows`:
    of before_after.csv; `heldout`: as in verdict.json.
    """
    there, errors = _errors(steps, case, held_out)
    before = _declared(steps)
    after = len(steps) - 1
    draws = open_stream(seed, case.campaign.name, "held-out poses", 0)
    limits, reductions = figures.compute_error_intervals(
        errors, _REPLICATES, draws, before
    )
    of_calibration = figures.compute_error_intervals(
        [errors[0], errors[after]], _REPLICATES, draws
    )[1][1]
    floor = figures.compute_noise_floor(
        steps[after].fitted, held_out.observations, *there[after]
    )
    rows = []
    warnings = []
    for step, error, limit in zip(steps, errors, limits, strict=True):
        training = figures.summarize_errors(
            np.linalg.norm(step.fitted.residual[:, :3], axis=1)
        )
        tested = figures.summarize_errors(error.distance)
        row: dict[str, Any] = {
            "step": step.name,
            "kind": step.kind,
            "parameters": int((~step.fitted.unidentifiable).sum()),
        }
        row |= {f"train_{name}": training[name] for name in figures.METRICS}
        for name in figures.METRICS:
            low, high = limit[name]
            row |= {
                f"heldout_{name}": tested[name],
                f"heldout_{name}_low": low,
                f"heldout_{name}_high": high,
            }
        rows.append(
            row
            | {
                f"heldout_{name.removesuffix('_m')}_over_floor": tested[name] / floor
                for name in figures.METRICS
            }
        )
    for name in figures.METRICS:
        low, high = (
            1e3 * rows[number][f"heldout_{name}"] for number in (before, after)
        )
        if high > low:
            warnings.append(
                f"the {_ERRORS[name]} {ABOUT_ERRORS} grew from {low:.3f} to {high:.3f} mm"
            )
    by_range = figures.summarize_errors_by_range(
        {"before": errors[before], "after": errors[after]}, outside
    )
    summary_after = ErrorSummary(**figures.summarize_errors(errors[after].distance))
    heldout = HeldOut(
        uncalibrated=UncalibratedErrors(
            **figures.summarize_errors(errors[0].distance),
            reduction_ci95=(of_calibration.low, of_calibration.high),
        ),
        before=ErrorSummary(**figures.summarize_errors(errors[before].distance)),
        after=summary_after,
        noise_floor_rms_m=None if np.isnan(floor) else floor,
        reduction_ci95=(reductions[after].low, reductions[after].high),
        reduction_std_error=reductions[after].std_error,
        poses=errors[0].poses,
        configurations=count_configurations(held_out.observations.states),
        joint_ranges=tuple(
            JointRange(**entry)
            for entry in find_joint_ranges(
                held_out.observations.states, held_out.campaign.robot
            )
        ),
        share_below_max=figures.bound_share_below_maximum(errors[0].poses),
        outside_range=from_document(ErrorsByRange, by_range, "errors by range"),
        with_gross_errors=None,
        delivered=summary_after,
    )
    if count := by_range["poses"]:
        lie = f"{count} of {format_count(len(outside), 'validation pose')} {'lies' if count == 1 else 'lie'}"
        warnings.append(
            f"{lie} outside the range of the fitted poses: errors there are extrapolated"
        )
    return (
        rows,
        heldout,
        warnings
        + warn_of_repeated_poses(
            case.observations.states, held_out.observations.states
        ),
    )


def _errors(
    steps: Sequence[Step], case: Case, held_out: Case
) -> tuple[list[tuple[Model, Estimate]], list[figures.PositionErrors]]:
    """Models of all steps, placed where held-out measurements were made, and their
    errors there."""
    there = [transfer_fit(step.fitted, case, held_out) for step in steps]
    return there, [
        figures.compute_position_errors(model, estimate, held_out.observations)
        for model, estimate in there
    ]


def _declared(steps: Sequence[Step]) -> int:
    return next(number for number, step in enumerate(steps) if step.kind == "declared")


def generate_residual_blocks(
    diagnosis: Diagnosis, verdict: Judgement
) -> Iterator[dict[str, np.ndarray]]:
    """Blocks of the residuals table: every measurement before and after, gross errors
    behind the others."""
    case = diagnosis.case
    before = diagnosis.declared
    after = diagnosis.final
    for part, left_out, unseen in (
        (case, diagnosis.left_out, False),
        (verdict.held_out, verdict.left_out, True),
    ):
        there = [transfer_fit(fitted, case, part) for fitted in (before, after)]
        outside = (
            verdict.outside
            if unseen
            else np.zeros(part.observations.cluster.max() + 1, bool)
        )
        measurements = part.campaign.measurements
        for some, beyond in (
            (measurements, outside[index_poses(measurements)]),
            (left_out, np.zeros(len(left_out), bool)),
        ):
            if not len(some):
                continue
            observations = separate_measurements(some)
            off = {
                stage: compute_residuals(
                    *each, observations, evaluate_conditions(*each, observations.states)
                )
                for stage, each in zip(("before", "after"), there, strict=True)
            }
            position = transform_to_base(there[-1][1], observations)[0]
            yield tabulate_residuals(
                some,
                beyond,
                position,
                off,
                held_out=unseen,
                gross_errors=some is left_out,
            )
