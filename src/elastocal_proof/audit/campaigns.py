"""Campaigns of the loop: the split of the poses, predictions of the declared model, probabilities, errors before and after."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pinocchio as pin
import yaml
from pandas.api.types import is_numeric_dtype

from elastocal_proof.audit.arm import Arm
from elastocal_proof.audit.audited import WRENCH
from elastocal_proof.audit.elastic import STATE, far_off, find_configurations, good_rows
from elastocal_proof.audit.equilibrium import Sagging, sagging
from elastocal_proof.audit.findings import Finding, compare, require
from elastocal_proof.audit.fits import SETTLED, STEP_BACK
from elastocal_proof.audit.streams import numbers

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal_proof.audit.audited import Audited

_POSE = ["session", "pose"]
# Effects that go with the time or with the row of a measurement.
_DATED = {"frame_drift", "setup_step", "temperature_gradient", "thermal_growth"}
# Positions are some metres, rotations some radians; near half a turn rotation vectors lose digits.
_DIGITS = 1e-10


def simulated(run: Audited, file: str, campaign: str) -> Iterator[Finding]:
    """Every angle, load and noise of a simulated campaign from its stream, every pose of the elastic arm by pinocchio."""
    source = _configured(run, "campaigns", campaign)
    if source.get("source") != "simulated":
        return
    document, table = _configured(run, "robots", source["robot"]), run.table(file)
    arm, draws = Arm(document), numbers(run.seed, campaign, "campaign")
    low, high = np.deg2rad(document["joint_limits_deg"]).T
    angles = low + (high - low) * draws.random((source["poses"], arm.joints))
    normal = draws.standard_normal((source["poses"], 3))
    forces = source["force_N"] * normal / np.linalg.norm(normal, axis=1)[:, None]
    # Without load and under the whole one the first poses are approached again and again.
    visits = [
        (pose, load, repeat)
        for pose in range(source["poses"])
        for load in range(len(source["ladder"]))
        for repeat in range(source["repeats"] if pose < source["repeated_poses"] and load < 2 else 1)
    ]
    wrenches, loaded = [], []
    for pose, load, _ in visits:
        force = source["ladder"][load] * forces[pose]
        wrenches.append(np.concatenate([force, np.cross(source["offset_m"], force)]))
        torques = arm.torques(angles[pose], wrenches[-1], arm.end_effector, "end_effector")
        loaded.append(arm.extend(angles[pose]) + arm.springs @ torques)
    for point in source["points"]:
        position, turned = (draws.standard_normal((len(visits), 3)) for _ in range(2))
        exact = [arm.pose(coordinates, point) for coordinates in loaded]
        seen = [
            (*(place + source["noise_m"] * off), *pin.log3(pin.exp3(source["noise_rad"] * turn) @ rotation))
            for (place, rotation), off, turn in zip(exact, position, turned, strict=True)
        ]
        rows, of_pose = table[table["target"] == point], angles[[pose for pose, _, _ in visits]]
        columns = [("visits", ["pose", "load", "repeat"], visits), ("wrenches", [*WRENCH], wrenches)]
        columns += [("joint angles", [f"q{j}" for j in range(1, arm.joints + 1)], of_pose)]
        for words, names, expected in [*columns, ("measured poses", ["x", "y", "z", "rx", "ry", "rz"], seen)]:
            yield compare(f"{words} of {point}", "pinocchio, numpy's Philox stream", rows[names], expected, _DIGITS)


def _configured(run: Audited, kind: str, name: str) -> dict[str, Any]:
    path = run.folder / f"config/{kind}/{name}.yaml"
    return dict(yaml.safe_load(path.read_text("utf-8"))) if path.is_file() else {}


def measurements(run: Audited, file: str, campaign: str) -> Iterator[Finding]:
    """Fitted and held-out measurements are those of the campaign's file, each once, and share no pose."""
    fitted, held_out = run.table(file), run.table(file.replace("training", "held_out"))
    # Poses of another campaign are numbered anew; measurements of it are others all the same.
    names, words = (list("xyz"), "measurement") if _is_session(run, campaign) else (_POSE, "pose")
    shared = set.intersection(*(set(map(tuple, frame[names].to_numpy())) for frame in (fitted, held_out)))
    note = f"{words}s {sorted(shared)[:3]}"
    yield require(f"no {words} is fitted and held out", "pandas", not shared, note, len(fitted))
    if {"fraction", "blocks"} & set(_document(run, campaign).get("campaign", {}).get("holdout", {})):
        both = pd.concat([fitted.assign(unseen=False), held_out.assign(unseen=True)]).groupby(_POSE).mean(numeric_only=True)
        parts = both["unseen"].groupby(find_configurations(both.filter(regex=r"^q\d+$").to_numpy())).nunique()
        note = f"{(parts > 1).sum()} of {len(parts)}"
        yield require("no configuration is fitted and held out", "numpy", parts.eq(1).all(), note, len(both))
    original = _original(run, campaign)
    if original is not None:
        rows = pd.concat([fitted, held_out]).sort_values("row")
        yield compare("every row of the campaign once", "counting", rows["row"], np.arange(1, len(original) + 1), 0.0)
        if len(rows) == len(original):
            columns = [name for name in ("pose", *"xyz", *WRENCH[:3]) if name in original]
            yield compare("columns as measured", "pandas", rows[columns], original[columns], 0.0)


