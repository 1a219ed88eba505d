"""The loop once more: which blind cases are followed up, what is read further, and the verdicts on it.

The analyst's side, which knows neither ground truths nor the plant; `carrying_out` is the other side.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from elastocal.diagnosis.verdict import CLASS, NAMED

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

# Poses after which a verdict is stated anew.
POSES = (5, 10, 20)
# Shares of its load at which each is read, as each pose of the campaign was.
LADDER = (0.0, 1.0, 0.5, -0.5, -1.0)
# Where the poses come from: the loop's proposal, or drawn as those of the campaign were.
ARMS = ("proposed", "random")
# Most cases of a block that are followed up, by the size of the benchmark; it bounds the time and looks at no outcome.
MOST = {"smoke": 1, "quick": 2, "development": 2, "full": 2}


def followed_up(verdicts: Iterable[dict[str, Any]], most: int) -> list[dict[str, Any]]:
    """The cases that a block follows up.

    `verdicts`: of all cases of the block. Returns the first verdicts "class" with alternatives, for which an experiment is
    proposed, in the order of the names of their cases, which are in none.
    """
    classes = [v for v in verdicts if v["verdict"] == CLASS and any(effect["alternatives"] for effect in v["effects"])]
    return sorted(classes, key=lambda verdict: verdict["campaign"])[:most]


def folder_name(arm: str, poses: int) -> str:
    """Where campaigns with further poses lie: those of each arm, at each number of poses, in a folder of their own."""
    return f"{arm}_{poses}"


def diagnosed_until_named(folder_at: Mapping[int, str], diagnose: Callable[[str], dict[str, Any]]) -> dict[int, dict[str, Any]]:
    """Verdicts with more and more poses, until a single name is stated.

    `folder_at`: the campaign with so many further poses, the fewest first. `diagnose`: verdict on a folder. Returns verdicts by
    the number of further poses; the last is the first that is "named", or that on all poses.
    """
    verdicts: dict[int, dict[str, Any]] = {}
    for poses, folder in folder_at.items():
        verdicts[poses] = diagnose(folder)
        if verdicts[poses]["verdict"] == NAMED:
            break
    return verdicts


def diagnosed_anew(campaigns: str | Path, diagnose: Callable[[str], dict[str, Any]]) -> list[dict[str, Any]]:
    """Verdicts on all that was followed up in a block.

    `campaigns`: folder with ``<arm>_<poses>/<case>/``; empty where nothing was followed up. `diagnose`: verdict on a folder.
    Returns ``campaign, arm, poses, verdict``; what is measured after a single name is not looked at.
    """
    anew = []
    for name in sorted({folder.name for folder in Path(campaigns).glob("*/*")}):
        for arm in ARMS:
            folder_at = {poses: f"{campaigns}/{folder_name(arm, poses)}/{name}" for poses in POSES}
            for poses, verdict in diagnosed_until_named(folder_at, diagnose).items():
                anew.append({"campaign": name, "arm": arm, "poses": poses, "verdict": verdict})
    return anew
