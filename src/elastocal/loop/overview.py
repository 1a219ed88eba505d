"""What a campaign can show, before anything is diagnosed: what was read, what is identified and testable, what is suspicious.

Held-out poses are counted, and their joint angles compared with those fitted; what was measured at them is not looked at.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.accuracy import accuracy_sentence, calibrate_on_case, campaign_accuracy
from elastocal.campaigns.campaign import columns_of
from elastocal.counting import counted, first_names
from elastocal.data_checks.faults import faults
from elastocal.data_checks.warnings import controller_warnings
from elastocal.diagnosis.gross_errors import entries_of, first_kept, gross_errors, warnings_of
from elastocal.diagnosis.linearize import linearized
from elastocal.diagnosis.misplaced import misplaced
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit
from elastocal.fitting.model import Case, case_from, joint_compliances
from elastocal.fitting.noise import effective_parameters
from elastocal.loop.loading import load_campaign
from elastocal.validation.placing import repeat_warnings

if TYPE_CHECKING:
    from pathlib import Path

    from elastocal.campaigns.campaign import Measurements
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case

# Held-out poses of which a 95 % interval of an RMS is wider than a factor of two.
FEWEST_HELD_OUT = 6
# Loads whose directions span less than this share of the largest in a second direction pull in one line.
_ONE_DIRECTION = 0.05
# A compliance is impossible where it is less than minus so many standard errors.
_CLEAR = 2.0
# Parameters that are not identifiable and are named; more would be too many to read.
_NAMED = 8
_SOURCES = {"repeats": "repeats", "declared": "the campaign's declaration", "residual": "the residual of the declared model"}


@dataclass(frozen=True)
class Overview:
    """A campaign in words: `rows` of a table, heading and words; `attention`, sentences on faults and what looks suspicious.

    `testable`: number of candidate effects that can be tested. `diagnosable`: whether no fault of the data forbids it.
    """

    campaign: str
    diagnosable: bool
    testable: int
    rows: list[tuple[str, str]]
    attention: list[str]


def overview(folder: str | Path, robots_folder: str | Path) -> Overview:
    """Look through a campaign; `folder`, `robots_folder` as in `reading.read_campaign`. Raises `InputError`.

    The accuracy is that of a robot which is corrected by the declared model, if nothing is missing in it; none is stated where
    the data are at fault or a compliance comes out negative, for then something is missing.
    """
    descriptions, training, held_out = load_campaign(folder, robots_folder)
    whole, settings = case_from(descriptions, columns_of(training)), Settings()
    part = first_kept(whole, settings)
    errors = gross_errors(part.declared, part.noise, whole.campaign.measurements, part.kept, settings)
    left_out = entries_of(replace(errors, gross=~part.kept), whole.campaign, held_out=False)
    case, campaign, declared = part.case, part.case.campaign, part.to_all(part.declared)
    candidates = list(case.candidates.values())
    untestable = linearized(part.declared, part.searched, candidates, settings).untestable
    found, negative = faults(campaign), _negative_springs(declared)
    diagnosable, testable = not any(fault.decisive for fault in found), len(candidates) - len(untestable)
    attention = [fault.detail for fault in found]
    accuracy: list[tuple[str, str]] = []
    if diagnosable and not negative:
        fitted = calibrate_on_case(case, declared.model, declared.estimate, declared.covariance, part.noise)
        sentence = accuracy_sentence(campaign_accuracy(fitted))
        accuracy = [("accuracy", f"if the declared model is complete: {sentence}")]
        attention += [each["sentence"] for each in misplaced(_with_base(declared, case), campaign)]
    attention += [*controller_warnings(campaign), *part.warnings]
    if negative:
        attention.append(
            f"the compliance of joint {' and '.join(negative)} comes out negative: the declared model lacks something, so that"
            " no accuracy is stated before the diagnosis"
        )
    attention += [*warnings_of(left_out), *_suspicious(case, declared, _poses(training), _poses(held_out))]
    attention += repeat_warnings(training, held_out)
    reasons = Counter(untestable.values()).most_common()
    rows = [
        *_read(case, training, held_out),
        ("noise", f"{1e6 * part.noise.position_m:.0f} µm a coordinate, from {_SOURCES[part.noise.source]}"),
        *_identified(declared),
        *accuracy,
        ("testable", counted(testable, "candidate effect")),
        *(("", f"{count} not testable: {reason}") for reason, count in reasons),
    ]
    return Overview(campaign.name, diagnosable, testable, rows, attention)


def _read(case: Case, training: Measurements, held_out: Measurements) -> list[tuple[str, str]]:
    """What was read."""
    campaign, states = case.campaign, case.observations.states
    count = len(np.unique(states.session))
    sessions = f", {count} sessions" if count > 1 else ""
    # Numbers of loads are labels; 0 is none.
    loads = {int(load) for load in states.load}
    loaded, force = len(loads - {0}), np.linalg.norm(states.wrench[:, :3], axis=1).max()
    parts = [*(["unloaded"] if 0 in loads else []), *([counted(loaded, "load")] if loaded else [])]
    most = int(states.repeats.max())
    repeats = "each state measured once" if most == 1 else f"a state measured up to {most} times"
    poses = f"{counted(_poses(training), 'pose')} to fit and {counted(_poses(held_out), 'validation pose')}"
    targets = ", ".join(target.name for target in campaign.targets)
    robot = f"{campaign.name}: {campaign.robot.name}, {counted(campaign.robot.joints, 'joint')}"
    return [
        ("read", f"{robot}, {campaign.measured} in the {campaign.frame} frame"),
        ("", f"{poses}; {counted(len(training), 'measurement')} of {targets}{sessions}"),
        ("", " and ".join(parts) + (f" of up to {force:,.0f} N" if loaded else "") + f"; {repeats}"),
    ]


def _identified(declared: Fit) -> list[tuple[str, str]]:
    """How well the declared model fits, and which of its parameters these poses determine."""
    rms = 1e3 * np.sqrt((declared.residual[:, :3] ** 2).sum(axis=1).mean())
    named = [f"{owner} {parameter.name}" for owner, parameter in declared.parameters]
    held = [name for name, held in zip(named, declared.held, strict=True) if held]
    left = f"; not identifiable: {first_names(held, _NAMED)}" if held else ""
    count = counted(int((~declared.held).sum()), "parameter")
    return [
        ("declared model", f"residual of {rms:.3f} mm RMS on the fitted poses"),
        ("identified", f"{count}, effectively {effective_parameters(declared):.0f}{left}"),
    ]


def _with_base(declared: Fit, case: Case) -> Fit:
    """The declared model with a base that may stand elsewhere than declared, where one is."""
    base = case.candidates.get("base_placement")
    if base is None or case.campaign.frame != "base":
        return declared
    model = replace(declared.model, effects=(*declared.model.effects, base))
    return fit(model, case.observations, declared.noise)


def _poses(part: Measurements) -> int:
    return len(np.unique(np.column_stack([part.session, part.pose]), axis=0))


def _negative_springs(declared: Fit) -> list[str]:
    """Joints whose compliance is negative by more than chance: what the declared model lacks hides behind them."""
    if not declared.model.identifies_compliance:
        return []
    mine = declared.places_of("joint_compliance")
    errors = np.where(declared.held[mine], np.inf, np.sqrt(np.diag(declared.covariance))[mine])
    below = joint_compliances(declared.model, declared.estimate) < -_CLEAR * errors
    return [str(joint + 1) for joint in np.flatnonzero(below)]


def _suspicious(case: Case, declared: Fit, poses: int, judged: int) -> list[str]:
    """What little or one-sided measurements cannot show."""
    found, states, numbers = [], case.observations.states, declared.residual.size
    effective, parameters = effective_parameters(declared), int((~declared.held).sum())
    least = int(np.ceil(poses * Settings().numbers_a_parameter * effective / numbers))
    if least > poses:
        found.append(
            f"{poses} poses are few for {parameters} parameters, of which they determine about {effective:.0f}, by"
            f" {numbers} numbers: other poses will be off by more than these. Measure about {least} poses to fit, or"
            " orientations too, or declare fewer errors"
        )
    if states.repeats.max() == 1:
        found.append("no pose is repeated: the noise is what the campaign declares, or what the model leaves")
    if judged < FEWEST_HELD_OUT:
        found.append(f"{judged} held-out poses say little of the error: {FEWEST_HELD_OUT} or more would")
    forces = states.wrench[states.wrench.any(axis=1), :3]
    if len(forces):
        spread = np.linalg.svd(forces, compute_uv=False)
        if spread[1] < _ONE_DIRECTION * spread[0]:
            found.append("all loads pull along one line: compliances across it are not shown")
    elif case.campaign.compliance == "identify":
        found.append("no measurement is under a load: compliances are not identifiable")
    if len(np.unique(states.load)) == 2:
        found.append("one load beside none: what is not linear in the load cannot be distinguished")
    return found
