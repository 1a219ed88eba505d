"""Campaigns of the loop: the split of the poses, predictions of the declared model, probabilities, errors before and after."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

from elastocal.audit.configurations import configurations
from elastocal.audit.elastic import STATE, far_off, good_rows
from elastocal.audit.equilibrium import Sagging, sagging
from elastocal.audit.findings import Finding, compared, held
from elastocal.audit.fits import SETTLED, STEP_BACK

if TYPE_CHECKING:
    from elastocal.audit.audited import Audited

_POSE = ["session", "pose"]
# Effects that go with the time or with the row of a measurement.
_DATED = {"frame_drift", "setup_step", "temperature_gradient", "thermal_growth"}


def measurements(run: Audited, file: str, campaign: str) -> list[Finding]:
    """Fitted and held-out measurements are those of the campaign's file, each once, and share no pose."""
    held_out = run.table(file.replace("training", "held_out"))
    fitted, source = run.table(file), f"data/campaigns/{campaign}/measurements.parquet"
    # Poses of another campaign are numbered anew; measurements of it are others all the same.
    another = _session(run, campaign)
    names, words = (list("xyz"), "measurement") if another else (_POSE, "pose")
    poses = [set(map(tuple, frame[names].to_numpy())) for frame in (fitted, held_out)]
    shared = poses[0] & poses[1]
    note = f"{words}s {sorted(shared)[:3]}"
    found = [held(file, f"no {words} is fitted and held out", "pandas", not shared, note, len(poses[0]))]
    if {"fraction", "blocks"} & set(_document(run, campaign).get("campaign", {}).get("holdout", {})):
        both = pd.concat([fitted.assign(unseen=False), held_out.assign(unseen=True)]).groupby(_POSE).mean(numeric_only=True)
        parts = both["unseen"].groupby(configurations(both.filter(regex=r"^q\d+$").to_numpy())).nunique()
        note = f"{(parts > 1).sum()} of {len(parts)}"
        found.append(held(file, "no configuration is fitted and held out", "numpy", bool(parts.eq(1).all()), note, len(both)))
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
    """Held-out measurements are those of the campaign's file, by their rows."""
    source = f"data/campaigns/{campaign}/measurements.parquet"
    if not run.there(source) or _document(run, campaign).get("held_out") is not None:
        return []
    rows, original = run.table(file), run.table(source)
    names = [name for name in rows if name in original and name != "target" and is_numeric_dtype(original[name])]
    expected = original.iloc[rows["row"].to_numpy() - 1][names]
    return [compared(file, "measurements as the campaign has them", "pandas", rows[names], expected, 0.0)]


def confounding(run: Audited, file: str, campaign: str) -> list[Finding]:
    """Angles between every two candidates that were tested, each pair once."""
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
    """Probabilities of mechanisms are sums over the models; correlations lie within one."""
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
    """Probabilities of the models follow from their odds; each model's mechanisms are those of its parts."""
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
    """Errors before and after from the residuals; residuals of the declared model from pinocchio where it is springs alone."""
    frame, model, found = run.table(file).query("not gross_error"), sagging(run, campaign), []
    if not _session(run, campaign):
        table = f"reports/loop/{campaign}/before_after.csv"
        before_after, means = run.table(table), _means(run, campaign, frame)
        loaded = frame.iloc[np.argsort(np.linalg.norm(frame[["fx", "fy", "fz"]], axis=1), kind="stable")[-run.sample :]]
        left = max((stand.left_m for stand in model.standing(loaded)), default=0.0) if model else 0.0
        allowed = STEP_BACK + means.apart_m + left
        rows = {"before": before_after[before_after["kind"] == "declared"].iloc[:1], "after": before_after.iloc[-1:]}
        for part, errors in (("train", means.errors[~means.held_out]), ("heldout", means.errors[means.held_out])):
            for number, (state, row) in enumerate(rows.items()):
                if not len(errors) or row.empty or f"{part}_rms_m" not in row or _dated(run, campaign, state, means):
                    continue
                each = errors[:, number]
                expected = [each.mean(), np.sqrt((each**2).mean()), each.max()]
                stored = row[[f"{part}_{name}_m" for name in ("mean", "rms", "max")]].to_numpy(float)
                found.append(compared(table, f"{part} errors {state}", "numpy", stored, expected, 1e-8, allowed))
    return found + (_predicted(run, file, campaign, model, frame) if model else [])


