"""A campaign's folder to its verdict in one call: what the blind proof, benchmarks and notebooks use. The pipeline makes the
same two calls, with tables between them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.application.accuracy import (
    before_m,
    calibrate_on_case,
    campaign_accuracy,
    campaign_poses,
    judge_by_held_out,
    set_form,
)
from elastocal.application.calibrated import forward, nominal_forward
from elastocal.application.certificate import effect_costs
from elastocal.campaigns.columns import columns_of
from elastocal.data_checks.protocol import data_at_fault
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import judge, residual_blocks, split_table
from elastocal.diagnosis.misplaced import misplaced
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.case import Case, case_from
from elastocal.io.json_files import read_json, write_json
from elastocal.io.provenance import provenance
from elastocal.io.storage import read_table, write_table
from elastocal.loop import diagnosis_tables as tables
from elastocal.loop.loading import load_campaign
from elastocal.loop.schemas import STEPS, residuals
from elastocal.mechanics.pose_differences import pose_differences

if TYPE_CHECKING:
    from pathlib import Path

    from elastocal.application.calibrated import CalibratedRobot, OperatingConditions
    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.diagnosis.judge import Verdict


def judge_campaign(job: Any) -> None:
    """The step of a rule: the verdict, every model on poses that no step has seen."""
    # Who asks for the verdict alone starts without pandas.
    import pandas as pd

    from elastocal.io.data_frames import write_csv

    case = tables.load_case(job.input.descriptions, job.input.training)
    held_out = tables.load_case(job.input.descriptions, job.input.held_out, "held_out")
    found = tables.diagnosis_from(case, read_json(job.input.diagnosis), read_table(job.input.steps, STEPS))
    verdict = judged(found, held_out, job.params.seed)
    write_json(job.output.verdict, verdict.document, allow_nan=False)
    write_csv(job.output.before_after, pd.DataFrame(verdict.rows))
    write_csv(job.output.splits, pd.DataFrame(split_table(found, verdict.held_out, job.params.seed)))
    schema = residuals(case.campaign.robot.joints)
    write_table(job.output.residuals, schema, residual_blocks(found, verdict), provenance(job.params, **job.wildcards))


def cases_in(folder: str | Path, robots_folder: str | Path) -> tuple[Case, Case]:
    """Training and held-out cases of a campaign's folder.

    `folder`, `robots_folder`: as in `reading.read_campaign`.
    """
    descriptions, training, held_out = load_campaign(folder, robots_folder)
    return (
        case_from(descriptions, columns_of(training)),
        case_from(descriptions["held_out"] or descriptions, columns_of(held_out)),
    )


def diagnosed(folder: str | Path, robots_folder: str | Path, seed: int, settings: Settings | None = None) -> dict[str, Any]:
    """Diagnose a campaign and judge it on its held-out poses.

    `folder`, `robots_folder`: as in `reading.read_campaign`. Returns as verdict.json.
    """
    training, held_out = cases_in(folder, robots_folder)
    return judged(diagnose(training, settings or Settings(), seed), held_out, seed).document


def calibrated_by(diagnosis: Diagnosis, held_out: Case) -> CalibratedRobot:
    """The robot that a diagnosis found, with all that is known of its errors: held-out rows without gross ones judge it."""
    case, final = diagnosis.case, diagnosis.final
    found = calibrate_on_case(case, final.model, final.estimate, final.covariance, final.noise)
    found = set_form(found, diagnosis.document["other_models_m"] or 0.0)
    return judge_by_held_out(found, final, case, held_out)


def judged(diagnosis: Diagnosis, held_out: Case, seed: int) -> Verdict:
    """The verdict of a diagnosis on held-out poses, with the accuracy of the corrected robot and the cost of each effect.

    ``accuracy`` and ``uncorrected_m``, the RMS error without a correction at the same poses, are predicted; ``cost_m`` of an
    effect is the RMS error over the campaign's poses and loads if it alone were left out of the correction. All are None where
    the data are at fault, the cost also of an effect that is not in the final model or moves no robot. ``misplaced``: what was
    declared wrongly, see there.
    """
    verdict, case = judge(diagnosis, held_out, seed), diagnosis.case
    accuracy, uncorrected, costs = None, None, dict[str, float]()
    wrong: list[dict[str, Any]] = []
    if not data_at_fault(verdict.document):
        found = calibrated_by(diagnosis, verdict.held_out)
        accuracy = campaign_accuracy(found).document()
        uncorrected = _uncorrected_m(found, *campaign_poses(found))
        costs = effect_costs(found, *campaign_poses(found))
        wrong = misplaced(diagnosis.final, case.campaign)
    effects = [effect | {"cost_m": costs.get(effect["name"])} for effect in verdict.document["effects"]]
    stated = {"accuracy": accuracy, "uncorrected_m": uncorrected, "effects": effects, "misplaced": wrong}
    return replace(verdict, document=verdict.document | stated)


def _uncorrected_m(found: CalibratedRobot, reported_angles: np.ndarray, operating: OperatingConditions) -> float:
    """RMS error of the uncorrected robot at some commands, in the frame of its accuracy."""
    position, rotation = forward(found, reported_angles, operating)
    off = pose_differences(*nominal_forward(found.robot, reported_angles), position, rotation)
    return float(np.sqrt((before_m(found, position, rotation, off) ** 2).mean()))
