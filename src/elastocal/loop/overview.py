"""What a campaign can show, before anything is diagnosed: what was read, what is identified and testable, what is suspicious.

Held-out poses are counted, and their joint angles compared with those fitted; what was measured at them is not looked at.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.application.accuracy import calibrate_on_case, campaign_accuracy
from elastocal.campaigns.columns import columns_of
from elastocal.data_checks.protocol import faults
from elastocal.data_checks.warnings import controller_warnings
from elastocal.diagnosis.gross_errors import entries_of, gross_errors, warnings_of
from elastocal.diagnosis.kept_rows import first_kept
from elastocal.diagnosis.linearize import linearized
from elastocal.diagnosis.misplaced import misplaced
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit
from elastocal.fitting.model import case_from, joint_compliances
from elastocal.fitting.tolerances import effective_parameters
from elastocal.loop.loading import load_campaign
from elastocal.validation.placing import repeat_warnings

if TYPE_CHECKING:
    from pathlib import Path

    from elastocal.campaigns.campaign import Campaign
    from elastocal.diagnosis.kept_rows import Kept
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case

# Held-out poses of which a 95 % interval of an RMS is wider than a factor of two.
FEWEST_HELD_OUT = 6
# Loads whose directions span less than this share of the largest in a second direction pull in one line.
_ONE_DIRECTION = 0.05
# A compliance is stated where it is more than so many standard errors, and is impossible where it is less than minus as many.
_CLEAR = 2.0


def overview(folder: str | Path, robots_folder: str | Path) -> dict[str, Any]:
    """Look through a campaign.

    `folder`, `robots_folder`: as in `reading.read_campaign`. Returns ``campaign, robot, joints, targets, frame, measured``;
    ``training`` and ``held_out`` with their ``poses``; ``states, measurements, numbers, loads, repeats, sessions,
    largest_force_N``; ``noise`` (source, position_m, orientation_rad); ``faults`` (name, sentence, decisive);
    ``residual_rms_m`` of the declared model; ``parameters``, ``effective_parameters`` (without what priors decide) and
    ``held`` (those that are not identifiable); ``mounts`` (target, rotation_rad) that are fitted; ``compliance`` (value,
    relative standard error of each joint, None where these poses do not determine it); ``testable`` and ``untestable`` (how
    many candidate effects, by reason); ``suspicious``, sentences; ``diagnosable``; ``accuracy`` that a robot is predicted
    to have which is corrected by the declared model, if nothing is missing in it (`Accuracy.document`), None where the data
    are at fault or a compliance comes out negative: then something is missing, and none is stated; ``misplaced``, what was
    declared wrongly. Raises `InputError`.
    """
    descriptions, training, held_out = load_campaign(folder, robots_folder)
    whole, settings = case_from(descriptions, columns_of(training)), Settings()
    part = first_kept(whole, settings)
    errors = gross_errors(part.declared, part.noise, whole.campaign.measurements, part.kept, settings)
    left_out = entries_of(replace(errors, gross=~part.kept), whole.campaign, held_out=False)
    case, noise, warnings, declared = part.case, part.noise, part.warnings, part.declared_to_all()
    campaign, states = case.campaign, case.observations.states
    found = faults(campaign, campaign.measurements)
    decisive = any(fault.decisive for fault in found)
    springs, negative = _compliances(declared)
    facts: dict[str, Any] = _identified(declared) | {
        "compliance": springs,
        "campaign": campaign.name,
        "robot": campaign.robot.name,
        "joints": campaign.robot.joints,
        "targets": [target.name for target in campaign.targets],
        "frame": campaign.frame,
        "measured": campaign.measured,
        "training": {"poses": _poses(training.session, training.pose)},
        "held_out": {"poses": _poses(held_out.session, held_out.pose)},
        "states": len(states),
        "measurements": len(training),
        "numbers": declared.residual.size,
        "loads": sorted({int(load) for load in states.load}),
        "repeats": int(states.repeats.max()),
        "sessions": len(np.unique(states.session)),
        "largest_force_N": float(np.linalg.norm(states.wrench[:, :3], axis=1).max()),
        "noise": {"source": noise.source, "position_m": noise.position_m, "orientation_rad": noise.orientation_rad},
        "faults": [{"name": f.name, "sentence": f.detail, "decisive": f.decisive} for f in found],
        "residual_rms_m": float(np.sqrt((declared.residual[:, :3] ** 2).sum(axis=1).mean())),
        "diagnosable": not decisive,
        "accuracy": None,
        "misplaced": [],
    }
    if not decisive and not negative:
        fitted = calibrate_on_case(case, declared.model, declared.estimate, declared.covariance, noise)
        facts["accuracy"] = campaign_accuracy(fitted).document()
        facts["misplaced"] = misplaced(_with_base(declared, case), campaign)
    if negative:
        warnings = [
            *warnings,
            f"the compliance of joint {' and '.join(negative)} comes out negative: the declared model lacks something, so that"
            " no compliance and no accuracy are stated before the diagnosis",
        ]
    wrong = [each["sentence"] for each in facts["misplaced"]]
    suspicious = [*wrong, *controller_warnings(campaign), *warnings, *warnings_of(left_out)]
    suspicious += _suspicious(campaign, facts, case, settings)
    return facts | _testable(part) | {"suspicious": [*suspicious, *repeat_warnings(training, held_out)]}


def _with_base(declared: Fit, case: Case) -> Fit:
    """The declared model with a base that may stand elsewhere than declared, where one is."""
    base = case.candidates.get("base_placement")
    if base is None or case.campaign.frame != "base":
        return declared
    model = replace(declared.model, effects=(*declared.model.effects, base))
    return fit(model, case.observations, declared.noise)


def _poses(session: np.ndarray, pose: np.ndarray) -> int:
    return len(np.unique(np.column_stack([session, pose]), axis=0))


def _identified(declared: Fit) -> dict[str, Any]:
    named = [f"{owner} {parameter.name}" for owner, parameter in declared.parameters]
    vectors = Rotation.from_matrix(declared.estimate.target_rotation).as_rotvec()
    kept = [name for name, held in zip(named, declared.held, strict=True) if held]
    return {
        "parameters": int((~declared.held).sum()),
        "effective_parameters": effective_parameters(declared),
        "held": kept,
        "mounts": [
            {"target": declared.model.targets[number].name, "rotation_rad": vectors[number].tolist()}
            for number, parts in declared.model.fitted_parts
            if parts.stop == 6 and not {f"target {declared.model.targets[number].name} r{axis}" for axis in "xyz"} & {*kept}
        ],
    }


def _compliances(declared: Fit) -> tuple[list[dict[str, float | None]], list[str]]:
    """Of each joint its compliance where it is clear of zero, none where one is negative; and which joints these are."""
    if not declared.model.identifies_compliance:
        return [], []
    mine = declared.places_of("joint_compliance")
    values = joint_compliances(declared.model, declared.estimate)
    errors = np.where(declared.held[mine], np.inf, np.sqrt(np.diag(declared.covariance))[mine])
    negative = [str(joint + 1) for joint in np.flatnonzero(values < -_CLEAR * errors)]
    return [
        {"value_urad_per_Nm": 1e6 * float(value), "relative_std_error": float(error / value)}
        if value > _CLEAR * error
        else {"value_urad_per_Nm": None, "relative_std_error": None}
        for value, error in zip(values, errors, strict=True)
        if not negative
    ], negative


def _testable(part: Kept) -> dict[str, Any]:
    candidates = list(part.case.candidates.values())
    untestable = linearized(part.declared, part.searched, candidates, Settings()).untestable
    return {"testable": len(candidates) - len(untestable), "untestable": dict(Counter(untestable.values()).most_common())}


def _suspicious(campaign: Campaign, facts: dict[str, Any], case: Case, settings: Settings) -> list[str]:
    found, states = [], case.observations.states
    effective, poses = facts["effective_parameters"], facts["training"]["poses"]
    least = int(np.ceil(poses * settings.numbers_a_parameter * effective / facts["numbers"]))
    if least > poses:
        found.append(
            f"{poses} poses are few for {facts['parameters']} parameters, of which they determine about {effective:.0f}, by"
            f" {facts['numbers']} numbers: other poses will be off by more than these. Measure about {least} poses to fit, or"
            " orientations too, or declare fewer errors"
        )
    if facts["repeats"] == 1:
        found.append("no pose is repeated: the noise is what the campaign declares, or what the model leaves")
    if facts["held_out"]["poses"] < FEWEST_HELD_OUT:
        found.append(f"{facts['held_out']['poses']} held-out poses say little of the error: {FEWEST_HELD_OUT} or more would")
    forces = states.wrench[states.wrench.any(axis=1), :3]
    if len(forces):
        spread = np.linalg.svd(forces, compute_uv=False)
        if spread[1] < _ONE_DIRECTION * spread[0]:
            found.append("all loads pull along one line: compliances across it are not shown")
    elif campaign.compliance == "identify":
        found.append("no measurement is under a load: compliances are not identifiable")
    if len(facts["loads"]) == 2:
        found.append("one load beside none: what is not linear in the load cannot be distinguished")
    return found
