"""A campaign's folder to its verdict in one call: what the blind proof, benchmarks and notebooks use. The pipeline makes the
same two calls, with tables between them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from elastocal.application.accuracy import calibrate_on_case, campaign_accuracy, campaign_poses, judge_by_held_out, set_form
from elastocal.application.certificate import effect_costs
from elastocal.campaigns.columns import columns_of
from elastocal.data_checks.protocol import data_at_fault
from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import judge
from elastocal.diagnosis.misplaced import misplaced
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
    found = calibrate_on_case(case, final.model, final.estimate, final.covariance, final.noise)
    found = set_form(found, diagnosis.document["other_models_m"] or 0.0)
    return judge_by_held_out(found, final, case, held_out)


def judged(diagnosis: Diagnosis, held_out: Case, seed: int) -> Verdict:
    """The verdict of a diagnosis on held-out poses, with the accuracy of the corrected robot and the cost of each effect.

    ``accuracy`` is predicted, ``cost_m`` of an effect is the RMS error over the campaign's poses and loads if it alone were
    left out of the correction. Both are None where the data are at fault, the cost also of an effect that is not in the final
    model or moves no robot. ``misplaced``: what was declared wrongly, see there.
    """
    verdict, case = judge(diagnosis, held_out, seed), diagnosis.case
    accuracy, costs = None, dict[str, float]()
    wrong: list[dict[str, Any]] = []
    if not data_at_fault(verdict.document):
        found = calibrated_by(diagnosis, verdict.held_out)
        accuracy = campaign_accuracy(found).document()
        costs = effect_costs(found, *campaign_poses(found))
        wrong = misplaced(diagnosis.final, case.campaign)
    effects = [effect | {"cost_m": costs.get(effect["name"])} for effect in verdict.document["effects"]]
    return replace(verdict, document=verdict.document | {"accuracy": accuracy, "effects": effects, "misplaced": wrong})
