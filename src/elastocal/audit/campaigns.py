"""Campaigns of the loop: the split of the poses, predictions of the declared model, probabilities, errors before and after."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

from elastocal.audit.arm import Arm
from elastocal.audit.findings import Finding, compared, held

if TYPE_CHECKING:
    from elastocal.audit.audited import Audited

_POSE = ["session", "pose"]
_REPEATED = [*_POSE, "load", "target"]


def measurements(run: Audited, file: str, campaign: str) -> list[Finding]:
    """Fitted and held-out measurements are those of the campaign's file, each once, and share no pose.

    Parameters
    ----------
    run : Audited
    file, campaign : str

    Returns
    -------
    list of Finding
    """
    held_out = run.table(file.replace("training", "held_out"))
    fitted, source = run.table(file), f"data/campaigns/{campaign}/measurements.parquet"
    # Poses of another campaign are numbered anew; measurements of it are others all the same.
    another = _session(run, campaign)
    names, words = (list("xyz"), "measurement") if another else (_POSE, "pose")
    poses = [set(map(tuple, frame[names].to_numpy())) for frame in (fitted, held_out)]
    shared = poses[0] & poses[1]
    note = f"{words}s {sorted(shared)[:3]}"
    found = [held(file, f"no {words} is fitted and held out", "pandas", not shared, note, len(poses[0]))]
    if run.there(source) and _document(run, campaign).get("held_out") is None:
        rows, original = pd.concat([fitted, held_out]).sort_values("row"), run.table(source)
        numbered = compared(
            file, "every row of the campaign once", "counting", rows["row"], np.arange(1, len(original) + 1), 0.0
        )
        found.append(numbered)
        if numbered.holds:
            for name in ("pose", "x", "y", "z", "fx", "fy", "fz"):
                if name in original:
                    found.append(compared(file, f"column {name} as measured", "pandas", rows[name], original[name], 1e-12))
    return found


def kept_back(run: Audited, file: str, campaign: str) -> list[Finding]:
    """Held-out measurements are those of the campaign's file, by their rows.

    Parameters
    ----------
    run : Audited
    file, campaign : str

    Returns
    -------
    list of Finding
    """
    source = f"data/campaigns/{campaign}/measurements.parquet"
    if not run.there(source) or _document(run, campaign).get("held_out") is not None:
        return []
    rows, original = run.table(file), run.table(source)
    names = [name for name in rows if name in original and name != "target" and is_numeric_dtype(original[name])]
    expected = original.iloc[rows["row"].to_numpy() - 1][names]
    return [compared(file, "measurements as the campaign has them", "pandas", rows[names], expected, 0.0)]


def confounding(run: Audited, file: str, campaign: str) -> list[Finding]:
    """Angles between every two candidates that were tested, each pair once.

    Parameters
    ----------
    run : Audited
    file, campaign : str

    Returns
    -------
    list of Finding
    """
    frame = run.table(file)
    tested = sorted({*frame["one"], *frame["other"]})
    pairs = {frozenset(pair) for pair in zip(frame["one"], frame["other"], strict=True)}
    every = len(pairs) == len(frame) == len(tested) * (len(tested) - 1) // 2
    right = bool(frame["angle_deg"].between(0, 90).all())
    return [
        held(file, "every two candidates once", "counting", every, f"{len(frame)} pairs of {len(tested)}", len(frame)),
        held(file, "angles between 0 and 90 degrees", "counting", right, "another one", len(frame)),
    ]


def diagnosis(run: Audited, file: str, campaign: str) -> list[Finding]:
    """Probabilities of mechanisms are sums over the models; correlations lie within one.

    Parameters
    ----------
    run : Audited
    file, campaign : str

    Returns
    -------
    list of Finding
    """
    document = run.document(file)["document"]
    models = run.table(f"results/loop/{campaign}/models.parquet")
    probability = models["probability"].to_numpy()
    total = bool(probability.min(initial=0.0) >= 0 and probability.sum() <= 1 + 1e-9)
    found = [held(file, "probabilities of the models", "pandas", total, f"they sum to {probability.sum():.9g}", len(models))]
    falling = bool((np.diff(probability) <= 1e-12).all())
    found.append(held(file, "the most probable model comes first", "pandas", falling, "another one", len(models)))
    kept = probability.sum()
    for name, stated in (document.get("probabilities") or {}).get("mechanisms", {}).items():
        having = models["mechanisms"].map(lambda text, name=name: name in text.split(" + ")).to_numpy()
        # Models that are not kept hold the rest.
        off = abs(stated - probability[having].sum()) <= 1 - kept + 1e-6
        note = f"stated {stated:.6g}, models sum to {probability[having].sum():.6g}"
        found.append(held(file, f"probability of {name}", "pandas", off, note, int(having.sum())))
    correlations = run.table(f"results/loop/{campaign}/correlations.parquet")["correlation"]
    within = bool((correlations.abs() <= 1 + 1e-9).all())
    found.append(held(file, "correlations lie within one", "pandas", within, "one beyond", len(correlations)))
    return found


def models(run: Audited, file: str, campaign: str) -> list[Finding]:
    """Probabilities of the models follow from their odds; each model's mechanisms are those of its parts.

    Parameters
    ----------
    run : Audited
    file, campaign : str

    Returns
    -------
    list of Finding
    """
    frame = run.table(file)
    odds = np.exp(frame["log_odds"] - frame["log_odds"].max())
    expected = odds * frame["probability"].sum() / odds.sum()
    found = [compared(file, "probabilities by odds", "numpy", frame["probability"], expected)]
    off = []
    for stated, units in zip(frame["mechanisms"], frame["units"], strict=True):
        named = sorted({re.split(r"[@\[ ]", unit)[0] for unit in units.split("; ") if unit}) or ["nothing"]
        if " + ".join(named) != stated:
            off.append(f"{stated}: {units}"[:80])
    return [*found, held(file, "mechanisms of the parts of each model", "text", not off, ", ".join(off[:2]), len(frame))]


def residuals(run: Audited, file: str, campaign: str) -> list[Finding]:
    """Errors before and after from the residuals; residuals of the declared model from pinocchio where it is springs alone.

    Parameters
    ----------
    run : Audited
    file, campaign : str

    Returns
    -------
    list of Finding
    """
    frame, found = run.table(file), []
    table = f"reports/loop/{campaign}/before_after.csv"
    before_after = run.table(table)
    declared = before_after[before_after["kind"] == "declared"]
    for part, kept in (("train", ~frame["held_out"]), ("heldout", frame["held_out"])):
        for state, row in (("before", declared.iloc[:1]), ("after", before_after.iloc[-1:])):
            # An error is that of the mean of what was repeated.
            means = frame[kept].groupby(_REPEATED)[[f"{state}_d{axis}" for axis in "xyz"]].mean()
            errors = np.linalg.norm(means.to_numpy(), axis=1)
            if not len(errors) or row.empty or f"{part}_rms_m" not in row or _session(run, campaign):
                continue
            expected = [errors.mean(), np.sqrt((errors**2).mean()), errors.max()]
            stored = row[[f"{part}_{name}_m" for name in ("mean", "rms", "max")]].to_numpy(float)
            found.append(compared(table, f"{part} errors {state}", "numpy", stored, expected, 1e-8))
    return found + _predicted(run, file, campaign, frame)


def _predicted(run: Audited, file: str, campaign: str, frame: pd.DataFrame) -> list[Finding]:
    """Residuals of sampled rows by pinocchio, in the base frame with known targets and nothing declared but springs."""
    described = _document(run, campaign)
    asked, verdict = described["campaign"], run.document(f"reports/loop/{campaign}/verdict.json")
    targets = asked["targets"]
    known = all(target["offset_m"] != "unknown" for target in targets.values())
    compliance = (verdict.get("compliance_urad_per_Nm") or {}).get("before")
    if asked["frame"] != "base" or asked["declared"] or not known or compliance is None or _moved_base(run, campaign):
        return []
    springs, offsets = 1e-6 * np.array(compliance), [np.array(target["offset_m"], float) for target in targets.values()]
    points = [target["point"] for target in targets.values()]
    arms = [Arm(described["robot"], offset) for offset in offsets]
    stored, expected = [], []
    for place in run.picked(file, len(frame)):
        row = frame.iloc[place]
        arm, point = arms[int(row["target"])], points[int(row["target"])]
        angles = row[[f"q{j}" for j in range(1, arm.joints + 1)]].to_numpy(float)
        wrench = row[["fx", "fy", "fz", "mx", "my", "mz"]].to_numpy(float)
        # In this loop the wrench acts at the last measuring point, whatever is measured.
        torques = arm.jacobian(angles, arm.end_effector).T @ wrench
        predicted = arm.pose(angles + springs * torques, point)[0]
        stored.append(row[["before_dx", "before_dy", "before_dz"]].to_numpy(float))
        expected.append(row[["x", "y", "z"]].to_numpy(float) - predicted)
    # The load acts on the deflected arm there, on the undeflected one here: a thousandth of the deflection at most.
    largest = float(np.max(np.abs(np.array(expected)), initial=0.0))
    checked = f"residuals of the declared model, {len(stored)} rows"
    return [compared(file, checked, "pinocchio", stored, expected, absolute=_SECOND_ORDER * max(largest, 1e-3))]


# A spring turns by some 1e-3 rad, by which the lever of the load changes.
_SECOND_ORDER = 1e-2


def _document(run: Audited, campaign: str) -> dict[str, Any]:
    return dict(run.document(f"results/loop/{campaign}/campaign.json"))


def _session(run: Audited, campaign: str) -> bool:
    """Whether another campaign is the test, whose frames are fitted anew."""
    return _document(run, campaign).get("held_out") is not None


def _moved_base(run: Audited, campaign: str) -> bool:
    steps = run.table(f"results/loop/{campaign}/steps.parquet")
    first = steps[steps["step"] == steps["step"].min()]
    return bool(first["owner"].str.contains("frame|session", regex=True).any())


CHECKS = (
    (re.compile(r"results/loop/([^/]+)/training\.parquet"), measurements),
    (re.compile(r"results/loop/([^/]+)/diagnosis\.json"), diagnosis),
    (re.compile(r"results/loop/([^/]+)/held_out\.parquet"), kept_back),
    (re.compile(r"results/loop/([^/]+)/confounding\.parquet"), confounding),
    (re.compile(r"results/loop/([^/]+)/models\.parquet"), models),
    (re.compile(r"reports/loop/([^/]+)/residuals\.parquet"), residuals),
)
