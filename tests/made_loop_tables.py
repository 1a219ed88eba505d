"""Tables of the loop made up for figures and reports: their columns, no robot behind them."""

import numpy as np

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


def candidate_table(count=30, untestable=5, chosen=1, beyond=2):
    """Columns of a candidates table: the first ones stand out most, the last cannot be tested."""
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
        "p_value": where_tested(10.0 ** -(40.0 - rank)),
        "p_family": where_tested(np.where(rank < beyond, 0.0005, 0.9)),
        "statistic": where_tested(200 - 4 * rank),
        "bic_gain": where_tested(180 - 4 * rank),
        "chosen": rank < chosen,
        "angle_deg": where_tested(50.0),
        "note": np.where(tested, "", "no time in the data").astype(object),
    }


def confounding_table(candidates):
    """Angles of all pairs of the tested candidates of a table."""
    shapes = [f" {shape:.3g}" if np.isfinite(shape) else "" for shape in candidates["shape"]]
    named = candidates["candidate"] + np.array(shapes, object)
    names = named[np.isfinite(candidates["p_value"])]
    pairs = [(one, other) for number, one in enumerate(names) for other in names[:number]]
    return {
        "one": np.array([one for one, _ in pairs], object),
        "other": np.array([other for _, other in pairs], object),
        "angle_deg": np.linspace(0, 90, len(pairs)),
    }


def step_rows(effects=("lost_motion",), controls=("joint_offset@4",), largest_m=3e-4):
    """Rows of before_after.csv, each model better than the one before."""
    named = [("frames and targets", "frames"), ("declared model", "declared")]
    named += [(f"+ {name}", "effect") for name in effects] + [(f"control: {name}", "control") for name in controls]
    rows = []
    for number, (name, kind) in enumerate(named):
        size = largest_m * (0.7 if kind == "control" else 0.7**number)
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
        row = {"effect": effect, "pose": number, "load": 1, "point": "6DoF"} | {
            f"q{joint}": -0.1 * joint for joint in range(1, 7)
        }
        row |= {"fx": 910.1, "fy": -0.2, "fz": -411.8, "mx": -205.9, "my": 0.0, "mz": 455.1}
        rows.append(row | {"separation": 110.0 + 10 * number, "separation_without": 100.0})
    return rows


def effect_entry(
    name="lost_motion", members=("lost_motion@3",), joints=(3,), parameters=("half_play",), alternatives=(), doubted=()
):
    """An entry of the effects of verdict.json; its first member goes with what is `doubted`."""
    named = [
        {"name": f"{member} {parameter}", "value": 1.2e-4 * (1 + number), "std_error": 3e-6, "unit": "rad", "held": False}
        for number, (member, parameter) in enumerate((m, p) for m in members for p in parameters)
    ]
    return {
        "name": name,
        "family": "gearbox",
        "joints": list(joints),
        "members": list(members),
        "parameters": named,
        "p_value": 0.0005,
        "heldout_gain": 0.24,
        "alternatives": list(alternatives),
        "doubts": [{"effect": members[0], "departure": departure, "p_value": 0.001} for departure in doubted],
        "angle_to_nearest_deg": 49.0,
    }


def fault_entry():
    """A fault of the data among the effects of verdict.json."""
    return {
        "name": "wrong_unit",
        "family": "data",
        "joints": [],
        "detail": "the loads look as if they were written in kilonewtons",
        "parameters": [{"name": "newtons for each unit of force written", "value": 1000.0, "std_error": None, "unit": "N"}],
        "p_value": None,
        "heldout_gain": None,
        "alternatives": [],
        "doubts": [],
        "angle_to_nearest_deg": None,
    }


def verdict_document(word, effects=(), warnings=(), rejected_after=False, noise="repeats", campaign="made_up", held=()):
    """Contents of verdict.json."""
    known = noise != "residual"
    before = {
        "mean_square_over_noise": 1.5 if known else None,
        "p_value": 1e-6 if known else None,
        "rejected": bool(effects) and known,
    }
    after = {"mean_square_over_noise": 1.01 if known else None, "p_value": 0.4 if known else None, "rejected": rejected_after}
    errors = {"mean_m": 1.1e-4, "rms_m": 1.2e-4, "p95_m": 2.0e-4, "max_m": 3.0e-4}
    return {
        "campaign": campaign,
        "verdict": word,
        "effects": list(effects),
        "noise": {
            "source": noise,
            "position_m": 6e-5,
            "orientation_rad": 6e-5,
            "joint_rad": [0.0] * 5 + [2e-5],
            "degrees_of_freedom": 1008 if noise == "repeats" else 0,
        },
        "lack_of_fit": {"before": before, "after": after, "explained_share": 0.3},
        "heldout": {
            "before": errors,
            "after": {name: 0.7 * value for name, value in errors.items()},
            "noise_floor_rms_m": 5e-5 if known else None,
            "reduction_ci95": [0.15, 0.32],
            "reduction_std_error": 0.04,
            "poses": 10,
        },
        "compliance_urad_per_Nm": {"before": [0.5] * 6, "after": [0.48] * 6, "std_error": [0.01] * 5 + [0.0]},
        "held": list(held),
        "candidates_tested": 30,
        "warnings": list(warnings),
    }


def parameter_table(declared=("joint_offset@2 offset",), held=()):
    """Columns of a parameters table: a frame, the compliances, those named, and the discrepancy."""
    named = [f"frame 0 {axis}" for axis in ("dx", "dy", "dz")] + [f"joint_compliance c{joint}" for joint in range(1, 7)]
    named += [*declared, "fit discrepancy"]
    count = len(named)
    return {
        "owner": np.array([name.rsplit(" ", 1)[0] for name in named], object),
        "parameter": np.array([name.rsplit(" ", 1)[1] for name in named], object),
        "unit": np.array(["rad"] * count, object),
        "value": np.full(count, 3e-4),
        "std_error": np.full(count, 2e-5),
        "held": np.isin(named, held),
        "prior_std": np.full(count, np.nan),
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
