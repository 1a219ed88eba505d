"""`elastocal correct`: wanted poses to the joint targets that bring the robot there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from elastocal.command.campaign import diagnosed_campaign, held_out_rms_m
from elastocal.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from elastocal.application.compensation import Correction

# Lines that a message names.
_NAMED = 5


def correct(
    folder: Annotated[Path, typer.Argument(help="Folder of a diagnosed campaign.")],
    path: Annotated[Path, typer.Argument(help="CSV of wanted poses: x, y, z in m, rx, ry, rz in rad; fx..mz, q1..qn.")],
    output: Annotated[Path, typer.Option(help="CSV of joint targets.")],
    partial: Annotated[bool, typer.Option("--partial", help="Write the file though some targets cannot be reached.")] = False,
) -> None:
    """Joint targets that bring the loaded, sagging, imperfect robot to the wanted poses."""
    from elastocal.application.calibrated import OperatingConditions, assumptions
    from elastocal.application.compensation import OK, corrected
    from elastocal.exchange.target_path import read_target_path
    from elastocal.io.data_frames import write_csv
    from elastocal.validation.fitted_range import beyond_campaign

    console = Console(stderr=True)
    campaign = diagnosed_campaign(folder)
    calibrated = campaign.calibrated
    wanted = read_target_path(path, calibrated.robot.joints)
    operating = OperatingConditions(wanted.wrench, wanted.approach, wanted.time_s, wanted.temperature_c)
    for line in assumptions(calibrated, operating):
        console.print(f"assumed: {line}", markup=False, highlight=False, soft_wrap=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        bar = progress.add_task("correcting", total=len(wanted))
        found = corrected(
            calibrated,
            wanted.position,
            wanted.rotation,
            operating,
            wanted.start,
            lambda done: progress.update(bar, completed=done),
        )
    bad = (found.status != OK).nonzero()[0]
    if len(bad) and not partial:
        rows = ", ".join(f"line {wanted.lines[row]} is {found.status[row]}" for row in bad[:_NAMED])
        more = f" and {len(bad) - _NAMED} more" if len(bad) > _NAMED else ""
        raise InputError(path, "", rows + more, "poses that the robot reaches within its limits, or --partial")
    beyond = beyond_campaign(
        campaign.case.observations.states, calibrated.robot.model_angles(found.joint_angles), wanted.wrench
    )
    write_csv(output, joint_targets(found, beyond))
    if beyond.any():
        share = f"{beyond.sum():,} of {len(beyond):,} targets"
        line = f"{share} lie beyond the poses or loads of the campaign: errors there are extrapolated"
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    console.print(summary(found), markup=False, highlight=False, soft_wrap=True)
    missed = held_out_rms_m(campaign.name)
    if missed is not None:
        line = f"the campaign's held-out poses were missed by {1e3 * missed:.3f} mm (RMS, with the tracker's noise)"
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    console.print(f"    {output}", markup=False, highlight=False, soft_wrap=True)


def joint_targets(found: Correction, beyond: np.ndarray) -> pd.DataFrame:
    """The file of joint targets.

    Parameters
    ----------
    found : Correction
    beyond : ndarray of bool (N,)
        Whether each lies beyond what the campaign measured.

    Returns
    -------
    pandas.DataFrame
        q1..qn (rad, as the controller reports them), predicted errors (m, rad) and the status.
    """
    import numpy as np
    import pandas as pd

    angles = {f"q{joint}": column for joint, column in enumerate(found.joint_angles.T, 1)}
    nominal = {f"q{joint}_uncorrected": column for joint, column in enumerate(found.uncorrected.T, 1)}
    errors = {
        "predicted_error_before_m": np.linalg.norm(found.error_before[:, :3], axis=1),
        "predicted_error_after_m": np.linalg.norm(found.error_after[:, :3], axis=1),
        "predicted_std_m": found.std_m,
        "predicted_rotation_before_rad": np.linalg.norm(found.error_before[:, 3:], axis=1),
        "predicted_rotation_std_rad": found.std_rad,
        "repeatability_m": found.repeatability_m,
        "outside_range": beyond,
    }
    return pd.DataFrame(angles | errors | {"status": found.status} | nominal)


def summary(found: Correction) -> str:
    """One line on how many targets were corrected, and what their errors are predicted to be."""
    import numpy as np

    from elastocal.application.compensation import OK

    good = found.status == OK
    line = f"{good.sum():,} of {len(good):,} targets corrected"
    if not good.any():
        return line
    before = 1e3 * np.sqrt((found.error_before[good, :3] ** 2).sum(axis=1).mean())
    after = 1e3 * np.sqrt((found.std_m[good] ** 2).mean())
    return f"{line}; predicted position error (RMS) {before:.3f} mm uncorrected, {after:.3f} mm corrected"
