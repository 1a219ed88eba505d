"""Synthetic tables and verdicts of the loop for figures and reports, and the facts that
a report states about them."""

from copy import deepcopy
from pathlib import Path

import numpy as np
import yaml

from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.verdict import (
    ADEQUATE,
    CLASS,
    NAMED,
    NOT_TESTABLE,
    SEVERAL,
    UNEXPLAINED,
)
from elastocal.io.typed_json import from_document, to_document
from elastocal.report.loop_facts import collect_loop_facts
from elastocal.verdict import DataFault, Effect, Probabilities, Verdict

# Entries of verdict.json that are the same in all verdicts.
DATA = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))
FAMILIES = (
    "geometry",
    "gravity",
    "transmission",
    "elastic",
    "gearbox",
    "load",
    "drift",
)


def residual_table(poses=30, repeats=1):
    """Make the columns of a residuals table. Joint 2 causes a sine of 300 µm in the
    vertical direction, which the correction removes."""
    rng = np.random.default_rng(0)
    targets = 2
    count = poses * targets * repeats * 2
    pose = np.repeat(np.arange(poses), targets * repeats * 2)
    angles = rng.uniform(-2, 2, (poses, 6))[pose]
    load = np.tile(np.repeat([0, 1], targets * repeats), poses)
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
        "time_s": 60.0 * np.arange(count),
    }
    table |= {f"q{joint}": angles[:, joint - 1] for joint in range(1, 7)}
    table |= {
        name: 500.0 * load * (name == "fz")
        for name in ("fx", "fy", "fz", "mx", "my", "mz")
    }
    position = rng.uniform([0.5, -1, 0.2], [2, 1, 2], (poses, 3))[pose]
    table |= dict(zip("xyz", position.T, strict=True))
    noise = 20e-6 * rng.normal(size=(count, 3))
    wave = 300e-6 * np.sin(angles[:, 1])
    for stage, size in (("before", 1.0), ("after", 0.0)):
        error = noise + size * wave[:, None] * [0, 0, 1]
        table |= {
            f"{stage}_d{axis}": error[:, number] for number, axis in enumerate("xyz")
        }
        table |= {f"{stage}_r{axis}": np.full(count, np.nan) for axis in "xyz"}
    return table


def candidate_table(count=30, chosen=1):
    """Make the columns of a candidates table, in the order of falling Bayes factors; the
    last ones cannot be tested."""
    total = count + 5
    names = [f"effect_{number}@{number % 6 + 1}" for number in range(total)]
    tested = np.arange(total) < count
    rank = np.arange(total, dtype=float)

    def where_tested(values):
        return np.where(tested, values, np.nan)

    return {
        "candidate": np.array(names, object),
        "family": np.array(
            [FAMILIES[number % len(FAMILIES)] for number in range(total)], object
        ),
        "shape": np.where(rank == 1, 44.7213, np.nan),
        "log_bayes_factor": where_tested(100.0 - 7 * rank),
        "probability": where_tested(np.where(rank < chosen, 0.94, 0.01)),
        "chosen": rank < chosen,
        "note": np.where(tested, "", "no time in the data").astype(object),
    }


def probabilities(sets=None, alarm_p_value=0.002):
    """Make the probabilities of verdict.json from pairs of a set of mechanisms, with
    their locations, and its probability."""
    sets = sets or [
        ({"lost_motion": ["joint 3"]}, 0.94),
        ({"joint_tilt": ["joint 2"]}, 0.05),
        ({}, 0.004),
    ]
    listed = [
        {"mechanisms": list(locations), "probability": value, "locations": locations}
        for locations, value in sets
    ]
    mechanisms = {}
    for locations, value in sets:
        for name in locations:
            mechanisms[name] = mechanisms.get(name, 0.0) + value
    nothing = sum(value for locations, value in sets if not locations)
    facts = {"nothing": nothing, "stated": sets[0][1], "alarm_p_value": alarm_p_value}
    document = facts | {"mechanisms": mechanisms, "sets": listed}
    return from_document(Probabilities, document, "made up")


def step_rows(effects=("lost_motion",), largest_m=3e-4):
    """Make rows of before_after.csv; each model is better than the one before."""
    named = [("frames and targets", "frames"), ("declared model", "declared")]
    named += [(f"with {name}", "effect") for name in effects]
    rows = []
    for number, (name, kind) in enumerate(named):
        size = largest_m * 0.7**number
        row = {"step": name, "kind": kind, "parameters": 6 * min(number, 1) + number}
        for metric, factor in {"mean": 0.5, "rms": 0.6, "p95": 0.9, "max": 1.0}.items():
            row |= {
                f"train_{metric}_m": 0.9 * factor * size,
                f"heldout_{metric}_m": factor * size,
            }
            # Quantiles have no interval.
            low, high = (0.8, 1.2) if metric in ("mean", "rms") else (np.nan, np.nan)
            row |= {
                f"heldout_{metric}_m_low": low * factor * size,
                f"heldout_{metric}_m_high": high * factor * size,
            }
            row |= {f"heldout_{metric}_over_floor": factor * size / 5e-5}
        rows.append(row)
    return rows


def experiment_rows(count=10):
    """Make rows of next_experiment.csv."""
    return [
        DATA["experiment"]
        | {"pose": n, "separation": 10.0 + n, "resolved": 0.5 + 0.04 * n}
        for n in range(count)
    ]


