"""A campaign that was diagnosed, from the files of its diagnosis: its calibrated robot,
without a fit of its model, and the contents of its certificate, how good the robot is,
against what, and how sure that is."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from datetime import date
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal import __version__
from elastocal.application.accuracy import (
    REGION,
    compute_uncorrected_rms_m,
    predict_errors,
    select_campaign_commands,
)
from elastocal.application.calibrated import compute_effect_contributions
from elastocal.application.frames import root_mean_square
from elastocal.application.scope import (
    build_residual_model,
    calibrate_on_case,
    set_form_error,
)
from elastocal.application.statements import tabulate_errors
from elastocal.campaigns.campaign_folder import CampaignFolder, read_campaign_folder
from elastocal.diagnosis.misplaced import describe_reference_point
from elastocal.errors import InputError
from elastocal.fitting.noise import parse_noise
from elastocal.io.json_files import read_json
from elastocal.io.origin import configuration_sha256
from elastocal.io.records import check_sources, trace_jobs
from elastocal.loop.diagnosis_tables import load_case, rows_left_out, step_model
from elastocal.remainder.corrected import predictor_of
from elastocal.validation.conformity import (
    PASS,
    UNDECIDED,
    decide_conformity,
    find_joint_ranges,
    list_shortfalls,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.fitting.model import Case


@dataclass(frozen=True)
class Diagnosed:
    """A campaign and what its diagnosis found.

    `folder`: of the campaign. `case`: of the training poses, without their gross errors.
    `facts`, `verdict`: contents of diagnosis.json and verdict.json. `origin`:
    ``commit`` of the jobs that made them, ``code_sha256`` and ``data_sha256`` of all
    that they read of the program and of the campaign, ``environment``.
    """

    folder: CampaignFolder
    case: Case
    facts: dict[str, Any]
    verdict: dict[str, Any]
    origin: dict[str, Any]

    @property
    def name(self) -> str:
        """Name of the campaign."""
        return self.folder.name

    @cached_property
    def calibrated(self) -> CalibratedRobot:
        """By the final model, its errors as large as the verdict says after a look at
        held-out poses."""
        step = self.facts["steps"][-1]
        again = self.verdict["remainder"]
        accuracy = self.verdict["accuracy"]
        model, estimate = step_model(self.case, step)
        more = None
        if again and again["regression"]:
            predictor = predictor_of(again, model, estimate, self.case.observations)
            noise_m = self.verdict["noise"]["position_m"]
            more = build_residual_model(
                self.case, estimate, predictor, again["spread"]["typical"], noise_m
            )
        found = calibrate_on_case(
            self.case,
            model,
            estimate,
            np.array(self.facts["covariance"]),
            parse_noise(step),
            more,
        )
        contradicted = bool(accuracy and accuracy["contradicted"])
        form_m = (
            accuracy["form_m"]
            if contradicted
            else self.facts["document"].get("other_models_m") or 0.0
        )
        return set_form_error(found, form_m, contradicted=contradicted)

    def by_physics(self) -> Diagnosed:
        """The same without the regression on the remainder, as if there were none."""
        heldout = self.verdict["heldout"] | {
            "delivered": self.verdict["heldout"]["after"]
        }
        alone = {"remainder": None, "heldout": heldout} | (
            self.verdict["physics"] or {}
        )
        return replace(self, verdict=self.verdict | alone)


def load_diagnosed(
    folder: str | Path, robots_folder: str | Path, top: str | Path
) -> Diagnosed:
    """A campaign that was diagnosed, of which nothing has changed since, in the folder
    that holds results/ and reports/.

    An InputError refuses what is not as `trace_jobs` asks of all jobs behind its
    report or `check_sources` of those behind its verdict, and other files of the
    campaign than were read.
    """
    campaign_folder = read_campaign_folder(folder, robots_folder)
    name = campaign_folder.name
    results = f"results/loop/{name}"
    reports = f"reports/loop/{name}"
    tables = Path(top, results)
    verdict = Path(top, reports, "verdict.json")
    fresh = f"elastocal diagnose {folder}"
    if not verdict.exists() and not (tables / "diagnosis.json").exists():
        raise InputError(folder, "", f"no diagnosis of it in {tables}", fresh)
    # The report has all other files behind it.
    trace_jobs([f"{reports}/report.html"], top)
    jobs = trace_jobs([f"{reports}/verdict.json"], top)
    check_sources(jobs, top, f"results of this version: {fresh}")
    reader = next(job for job in jobs if f"{results}/campaign.json" in job.outputs)
    # The user's files may have moved since.
    data = {
        (Path(file).name, reader.inputs[file])
        for file in reader.own or reader.made_inputs
    }
    now = {
        (Path(file).name, digest) for file, digest in campaign_folder.digests.items()
    }
    if (
        not data
        <= now
        <= {
            (Path(file).name, digest)
            for job in jobs
            for file, digest in job.inputs.items()
        }
    ):
        raise InputError(
            folder,
            "",
            "changes since its diagnosis",
            f"a campaign as it was diagnosed: {fresh}",
        )
    facts = read_json(tables / "diagnosis.json")
    case = load_case(tables / "campaign.json", tables / "training.parquet")
    origin = {
        "commit": _listed(job.origin.commit for job in jobs),
        "code_sha256": configuration_sha256(
            {file: digest for job in jobs for file, digest in job.sources.items()}
        ),
        "data_sha256": configuration_sha256(sorted(data)),
        "environment": {
            name: _listed(job.environment.get(name, "none") for job in jobs)
            for name in jobs[-1].environment
        },
    }
    return Diagnosed(
        campaign_folder,
        case.select(~rows_left_out(case, facts)),
        facts,
        read_json(verdict),
        origin,
    )


def _listed(values: Iterable[str]) -> str:
    return ", ".join(sorted(set(values)))


def certificate(
    found: Diagnosed, tolerance_m: float, accepted_risk: float
) -> dict[str, Any]:
    """Contents of a certificate: all of the corrected robot is predicted, at the poses
    and loads of the campaign.

    `found`: the campaign. Returns JSON-serialisable.
    """
    document = found.folder.document
    calibrated, verdict, heldout = (
        found.calibrated,
        found.verdict,
        found.verdict["heldout"],
    )
    robot = calibrated.robot
    states = found.case.observations.states
    poses = select_campaign_commands(calibrated)
    prediction = predict_errors(calibrated, *poses)
    accuracy = prediction.summarize(REGION)
    worst = int(np.argmax(prediction.error_m))
    decision = decide_conformity(prediction.rms_m, tolerance_m, accepted_risk)
    missing = list_shortfalls(heldout["configurations"], states, robot)
    if not accuracy.fitted:
        missing = [
            "nothing fitted: no error of 0 is predicted of a robot of which nothing was fitted",
            *missing,
        ]
    if missing and decision.decision == PASS:
        decision = replace(decision, decision=UNDECIDED)
    joints = [
        {"value": value, "unit": "m" if slides else "rad"}
        for value, slides in zip(
            poses[0][worst].tolist(), robot.chain.prismatic, strict=True
        )
    ]
    return {
        "campaign": found.name,
        "robot": robot.name,
        "serial": document.get("serial_number", ""),
        "date": date.today().isoformat(),
        "stated": {"measured_on": document.get("measured_on", "")}
        | document.get("certificate", {}),
        "version": __version__,
        "origin": found.origin,
        "files": {
            Path(file).name: digest for file, digest in found.folder.digests.items()
        },
        "verdict": verdict["verdict"],
        "repeatable": verdict["repeatable"],
        "effects": [effect["name"] for effect in verdict["effects"]],
        "errors": tabulate_errors(verdict),
        "validation_rms_m": {
            "uncorrected": heldout["uncalibrated"]["rms_m"],
            "corrected": heldout["delivered"]["rms_m"],
        },
        "regression": (verdict["remainder"] or {}).get("words", ""),
        "noise_floor_rms_m": heldout["noise_floor_rms_m"],
        "accuracy": asdict(accuracy),
        "point": describe_reference_point(found.case.campaign),
        "misplaced": verdict["misplaced"],
        "worst_pose": {"joints": joints, "error_m": float(prediction.error_m[worst])},
        "conformity": asdict(decision)
        | {"configurations": heldout["configurations"], "shortfalls": missing},
        "joint_ranges": find_joint_ranges(states, robot),
        "budget": [
            {"name": name, "rms_m": rms}
            for name, rms in error_budget(calibrated, *poses).items()
        ],
        "budget_states": accuracy.poses,
        "tracker_rms_m": float(np.sqrt(3.0) * calibrated.noise.position_m),
    }


def error_budget(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> dict[str, float]:
    """Error budget of a robot over commands (N, n) under loads (N, 6), m, RMS.

    What is missed without any correction; each effect by its name in the catalogue, or
    ``joint_compliance``, if it alone were left out, largest first; what a correction
    leaves, by `accuracy.predict_errors`. Only the last add up: effects may work against
    each other, and loads meet springs.
    """
    costs = compute_effect_contributions(calibrated, reported_angles, wrench)
    rest = predict_errors(calibrated, reported_angles, wrench, draws=0)
    ends = {
        "left by the regression": root_mean_square(rest.regression_m),
        "form of the model": root_mean_square(rest.form_m),
        "not commanded": rest.scope.left_out_m,
    }
    return {
        "uncorrected": compute_uncorrected_rms_m(calibrated, reported_angles, wrench),
        **{
            name: costs[name]
            for name in sorted(costs, key=costs.__getitem__, reverse=True)
            if costs[name] > 0.0
        },
        "uncertainty of the parameters": root_mean_square(rest.parameters_m),
        "repeatability": root_mean_square(rest.repeated_m),
        **{name: end for name, end in ends.items() if end},
    }
