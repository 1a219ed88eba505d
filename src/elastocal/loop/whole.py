"""A campaign's folder to its verdict in one call: what the blind proof, benchmarks and
notebooks use. The pipeline makes the same two calls, with tables between them."""

from __future__ import annotations

from dataclasses import asdict, replace
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
from elastocal.data_checks.protocol import data_at_fault
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import generate_residual_blocks, judge
from elastocal.diagnosis.misplaced import find_misplaced_frames
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.model import Case, build_case
from elastocal.io.json_files import read_json, write_json
from elastocal.io.origin import describe_provenance
from elastocal.io.storage import write_table
from elastocal.loop import diagnosis_tables as tables
from elastocal.loop.loading import load_campaign
from elastocal.loop.schemas import residuals
from elastocal.validation.held_out import compute_position_residuals
from elastocal.validation.transfer import transfer_fit

if TYPE_CHECKING:
    from pathlib import Path

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.diagnosis.judge import Judgement
    from elastocal.remainder.corrected import Corrected


def judge_campaign(job: Any) -> None:
    """The step of a rule: the verdict, every model on poses that no step has seen."""
    # Who asks for the verdict alone starts without pandas.
    import pandas as pd

    from elastocal.io.data_frames import write_csv

    case = tables.load_case(job.input.descriptions, job.input.training)
    held_out = tables.load_case(job.input.descriptions, job.input.held_out, "held_out")
    found = tables.diagnosis_from(case, read_json(job.input.diagnosis))
    verdict = judged(found, held_out, job.params.seed)
    write_json(job.output.verdict, verdict.document, allow_nan=False)
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
    delivered: Corrected | None,
    physics_only: bool = False,
) -> CalibratedRobot:
    """The robot that a diagnosis found, with all that is known of its errors: held-out
    rows without gross ones judge it.

    `delivered`: of `judge.apply_regression`. `physics_only`: corrected without its
    regression; where there is one, what the final model leaves is known to be no noise.
    """
    case = diagnosis.case
    final = diagnosis.final
    residual = compute_position_residuals(
        *transfer_fit(final, case, held_out), held_out.observations
    )
    noise_m = final.noise.position_m
    more = None
    if delivered is not None and delivered.predictor is not None:
        noise_m = diagnosis.document["noise"]["position_m"]
        if not physics_only:
            residual = delivered.residual
            more = build_residual_model(
                case,
                final.estimate,
                delivered.predictor,
                delivered.chosen["spread"]["typical"],
                noise_m,
            )
    found = calibrate_on_case(
        case, final.model, final.estimate, final.covariance, final.noise, more
    )
    found = set_form_error(found, diagnosis.document["other_models_m"] or 0.0)
    return inflate_to_held_out_errors(found, held_out, residual, noise_m)


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
    verdict = judge(diagnosis, held_out, seed)
    costs = dict[str, float]()
    stated: dict[str, Any] = {
        "accuracy": None,
        "uncorrected_m": None,
        "physics": None,
        "misplaced": [],
    }
    if not data_at_fault(verdict.document):
        found = calibrated_by(diagnosis, verdict.held_out, verdict.delivered)
        stated |= _accuracy(found) | {
            "misplaced": [
                asdict(frame)
                for frame in find_misplaced_frames(
                    diagnosis.final, diagnosis.case.campaign
                )
            ]
        }
        if found.residual_model is not None:
            stated["physics"] = _accuracy(
                calibrated_by(
                    diagnosis, verdict.held_out, verdict.delivered, physics_only=True
                )
            )
        costs = compute_effect_contributions(
            replace(found, residual_model=None), *select_campaign_commands(found)
        )
    effects = [
        effect | {"cost_m": costs.get(effect["name"])}
        for effect in verdict.document["effects"]
    ]
    return replace(verdict, document=verdict.document | stated | {"effects": effects})


def _accuracy(found: CalibratedRobot) -> dict[str, Any]:
    """Predicted accuracy of a corrected robot, and in the same frame the RMS error of
    the uncorrected one at the same poses."""
    return {
        "accuracy": asdict(predict_campaign_accuracy(found)),
        "uncorrected_m": compute_uncorrected_rms_m(
            found, *select_campaign_commands(found)
        ),
    }
