"""The calibrated robot of a campaign that was diagnosed, from the files of its diagnosis, without a fit of its model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.accuracy import calibrate_on_case, regression_on, set_form
from elastocal.campaigns.reading import campaign_files, read_descriptions
from elastocal.errors import InputError
from elastocal.fitting.case import noise_from
from elastocal.io.json_files import read_json
from elastocal.io.origin import configuration_sha256
from elastocal.io.records import check_sources, checksum, jobs_behind
from elastocal.io.storage import read_table
from elastocal.loop.diagnosis_tables import load_case, rows_left_out, step_model
from elastocal.loop.schemas import STEPS
from elastocal.remainder.corrected import fitted_again
from elastocal.remainder.tuning import Spread

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import Any

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.fitting.case import Case
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.io.records import JobRecord


@dataclass(frozen=True)
class Diagnosed:
    """A campaign and what its diagnosis found.

    `name`: of the campaign. `case`: of the training poses, without their gross errors. `model`, `estimate`, `covariance`,
    `noise`: the final ones. `form_m`: what other models leave open. `verdict`: verdict.json. `origin`: ``commit`` of the jobs
    that made it, ``code_sha256`` and ``data_sha256`` of all that they read of the program and of the campaign, ``environment``.
    """

    name: str
    case: Case
    model: Model
    estimate: Estimate
    covariance: np.ndarray
    noise: Noise
    form_m: float
    verdict: dict[str, Any]
    origin: dict[str, Any]

    @cached_property
    def calibrated(self) -> CalibratedRobot:
        """By the final model, its errors as large as the verdict says after a look at held-out poses."""
        more, again, accuracy = None, self.verdict["remainder"], self.verdict["accuracy"]
        if again and again["regression"]:
            predictor = fitted_again(again, self.model, self.estimate, self.case.observations)
            noise_m = self.verdict["noise"]["position_m"]
            more = regression_on(self.case, self.estimate, predictor, Spread(**again["spread"]), noise_m)
        found = calibrate_on_case(self.case, self.model, self.estimate, self.covariance, self.noise, more)
        contradicted = bool(accuracy and accuracy["contradicted"])
        return set_form(found, accuracy["form_m"] if contradicted else self.form_m, contradicted)

    def by_physics(self) -> Diagnosed:
        """The same without the regression on the remainder, as if there were none."""
        heldout = self.verdict["heldout"] | {"delivered": self.verdict["heldout"]["after"]}
        alone = {"remainder": None, "heldout": heldout} | (self.verdict["physics"] or {})
        return replace(self, verdict=self.verdict | alone)


def load_diagnosed(folder: str | Path, robots_folder: str | Path, top: str | Path) -> Diagnosed:
    """A campaign that was diagnosed, of which nothing has changed since, in the folder that holds results/ and reports/.

    An InputError refuses what is not as `jobs_behind` asks of all jobs behind its report or `check_sources` of those behind its
    verdict, and other files of the campaign than were read.
    """
    name = read_descriptions(folder, robots_folder)[0]["campaign"]
    results, reports = f"results/loop/{name}", f"reports/loop/{name}"
    tables, verdict, fresh = Path(top, results), Path(top, reports, "verdict.json"), f"elastocal diagnose {folder}"
    if not verdict.exists() and not (tables / "diagnosis.json").exists():
        raise InputError(folder, "", f"no diagnosis of it in {tables}", fresh)
    # The report has all other files behind it.
    jobs_behind([f"{reports}/report.html"], top)
    jobs = jobs_behind([f"{reports}/verdict.json"], top)
    check_sources(jobs, top, f"results of this version: {fresh}")
    data = _data_of(jobs, f"{results}/campaign.json")
    now = {(Path(file).name, checksum(file)) for file in campaign_files(folder, robots_folder)}
    if not data <= now <= {(Path(file).name, digest) for job in jobs for file, digest in job.inputs.items()}:
        raise InputError(folder, "", "changes since its diagnosis", f"a campaign as it was diagnosed: {fresh}")
    facts, steps = read_json(tables / "diagnosis.json"), read_table(tables / "steps.parquet", STEPS)
    case = load_case(tables / "campaign.json", tables / "training.parquet")
    case = case.select(~rows_left_out(case, facts))
    model, estimate = step_model(case, facts, steps, len(facts["steps"]) - 1)
    origin = {
        "commit": _listed(job.origin.commit for job in jobs),
        "code_sha256": configuration_sha256({file: digest for job in jobs for file, digest in job.sources.items()}),
        "data_sha256": configuration_sha256(sorted(data)),
        "environment": {name: _listed(job.environment.get(name, "none") for job in jobs) for name in jobs[-1].environment},
    }
    noise, form_m = noise_from({"noise": facts["steps"][-1]["noise"]}), facts["document"].get("other_models_m") or 0.0
    return Diagnosed(name, case, model, estimate, np.array(facts["covariance"]), noise, form_m, read_json(verdict), origin)


def _data_of(jobs: Sequence[JobRecord], first: str) -> set[tuple[str, str]]:
    """Names and SHA-256 of the campaign's files as step 1 read them: the user's, which may have moved, or its folder's."""
    job = next(job for job in jobs if first in job.outputs)
    folder = Path(next(iter(job.inputs))).parent
    files = job.own or [file for file in job.inputs if Path(file).parent == folder]
    return {(Path(file).name, job.inputs[file]) for file in files}


def _listed(values: Iterable[str]) -> str:
    return ", ".join(sorted(set(values)))
