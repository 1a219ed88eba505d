"""A campaign's folder to its verdict in one call: what the blind proof, benchmarks and
notebooks use. The pipeline makes the same two calls, with tables between them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from elastocal.application.accuracy import (
    compute_uncorrected_rms_m,
    inflate_to_held_out_errors,
    predict_campaign_accuracy,
    select_campaign_commands,
)
from elastocal.application.calibrated import compute_effect_contributions
from elastocal.application.scope import (
    build_residual_model,
    calibrate_on_case,
    set_form_error,
)
from elastocal.campaigns.campaign import tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import generate_residual_blocks, judge
from elastocal.diagnosis.misplaced import find_misplaced_frames
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.model import Case, build_case
from elastocal.io.json_files import read_json
from elastocal.io.origin import describe_provenance
from elastocal.io.storage import write_table
from elastocal.loop import diagnosis_tables as tables
from elastocal.loop.loading import load_campaign
from elastocal.loop.schemas import residuals
from elastocal.validation.held_out import compute_position_residuals
from elastocal.validation.transfer import transfer_fit
from elastocal.verdict import PredictedErrors, write_verdict

if TYPE_CHECKING:
    from pathlib import Path

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.diagnosis.judge import Judgement
    from elastocal.residual_model.selection import CorrectedResiduals


def judge_campaign(job: Any) -> None:
    """The step of a rule: the verdict, every model on poses that no step has seen."""
    # Who asks for the verdict alone starts without pandas.
    import pandas as pd

    from elastocal.io.data_frames import write_csv

    case = tables.load_case(job.input.descriptions, job.input.training)
    held_out = tables.load_case(job.input.descriptions, job.input.held_out, "held_out")
    found = tables.diagnosis_from(case, read_json(job.input.diagnosis))
    verdict = judged(found, held_out, job.params.seed)
    write_verdict(job.output.verdict, verdict.verdict)
    write_csv(job.output.before_after, pd.DataFrame(verdict.rows))
    schema = residuals(case.campaign.robot.joints)
    write_table(
        job.output.residuals,
        schema,
        generate_residual_blocks(found, verdict),
        describe_provenance(job.params, **job.wildcards),
    )


def cases_in(folder: str | Path, robots_folder: str | Path) -> tuple[Case, Case]:
    """Training and held-out cases of a campaign's folder.

    `folder`, `robots_folder`: as in `read_campaign_folder`.
    """
    descriptions, training, held_out = load_campaign(
        read_campaign_folder(folder, robots_folder)
    )
    return (
        build_case(descriptions, tabulate_measurements(training)),
        build_case(
            descriptions["held_out"] or descriptions, tabulate_measurements(held_out)
        ),
    )


def diagnosed(
    folder: str | Path,
    robots_folder: str | Path,
    seed: int,
    settings: Settings | None = None,
) -> dict[str, Any]:
    """Diagnose a campaign and judge it on its held-out poses.

    `folder`, `robots_folder`: as in `read_campaign_folder`. Returns as verdict.json.
    """
    training, held_out = cases_in(folder, robots_folder)
    return judged(
        diagnose(training, settings or Settings(), seed), held_out, seed
    ).document


def calibrated_by(
    diagnosis: Diagnosis,
    held_out: Case,
    delivered: CorrectedResiduals | None,
    *,
    physics_only: bool = False,
) -> CalibratedRobot:
    """Return the robot of a diagnosis, with errors as large as validation poses show.

    Parameters
    ----------
    diagnosis : Diagnosis
        Result of the training poses.
    held_out : Case
        Validation poses without gross errors.
    delivered : Corrected or None
        Result of `judge.apply_regression`.
    physics_only : bool
        Whether to leave out the regression. The residual of the final model is then
        still known not to be noise.
    """
    case = diagnosis.case
    final = diagnosis.final
    residual = compute_position_residuals(
        *transfer_fit(final, case, held_out), held_out.observations
    )
    noise_m = final.noise.position_m
    regression = None
    if delivered is not None and delivered.predictor is not None:
        noise_m = diagnosis.verdict.noise.position_m
        if not physics_only:
            residual = delivered.residual
            regression = build_residual_model(
                case,
                final.estimate,
                delivered.predictor,
                delivered.chosen["spread"]["typical"],
                noise_m,
            )
    robot = calibrate_on_case(
        case, final.model, final.estimate, final.covariance, final.noise, regression
    )
    robot = set_form_error(robot, diagnosis.verdict.other_models_m or 0.0)
    return inflate_to_held_out_errors(robot, held_out, residual, noise_m)


def judged(diagnosis: Diagnosis, held_out: Case, seed: int) -> Judgement:
    """The verdict of a diagnosis on held-out poses, with the accuracy of the corrected
    robot and the cost of each effect.

    ``accuracy`` and ``uncorrected_m``, the RMS error without a correction at the same
    poses, are predicted; ``cost_m`` of an effect is the RMS error over the campaign's
    poses and loads if it alone were left out of the correction. All are None where the
    data are at fault, the cost also of an effect that is in no command. ``misplaced``:
    what was declared wrongly, see there. ``physics``: accuracy and ``uncorrected_m`` of
    a robot that is corrected without the regression on the remainder; None where there
    is none.
    """
    judgement = judge(diagnosis, held_out, seed)
    verdict = judgement.verdict
    if verdict.faults:
        return judgement
    robot = calibrated_by(diagnosis, judgement.held_out, judgement.delivered)
    physics = None
    if robot.residual_model is not None:
        physics_robot = calibrated_by(
            diagnosis, judgement.held_out, judgement.delivered, physics_only=True
        )
        physics = _predict_errors(physics_robot)
    contributions = compute_effect_contributions(
        replace(robot, residual_model=None), *select_campaign_commands(robot)
    )
    predicted = _predict_errors(robot)
    misplaced = find_misplaced_frames(diagnosis.final, diagnosis.case.campaign)
    return replace(
        judgement,
        verdict=replace(
            verdict,
            effects=tuple(
                replace(effect, cost_m=contributions.get(effect.name))
                for effect in verdict.missing_effects
            ),
            accuracy=predicted.accuracy,
            uncorrected_m=predicted.uncorrected_m,
            physics=physics,
            misplaced=tuple(misplaced),
        ),
    )


def _predict_errors(robot: CalibratedRobot) -> PredictedErrors:
    """Predict the accuracy of a corrected robot, and in the same frame the RMS error of
    the uncorrected one at the same poses."""
    return PredictedErrors(
        predict_campaign_accuracy(robot),
        compute_uncorrected_rms_m(robot, *select_campaign_commands(robot)),
    )
