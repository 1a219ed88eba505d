"""A folder with a blind proof, a closed loop and a league, their tables made by the functions of the pipeline."""

import hashlib
import json
from itertools import product

import numpy as np
import pandas as pd
from made_audits import forge
from made_blind_documents import PLAN, effect, frame, oracle, truth, verdict
from made_leagues import made_entries

from elastocal import __version__
from elastocal.io.data_frames import write_csv
from elastocal.io.storage import write_table
from elastocal.random_streams import stream
from elastocal_proof.blind import schemas as of_blind
from elastocal_proof.blind.closed_loop import MODELS, PARTS, case_errors, goals, summary
from elastocal_proof.blind.scores import intervals_of
from elastocal_proof.blind.summary import rates, reliability
from elastocal_proof.blind.summary import summarize as summarize_cases
from elastocal_proof.league.methods import dealt
from elastocal_proof.league.schemas import ENTRIES, FOLDS, MECHANISMS
from elastocal_proof.league.table import league_table, mechanism_table

SEED = 1
LEAGUE = {
    "folds": 4,
    "reference": "geometry",
    "methods": {"geometry": {}, "half": {}, "process": {}},
    "data": {"small": {"A robot": ["one"]}},
}
_ORIGIN = {
    "elastocal_version": __version__,
    "configuration": {},
    "configuration_sha256": hashlib.sha256(b"{}").hexdigest()[:16],
}


def made_proofs(folder):
    """Write all of it, with the checksums that jobs would have kept."""
    beside = ["results/closed_loop", "reports/closed_loop"]
    of_league = ["results/league/one/random", "reports/league/small"]
    for name in ("data/sealed/some_1", "results/blind/oracle", "reports/blind", *beside, *of_league):
        (folder / name).mkdir(parents=True)
    _blind(folder)
    _closed_loop(folder)
    _league(folder)
    files = [path for part in ("data", "results", "reports") for path in sorted((folder / part).rglob("*")) if path.is_file()]
    for path in files:
        forge(folder, path.relative_to(folder).as_posix())


def _cases():
    """Ground truths with verdicts and oracles: right, in a class, wrong, silent, of every group that is scored."""
    draws = np.random.default_rng(3)
    groups = [("single", 200.0), ("single", 50.0), ("setting", 50.0)]
    groups += [("several_joints", 200.0), ("outside", 200.0), ("none", 0.0)]
    for number in range(90):
        group, level = groups[number % len(groups)]
        joint, right = 1 + number % 6, draws.random() < 0.7
        kind = "outside:slipping_zero" if group == "outside" else "joint_offset"
        places = [] if group == "none" or number % 18 == 2 else [(kind, joint)]
        document = truth(
            *places,
            group=group,
            level=level,
            robot="kuka" if number % 5 == 0 else "irb7600",
            setting="force_3kN" if group == "setting" else "usual",
            campaign=f"case_{number:03}",
        )
        for defect in document["defects"]:
            defect["parameters"] = {"offset": 1e-4}
        size = 1e-4 * (1 + 0.3 * draws.standard_normal())
        found = effect(
            "joint_offset" if right else "payload", joint, parameters=[("offset", size, 3e-5)], alternatives=["payload"]
        )
        word = "adequate" if not places and right else ("named", "class")[number % 7 == 0]
        effects = [] if word == "adequate" else [found]
        said = verdict(
            word, *effects, after=1e-4 * (1 + 0.1 * draws.random()), freedom=288, compliance=1 + 0.1 * draws.random()
        )
        top = [each["name"] for each in effects]
        stated = 0.5 + 0.49 * draws.random()
        sets = [{"mechanisms": top, "probability": stated}, {"mechanisms": ["other"], "probability": 1 - stated}]
        said["probabilities"] = {"nothing": 0.01, "alarm_p_value": 0.002, "sets": sets}
        yield document, said | {"campaign": document["campaign"]}, oracle(rms=1e-4 * (1 + 0.02 * draws.random()))


