"""What a campaign measured and how noisy it is, as rows and sentences of its report."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from elastocal import __version__
from elastocal.counting import counted, grouped
from elastocal.diagnosis.words import listed
from elastocal.report.wording import MICRO, capital, length, percent, plain

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

NOISE_SOURCES = {
    "repeats": "The noise is taken from the differences between repeats of the same state.",
    "declared": "The noise is taken as the campaign declares it; there are too few repeats to check it.",
    "residual": "The noise is not known: with neither repeats nor a declared noise the residual itself was taken for it.",
}


def made(campaign: Mapping[str, Any]) -> str:
    """What the report is of and by: serial number and date, where the campaign states them, and the version of this program.

    `campaign`: contents of campaign.yaml.
    """
    stated = {"serial number ": campaign.get("serial_number"), "measured on ": campaign.get("measured_on")}
    parts = [*(name + value for name, value in stated.items() if value), f"report by elastocal {__version__}"]
    return capital(", ".join(parts))


def measured(table: Mapping[str, np.ndarray], descriptions: Mapping[str, Any]) -> list[list[str]]:
    """Rows of what was measured: name, at fitted poses, at validation poses.

    `table` (N,): columns of the residuals table. `descriptions`: contents of campaign.json.
    """
    held_out = table["held_out"].astype(bool)
    campaigns = [descriptions["campaign"], (descriptions["held_out"] or descriptions)["campaign"]]
    parts = [
        _part({name: values[mask] for name, values in table.items()}, campaign)
        for mask, campaign in zip((~held_out, held_out), campaigns, strict=True)
    ]
    return [[name, *(part[name] for part in parts)] for name in parts[0]]


def noise_rows(noise: Mapping[str, Any], with_orientation: bool) -> list[list[str]]:
    """Rows of the noise: name, value with unit."""
    stated = ", root mean square of what the measurements state" if noise["usual_m"] else ""
    rows = [[f"sensor, each component of a position{stated}", length(noise["position_m"])]]
    if with_orientation:
        rows.append(["sensor, each component of an orientation", f"{plain(MICRO * noise['orientation_rad'])} µrad"])
    if any(noise["joint_rad"]):
        rows += [
            [f"repeatability of joint {joint}", f"{plain(MICRO * value)} µrad"]
            for joint, value in enumerate(noise["joint_rad"], 1)
        ]
    rows.append(["error of every joint common to all measurements of a pose", f"{plain(MICRO * noise['pose_rad'])} µrad"])
    rows.append(["noise that the final model leaves, over the noise above", plain(noise["factor"])])
    if noise["degrees_of_freedom"]:
        rows.append(["contrasts between repeats behind it", grouped(noise["degrees_of_freedom"])])
    return rows


def misfit_sentence(misfit: Mapping[str, float] | None) -> str:
    """What the models leave on the fitted poses, against the noise.

    `misfit`: of verdict.json. Returns empty where nothing was fitted.
    """
    if not misfit:
        return ""
    before, after = plain(misfit["before"]), plain(misfit["after"])
    if before == after:
        return f"On the fitted poses the declared model leaves a mean square of {before} times that of the noise."
    return (
        f"On the fitted poses the declared model leaves a mean square of {before} times that of the noise, the most probable "
        f"model {after} times."
    )


def _part(part: Mapping[str, np.ndarray], campaign: Mapping[str, Any]) -> dict[str, str]:
    """What was measured in one part of the measurements."""
    if not len(part["pose"]):
        return dict.fromkeys(("campaign", "measurements"), "none")
    states = _distinct(part, "session", "pose", "load")
    repeats = Counter(map(tuple, np.column_stack([part[name] for name in ("session", "pose", "load", "target")])))
    each = np.array(list(repeats.values()))
    force = np.linalg.norm([part[name] for name in ("fx", "fy", "fz")], axis=0)
    loaded = force[force > 0]
    of_names = list(campaign["targets"].items())
    used = [of_names[number] for number in np.unique(part["target"])]
    kind = "position and orientation" if campaign["measured"] == "pose" else "position"
    frame = "the tracker's; its placement is fitted" if campaign["frame"] == "tracker" else "the base's"
    loads = "none"
    if len(loaded):
        ends = (
            [plain(loaded.min())]
            if np.isclose(loaded.min(), loaded.max(), rtol=1e-3)
            else map(plain, (loaded.min(), loaded.max()))
        )
        numbers = counted(len(np.unique(part["load"][force > 0])), "load")
        loads = f"{numbers} of {' to '.join(ends)} N on {percent(len(loaded) / len(force))} of the measurements"
    return {
        "campaign": campaign["campaign"],
        "measurements": f"{grouped(len(part['pose']))}, each a {kind}",
        "poses": counted(_distinct(part, "session", "pose"), "pose") + f" in {counted(_distinct(part, 'session'), 'session')}",
        "states (pose and load)": grouped(states),
        "loads": loads,
        "targets": listed(
            (
                ("" if name == target["point"] else f"{name} ")
                + f"at the measuring point {target['point']}{_mount(target, campaign['measured'] == 'pose')}"
                for name, target in used
            ),
            12,
        ),
        "repeats of a state": str(each.min())
        if each.min() == each.max()
        else f"{each.min()} to {each.max()}, median {np.median(each):g}",
        "coordinate frame": frame,
        "time": "recorded" if np.isfinite(part["time_s"]).any() else "not recorded",
    }


def _mount(target: Mapping[str, Any], oriented: bool) -> str:
    """What is fitted of how a target sits, and a known turn of its mount."""
    rotation = target.get("rotation", target["offset_m"]) if oriented else ""
    fitted = [word for word, value in (("place", target["offset_m"]), ("rotation", rotation)) if value == "unknown"]
    known = "rotation" in target and oriented and rotation != "unknown" and any(rotation)
    turned = f", turned by {np.degrees(np.linalg.norm(rotation)):.4g}°" if known else ""
    return turned + (f", {' and '.join(fitted)} fitted" if fitted else "")


def _distinct(part: Mapping[str, np.ndarray], *names: str) -> int:
    return len(np.unique(np.column_stack([part[name] for name in names]), axis=0))
