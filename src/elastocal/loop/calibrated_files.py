"""The calibrated robot of a campaign that was diagnosed, from the tables of its diagnosis, without a fit of its model."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.application.accuracy import calibrate_on_case, regression_on, set_form
from elastocal.campaigns.reading import campaign_files, read_descriptions
from elastocal.errors import InputError
from elastocal.fitting.noise import noise_from
from elastocal.io.json_files import read_json
from elastocal.io.origin import configuration_sha256
from elastocal.io.records import check_sources, checksum, jobs_behind
from elastocal.io.storage import read_table
from elastocal.loop.diagnosis_tables import covariance_from, final_parameters, load_case, rows_left_out, step_model
from elastocal.loop.schemas import CORRELATIONS, STEPS
from elastocal.remainder.corrected import fitted_again
from elastocal.remainder.tuning import Spread

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import Any

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.fitting.model import Case
    from elastocal.io.records import JobRecord

# Of results/loop/<campaign>/ and of reports/loop/<campaign>/, whose last file has all others behind it.
DESCRIPTIONS, TRAINING, DIAGNOSIS = "campaign.json", "training.parquet", "diagnosis.json"
STEPS_TABLE, CORRELATIONS_TABLE = "steps.parquet", "correlations.parquet"
VERDICT, REPORT = "verdict.json", "report.html"


@dataclass(frozen=True)
class Diagnosed:
    """A campaign and what its diagnosis found.

    `name`: of the campaign. `case`: of the training poses, without their gross errors. `calibrated`: by the final model, its
    errors as large as verdict.json says after a look at held-out poses. `verdict`: verdict.json; of physics alone, where that
    was asked for, as if there were no regression. `origin`: ``commit`` of the jobs that made it, ``code_sha256`` and
    ``data_sha256`` of all that they read of the program and of the campaign, ``environment``.
    """

    name: str
    case: Case
    calibrated: CalibratedRobot
    verdict: dict[str, Any]
    origin: dict[str, Any]


def load_diagnosed(folder: str | Path, robots_folder: str | Path, top: str | Path, physics_only: bool = False) -> Diagnosed:
    """A campaign that was diagnosed, of which nothing has changed since, in the folder that holds results/ and reports/.

    An InputError refuses what is not as `jobs_behind` asks of all jobs behind its report or `check_sources` of those behind its
    verdict, and other files of the campaign than were read. `physics_only`: without the regression on the remainder.
    """
    name = read_descriptions(folder, robots_folder)[0]["campaign"]
    results, reports = f"results/loop/{name}", f"reports/loop/{name}"
    fresh = f"elastocal diagnose {folder}"
    if not Path(top, reports, VERDICT).exists() and not Path(top, results, DIAGNOSIS).exists():
        raise InputError(folder, "", f"no diagnosis of it in {Path(top, results)}", fresh)
    jobs_behind([f"{reports}/{REPORT}"], top)
    jobs = jobs_behind([f"{reports}/{VERDICT}"], top)
    check_sources(jobs, top, f"results of this version: {fresh}")
    data = _data_of(jobs, results)
    now = {(Path(file).name, checksum(file)) for file in campaign_files(folder, robots_folder)}
    if not data <= now <= {(Path(file).name, digest) for job in jobs for file, digest in job.inputs.items()}:
        raise InputError(folder, "", "changes since its diagnosis", f"a campaign as it was diagnosed: {fresh}")
    tables, stated = Path(top, results), Path(top, reports)
    facts, steps = read_json(tables / DIAGNOSIS), read_table(tables / STEPS_TABLE, STEPS)
    verdict = read_json(stated / VERDICT)
    if physics_only:
        verdict |= {"remainder": None, "heldout": verdict["heldout"] | {"delivered": verdict["heldout"]["after"]}}
        verdict |= verdict["physics"] or {}
    case = load_case(tables / DESCRIPTIONS, tables / TRAINING)
    case = case.select(~rows_left_out(case, facts))
    last = len(facts["steps"]) - 1
    model, estimate = step_model(case, facts, steps, last)
    covariance = covariance_from(final_parameters(facts, steps), read_table(tables / CORRELATIONS_TABLE, CORRELATIONS))
    noise = noise_from({"noise": facts["steps"][last]["noise"]})
    more, again = None, verdict["remainder"]
    if again and again["regression"]:
        predictor, spread = fitted_again(again, model, estimate, case.observations), Spread(**again["spread"])
        more = regression_on(case, estimate, predictor, spread, verdict["noise"]["position_m"])
    calibrated = calibrate_on_case(case, model, estimate, covariance, noise, more)
    accuracy = verdict["accuracy"]
    contradicted = bool(accuracy and accuracy["contradicted"])
    form = accuracy["form_m"] if contradicted else facts["document"].get("other_models_m") or 0.0
    origin = {
        "commit": _listed(job.origin.commit for job in jobs),
        "code_sha256": configuration_sha256({file: digest for job in jobs for file, digest in job.sources.items()}),
        "data_sha256": configuration_sha256(sorted(data)),
        "environment": {name: _listed(job.environment.get(name, "none") for job in jobs) for name in jobs[-1].environment},
    }
    return Diagnosed(name, case, set_form(calibrated, form, contradicted), verdict, origin)


def _data_of(jobs: Sequence[JobRecord], results: str) -> set[tuple[str, str]]:
    """Names and SHA-256 of the campaign's files as step 1 read them: the user's, which may have moved, or its folder's."""
    job = next(job for job in jobs if f"{results}/{DESCRIPTIONS}" in job.outputs)
    folder = Path(next(iter(job.inputs))).parent
    files = job.own or [file for file in job.inputs if Path(file).parent == folder]
    return {(Path(file).name, job.inputs[file]) for file in files}


def _listed(values: Iterable[str]) -> str:
    return ", ".join(sorted(set(values)))
