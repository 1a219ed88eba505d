"""From a campaign's folder to its verdict in one call, for the blind benchmark, benchmarks
and notebooks. The pipeline makes the same two calls with tables between them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from elastocal.application.accuracy import (
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
from elastocal.fitting.cases import build_case
from elastocal.fitting.model import Case
from elastocal.fitting.noise import get_noise
from elastocal.fitting.sensor_noise import compute_target_std_m
from elastocal.io.json_files import read_json
from elastocal.io.origin import describe_provenance
from elastocal.io.storage import write_table
from elastocal.loop.diagnosis_tables import load_case, restore_diagnosis
from elastocal.loop.loading import load_campaign
from elastocal.loop.schemas import RESIDUALS
from elastocal.validation.held_out import compute_position_residuals
from elastocal.validation.transfer import transfer_fit
from elastocal.verdict import write_verdict

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.diagnosis.judge import Judgement
    from elastocal.residual_model.selection import CorrectedResiduals


def judge_campaign(job: Any) -> None:
    """Judge every model on the validation poses and write the verdict. Called by a rule
    of the workflow."""
    # Import pandas only here, because a diagnosis in one call does not need it.
    import pandas as pd

    from elastocal.io.data_frames import write_csv

    case = load_case(job.input.descriptions, job.input.training)
    held_out = load_case(job.input.descriptions, job.input.held_out, "held_out")
    diagnosis = restore_diagnosis(case, read_json(job.input.diagnosis))
    judgement = judge_and_predict(diagnosis, held_out, job.params.seed)
    write_verdict(job.output.verdict, judgement.verdict)
    write_csv(job.output.before_after, pd.DataFrame(judgement.rows))
    write_table(
        job.output.residuals,
        RESIDUALS.for_joints(case.campaign.robot.joints),
        generate_residual_blocks(diagnosis, judgement),
        describe_provenance(job.params, **job.wildcards),
    )


def read_cases(folder: str | Path, robots_folder: str | Path) -> tuple[Case, Case]:
    """Read the training case and the held-out case of a campaign's folder.

    Parameters
    ----------
    folder, robots_folder : str or path
        As in `read_campaign_folder`.
    """
    descriptions, training, held_out = load_campaign(
        read_campaign_folder(folder, robots_folder)
    )
    held_out_descriptions = descriptions["held_out"] or descriptions
    return (
        build_case(descriptions, tabulate_measurements(training)),
        build_case(held_out_descriptions, tabulate_measurements(held_out)),
    )


def diagnose_folder(
    folder: str | Path,
    robots_folder: str | Path,
    seed: int,
    settings: Settings | None = None,
) -> dict[str, Any]:
    """Diagnose a campaign and judge it on its held-out poses.

    Parameters
    ----------
    folder, robots_folder : str or path
        As in `read_campaign_folder`.
    seed : int
        Seed of all random streams.
    settings : Settings, optional
        Settings of the diagnosis.

    Returns
    -------
    dict
        Contents of verdict.json.
    """
    training, held_out = read_cases(folder, robots_folder)
    diagnosis = diagnose(training, settings or Settings(), seed)
    return judge_and_predict(diagnosis, held_out, seed).document


def build_calibrated_robot(
    diagnosis: Diagnosis, held_out: Case, delivered: CorrectedResiduals | None
) -> CalibratedRobot:
    """Return the robot of a diagnosis, with errors as large as validation poses show.

    Parameters
    ----------
    diagnosis : Diagnosis
        Result of the training poses.
    held_out : Case
        Validation poses without gross errors.
    delivered : CorrectedResiduals or None
        Result of `judge.apply_regression`.
    """
    case = diagnosis.case
    final = diagnosis.final
    residual, noise_m = _compute_held_out_residual(diagnosis, held_out)
    regression = None
    if delivered is not None and delivered.predictor is not None:
        residual = delivered.residual
        noise = get_noise(diagnosis.verdict.noise)
        regression = build_residual_model(
            case,
            final.estimate,
            delivered.predictor,
            delivered.choice,
            compute_target_std_m(final.model, final.estimate, case.observations, noise),
        )
    robot = calibrate_on_case(
        case, final.model, final.estimate, final.covariance, final.noise, regression
    )
    robot = set_form_error(robot, diagnosis.verdict.other_models_m or 0.0)
    return inflate_to_held_out_errors(robot, held_out, residual, noise_m)


def remove_regression(
    robot: CalibratedRobot, diagnosis: Diagnosis, held_out: Case
) -> CalibratedRobot:
    """Return the robot of `build_calibrated_robot` without its regression on the
    residuals, with errors as large as validation poses show for it.

    The residual of the final model is then known not to be noise. Its best placement
    stays the same: a regression moves the poses by too little to change it.
    """
    physics = replace(robot, residual_model=None)
    physics = set_form_error(physics, diagnosis.verdict.other_models_m or 0.0)
    return inflate_to_held_out_errors(
        physics, held_out, *_compute_held_out_residual(diagnosis, held_out)
    )


def _compute_held_out_residual(
    diagnosis: Diagnosis, held_out: Case
) -> tuple[np.ndarray, float]:
    """Residual (M, 3) of the final model at validation poses, and the tracker's standard
    deviation of a coordinate, both in m.

    What the model leaves beyond this noise counts as an error of the robot.
    """
    transferred = transfer_fit(diagnosis.final, diagnosis.case, held_out)
    observations = held_out.observations
    residual = compute_position_residuals(*transferred, observations)
    noise = get_noise(diagnosis.verdict.noise)
    return residual, compute_target_std_m(*transferred, observations, noise)


def judge_and_predict(diagnosis: Diagnosis, held_out: Case, seed: int) -> Judgement:
    """Judge a diagnosis on held-out poses, and predict the accuracy of the corrected
    robot.

    Adds to the verdict, unless the data have a fault: ``accuracy``; ``physics``, the same for
    a robot that is corrected without the residual regression, None if there is no
    regression; ``cost_m`` of each effect that a command contains, the RMS error over
    the campaign's poses and loads if this effect alone were left out of the
    correction; and ``misplaced`` frames.
    """
    judgement = judge(diagnosis, held_out, seed)
    verdict = judgement.verdict
    if verdict.faults:
        return judgement
    robot = build_calibrated_robot(diagnosis, judgement.held_out, judgement.delivered)
    physics = None
    if robot.residual_model is not None:
        physics = predict_campaign_accuracy(
            remove_regression(robot, diagnosis, judgement.held_out)
        )
    contributions = compute_effect_contributions(
        replace(robot, residual_model=None), *select_campaign_commands(robot)
    )
    effects = tuple(
        replace(effect, cost_m=contributions.get(effect.name))
        for effect in verdict.missing_effects
    )
    misplaced = find_misplaced_frames(diagnosis.final, diagnosis.case.campaign)
    verdict = replace(
        verdict,
        effects=effects,
        accuracy=predict_campaign_accuracy(robot),
        physics=physics,
        misplaced=tuple(misplaced),
    )
    return replace(judgement, verdict=verdict)