def _blind(folder):
    entries, lines = list(_cases()), []
    for document, _, _ in entries:
        path = folder / f"data/sealed/some_1/{document['campaign']}.json"
        path.write_text(json.dumps(document), encoding="utf-8")
        lines.append(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n")
    (folder / "reports/blind/manifest.sha256").write_text("".join(lines), encoding="utf-8")
    (folder / "results/blind/some_1.json").write_text(json.dumps([said for _, said, _ in entries]), encoding="utf-8")
    known = {document["campaign"]: {"oracle": found, "limit": None} for document, _, found in entries}
    (folder / "results/blind/oracle/some_1.json").write_text(json.dumps(known), encoding="utf-8")
    cases = frame(*entries)
    spans = pd.DataFrame([row for document, said, _ in entries for row in intervals_of(PLAN, document, said)])
    tables = {
        "cases": cases,
        "intervals": spans,
        "rates": rates(cases),
        "reliability": reliability(cases),
        "summary": summarize_cases(PLAN, cases, spans, SEED),
    }
    for name, table in tables.items():
        write_csv(folder / f"reports/blind/{name}.csv", table)


def made_moves(cases=8, poses=50, seed=1, reached=1.0):
    """Poses of cases of the closed loop, errors normal and of a size for each model; a share `reached` of each is no noise."""
    draws, sizes = np.random.default_rng(seed), dict(zip(MODELS, (3e-3, 2e-3, 2e-4, 1.1e-4, 1e-4), strict=True))
    rows = []
    for case, part, model in product(range(cases), PARTS, MODELS):
        off = np.linalg.norm(sizes[model] / np.sqrt(3) * draws.standard_normal((poses, 3)), axis=1)
        row = {"effect": "payload", "seed": case, "verdict": "named", "named": case % 2 == 0, "part": part, "model": model}
        row |= {"pose": np.arange(poses), "reached_error_m": reached * off, "measured_error_m": off}
        rows.append(pd.DataFrame(row | {"predicted_std_m": sizes[model], "corrected": True}))
    return pd.concat(rows, ignore_index=True)


def _closed_loop(folder):
    moves = made_moves(poses=30, seed=2, reached=0.5)
    moves.loc[(moves["pose"] == 3) & (moves["model"] == "geometry"), "corrected"] = False
    block = {name: column.to_numpy() for name, column in moves.items()}
    block |= {f"q{joint}": np.zeros(len(moves)) for joint in range(1, 7)}
    write_table(folder / "results/closed_loop/kuka.parquet", of_blind.closed_loop(6), [block], _ORIGIN)
    errors = case_errors({"kuka": moves})
    write_csv(folder / "reports/closed_loop/cases.csv", errors)
    write_csv(folder / "reports/closed_loop/closed_loop.csv", summary(errors, SEED))
    write_csv(folder / "reports/closed_loop/goals.csv", goals(errors))


class _Measured:
    """What folds are dealt by: poses with their joint angles."""

    def __init__(self, pose):
        self.session, self.pose = np.zeros(len(pose), np.int32), pose
        self.joint_angles = np.random.default_rng(5).uniform(-1, 1, (pose.max() + 1, 3))[pose]


def _league(folder):
    made = made_entries(1e-4, 40)
    measured = _Measured(made["pose"].to_numpy())
    folds = dealt(measured, LEAGUE["folds"], stream(SEED, "one", "league folds", 0))
    write_table(folder / "results/league/one/folds.parquet", FOLDS, [folds], _ORIGIN)
    # Of the measurements an audit looks at which there are.
    angles = {f"q{joint + 1}": measured.joint_angles[:, joint] for joint in range(measured.joint_angles.shape[1])}
    made[["session", "pose", "load", "target"]].assign(**angles).to_parquet(folder / "results/league/one/measurements.parquet")
    results = {}
    for method, size, std in (("geometry", 2e-4, None), ("half", 1e-4, None), ("process", 1.2e-4, 1.2e-4)):
        entries = made_entries(size, 40, len(method), std).assign(fold=folds["random"][made["pose"]])
        columns = {name: entries[name].to_numpy() for name in entries}
        write_table(folder / f"results/league/one/random/{method}.parquet", ENTRIES, [columns], _ORIGIN)
        results["one", "random", method] = entries
    found = pd.DataFrame(
        {"fold": [1, 2, 3, 4, 1], "mechanism": ["payload"] * 4 + ["other"], "probability": [0.9, 0.8, 1, 1, 0.2], "share": 0.3}
    )
    columns = {name: found[name].tolist() if name == "mechanism" else found[name].to_numpy(float) for name in found}
    write_table(folder / "results/league/one/random/mechanisms.parquet", MECHANISMS, [columns], _ORIGIN)
    robots = LEAGUE["data"]["small"]
    write_csv(folder / "reports/league/small/league.csv", league_table(results, robots, LEAGUE["reference"], SEED))
    write_csv(folder / "reports/league/small/mechanisms.csv", mechanism_table({"one": found}, robots, LEAGUE["folds"]))
