"""Load a diagnosed campaign from its files, restore its calibrated robot without a fit,
and build the contents of its certificate."""

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
    predict_determined_rms_m,
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
from elastocal.application.statements import describe_left_out, tabulate_errors
from elastocal.campaigns.campaign_folder import CampaignFolder, read_campaign_folder
from elastocal.diagnosis.misplaced import describe_reference_point
from elastocal.errors import InputError
from elastocal.fitting.noise import get_noise, parse_noise
from elastocal.fitting.sensor_noise import compute_target_std_m
from elastocal.io.json_files import read_json
from elastocal.io.origin import digest_configuration
from elastocal.io.records import check_sources, trace_jobs
from elastocal.io.typed_json import to_document
from elastocal.loop.diagnosis_tables import (
    find_rejected_rows,
    load_case,
    restore_step_model,
)
from elastocal.residual_model.selection import fit_to_observations
from elastocal.validation.conformity import (
    PASS,
    UNDECIDED,
    decide_conformity,
    find_joint_ranges,
    list_shortfalls,
)
from elastocal.verdict import read_verdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from elastocal.application.accuracy import ErrorPrediction
    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.fitting.model import Case
    from elastocal.io.records import JobRecord
    from elastocal.mechanics.robot import Robot
    from elastocal.validation.conformity import Conformity
    from elastocal.verdict import Verdict


@dataclass(frozen=True)
class DiagnosedCampaign:
    """A campaign with the results of its diagnosis.

    Attributes
    ----------
    folder : CampaignFolder
        Folder of the campaign.
    case : Case
        Training poses without their gross errors.
    facts : dict
        Contents of diagnosis.json.
    verdict : Verdict
        Contents of verdict.json.
    origin : dict
        ``commit`` of the jobs that made these files, ``code_sha256`` and
        ``data_sha256`` of everything that they read of the program and of the campaign,
        and their ``environment``.
    """

    folder: CampaignFolder
    case: Case
    facts: dict[str, Any]
    verdict: Verdict
    origin: dict[str, Any]

    @property
    def name(self) -> str:
        """Name of the campaign."""
        return self.folder.name

    @cached_property
    def calibrated(self) -> CalibratedRobot:
        """The robot of the final model, with errors as large as the validation poses
        show them."""
        step = self.facts["steps"][-1]
        model, estimate = restore_step_model(self.case, step)
        regression = None
        remainder = self.verdict.remainder
        if remainder and remainder.regression and remainder.spread:
            observations = self.case.observations
            noise = get_noise(self.verdict.noise)
            regression = build_residual_model(
                self.case,
                estimate,
                fit_to_observations(remainder, model, estimate, observations),
                remainder,
                compute_target_std_m(model, estimate, observations, noise),
            )
        robot = calibrate_on_case(
            self.case,
            model,
            estimate,
            np.array(self.facts["covariance"]),
            parse_noise(step),
            regression,
        )
        accuracy = self.verdict.accuracy
        if accuracy and accuracy.contradicted:
            return set_form_error(robot, accuracy.form_m, contradicted=True)
        return set_form_error(
            robot, self.verdict.other_models_m or 0.0, contradicted=False
        )

    def without_regression(self) -> DiagnosedCampaign:
        """Return the same campaign without the regression on the residual."""
        verdict = replace(
            self.verdict,
            remainder=None,
            heldout=replace(self.verdict.heldout, delivered=self.verdict.heldout.after),
        )
        if self.verdict.physics:
            verdict = replace(verdict, accuracy=self.verdict.physics)
        return replace(self, verdict=verdict)


