"""Tables of the loop made up for figures and reports: their columns, no robot behind them."""

from copy import deepcopy
from pathlib import Path

import numpy as np
import yaml

from elastocal.data_checks.protocol import data_at_fault
from elastocal.diagnosis.settings import Settings

# What of verdict.json is always the same.
DATA = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))
FAMILIES = ("geometry", "gravity", "transmission", "elastic", "gearbox", "load", "drift")


def residual_table(poses=30, targets=2, loaded=True, timed=True, found=True, repeats=1, seed=0):
    """Columns of a residuals table; joint 2 makes a sine of 300 µm in the vertical that goes with what is found."""
    rng = np.random.default_rng(seed)
    count = poses * targets * repeats * 2
    pose = np.repeat(np.arange(poses), targets * repeats * 2)
    angles = rng.uniform(-2, 2, (poses, 6))[pose]
    load = np.tile(np.repeat([0, 1], targets * repeats), poses) if loaded else np.zeros(count, int)
    table = {
        "session": np.zeros(count, int),
        "pose": pose,
        "load": load,
        "repeat": np.tile(np.repeat(np.arange(repeats), targets), 2 * poses),
        "target": np.tile(np.arange(targets), 2 * poses * repeats),
        "row": np.arange(1, count + 1),
        "held_out": pose % 3 == 0,
        "gross_error": np.zeros(len(pose), bool),
        "outside_range": pose == 0,
        "time_s": 60.0 * np.arange(count) if timed else np.full(count, np.nan),
    }
    table |= {f"q{joint}": angles[:, joint - 1] for joint in range(1, 7)}
    table |= {name: 500.0 * load * (name == "fz") for name in ("fx", "fy", "fz", "mx", "my", "mz")}
    place = rng.uniform([0.5, -1, 0.2], [2, 1, 2], (poses, 3))[pose]
    table |= dict(zip("xyz", place.T, strict=True))
    noise = 20e-6 * rng.normal(size=(count, 3))
    wave = 300e-6 * np.sin(angles[:, 1])
    for stage, size in (("before", 1.0), ("after", 0.0 if found else 1.0)):
        off = noise + size * wave[:, None] * [0, 0, 1]
        table |= {f"{stage}_d{axis}": off[:, number] for number, axis in enumerate("xyz")}
        table |= {f"{stage}_r{axis}": np.full(count, np.nan) for axis in "xyz"}
    return table


def candidate_table(count=30, untestable=5, chosen=1, note="no time in the data"):
    """Columns of a candidates table: by falling Bayes factor, the last cannot be tested."""
    total = count + untestable
    names = [f"effect_{number}@{number % 6 + 1}" for number in range(total)]
    tested = np.arange(total) < count
    rank = np.arange(total, dtype=float)

    def where_tested(values):
        return np.where(tested, values, np.nan)

    return {
        "candidate": np.array(names, object),
        "effect": np.array([name.split("@")[0] for name in names], object),
        "family": np.array([FAMILIES[number % len(FAMILIES)] for number in range(total)], object),
        "joints": np.array([name.split("@")[1] for name in names], object),
        "shape": np.where(rank == 1, 44.7213, np.nan),
        "parameters": np.ones(total, int),
        "log_bayes_factor": where_tested(100.0 - 7 * rank),
        "probability": where_tested(np.where(rank < chosen, 0.94, 0.01)),
        "chosen": rank < chosen,
        "note": np.where(tested, "", note).astype(object),
    }


def probabilities(sets=None, alarm_p_value=0.002):
    """Probabilities of verdict.json; `sets` of mechanisms with their locations, each with its probability."""
    sets = sets or [({"lost_motion": ["joint 3"]}, 0.94), ({"joint_tilt": ["joint 2"]}, 0.05), ({}, 0.004)]
    listed = [{"mechanisms": list(where), "probability": value, "locations": where} for where, value in sets]
    mechanisms = {}
    for where, value in sets:
        for name in where:
            mechanisms[name] = mechanisms.get(name, 0.0) + value
    nothing = sum(value for where, value in sets if not where)
    facts = {"nothing": nothing, "stated": sets[0][1], "alarm_p_value": alarm_p_value}
    return facts | {"mechanisms": mechanisms, "sets": listed}


def step_rows(effects=("lost_motion",), largest_m=3e-4):
    """Rows of before_after.csv, each model better than the one before."""
    named = [("frames and targets", "frames"), ("declared model", "declared")]
    named += [(f"with {name}", "effect") for name in effects]
    rows = []
    for number, (name, kind) in enumerate(named):
        size = largest_m * 0.7**number
        row = {"step": name, "kind": kind, "parameters": 6 * min(number, 1) + number}
        for metric, factor in {"mean": 0.5, "rms": 0.6, "p95": 0.9, "max": 1.0}.items():
            row |= {f"train_{metric}_m": 0.9 * factor * size, f"heldout_{metric}_m": factor * size}
            # As of few poses: the 95th percentile is open above, the maximum has no interval.
            low, high = {"p95": (0.8, np.inf), "max": (np.nan, np.nan)}.get(metric, (0.8, 1.2))
            row |= {f"heldout_{metric}_m_low": low * factor * size, f"heldout_{metric}_m_high": high * factor * size}
            row |= {f"heldout_{metric}_over_floor": factor * size / 5e-5}
        rows.append(row)
    return rows


