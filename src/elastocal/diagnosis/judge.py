"""The last step of a diagnosis: judge every model by poses that no step has seen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.campaigns.campaign import NO_REMAINDER, Measurements, tabulate_residuals
from elastocal.counting import format_count
from elastocal.diagnosis.contamination import weigh_held_out_rows
from elastocal.diagnosis.gross_errors import (
    OutlierTest,
    describe_gross_errors,
    describe_standing_out,
    find_held_out_gross_errors,
    format_gross_error_warnings,
)
from elastocal.diagnosis.studentized_residuals import estimate_prediction_uncertainty
from elastocal.fitting.model import (
    Case,
    compute_residual_vectors,
    evaluate_conditions,
    predict,
    transform_to_base,
)
from elastocal.fitting.noise import count_effective_parameters, get_noise
from elastocal.fitting.observations import index_poses, separate_measurements
from elastocal.io.typed_json import from_document, to_document
from elastocal.random_streams import open_stream
from elastocal.residual_model.selection import (
    CorrectedResiduals,
    ResidualModelPlan,
    summarize_residual_model,
    validate_residual_model,
)
from elastocal.validation.conformity import count_configurations, find_joint_ranges
from elastocal.validation.held_out import (
    METRICS,
    PositionErrors,
    bound_share_below_maximum,
    compute_error_intervals,
    compute_errors_as_read,
    compute_noise_floor,
    compute_position_errors,
    summarize_errors,
    summarize_errors_by_range,
)
from elastocal.validation.transfer import (
    find_extrapolated_poses,
    is_same_campaign,
    transfer_fit,
    warn_of_repeated_poses,
)
from elastocal.verdict import (
    BeforeAfter,
    BoardErrors,
    ErrorsBefore,
    ErrorsByRange,
    ErrorSummary,
    HeldOut,
    Remainder,
    Verdict,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from elastocal.diagnosis.diagnose import Diagnosis, Step
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.verdict import Effect

    TransferredFit = tuple[Model, Estimate]

# Number of bootstrap replicates of the held-out poses.
_REPLICATES = 1000
_METRIC_NAMES = {
    "mean_m": "mean error",
    "rms_m": "RMS error",
    "p95_m": "95th percentile of the errors",
    "max_m": "largest error",
}


@dataclass(frozen=True)
class Judgement:
    """A diagnosis, with what the held-out poses say of it.

    Attributes
    ----------
    verdict
        The whole verdict.
    rows
        Rows of before_after.csv, one for each step.
    held_out
        Held-out poses without their gross errors.
    left_out
        These gross errors.
    outside
        (P,) of bool, held-out poses outside the range of the fitted ones.
    delivered
        Residual of the held-out poses by the final model and a regression; None if the
        campaign asks for no regression.
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

    Parameters
    ----------
    diagnosis
        Result of the training poses.
    held_out
        Held-out measurements. If they are of another campaign, its frames and targets
        are fitted to them.
    seed
        Seed of the bootstrap over poses.
    """
    outliers, kept, outside = remove_gross_errors(diagnosis, held_out)
    rows, heldout, warnings = compare_held_out_errors(
        diagnosis.steps,
        (diagnosis.case, kept),
        outside,
        get_noise(diagnosis.verdict.noise),
        seed,
    )
    gross_errors = describe_gross_errors(outliers, held_out.campaign, held_out=True)
    for row in rows:
        row["heldout_rms_all_rows_m"] = row["heldout_rms_m"]
    if gross_errors:
        _, errors = _compute_step_errors(diagnosis.steps, diagnosis.case, held_out)
        summaries = [_summarize(step_errors) for step_errors in errors]
        for row, summary in zip(rows, summaries, strict=True):
            row["heldout_rms_all_rows_m"] = summary.rms_m
        heldout = replace(
            heldout, with_gross_errors=BeforeAfter(summaries[0], summaries[-1])
        )
        warnings.append(
            f"held-out errors are without {format_count(len(gross_errors), 'gross error')}:"
            f" with all rows the RMS is {1e3 * summaries[-1].rms_m:.3g} mm"
            f" instead of {1e3 * heldout.after.rms_m:.3g} mm"
        )
    standing_out = describe_standing_out(
        outliers.distant & ~outliers.gross, held_out.campaign, least_poses=1
    )
    warnings += [f"validation poses: {sentence}" for sentence in standing_out]
    delivered = apply_regression(diagnosis, kept, seed)
    remainder = None
    if delivered is not None:
        remainder = _state_remainder(diagnosis, kept, delivered, seed)
        heldout = replace(heldout, delivered=remainder.errors)
    training = diagnosis.verdict
    changes = {
        "effects": (*training.faults, *_add_gains(training.missing_effects, rows)),
        "heldout": heldout,
        "remainder": remainder,
        "gross_errors": (*training.gross_errors, *gross_errors),
        "warnings": (
            *training.warnings,
            *format_gross_error_warnings(gross_errors),
            *warnings,
        ),
    }
    return Judgement(
        Verdict(**vars(training) | changes),
        rows,
        kept,
        held_out.campaign.measurements.select(outliers.gross),
        outside,
        delivered,
    )


def _add_gains(
    effects: Sequence[Effect], rows: Sequence[Mapping[str, Any]]
) -> list[Effect]:
    """Add the share by which each effect lowers the RMS of the held-out errors, by the
    rows of before_after.csv; None for an effect without a step of its own."""
    gains = {
        row["step"].removeprefix("with "): float(
            1 - row["heldout_rms_m"] / previous["heldout_rms_m"]
        )
        for previous, row in pairwise(rows)
        if row["kind"] == "effect"
    }
    return [replace(effect, heldout_gain=gains.get(effect.name)) for effect in effects]


def _state_remainder(
    diagnosis: Diagnosis, held_out: Case, delivered: CorrectedResiduals, seed: int
) -> Remainder:
    """State what a regression on the residual of the final model improves."""
    case = diagnosis.case
    stream = open_stream(seed, case.campaign.name, "remainder", 0)
    return summarize_residual_model(
        delivered, diagnosis.declared, diagnosis.final, case, held_out, stream
    )


def apply_regression(
    diagnosis: Diagnosis, held_out: Case, seed: int
) -> CorrectedResiduals | None:
    """Predict held-out poses by the final model and the regression of the campaign.

    Parameters
    ----------
    diagnosis
        Result of the training poses.
    held_out
        Held-out poses without gross errors.
    seed
        Seed of the cross-validation.

    Returns
    -------
    CorrectedResiduals or None
        None if the campaign asks for no regression, if its data are at fault, or if its
        measurements have no vectors that a regression could predict.
    """
    campaign = diagnosis.case.campaign
    if campaign.remainder == NO_REMAINDER or diagnosis.verdict.faults:
        return None
    if diagnosis.final.model.rows == 1:
        return None
    # Poses that were held out at random have neighbours among the fitted ones. Others
    # have none, and the poses that set the intervals must not have any either.
    plan = ResidualModelPlan(
        campaign.remainder,
        blocks="fraction" not in campaign.holdout,
        within_range=True,
        seed=seed,
    )
    return validate_residual_model(diagnosis.final, diagnosis.case, held_out, plan)


def remove_gross_errors(
    diagnosis: Diagnosis, held_out: Case
) -> tuple[OutlierTest, Case, np.ndarray]:
    """Leave out the held-out rows that the final model does not explain, by the rule of
    the training rows.

    Returns
    -------
    OutlierTest
        Outcome of the test of all held-out rows.
    Case
        The case without its gross errors.
    ndarray
        (P,) of bool, poses of that case outside the range of the fitted ones.
    """
    final = diagnosis.final
    measurements = held_out.campaign.measurements
    kept = held_out
    outside = find_extrapolated_poses(final, diagnosis.case, held_out)
    outliers = OutlierTest.none(len(measurements), held_out.model.rows)
    if diagnosis.verdict.faults:
        return outliers, kept, outside
    fitted_uncertainty = estimate_prediction_uncertainty(
        final,
        get_noise(diagnosis.verdict.noise).without_pose_error,
        diagnosis.case.campaign.measurements,
    )
    is_extrapolated = outside[index_poses(measurements)]
    for _ in range(diagnosis.settings.gross_error_rounds):
        # Frames of another campaign are fitted to the rows that are kept.
        model, estimate = transfer_fit(final, diagnosis.case, kept)
        uncertainty = fitted_uncertainty
        if model is not final.model or estimate is not final.estimate:
            uncertainty = replace(uncertainty, parameter_covariance=None)
        previous = outliers.gross
        outliers = find_held_out_gross_errors(
            model, estimate, uncertainty, held_out, is_extrapolated, diagnosis.settings
        )
        if outliers.gross.any() and is_same_campaign(diagnosis.case, held_out):
            outliers = weigh_held_out_rows(
                replace(final, model=model, estimate=estimate),
                uncertainty.noise.without_pose_error,
                diagnosis.case,
                held_out,
                outliers,
                diagnosis.settings,
            )
        kept = held_out.select(~outliers.gross) if outliers.gross.any() else held_out
        is_unchanged = model is final.model and estimate is final.estimate
        if is_unchanged or (outliers.gross == previous).all():
            # Without frames of its own, another round would repeat this one.
            break
    poses = index_poses(kept.campaign.measurements)
    return outliers, kept, np.bincount(poses, is_extrapolated[~outliers.gross]) > 0


def compare_held_out_errors(
    steps: Sequence[Step],
    cases: tuple[Case, Case],
    outside: np.ndarray,
    measured_noise: Noise,
    seed: int,
) -> tuple[list[dict[str, Any]], HeldOut, list[str]]:
    """Compare the errors of all steps on training and held-out poses.

    Parameters
    ----------
    steps
        Models from the frames to the final one.
    cases
        Training poses, and held-out poses without gross errors.
    outside
        (P,) of bool, held-out poses outside the range of the fitted ones.
    measured_noise
        Noise that repeats show or the campaign states, which is the noise floor. What a
        model leaves beyond it is an error of the model, and no noise.
    seed
        Seed of the bootstrap over poses.

    Returns
    -------
    rows : list of dict
        Rows of before_after.csv.
    heldout : HeldOut
        Errors of the validation poses as they stand in the verdict.
    warnings : list of str
        Sentences.
    """
    held_out = cases[1]
    transferred, errors = _compute_step_errors(steps, *cases)
    declared = _find_declared(steps)
    stream = open_stream(seed, cases[0].campaign.name, "held-out poses", 0)
    intervals, reductions = compute_error_intervals(
        errors, _REPLICATES, stream, declared
    )
    _, (_, calibration) = compute_error_intervals(
        [errors[0], errors[-1]], _REPLICATES, stream
    )
    floor = compute_noise_floor(
        replace(steps[-1].fitted, noise=measured_noise),
        held_out.observations,
        *transferred[-1],
    )
    rows = [
        _tabulate_step(step, step_errors.distance, limits, floor)
        for step, step_errors, limits in zip(steps, errors, intervals, strict=True)
    ]
    by_range = summarize_errors_by_range(
        {"before": errors[0], "after": errors[-1]}, outside
    )
    after = _summarize(errors[-1])
    states = held_out.observations.states
    heldout = HeldOut(
        before=ErrorsBefore(
            **summarize_errors(errors[0].distance),
            reduction_ci95=(calibration.low, calibration.high),
        ),
        declared=_summarize(errors[declared]),
        after=after,
        noise_floor_rms_m=None if np.isnan(floor) else floor,
        reduction_ci95=(reductions[-1].low, reductions[-1].high),
        reduction_std_error=reductions[-1].std_error,
        poses=errors[0].poses,
        configurations=count_configurations(states),
        joint_ranges=find_joint_ranges(states, held_out.campaign.robot),
        share_below_max=bound_share_below_maximum(errors[0].poses),
        outside_range=from_document(ErrorsByRange, by_range, "errors by range"),
        with_gross_errors=None,
        delivered=after,
        in_camera=_summarize_in_camera(transferred, held_out),
        error=held_out.campaign.measuring.error,
    )
    return (
        rows,
        heldout,
        [
            *_warn_of_growth(heldout),
            *_warn_of_extrapolation(outside),
            *warn_of_repeated_poses(cases[0].observations.states, states),
        ],
    )


def _summarize_in_camera(
    transferred: Sequence[TransferredFit], held_out: Case
) -> BoardErrors | None:
    """Summarize errors of a board in the camera, of the first and the last model; None
    if what was measured is the target itself."""
    plan = held_out.campaign.measuring
    if plan.channels or not plan.kinds[0].is_converted:
        return None
    rms = []
    for model, estimate in (transferred[0], transferred[-1]):
        errors = compute_errors_as_read(model, estimate, held_out.observations, plan)
        squares = (errors**2).reshape(-1, 2, 3).sum(axis=2)
        rms.append(np.sqrt(squares.mean(axis=0)).tolist())
    (before_m, before_rad), (after_m, after_rad) = rms
    return BoardErrors(before_m, after_m, before_rad, after_rad)


def _tabulate_step(
    step: Step, distance: np.ndarray, intervals: Mapping[str, np.ndarray], floor: float
) -> dict[str, Any]:
    """Row of before_after.csv of one step, by its held-out errors (M,), their intervals
    and the RMS error of the noise alone, m."""
    training = summarize_errors(np.linalg.norm(step.fitted.residual[:, :3], axis=1))
    held_out = summarize_errors(distance)
    row: dict[str, Any] = {
        "step": step.name,
        "kind": step.kind,
        "parameters": round(count_effective_parameters(step.fitted)),
    }
    row |= {f"train_{name}": training[name] for name in METRICS}
    for name in METRICS:
        row[f"heldout_{name}"] = held_out[name]
        row[f"heldout_{name}_low"], row[f"heldout_{name}_high"] = intervals[name]
    for name in METRICS:
        row[f"heldout_{name.removesuffix('_m')}_over_floor"] = held_out[name] / floor
    return row


def _warn_of_growth(heldout: HeldOut) -> list[str]:
    warnings = []
    for name in METRICS:
        declared_mm = 1e3 * getattr(heldout.declared, name)
        after_mm = 1e3 * getattr(heldout.after, name)
        if after_mm > declared_mm:
            warnings.append(
                f"the {_METRIC_NAMES[name]} of the validation poses grew from"
                f" {declared_mm:.3f} to {after_mm:.3f} mm"
            )
    return warnings


def _warn_of_extrapolation(outside: np.ndarray) -> list[str]:
    count = int(outside.sum())
    if not count:
        return []
    poses = format_count(len(outside), "validation pose")
    verb = "lies" if count == 1 else "lie"
    return [
        f"{count} of {poses} {verb} outside the range of the fitted poses:"
        " errors there are extrapolated"
    ]


def _compute_step_errors(
    steps: Sequence[Step], case: Case, held_out: Case
) -> tuple[list[TransferredFit], list[PositionErrors]]:
    """Models of all steps, transferred to the held-out measurements, and their errors
    there."""
    transferred = [transfer_fit(step.fitted, case, held_out) for step in steps]
    errors = [
        compute_position_errors(model, estimate, held_out.observations)
        for model, estimate in transferred
    ]
    return transferred, errors


def _summarize(errors: PositionErrors) -> ErrorSummary:
    return ErrorSummary(**summarize_errors(errors.distance))


def _find_declared(steps: Sequence[Step]) -> int:
    return [step.kind for step in steps].index("declared")


def generate_residual_blocks(
    diagnosis: Diagnosis, judgement: Judgement
) -> Iterator[dict[str, np.ndarray]]:
    """Generate blocks of the residuals table: every measurement with its residuals
    before and after calibration, gross errors after the others."""
    no_poses = np.zeros(diagnosis.case.observations.cluster.max() + 1, bool)
    for case, outside, left_out, is_held_out in (
        (diagnosis.case, no_poses, diagnosis.left_out, False),
        (judgement.held_out, judgement.outside, judgement.left_out, True),
    ):
        stages = {
            "before": transfer_fit(diagnosis.nominal, diagnosis.case, case),
            "after": transfer_fit(diagnosis.final, diagnosis.case, case),
        }
        measurements = case.campaign.measurements
        yield _tabulate_stages(
            measurements,
            outside[index_poses(measurements)],
            stages,
            held_out=is_held_out,
            gross_errors=False,
        )
        if len(left_out):
            yield _tabulate_stages(
                left_out,
                np.zeros(len(left_out), bool),
                stages,
                held_out=is_held_out,
                gross_errors=True,
            )


def _tabulate_stages(
    measurements: Measurements,
    outside: np.ndarray,
    stages: Mapping[str, TransferredFit],
    *,
    held_out: bool,
    gross_errors: bool,
) -> dict[str, np.ndarray]:
    """Columns of the residuals table; arguments as of `tabulate_residuals`, with the
    model of each stage."""
    observations = separate_measurements(measurements)
    residuals = {}
    for stage, (model, estimate) in stages.items():
        conditions = evaluate_conditions(model, estimate, observations.states)
        residuals[stage] = compute_residual_vectors(
            model, estimate, observations, conditions
        )
    model, estimate = stages["after"]
    if model.measuring is None:
        position, _ = transform_to_base(estimate, observations)
    else:
        # Measurements of other kinds are no positions, so state where the target was.
        conditions = evaluate_conditions(model, estimate, observations.states)
        position, _ = predict(model, estimate, observations, conditions)
    return tabulate_residuals(
        measurements,
        outside,
        position,
        residuals,
        held_out=held_out,
        gross_errors=gross_errors,
    )