def load_diagnosed(
    folder: str | Path, robots_folder: str | Path, top: str | Path
) -> DiagnosedCampaign:
    """Load a campaign and its diagnosis, if neither has changed since.

    Parameters
    ----------
    folder, robots_folder : str or path
        As in `read_campaign_folder`.
    top : str or path
        Folder that holds results/ and reports/.

    Raises
    ------
    InputError
        If there is no diagnosis, if a file of a job behind its report has changed (see
        `trace_jobs`), if the program has changed since (see `check_sources`), or if the
        campaign has other files than those that were read.
    """
    campaign_folder = read_campaign_folder(folder, robots_folder)
    name = campaign_folder.name
    results = f"results/loop/{name}"
    reports = f"reports/loop/{name}"
    tables = Path(top, results)
    verdict_path = Path(top, reports, "verdict.json")
    command = f"elastocal diagnose {folder}"
    if not verdict_path.exists() and not (tables / "diagnosis.json").exists():
        raise InputError(folder, "", f"no diagnosis of it in {tables}", command)
    # The report depends on all other files, so this checks every job.
    trace_jobs([f"{reports}/report.html"], top)
    jobs = trace_jobs([f"{reports}/verdict.json"], top)
    check_sources(jobs, top, f"results of this version: {command}")
    read_files = read_json(tables / "campaign.json")["files"]
    if campaign_folder.digests != read_files:
        raise InputError(
            folder,
            "",
            "changes since its diagnosis",
            f"a campaign as it was diagnosed: {command}",
        )
    facts = read_json(tables / "diagnosis.json")
    case = load_case(tables / "campaign.json", tables / "training.parquet")
    return DiagnosedCampaign(
        campaign_folder,
        case.select(~find_rejected_rows(case, facts)),
        facts,
        read_verdict(verdict_path),
        _describe_origin(jobs, read_files),
    )


def _describe_origin(
    jobs: Sequence[JobRecord], read_files: Mapping[str, str]
) -> dict[str, Any]:
    """Return commit, digests and environment of the jobs behind a verdict.

    Parameters
    ----------
    jobs : sequence of JobRecord
        The jobs, in the order in which they began.
    read_files : mapping
        SHA-256 of the campaign's files by their roles.
    """
    sources: dict[str, str] = {}
    environment = {}
    for job in jobs:
        sources |= job.sources
    for name in jobs[-1].environment:
        versions = [job.environment.get(name, "none") for job in jobs]
        environment[name] = _join_distinct(versions)
    return {
        "commit": _join_distinct(job.origin.commit for job in jobs),
        "code_sha256": digest_configuration(sources),
        "data_sha256": digest_configuration(read_files),
        "environment": environment,
    }


def _join_distinct(values: Iterable[str]) -> str:
    return ", ".join(sorted(set(values)))


def build_certificate(
    campaign: DiagnosedCampaign, tolerance_m: float, accepted_risk: float
) -> dict[str, Any]:
    """Return the contents of a certificate.

    Every error of the corrected robot is predicted, at the poses and loads of the
    campaign.

    Parameters
    ----------
    campaign : DiagnosedCampaign
        The campaign with its diagnosis.
    tolerance_m : float
        Largest allowed RMS position error, m.
    accepted_risk : float
        Accepted probability of a wrong decision.

    Returns
    -------
    dict
        JSON-serialisable.

    Raises
    ------
    InputError
        No instrument measured positions: contacts and boards are consistent with each
        other, and say nothing of lengths.
    """
    document = campaign.folder.document
    plan = campaign.case.campaign.measuring
    if not plan.is_tracked:
        allowed = (
            "position or pose, measured by an instrument: only those show accuracy; "
            "elastocal export states the predicted error, and elastocal verify compares "
            "the corrected robot with such positions"
        )
        found = " and ".join(kind.name for kind in plan.kinds)
        raise InputError(campaign.folder.source, "measured", found, allowed)
    calibrated = campaign.calibrated
    verdict = campaign.verdict
    heldout = verdict.heldout
    robot = calibrated.robot
    states = calibrated.states
    commands = select_campaign_commands(calibrated)
    prediction = predict_errors(calibrated, *commands)
    accuracy = prediction.summarize(REGION)
    decision, missing = decide_on_campaign(
        calibrated, verdict, prediction, tolerance_m, accepted_risk
    )
    budget = {"before": heldout.before.rms_m}
    budget |= compute_error_budget(calibrated, *commands)
    return {
        "campaign": campaign.name,
        "robot": robot.name,
        "serial": document.get("serial_number", ""),
        "date": date.today().isoformat(),
        "stated": {"measured_on": document.get("measured_on", "")}
        | document.get("certificate", {}),
        "version": __version__,
        "origin": campaign.origin,
        "files": campaign.folder.digests,
        "verdict": verdict.verdict,
        "repeatable": to_document(verdict.repeatable),
        "effects": [
            effect.name for effect in verdict.missing_effects if effect.is_likely
        ],
        "errors": tabulate_errors(verdict),
        "validation_rms_m": {
            "before": heldout.before.rms_m,
            "corrected": heldout.delivered.rms_m,
        },
        "regression": verdict.remainder.words if verdict.remainder else "",
        "noise_floor_rms_m": heldout.noise_floor_rms_m,
        "accuracy": to_document(accuracy),
        "point": describe_reference_point(campaign.case.campaign),
        "misplaced": to_document(verdict.misplaced),
        "left_out": describe_left_out(verdict),
        "worst_pose": _describe_worst_pose(robot, commands[0], prediction.error_m),
        "conformity": asdict(decision)
        | {"configurations": heldout.configurations, "shortfalls": missing},
        "joint_ranges": [asdict(ends) for ends in find_joint_ranges(states, robot)],
        "budget": [{"name": name, "rms_m": rms_m} for name, rms_m in budget.items()],
        "budget_states": accuracy.poses,
        "tracker_rms_m": float(np.sqrt(3.0) * calibrated.noise.position_m),
    }