@dataclass(frozen=True)
class _Means:
    """Errors before and after (M, 2) of the mean of what was repeated, m, and which are held out.

    `apart_m`: by how much a mean of predictions is off the prediction at the mean joint angles, at most. `repeated`: whether
    anything was.
    """

    errors: np.ndarray
    held_out: np.ndarray
    apart_m: float
    repeated: bool


def _means(run: Audited, campaign: str, frame: pd.DataFrame) -> _Means:
    """Repeats are of one state, target and sense of approach; those that are far off count nowhere, as in a fit."""
    parts = [good_rows(run, campaign, part) for part in ("training", "held_out")]
    approach = [name for name in map(str, parts[0]) if name.startswith("approach")]
    rows = frame.merge(pd.concat([part.loc[~far_off(part), ["row", *approach]] for part in parts]), on="row")
    state = ["held_out", *STATE, *approach]
    groups = rows.groupby([*state, "target"], dropna=False)
    means = groups[[f"{when}_d{axis}" for when in ("before", "after") for axis in "xyz"]].mean()
    errors = np.linalg.norm(means.to_numpy().reshape(-1, 2, 3), axis=2)
    angles = [name for name in map(str, rows) if name[0] == "q" and name[1:].isdigit()]
    # Over turns of joints by t about their mean the target bends off a straight line by t^2 / 2 of its distance.
    turned = rows[angles] - rows.groupby(state, dropna=False)[angles].transform("mean")
    reach = np.linalg.norm(rows[list("xyz")].to_numpy(), axis=1).max(initial=0.0)
    apart = 0.5 * reach * float((turned.abs().sum(axis=1) ** 2).max())
    return _Means(errors, means.index.get_level_values("held_out").to_numpy(bool), apart, bool((groups.size() > 1).any()))


def _dated(run: Audited, campaign: str, state: str, means: _Means) -> bool:
    """Whether a model goes with time or row: repeats then have predictions of their own, and a fit that of their mean."""
    names = set(_document(run, campaign)["campaign"]["declared"])
    if state == "after":
        names |= {effect["name"] for effect in run.document(f"reports/loop/{campaign}/verdict.json")["effects"]}
    return means.repeated and bool(names & _DATED)


def _predicted(run: Audited, file: str, campaign: str, model: Sagging, frame: pd.DataFrame) -> list[Finding]:
    """Residuals of sampled rows by pinocchio, in the base frame with known targets, of a robot of springs and masses alone."""
    asked = _document(run, campaign)["campaign"]
    known = all(target["offset_m"] != "unknown" for target in asked["targets"].values())
    if asked["frame"] != "base" or asked["declared"] or not known or not model.complete or _moved_base(run, campaign):
        return []
    rows = frame.iloc[run.picked(file, len(frame))]
    stands = list(model.standing(rows))
    expected = rows[list("xyz")].to_numpy(float) - [stand.position for stand in stands]
    stored = frame[["before_dx", "before_dy", "before_dz"]]
    # Springs may still settle, all rows together, by thousandths of a standard error of the scatter that is there.
    scatter = max(float(np.sqrt((stored[~frame["held_out"]] ** 2).to_numpy().mean())) / model.noise_m, 1.0)
    columns = np.concatenate([stand.slack_m for stand in stands])
    picked = stored.loc[rows.index].to_numpy(float)
    settling = np.linalg.lstsq(columns, (expected - picked).ravel(), rcond=None)[0]
    expected = expected - (columns @ np.clip(settling, -SETTLED * scatter, SETTLED * scatter)).reshape(expected.shape)
    checked = f"residuals of the declared model, {len(rows)} rows"
    allowed = STEP_BACK + max(stand.left_m for stand in stands)
    return [compared(file, checked, "pinocchio", picked, expected, 0.0, allowed)]


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
