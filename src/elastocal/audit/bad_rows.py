"""Bad rows: every case and rate from the slips that were written, by pandas and scipy."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pandas as pd
from scipy import stats

from elastocal.audit.findings import Finding, compared, held

if TYPE_CHECKING:
    from elastocal.audit.audited import Audited

_TOGETHER = ["robot", "seed"]


def cases(run: Audited, file: str) -> list[Finding]:
    """Every slip is there once, and verdicts count as the same that are."""
    stated = run.table(file)
    robots = list(dict.fromkeys(stated["robot"]))
    slips = pd.concat([run.table(f"results/bad_rows/{robot}.parquet").assign(robot=robot) for robot in robots])
    every = len(slips) == len(stated) and bool(
        (slips["bad_rows"].astype(str).to_numpy() == stated["bad_rows"].astype(str)).all()
    )
    found = [held(file, "every slip once", "counting", every, f"{len(stated)} of {len(slips)}", len(stated))]
    if every:
        for version in ("damaged", "fewer"):
            same = (slips[f"{version}_verdict"] + slips[f"{version}_found"]).to_numpy() == (
                slips["clean_verdict"] + slips["clean_found"]
            ).to_numpy()
            right = bool((stated[f"{version}_same"].to_numpy(bool) == same).all())
            found.append(held(file, f"verdicts with rows {version}", "pandas", right, "others", len(same)))
        named = bool((slips["named"].to_numpy() == stated["named"].to_numpy(bool)).all())
        found.append(held(file, "rows named", "pandas", named, "others", len(slips)))
    return found


def rates(run: Audited, file: str) -> list[Finding]:
    """The rates that have a target, with their intervals."""
    stated, slips = run.table(file), run.table(file.replace("summary.csv", "cases.csv"))
    one = slips.groupby(_TOGETHER).first()
    large = slips[slips["size"] >= 10.0]
    hits = {
        "verdict of the clean file": one["damaged_same"].astype(bool),
        "no row lost": one["clean_rows_lost"] == 0,
        "row named": large["named"].astype(bool),
    }
    judged = stated[stated["target"].notna()].set_index("quantity")
    found = [held(file, "rates with a target", "counting", set(judged.index) == set(hits), "others", len(judged))]
    if found[0].holds:
        for name, each in hits.items():
            limits = stats.binomtest(int(each.sum()), len(each)).proportion_ci(0.95, "exact")
            expected = [float(each.mean()), limits.low, limits.high]
            row = judged.loc[name, ["rate", "low", "high"]]
            found.append(compared(file, f"{name}, with limits", "scipy", row.astype(float), pd.Series(expected), 1e-8))
    return found


CHECKS = (
    (re.compile(r"reports/bad_rows/cases\.csv"), cases),
    (re.compile(r"reports/bad_rows/summary\.csv"), rates),
)