def kept_back(run: Audited, file: str, campaign: str) -> Iterator[Finding]:
    """Held-out measurements are those of the campaign's file, by their rows."""
    rows, original = run.table(file), _original(run, campaign)
    if original is not None:
        names = [name for name in rows if name in original and name != "target" and is_numeric_dtype(original[name])]
        expected = original.iloc[rows["row"].to_numpy() - 1][names]
        yield compare("measurements as the campaign has them", "pandas", rows[names], expected, 0.0)


def confounding(run: Audited, file: str, campaign: str) -> Iterator[Finding]:
    """Angles between every two candidates that were tested, each pair once."""
    frame = run.table(file)
    tested, pairs = {*frame["one"], *frame["other"]}, {*map(frozenset, zip(frame["one"], frame["other"], strict=True))}
    every = len(pairs) == len(frame) == len(tested) * (len(tested) - 1) // 2
    yield require("every two candidates once", "counting", every, f"{len(frame)} pairs of {len(tested)}", len(frame))
    right = frame["angle_deg"].between(0, 90).all()
    yield require("angles between 0 and 90 degrees", "counting", right, "another one", len(frame))


def diagnosis(run: Audited, file: str, campaign: str) -> Iterator[Finding]:
    """Probabilities of mechanisms are sums over the models; correlations lie within one."""
    models = run.table(f"results/loop/{campaign}/models.parquet")
    probability = models["probability"].to_numpy()
    total = probability.sum()
    proper = probability.min(initial=0.0) >= 0 and total <= 1 + 1e-9
    yield require("probabilities of the models", "pandas", proper, f"they sum to {total:.9g}", len(models))
    falling = (np.diff(probability) <= 1e-12).all()
    yield require("the most probable model comes first", "pandas", falling, "another one", len(models))
    stated = (run.document(file)["document"].get("probabilities") or {}).get("mechanisms", {})
    for name, value in stated.items():
        having = np.array([name in text.split(" + ") for text in models["mechanisms"]], bool)
        # Models that are not kept hold the rest.
        summed = probability[having].sum()
        near, note = abs(value - summed) <= 1 - total + 1e-6, f"stated {value:.6g}, models sum to {summed:.6g}"
        yield require(f"probability of {name}", "pandas", near, note, int(having.sum()))
    correlations = run.table(f"results/loop/{campaign}/correlations.parquet")["correlation"]
    within = (correlations.abs() <= 1 + 1e-9).all()
    yield require("correlations lie within one", "pandas", within, "one beyond", len(correlations))


def models(run: Audited, file: str, campaign: str) -> Iterator[Finding]:
    """Probabilities of the models follow from their odds; each model's mechanisms are those of its parts.

    Of parts beside a smooth error either that or they may be too small to be stated.
    """
    frame = run.table(file)
    odds = np.exp(frame["log_odds"] - frame["log_odds"].max())
    yield compare("probabilities by odds", "numpy", frame["probability"], odds * frame["probability"].sum() / odds.sum())
    parts = [{re.split(r"[@\[ ]", unit)[0] for unit in units.split("; ") if unit} for units in frame["units"]]
    off = [stated for stated, named in zip(frame["mechanisms"], parts, strict=True) if stated not in _stated_of(named)]
    yield require("mechanisms of the parts of each model", "text", not off, ", ".join(off[:2]), len(frame))


def _stated_of(parts: set[str]) -> set[str]:
    """What a model of some mechanisms may state."""
    known = parts - {"other"}
    choices = [parts, known, parts - known] if known and known != parts else [parts]
    return {" + ".join(sorted(names)) or "nothing" for names in choices}


def residuals(run: Audited, file: str, campaign: str) -> Iterator[Finding]:
    """Errors before and after from the residuals; residuals of the declared model from pinocchio where it is springs alone."""
    frame, model = run.table(file).query("not gross_error"), sagging(run, campaign)
    if not _is_session(run, campaign):
        yield from _errors(run, campaign, frame, model)
    if model is not None:
        yield from _predicted(run, file, campaign, model, frame)


