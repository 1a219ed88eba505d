"""Inspect a campaign before its diagnosis: what was read, what is identifiable and
testable, and what is suspicious.

Held-out poses are counted, and their joint angles are compared with the fitted ones.
Their measurements are not used.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.identifiability import (
    describe_unseen_errors,
    find_unseen_errors,
    predict_tip_error,
)
from elastocal.application.pose_counts import warn_of_few_poses
from elastocal.campaigns.campaign import tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.holdout import list_poses
from elastocal.counting import format_count, list_first
from elastocal.data_checks.faults import find_faults, warn_of_computed_positions
from elastocal.data_checks.target_distances import compare_target_distances
from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.fitted_subset import select_initial_subset
from elastocal.diagnosis.gross_errors import (
    describe_gross_errors,
    find_gross_errors,
    format_gross_error_warnings,
)
from elastocal.diagnosis.misplaced import find_misplaced_frames
from elastocal.diagnosis.settings import Settings
from elastocal.fitting.cases import build_case
from elastocal.fitting.least_squares import compute_negative_compliances, fit_model
from elastocal.fitting.noise import count_effective_parameters
from elastocal.loop.loading import load_campaign
from elastocal.validation.transfer import warn_of_repeated_poses

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from elastocal.campaigns.campaign import Measurements
    from elastocal.diagnosis.fitted_subset import FittedSubset
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case
    from elastocal.fitting.noise import Noise

# With fewer held-out poses, the 95 % interval of an RMS is wider than a factor of two.
FEWEST_HELD_OUT = 6
# Loads count as collinear if their second singular value is below this share of the
# first.
_COLLINEAR_SHARE = 0.05
# A compliance is impossible if it is negative by more than this many standard errors.
_NEGATIVE_STD_ERRORS = 2.0
# Upper bound on the unidentifiable parameters that are named.
_MAX_NAMED = 8
_SOURCES = {
    "repeats": "repeats",
    "declared": "the campaign's declaration",
    "residual": "the residual of the declared model",
}


@dataclass(frozen=True)
class Overview:
    """A campaign in words.

    Attributes
    ----------
    campaign : str
        Name of the campaign.
    diagnosable : bool
        Whether the data have no fault that forbids a diagnosis.
    testable : int
        Number of candidate effects that can be tested.
    rows : list of (str, str)
        Rows of a table: heading and words.
    attention : list of str
        Sentences on faults and on what looks suspicious.
    """

    campaign: str
    diagnosable: bool
    testable: int
    rows: list[tuple[str, str]]
    attention: list[str]

    @property
    def answer(self) -> str:
        """Whether the campaign can be diagnosed, and how much of it can be tested."""
        if not self.diagnosable:
            return f"{self.campaign} cannot be diagnosed: the data are at fault"
        testable = format_count(self.testable, "candidate effect")
        answer = f"{self.campaign} can be diagnosed: {testable} can be tested"
        if self.attention:
            answer += f"; {format_count(len(self.attention), 'remark')} below"
        return answer

    def __str__(self) -> str:
        return "\n".join([self.answer, *(f"! {line}" for line in self.attention)])


def inspect_campaign(folder: str | Path, robots_folder: str | Path) -> Overview:
    """Inspect a campaign before its diagnosis.

    Parameters
    ----------
    folder, robots_folder : str or path
        As in `read_campaign_folder`.

    Raises
    ------
    InputError
        If the campaign cannot be read.
    """
    descriptions, training, held_out = load_campaign(
        read_campaign_folder(folder, robots_folder)
    )
    whole = build_case(descriptions, tabulate_measurements(training))
    return inspect_case(whole, held_out)


def inspect_case(whole: Case, held_out: Measurements) -> Overview:
    """Inspect the fitted and the held-out measurements of a campaign.

    Parameters
    ----------
    whole : Case
        The measurements to fit.
    held_out : Measurements
        The measurements that validate.
    """
    training = whole.campaign.measurements
    settings = Settings()
    subset = select_initial_subset(whole, settings)
    case = subset.case
    declared = subset.fit_to_all(subset.declared)
    untestable = build_candidate_design(
        subset.declared, subset.search_sample, [*case.candidates.values()], settings
    ).untestable
    testable = len(case.candidates) - len(untestable)
    data_faults = find_faults(case.campaign)
    rows = [
        *_describe_measurements(case, training, held_out),
        ("noise", _describe_noise(subset.noise)),
        *_describe_declared_model(declared),
        ("testable", format_count(testable, "candidate effect")),
        *_describe_untestable(untestable),
    ]
    attention = [fault.detail for fault in data_faults]
    # With data at fault, the fit says nothing of the robot.
    if not data_faults and not case.campaign.measuring.is_tracked:
        rows += _describe_tip(declared, case)
        attention += describe_unseen_errors(
            find_unseen_errors(declared, case.observations)
        )
    negative = _find_negative_compliances(declared)
    # A negative compliance means that the model lacks something, so the search for
    # misplaced frames would mistake it for one.
    if not data_faults and not negative:
        attention += _describe_misplaced_frames(declared, case)
    attention += compare_target_distances(whole.campaign)
    attention += [*warn_of_computed_positions(case.campaign), *subset.warnings]
    if negative:
        attention.append(
            f"the compliance of joint {' and '.join(negative)} comes out negative: "
            "the declared model lacks something"
        )
    attention += _describe_gross_errors(whole, subset, settings)
    attention += _list_shortcomings(case, declared, training, held_out)
    attention += warn_of_repeated_poses(training, held_out)
    return Overview(case.campaign.name, not data_faults, testable, rows, attention)


def _describe_tip(declared: Fit, case: Case) -> list[tuple[str, str]]:
    """Return a row on the predicted error of the tip, which is not what was measured;
    none if the declared model has no parameter of the robot."""
    error_m = predict_tip_error(declared, case.observations)
    if error_m is None:
        return []
    words = (
        f"{1e3 * error_m:.3f} mm RMS predicted for the position of the target by the"
        " uncertainty of the declared model, after the best placement of base and tool"
    )
    return [("tip", words)]


def _describe_noise(noise: Noise) -> str:
    return (
        f"{1e6 * noise.position_m:.0f} µm a coordinate, from {_SOURCES[noise.source]}"
    )


def _describe_untestable(untestable: Mapping[str, str]) -> list[tuple[str, str]]:
    """Return rows with the number of candidates for each reason, the most frequent
    first."""
    reasons = Counter(untestable.values()).most_common()
    return [("", f"{count} not testable: {reason}") for reason, count in reasons]


def _describe_gross_errors(
    whole: Case, subset: FittedSubset, settings: Settings
) -> list[str]:
    """Return a sentence for each of the first rows that the declared model cannot
    explain."""
    outliers = find_gross_errors(
        subset.declared,
        subset.noise,
        whole.campaign.measurements,
        subset.kept,
        settings,
    )
    left_out = replace(
        outliers, gross=~subset.kept, probability=subset.wrong_probability
    )
    gross_errors = describe_gross_errors(left_out, whole.campaign, held_out=False)
    return format_gross_error_warnings(gross_errors)


def _describe_misplaced_frames(declared: Fit, case: Case) -> list[str]:
    """Return sentences on misplaced frames, after a fit of the base if the campaign
    declares its placement."""
    base = case.candidates.get("base_placement")
    if base is not None and case.campaign.frame == "base":
        model = replace(declared.model, effects=(*declared.model.effects, base))
        declared = fit_model(model, case.observations, declared.noise)
    frames = find_misplaced_frames(declared, case.campaign)
    return [frame.sentence for frame in frames]


def _describe_measurements(
    case: Case, training: Measurements, held_out: Measurements
) -> list[tuple[str, str]]:
    """Return rows on what was read."""
    campaign = case.campaign
    states = case.observations.states
    sessions = format_count(len(np.unique(states.session)), "session")
    max_repeats = int(states.repeats.max())
    max_force = np.linalg.norm(states.wrench[:, :3], axis=1).max()
    # Numbers of loads are labels; 0 means unloaded.
    load_count = np.unique(states.load[states.load != 0]).size
    loads = "no load"
    if load_count:
        loads = f"{format_count(load_count, 'load')} of up to {max_force:,.0f} N"
    joints = format_count(campaign.robot.joints, "joint")
    targets = ", ".join(target.name for target in campaign.targets)
    kinds = " and ".join(kind.name for kind in campaign.measuring.kinds)
    frame = f"the {campaign.frame} frame"
    if campaign.frame == "tracker" and not campaign.measuring.is_tracked:
        frame = "a frame that is fitted in each session"
    fitted_poses = format_count(_count_poses(training), "pose")
    validation_poses = format_count(_count_poses(held_out), "validation pose")
    measurements = format_count(len(training), "measurement")
    return [
        ("read", f"{campaign.name}: {campaign.robot.name}, {joints}"),
        ("", f"{kinds} of {targets} in {frame}"),
        ("", f"{fitted_poses} to fit and {validation_poses} in {sessions}"),
        ("", f"{measurements}, up to {max_repeats} of a state, {loads}"),
    ]


def _describe_declared_model(declared: Fit) -> list[tuple[str, str]]:
    """Return rows on the fit of the declared model, and on the parameters that these
    poses determine."""
    rms_mm = 1e3 * np.sqrt((declared.residual[:, :3] ** 2).sum(axis=1).mean())
    unidentifiable = [
        f"{owner} {parameter.name}"
        for (owner, parameter), is_held in zip(
            declared.parameters, declared.unidentifiable, strict=True
        )
        if is_held
    ]
    count = format_count(int((~declared.unidentifiable).sum()), "parameter")
    identified = f"{count}, effectively {count_effective_parameters(declared):.0f}"
    if unidentifiable:
        names = list_first(unidentifiable, _MAX_NAMED)
        identified += f"; not identifiable: {names}"
    return [
        ("declared model", f"residual of {rms_mm:.3f} mm RMS on the fitted poses"),
        ("identified", identified),
    ]


def _count_poses(measurements: Measurements) -> int:
    return len(list_poses(measurements)[0])


def _find_negative_compliances(declared: Fit) -> list[str]:
    """Return joints whose compliance is negative by more than chance; they absorb what
    the declared model lacks."""
    if not declared.model.identifies_compliance:
        return []
    negative = compute_negative_compliances(declared) > _NEGATIVE_STD_ERRORS
    return [str(joint + 1) for joint in np.flatnonzero(negative)]


def _list_shortcomings(
    case: Case, declared: Fit, training: Measurements, held_out: Measurements
) -> list[str]:
    """Return what too few or one-sided measurements cannot show."""
    shortcomings = _warn_of_few_poses(case, declared, _count_poses(training))
    states = case.observations.states
    if states.repeats.max() == 1:
        shortcomings.append(
            "no pose is repeated: the noise is the declared one, "
            "or the residual of the model"
        )
    validation_poses = _count_poses(held_out)
    if validation_poses < FEWEST_HELD_OUT:
        shortcomings.append(
            f"{validation_poses} held-out poses determine the error poorly: "
            f"use {FEWEST_HELD_OUT} or more"
        )
    forces = states.wrench[states.wrench.any(axis=1), :3]
    # A single force has a single singular value.
    largest, second = [*np.linalg.svd(forces, compute_uv=False), 0.0, 0.0][:2]
    if len(forces) and second < _COLLINEAR_SHARE * largest:
        shortcomings.append(
            "all loads act along one line: they do not show compliances across it"
        )
    if not len(forces) and case.campaign.compliance == "identify":
        shortcomings.append(
            "no measurement is under a load: compliances are not identifiable"
        )
    if len(np.unique(states.load)) == 2:
        shortcomings.append(
            "only one load besides the unloaded state: effects that are nonlinear in the "
            "load cannot be distinguished"
        )
    return shortcomings


def _warn_of_few_poses(case: Case, declared: Fit, poses: int) -> list[str]:
    """Return a warning if poses are too few for the parameters of the declared model."""
    return warn_of_few_poses(
        poses,
        declared.residual.size,
        int((~declared.unidentifiable).sum()),
        count_effective_parameters(declared),
        [kind.name for kind in case.campaign.measuring.kinds],
    )
