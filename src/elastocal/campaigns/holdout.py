"""Which poses of a campaign are fitted and which are held out to test the fit; where the campaign that tests may lie."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.campaigns.campaign import DOCUMENT, Campaign, Measurements
from elastocal.campaigns.groups import groups_of
from elastocal.campaigns.joint_space import blocks_of_poses, configurations
from elastocal.counting import counted
from elastocal.errors import InputError

_HOLDOUTS = ("fraction", "blocks", "session", "poses", "campaign")
# Below these a fit or a test says nothing.
FEWEST_TRAINING_POSES, FEWEST_HELD_OUT_POSES = 5, 2
_NOWHERE_RAD = 1e9


def split(campaign: Campaign) -> tuple[Measurements, Measurements]:
    """Measurements to fit and measurements to test, parted by whole poses.

    Returns `training`, `held_out`: in the order of the file, on which the choice of poses does not depend. Where another
    campaign is the test, all measurements are training and `held_out` is empty: see `reading.held_out_campaign`. Raises
    `InputError`: too few poses, or poses that are not there.
    """
    held_out = held_out_mask(campaign.holdout, campaign.measurements, campaign.robot.reported_offset, campaign.name)
    return campaign.measurements.select(~held_out), campaign.measurements.select(held_out)


def holdout_from(described: dict[str, Any], folder: Path, source: str) -> dict[str, Any]:
    """How a campaign parts its measurements, in one way and with a seed where the poses are drawn.

    `described`: ``holdout`` of ``campaign.yaml``. `folder`: folder of the campaign. `source`: named in errors. Raises
    `InputError`: no way or more than one, a seed where nothing is drawn, or as `other_folder`.
    """
    ways = [way for way in _HOLDOUTS if way in described]
    drawn = ways in (["fraction"], ["blocks"])
    if len(ways) != 1 or ("seed" in described and not drawn):
        allowed = "one of {fraction, seed}, {blocks, seed}, {session}, {poses} or {campaign}"
        raise InputError(source, "holdout", f"{', '.join(described)} together" if len(described) > 1 else "seed alone", allowed)
    if "campaign" in described:
        other_folder(described["campaign"], folder, source)
    return {"seed": 1} | described if drawn else dict(described)


def other_folder(named: str, folder: Path, source: str) -> Path:
    """Folder of the campaign that tests another one.

    `named`: as ``holdout.campaign`` names it. `folder`: of the campaign that it tests. `source`: named in errors. Raises
    `InputError`: no campaign there, the same campaign, or a folder elsewhere than beside or below the tested one's.
    """
    other = folder / named
    allowed = f"a folder beside this one with a {DOCUMENT}, such as ../other"
    if not is_file_in(other / DOCUMENT, folder.resolve().parent):
        raise InputError(source, "holdout.campaign", repr(named), allowed)
    if other.samefile(folder):
        raise InputError(source, "holdout.campaign", f"{named!r}, the campaign itself", allowed)
    return other


def held_out_mask(holdout: Mapping[str, Any], measurements: Measurements, reported_zero: np.ndarray, source: str) -> np.ndarray:
    """Which measurements are held out, ndarray of bool (N,).

    Where poses are drawn it is by configuration, with all poses that share its joint angles: a repeat of what was fitted tests
    nothing. Rows of zeros, which were lost, change no draw; ``reported_zero`` (n,) is where the model's joints then stand, rad.
    `InputError`, which names ``source``: too few configurations, or poses that are not there.
    """
    pairs, index = measured_poses(measurements)
    measured = (measurements.joint_angles != reported_zero).any(axis=1) | measurements.position.any(axis=1)
    nothing = np.bincount(index, measured) == 0
    if nothing.any() and np.median(np.bincount(index)) > 1 and {"fraction", "blocks"} & {*holdout}:
        # Of several rows a pose one was lost: others tell of its pose, and a draw that counted it would part all poses anew.
        mask, known = np.ones(len(measurements), bool), ~nothing[index]
        mask[known] = held_out_mask(holdout, measurements.select(known), reported_zero, source)
        return mask
    # A pose that was lost is a configuration of its own, and none that stands at zero.
    angles = np.where(nothing[index, None], _NOWHERE_RAD + index[:, None], measurements.joint_angles)
    configuration = configurations(angles, index)
    chosen = np.zeros(len(pairs), bool)
    if "campaign" not in holdout:
        chosen = _chosen_poses(holdout, measurements, pairs, configuration, index, source)
    fitted, tested = (len(np.unique(configuration[part])) for part in (~chosen, chosen))
    fewest = 0 if "campaign" in holdout else FEWEST_HELD_OUT_POSES
    if fitted < FEWEST_TRAINING_POSES or tested < fewest:
        found = f"{counted(fitted, 'configuration')} to fit and {tested} held out"
        least = f"at least {FEWEST_TRAINING_POSES} to fit" + (f" and {fewest} held out" if fewest else "")
        allowed = f"{least}; poses with the same joint angles are one"
        raise InputError(source, "holdout", found, allowed)
    return chosen[index]


def measured_poses(measurements: Measurements) -> tuple[np.ndarray, np.ndarray]:
    """The poses that were measured, each once.

    Returns `pairs` (P, 2): session and pose, sorted; `index` (N,) of int: of each measurement's pair.
    """
    pairs = np.column_stack([measurements.session, measurements.pose])
    first, index = groups_of(pairs)
    return pairs[first], index


def _chosen_poses(
    holdout: Mapping[str, Any],
    measurements: Measurements,
    pairs: np.ndarray,
    configuration: np.ndarray,
    index: np.ndarray,
    source: str,
) -> np.ndarray:
    """Mask (P,) of the poses that are held out; `pairs` and `index` as of `measured_poses`."""
    count, chosen = configuration.max() + 1, np.zeros(len(pairs), bool)
    if "poses" in holdout:
        for entry in holdout["poses"]:
            match = (pairs == entry).all(axis=1) if isinstance(entry, list | tuple) else pairs[:, 1] == entry
            if not match.any():
                allowed = f"poses that were measured, {pairs[:, 1].min()}..{pairs[:, 1].max()}"
                raise InputError(source, "holdout.poses", str(entry), allowed)
            chosen |= match
        return chosen
    if "session" in holdout:
        wanted, there = np.atleast_1d(holdout["session"]), np.unique(pairs[:, 0])
        for session in wanted:
            if session not in there:
                allowed = f"sessions that were measured: {', '.join(map(str, there))}"
                raise InputError(source, "holdout.session", str(session), allowed)
        return np.isin(pairs[:, 0], wanted)
    draws = np.random.Generator(np.random.PCG64(holdout["seed"]))
    if "blocks" in holdout:
        if holdout["blocks"] > count:
            raise InputError(source, "holdout.blocks", str(holdout["blocks"]), f"at most as many as configurations, {count}")
        return blocks_of_poses(measurements.joint_angles, index, holdout["blocks"]) == draws.integers(holdout["blocks"])
    return np.isin(configuration, draws.permutation(count)[: round(holdout["fraction"] * count)])


def is_file(path: str | Path) -> bool:
    """Whether a path is that of a regular file; False too for what no path can be."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        # A name that is too long, or with a null character.
        return False


def is_file_in(path: str | Path, *folders: str | Path) -> bool:
    """Whether a path is that of a regular file in or below one of some folders.

    `path`, `*folders`: links are followed, on both sides.
    """
    return is_file(path) and any(Path(path).resolve().is_relative_to(Path(folder).resolve()) for folder in folders)