def _errors(run: Audited, campaign: str, frame: pd.DataFrame, model: Sagging | None) -> Iterator[Finding]:
    """Mean, RMS and maximum in before_after.csv of the means of what was repeated.

    Repeats are of one state, target and sense of approach; those that are far off count nowhere, as in a fit.
    """
    table = f"reports/loop/{campaign}/before_after.csv"
    parts = [good_rows(run, campaign, part) for part in ("training", "held_out")]
    approach = [name for name in map(str, parts[0]) if name.startswith("approach")]
    rows = frame.merge(pd.concat([part.loc[~far_off(part), ["row", *approach]] for part in parts]), on="row")
    groups = rows.groupby(["held_out", *STATE, *approach, "target"], dropna=False)
    means = groups[[f"{when}_d{axis}" for when in ("before", "after") for axis in "xyz"]].mean()
    errors = np.linalg.norm(means.to_numpy().reshape(-1, 2, 3), axis=2)
    unseen = means.index.get_level_values("held_out").to_numpy(bool)
    # Over turns of joints by t about their mean the target bends off a straight line by t^2 / 2 of its distance.
    angles = rows.filter(regex=r"^q\d+$")
    turned = angles - angles.groupby([rows[name] for name in ("held_out", *STATE, *approach)], dropna=False).transform("mean")
    reach = np.linalg.norm(rows[list("xyz")].to_numpy(), axis=1).max(initial=0.0)
    loaded = frame.iloc[np.argsort(np.linalg.norm(frame[["fx", "fy", "fz"]], axis=1), kind="stable")[-run.sample :]]
    allowed = STEP_BACK + 0.5 * reach * float((turned.abs().sum(axis=1) ** 2).max())
    allowed += max((stand.left_m for stand in model.standing(loaded)), default=0.0) if model else 0.0
    stated, names = run.table(table), {*_document(run, campaign)["campaign"]["declared"]}
    models = {"before": stated[stated["kind"] == "declared"].iloc[:1], "after": stated.iloc[-1:]}
    for number, (state, row) in enumerate(models.items()):
        if state == "after":
            names |= {each["name"] for each in run.document(f"reports/loop/{campaign}/verdict.json")["effects"]}
        # Of a model that goes with time or row repeats have predictions of their own, and a fit that of their mean.
        if row.empty or (names & _DATED and (groups.size() > 1).any()):
            continue
        for part, each in (("train", errors[~unseen, number]), ("heldout", errors[unseen, number])):
            if len(each) and f"{part}_rms_m" in row:
                stored = row[[f"{part}_{name}_m" for name in ("mean", "rms", "max")]]
                expected = [each.mean(), np.sqrt((each**2).mean()), each.max()]
                found = compare(f"{part} errors {state}", "numpy", stored, expected, 1e-8, allowed)
                yield replace(found, file=table)


def _predicted(run: Audited, file: str, campaign: str, model: Sagging, frame: pd.DataFrame) -> Iterator[Finding]:
    """Residuals of sampled rows by pinocchio, in the base frame with known targets, of a robot of springs and masses alone."""
    asked, steps = _document(run, campaign)["campaign"], run.table(f"results/loop/{campaign}/steps.parquet")
    known = all(target["offset_m"] != "unknown" for target in asked["targets"].values())
    moved = steps[steps["step"] == steps["step"].min()]["owner"].str.contains("frame|session", regex=True).any()
    if asked["frame"] != "base" or asked["declared"] or not known or not model.complete or moved:
        return
    rows = frame.iloc[run.pick(file, len(frame))]
    stands = list(model.standing(rows))
    expected = rows[list("xyz")].to_numpy(float) - [stand.position for stand in stands]
    stored = frame[["before_dx", "before_dy", "before_dz"]]
    # Springs may still settle, all rows together, by thousandths of a standard error of the scatter that is there.
    scatter = max(float(np.sqrt((stored[~frame["held_out"]] ** 2).to_numpy().mean())) / model.noise_m, 1.0)
    columns, picked = np.concatenate([stand.slack_m for stand in stands]), stored.loc[rows.index].to_numpy(float)
    settling = np.clip(
        np.linalg.lstsq(columns, (expected - picked).ravel(), rcond=None)[0], -SETTLED * scatter, SETTLED * scatter
    )
    allowed, checked = STEP_BACK + max(stand.left_m for stand in stands), f"residuals of the declared model, {len(rows)} rows"
    yield compare(checked, "pinocchio", picked, expected - (columns @ settling).reshape(expected.shape), 0.0, allowed)


def _document(run: Audited, campaign: str) -> dict[str, Any]:
    return dict(run.document(f"results/loop/{campaign}/campaign.json"))


def _is_session(run: Audited, campaign: str) -> bool:
    """Whether another campaign is the test, whose frames are fitted anew."""
    return _document(run, campaign).get("held_out") is not None


def _original(run: Audited, campaign: str) -> pd.DataFrame | None:
    """What was measured, of a campaign whose test is part of it."""
    source = f"data/campaigns/{campaign}/measurements.parquet"
    return run.table(source) if run.has(source) and not _is_session(run, campaign) else None


CHECKS = {
    "data/campaigns/{campaign}/measurements.parquet": simulated,
    "results/loop/{campaign}/training.parquet": measurements,
    "results/loop/{campaign}/diagnosis.json": diagnosis,
    "results/loop/{campaign}/held_out.parquet": kept_back,
    "results/loop/{campaign}/confounding.parquet": confounding,
    "results/loop/{campaign}/models.parquet": models,
    "reports/loop/{campaign}/residuals.parquet": residuals,
}
