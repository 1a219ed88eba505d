"""What a campaign can show, before anything is diagnosed: what was read, what is
identified and testable, what is suspicious.

Held-out poses are counted, and their joint angles compared with those fitted; what was
measured at them is not looked at.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.campaigns.campaign import tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.holdout import list_poses
from elastocal.counting import format_count, list_first
from elastocal.data_checks.faults import controller_warnings, faults
from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.fitted_subset import select_initial_subset
from elastocal.diagnosis.gross_errors import (
    describe_gross_errors,
    find_gross_errors,
    format_gross_error_warnings,
)
from elastocal.diagnosis.misplaced import find_misplaced_frames
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import build_case, get_joint_compliances
from elastocal.fitting.noise import count_effective_parameters
from elastocal.loop.loading import load_campaign
from elastocal.validation.transfer import warn_of_repeated_poses

if TYPE_CHECKING:
    from pathlib import Path

    from elastocal.campaigns.campaign import Measurements
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case

# Held-out poses of which a 95 % interval of an RMS is wider than a factor of two.
FEWEST_HELD_OUT = 6
# Loads whose directions span less than this share of the largest in a second direction
# pull in one line.
_ONE_DIRECTION = 0.05
# A compliance is impossible where it is less than minus so many standard errors.
_CLEAR = 2.0
# Parameters that are not identifiable and are named; more would be too many to read.
_NAMED = 8
_SOURCES = {
    "repeats": "repeats",
    "declared": "the campaign's declaration",
    "residual": "the residual of the declared model",
}


@dataclass(frozen=True)
class Overview:
    """A campaign in words: `rows` of a table, heading and words; `attention`, sentences
    on faults and what looks suspicious.

    `testable`: number of candidate effects that can be tested. `diagnosable`: whether
    no fault of the data forbids it.
    """

    campaign: str
    diagnosable: bool
    testable: int
    rows: list[tuple[str, str]]
    attention: list[str]


def overview(folder: str | Path, robots_folder: str | Path) -> Overview:
    """Look through a campaign; `folder`, `robots_folder` as in `read_campaign_folder`.
    Raises `InputError`.

    What is misplaced is not looked for where a compliance comes out negative, for then
    something is missing in the model.
    """
    descriptions, training, held_out = load_campaign(
        read_campaign_folder(folder, robots_folder)
    )
    whole = build_case(descriptions, tabulate_measurements(training))
    settings = Settings()
    part = select_initial_subset(whole, settings)
    errors = find_gross_errors(
        part.declared, part.noise, whole.campaign.measurements, part.kept, settings
    )
    left_out = describe_gross_errors(
        replace(errors, gross=~part.kept), whole.campaign, held_out=False
    )
    case, campaign, declared = (
        part.case,
        part.case.campaign,
        part.fit_to_all(part.declared),
    )
    untestable = build_candidate_design(
        part.declared, part.search_sample, [*case.candidates.values()], settings
    ).untestable
    testable = len(case.candidates) - len(untestable)
    found = faults(campaign)
    negative = _negative_springs(declared)
    diagnosable = not found
    rows = _read(case, training, held_out)
    rows.append(
        (
            "noise",
            f"{1e6 * part.noise.position_m:.0f} µm a coordinate, from {_SOURCES[part.noise.source]}",
        )
    )
    rows += _identified(declared)
    attention = [fault.detail for fault in found]
    if diagnosable and not negative:
        attention += [
            frame.sentence
            for frame in find_misplaced_frames(_with_base(declared, case), campaign)
        ]
    attention += [*controller_warnings(campaign), *part.warnings]
    if negative:
        joints = " and ".join(negative)
        attention.append(
            f"the compliance of joint {joints} comes out negative: the declared model lacks something"
        )
    attention += [
        *format_gross_error_warnings(left_out),
        *_suspicious(case, declared, training, held_out),
        *warn_of_repeated_poses(training, held_out),
    ]
    reasons = Counter(untestable.values()).most_common()
    rows += [
        ("testable", format_count(testable, "candidate effect")),
        *(("", f"{n} not testable: {why}") for why, n in reasons),
    ]
    return Overview(campaign.name, diagnosable, testable, rows, attention)


def _read(
    case: Case, training: Measurements, held_out: Measurements
) -> list[tuple[str, str]]:
    """What was read."""
    campaign = case.campaign
    states = case.observations.states
    sessions = format_count(len(np.unique(states.session)), "session")
    most = int(states.repeats.max())
    force = np.linalg.norm(states.wrench[:, :3], axis=1).max()
    # Numbers of loads are labels; 0 is none.
    loaded = np.unique(states.load[states.load != 0]).size
    loads = (
        f"{format_count(loaded, 'load')} of up to {force:,.0f} N"
        if loaded
        else "no load"
    )
    return [
        (
            "read",
            f"{campaign.name}: {campaign.robot.name}, {format_count(campaign.robot.joints, 'joint')}",
        ),
        (
            "",
            f"{campaign.measured} of {', '.join(target.name for target in campaign.targets)} in the {campaign.frame} frame",
        ),
        (
            "",
            f"{format_count(_poses(training), 'pose')} to fit and {format_count(_poses(held_out), 'validation pose')} in {sessions}",
        ),
        (
            "",
            f"{format_count(len(training), 'measurement')}, up to {most} of a state, {loads}",
        ),
    ]


def _identified(declared: Fit) -> list[tuple[str, str]]:
    """How well the declared model fits, and which of its parameters these poses
    determine."""
    rms = 1e3 * np.sqrt((declared.residual[:, :3] ** 2).sum(axis=1).mean())
    named = [f"{owner} {parameter.name}" for owner, parameter in declared.parameters]
    held = [
        name for name, held in zip(named, declared.unidentifiable, strict=True) if held
    ]
    left = f"; not identifiable: {list_first(held, _NAMED)}" if held else ""
    count = format_count(int((~declared.unidentifiable).sum()), "parameter")
    return [
        ("declared model", f"residual of {rms:.3f} mm RMS on the fitted poses"),
        (
            "identified",
            f"{count}, effectively {count_effective_parameters(declared):.0f}{left}",
        ),
    ]


def _with_base(declared: Fit, case: Case) -> Fit:
    """The declared model with a base that may stand elsewhere than declared, where one
    is."""
    base = case.candidates.get("base_placement")
    if base is None or case.campaign.frame != "base":
        return declared
    return fit_model(
        replace(declared.model, effects=(*declared.model.effects, base)),
        case.observations,
        declared.noise,
    )


def _poses(part: Measurements) -> int:
    return len(list_poses(part)[0])


def _negative_springs(declared: Fit) -> list[str]:
    """Joints whose compliance is negative by more than chance: what the declared model
    lacks hides behind them."""
    if not declared.model.identifies_compliance:
        return []
    mine = declared.parameter_indices("joint_compliance")
    errors = np.where(
        declared.unidentifiable[mine],
        np.inf,
        np.sqrt(np.diag(declared.covariance))[mine],
    )
    below = get_joint_compliances(declared.model, declared.estimate) < -_CLEAR * errors
    return [str(joint + 1) for joint in np.flatnonzero(below)]


def _suspicious(
    case: Case, declared: Fit, training: Measurements, held_out: Measurements
) -> list[str]:
    """What little or one-sided measurements cannot show."""
    found = []
    states = case.observations.states
    numbers = declared.residual.size
    effective = count_effective_parameters(declared)
    parameters = int((~declared.unidentifiable).sum())
    poses = _poses(training)
    least = int(np.ceil(poses * Settings().numbers_a_parameter * effective / numbers))
    if least > poses:
        found.append(
            f"{poses} poses are few for {parameters} parameters, of which they determine about {effective:.0f}, by"
            f" {numbers} numbers: other poses will be off by more than these. Measure about {least} poses to fit, or"
            " orientations too, or declare fewer errors"
        )
    if states.repeats.max() == 1:
        found.append(
            "no pose is repeated: the noise is what the campaign declares, or what the model leaves"
        )
    if (judged := _poses(held_out)) < FEWEST_HELD_OUT:
        found.append(
            f"{judged} held-out poses say little of the error: {FEWEST_HELD_OUT} or more would"
        )
    forces = states.wrench[states.wrench.any(axis=1), :3]
    if len(forces):
        # A single force has a single singular value.
        largest, second = [*np.linalg.svd(forces, compute_uv=False), 0.0][:2]
        if second < _ONE_DIRECTION * largest:
            found.append(
                "all loads pull along one line: compliances across it are not shown"
            )
    elif case.campaign.compliance == "identify":
        found.append("no measurement is under a load: compliances are not identifiable")
    if len(np.unique(states.load)) == 2:
        found.append(
            "one load beside none: what is not linear in the load cannot be distinguished"
        )
    return found
