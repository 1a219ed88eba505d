"""A campaign's folder to its verdict in one call: what the blind proof, benchmarks and notebooks use. The pipeline makes the
same two calls, with tables between them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from elastocal.application.scope import calibrated_on, campaign_accuracy, judged_by_held_out, with_form
from elastocal.campaigns.columns import columns_of
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.case import Case, case_from
from elastocal.loop.loading import load_campaign

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.diagnosis.diagnose import Diagnosis
    from elastocal.diagnosis.judge import Verdict


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
    found = calibrated_on(case, final.model, final.estimate, final.covariance, final.noise)
    found = with_form(found, diagnosis.document["other_models_m"] or 0.0)
    return judged_by_held_out(found, final, case, held_out)


def judged(diagnosis: Diagnosis, held_out: Case, seed: int) -> Verdict:
    """The verdict of a diagnosis on held-out poses, with the accuracy that a corrected robot is predicted to have.

    None where the data are at fault: nothing is known of the robot then.
    """
    verdict, case = judge(diagnosis, held_out, seed), diagnosis.case
    accuracy = None
    if not any(effect["family"] == "data" for effect in verdict.document["effects"]):
        accuracy = campaign_accuracy(calibrated_by(diagnosis, verdict.held_out), case.observations.states).document()
    return replace(verdict, document=verdict.document | {"accuracy": accuracy})