def effect_entry(
    name="lost_motion",
    members=("lost_motion@3",),
    joints=(3,),
    parameters=("half_play",),
    alternatives=(),
    locations=None,
    *,
    adopted=True,
    cost_m=8.5e-5,
):
    """Make an effect of a verdict."""
    names = [f"{member} {parameter}" for member in members for parameter in parameters]
    locations = (
        locations or [(f"joint {joint}", 1.0) for joint in joints] or [("", 1.0)]
    )
    given = {
        "name": name,
        "joints": list(joints),
        "members": list(members),
        "alternatives": list(alternatives),
    }
    given |= {
        "parameters": [
            DATA["parameter"] | {"name": parameter_name, "value": 1.2e-4 * (1 + n)}
            for n, parameter_name in enumerate(names)
        ]
    }
    given |= {
        "locations": [
            {"location": location, "probability": value}
            for location, value in locations
        ]
    }
    judged = {"adopted": True} if adopted else {"adopted": False, "heldout_gain": None}
    document = DATA["effect"] | given | judged
    document["cost_m"] = cost_m if adopted else None
    return from_document(Effect, document, "made up")


def make_verdict(
    word,
    effects=(),
    warnings=(),
    noise="repeats",
    sets=None,
    outside=0,
    reduction=(0.15, 0.32),
    remainder=None,
):
    """Make a verdict with synthetic errors."""
    is_faulty = any(isinstance(effect, DataFault) for effect in effects)
    is_adopted = any(effect.adopted for effect in effects)
    declared = DATA["errors"]
    factor = 0.7 if is_adopted else 1.0
    before = {name: value / 0.7 for name, value in declared.items()}
    after = {name: factor * value for name, value in declared.items()}
    both = {"before": before, "after": after}
    document = deepcopy(DATA["verdict"]) | {
        "campaign": "made_up",
        "verdict": word,
        "effects": to_document(list(effects)),
        "warnings": list(warnings),
        "held": [],
        "remainder": remainder,
        "settings": to_document(Settings().document()),
        "kept": "effect" if is_adopted else "declared",
        "probabilities": None if is_faulty else to_document(probabilities(sets)),
    }
    if is_faulty:
        document |= {"misfit": None, "candidates_tested": 0}
    document["noise"] |= {
        "source": noise,
        "degrees_of_freedom": 1008 if noise == "repeats" else 0,
    }
    heldout = document["heldout"]
    heldout |= {"declared": declared, "after": after}
    heldout["delivered"] = remainder["errors"] if remainder else after
    heldout["before"] |= before
    heldout |= {
        "reduction_ci95": list(reduction) if is_adopted else [0.0, 0.0],
        "reduction_std_error": 0.04 if is_adopted else 0.0,
        "noise_floor_rms_m": None if noise == "residual" else 5e-5,
        "outside_range": {
            "poses": outside,
            "inside": both,
            "outside": both if outside else None,
        },
    }
    return from_document(Verdict, document, "made up")


HARMONICS = [
    f"transmission_harmonic@{joint}[orders {band}]"
    for joint in range(1, 7)
    for band in ("1-2", "3-6", "7-12")
]
WAVES = [f"{wave}_{order}q" for order in range(1, 7) for wave in ("cos", "sin")]
REMAINDER = DATA["remainder"] | {
    "outside": 3,
    "half_width_m": {"within": 1.0e-4, "outside": 4.0e-4},
}
TWO_LOCATIONS = [("joint 3", 0.8), ("joint 5", 0.2)]
CAMPAIGNS = {
    "adequate": make_verdict(
        ADEQUATE, sets=[({}, 0.97), ({"lost_motion": ["joint 3"]}, 0.02)]
    ),
    "named": make_verdict(NAMED, [effect_entry()]),
    "named, location uncertain": make_verdict(
        NAMED, [effect_entry(locations=TWO_LOCATIONS)]
    ),
    "class": make_verdict(
        CLASS, [effect_entry(alternatives=["joint_tilt", "link_elasticity"])]
    ),
    "class with a related mechanism": make_verdict(
        CLASS, [effect_entry(alternatives=["other"])]
    ),
    "several": make_verdict(
        SEVERAL, [effect_entry(), effect_entry("payload", ["payload"], (), ["mass"])]
    ),
    "named, not adopted": make_verdict(NAMED, [effect_entry(adopted=False)]),
    "class, not adopted": make_verdict(
        CLASS, [effect_entry(alternatives=["joint_tilt"], adopted=False)]
    ),
    "unexplained": make_verdict(
        UNEXPLAINED, sets=[({"other": ["joint 2"]}, 0.9), ({}, 0.1)]
    ),
    "not_testable": make_verdict(NOT_TESTABLE, sets=[({}, 1.0)]),
    "fault of the data": make_verdict(
        NAMED,
        [from_document(DataFault, DATA["fault"], "made up")],
        ["the fit of the final model did not converge"],
    ),
    "noise not known": make_verdict(
        ADEQUATE, noise="residual", warnings=["no repeats and no declared noise"]
    ),
    "hundreds of parameters": make_verdict(
        SEVERAL, [effect_entry("transmission_harmonic", HARMONICS, range(1, 7), WAVES)]
    ),
    "with a remainder": make_verdict(
        NAMED, [effect_entry()], outside=3, remainder=REMAINDER
    ),
    "poses outside the range": make_verdict(NAMED, [effect_entry()], outside=3),
}


def facts_of(verdict, **changed):
    """Collect the facts of the report of a verdict; tables that are not given are made
    to fit it."""
    adopted = [effect.name for effect in verdict.effects if effect.adopted]
    given = {
        "steps": step_rows(effects=adopted),
        "experiment": [],
        "table": residual_table(),
        "descriptions": DATA["descriptions"],
        "parameters": {
            name: np.array(values) for name, values in DATA["parameters"].items()
        },
    }
    return collect_loop_facts(verdict, **given | changed)


def plainly(text):
    """Return a text with plain blanks instead of non-breaking ones."""
    return text.replace("\u00a0", " ")