def experiment_rows(effect="link_elasticity", count=10):
    """Rows of next_experiment.csv."""
    rows = []
    for number in range(count):
        row = {"effect": effect, "pose": number, "load": 1, "point": "6DoF"}
        row |= {f"q{joint}": -0.1 * joint for joint in range(1, 7)}
        row |= {"fx": 910.1, "fy": -0.2, "fz": -411.8, "mx": -205.9, "my": 0.0, "mz": 455.1}
        rows.append(row | {"separation": 10.0 + number, "resolved": 0.5 + 0.04 * number})
    return rows


def effect_entry(
    name="lost_motion",
    members=("lost_motion@3",),
    joints=(3,),
    parameters=("half_play",),
    alternatives=(),
    locations=None,
    adopted=True,
    cost_m=8.5e-5,
):
    """An entry of the effects of verdict.json."""
    names = [f"{member} {parameter}" for member in members for parameter in parameters]
    locations = locations or [(f"joint {joint}", 1.0) for joint in joints] or [("", 1.0)]
    given = {"name": name, "joints": list(joints), "members": list(members), "alternatives": list(alternatives)}
    given |= {"parameters": [DATA["parameter"] | {"name": each, "value": 1.2e-4 * (1 + n)} for n, each in enumerate(names)]}
    given |= {"locations": [{"location": where, "probability": value} for where, value in locations]}
    judged = {"adopted": True} if adopted else {"adopted": False, "heldout_gain": None}
    return DATA["effect"] | given | judged | {"cost_m": cost_m if adopted else None}


def fault_entry():
    """A fault of the data among the effects of verdict.json."""
    return effect_entry(adopted=False) | DATA["fault"]


def remainder_facts(outside=0):
    """What verdict.json says of a regression on the remainder."""
    widths = {"within": 1.0e-4, "outside": 4.0e-4 if outside else None}
    return DATA["remainder"] | {"outside": outside, "half_width_m": widths}


def verdict_document(
    word,
    effects=(),
    warnings=(),
    noise="repeats",
    campaign="made_up",
    held=(),
    sets=None,
    outside=0,
    reduction=(0.15, 0.32),
    next_experiment=None,
    remainder=None,
):
    """Contents of verdict.json."""
    faulty, adopted = data_at_fault({"effects": effects}), any(effect["adopted"] for effect in effects)
    before = DATA["errors"]
    after = {name: (0.7 if adopted else 1.0) * value for name, value in before.items()}
    both = {"before": before, "after": after}
    found = deepcopy(DATA["verdict"]) | {"campaign": campaign, "verdict": word, "effects": list(effects)}
    found |= {"warnings": list(warnings), "held": list(held), "remainder": remainder, "settings": Settings().document()}
    found |= {"kept": "effect" if adopted else "declared", "probabilities": None if faulty else probabilities(sets)}
    found |= {"misfit": None, "candidates_tested": 0} if faulty else {}
    found |= {"next_experiment": next_experiment} if next_experiment else {}
    found["noise"] |= {"source": noise, "degrees_of_freedom": 1008 if noise == "repeats" else 0}
    heldout = found["heldout"]
    heldout |= both | {"delivered": remainder["errors"] if remainder else after}
    heldout["uncalibrated"] |= {name: value / 0.7 for name, value in before.items()}
    heldout |= {"reduction_ci95": list(reduction) if adopted else [0.0, 0.0], "reduction_std_error": 0.04 if adopted else 0.0}
    heldout["noise_floor_rms_m"] = None if noise == "residual" else 5e-5
    heldout["outside_range"] = {"poses": outside, "inside": both, "outside": both if outside else None}
    return found


def parameter_table(declared=("joint_offset@2 offset",), held=(), by_prior=()):
    """Columns of a parameters table: a frame, the compliances and those named, some of which only their priors determine."""
    named = [f"frame 0 {axis}" for axis in ("dx", "dy", "dz")] + [f"joint_compliance c{joint}" for joint in range(1, 7)]
    named += declared
    count = len(named)
    return {
        "owner": np.array([name.rsplit(" ", 1)[0] for name in named], object),
        "parameter": np.array([name.rsplit(" ", 1)[1] for name in named], object),
        "unit": np.array(["rad"] * count, object),
        "value": np.full(count, 3e-4),
        "std_error": np.full(count, 2e-5),
        "held": np.isin(named, held),
        "prior_std": np.where(np.isin(named, by_prior), 2.1e-5, np.nan),
    }


def campaign_descriptions(name="made_up", robot="A robot", held_out=None, declared=("joint_offset",), targets=("A", "B")):
    """Contents of campaign.json, as far as a report reads them."""
    campaign = {
        "campaign": name,
        "measured": "position",
        "frame": "tracker",
        "targets": {target: {"point": "6DoF", "offset_m": "unknown"} for target in targets},
        "compliance": "identify",
        "declared": list(declared),
    }
    other = {"campaign": campaign | {"campaign": held_out}} if held_out else None
    return {"campaign": campaign, "robot": {"name": robot}, "held_out": other}