def decide_on_campaign(
    calibrated: CalibratedRobot,
    verdict: Verdict,
    prediction: ErrorPrediction,
    tolerance_m: float,
    accepted_risk: float,
) -> tuple[Conformity, list[str]]:
    """Decide whether a corrected robot keeps a tolerance over its campaign.

    Parameters
    ----------
    calibrated : CalibratedRobot
        The robot with the states of its campaign.
    verdict : Verdict
        Tells how many configurations judge it.
    prediction : ErrorPrediction
        Errors at the poses and loads of the campaign.
    tolerance_m : float
        Largest allowed RMS position error, m.
    accepted_risk : float
        Accepted probability of a wrong decision.

    Returns
    -------
    decision : Conformity
        Undecided instead of a pass if there is any shortfall.
    shortfalls : list of str
        Reasons why the validation says too little, with the missing fit if nothing was
        fitted.
    """
    shortfalls = list_shortfalls(
        verdict.heldout.configurations, calibrated.states, calibrated.robot
    )
    determined_rms_m = predict_determined_rms_m(
        calibrated, *select_campaign_commands(calibrated)
    )
    decision = decide_conformity(
        prediction.rms_m, tolerance_m, accepted_risk, determined_rms_m
    )
    if not prediction.summarize(REGION).fitted:
        sentence = "nothing fitted: no error is predicted for a robot without fitted parameters"
        shortfalls = [sentence, *shortfalls]
    if shortfalls and decision.decision == PASS:
        decision = replace(decision, decision=UNDECIDED)
    return decision, shortfalls


def _describe_worst_pose(
    robot: Robot, reported_angles: np.ndarray, error_m: np.ndarray
) -> dict[str, Any]:
    """Return the joint coordinates of the pose with the largest predicted error."""
    worst = int(np.argmax(error_m))
    joints = [
        {"value": value, "unit": "m" if is_prismatic else "rad"}
        for value, is_prismatic in zip(
            reported_angles[worst].tolist(), robot.prismatic_commands, strict=True
        )
    ]
    return {"joints": joints, "error_m": float(error_m[worst])}


def compute_error_budget(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> dict[str, float]:
    """Compute the error budget of a robot over commands, RMS, m.

    The entries are: each effect, by its name in the
    catalogue or ``joint_compliance``, if it alone were left out of the correction,
    largest first; and the errors that the correction leaves, by
    `accuracy.predict_errors`. Only the squares of the last group add up, because effects
    may work against each other and loads interact with compliances.

    Parameters
    ----------
    calibrated : CalibratedRobot
        The robot.
    reported_angles : ndarray
        Joint angles (N, n) as the controller reports them, rad.
    wrench : ndarray
        Loads (N, 6), N and N m.
    """
    contributions = compute_effect_contributions(calibrated, reported_angles, wrench)
    by_size = sorted(contributions, key=contributions.__getitem__, reverse=True)
    remaining = predict_errors(calibrated, reported_angles, wrench, draws=0)
    budget = {}
    for name in by_size:
        if contributions[name] > 0.0:
            budget[name] = contributions[name]
    budget["uncertainty of the parameters"] = root_mean_square(remaining.parameters_m)
    budget["repeatability"] = root_mean_square(remaining.repeated_m)
    optional = {
        "left by the regression": root_mean_square(remaining.regression_m),
        "form of the model": root_mean_square(remaining.form_m),
        "not commanded": root_mean_square(remaining.left_out_m),
    }
    return budget | {name: rms_m for name, rms_m in optional.items() if rms_m}
