"""Errors planted into the files of a finished study, as somebody would make them who also forges every checksum."""

import contextlib
import hashlib
import json
import shutil

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from elastocal.io.data_frames import write_csv
from elastocal.io.origin import Origin
from elastocal.io.records import JobRecord, write_records
from elastocal.io.storage import read_blocks, write_table
from elastocal_proof.audit.schemas import SCHEMAS

IDEAL = "data/simulated/kuka/ideal.parquet"
EXPERIMENTS = "data/simulated/kuka/experiments.parquet"
MEASURED = "data/simulated/kuka/200um/measured.parquet"
IDENTIFIED = "results/identified/kuka/200um/6DoF.parquet"
DESIGN = "results/design/kuka/6DoF.parquet"
METRICS = "results/metrics/kuka/200um/6DoF.parquet"
REPLICATES = "results/replicates/kuka/200um/6DoF.parquet"
ACCURACY = "results/accuracy/kuka/200um/6DoF.parquet"
DESIGNS, GEOMETRY, USES = (f"results/{kind}/kuka.parquet" for kind in ("designs", "geometry", "uses"))
LADDER = "results/ladder/kuka_extended.parquet"
COMPARISON, EXPECTATIONS = "reports/tables/comparison.csv", "reports/tables/expectations.csv"
SCORES, PAIRS = "reports/tables/strategy_scores.csv", "reports/tables/strategy_pairs.csv"
CAMPAIGN = "kuka_extended_end_effector"
STEPS, CORRELATIONS, MODELS, HELD_OUT = (
    f"results/loop/{CAMPAIGN}/{name}.parquet" for name in ("steps", "correlations", "models", "held_out")
)
RESIDUALS, BEFORE_AFTER, SPLITS, VERDICT = (
    f"reports/loop/{CAMPAIGN}/{name}" for name in ("residuals.parquet", "before_after.csv", "splits.csv", "verdict.json")
)
CAMPAIGNS = "reports/loop/campaigns.csv"
# Of the comparison the row of the first figure of Table 3.
TABLE3 = 21


def forge(folder, file):
    """Record a file's checksum as if a job had written it."""
    with contextlib.chdir(folder):
        write_records(JobRecord("forged", {}, "", "", {}, (), (file,), Origin("c0ffee", "d16e57", 1), {}))


def rewritten(folder, file, change, joints=6, **origin):
    """Change the columns of each row group and write the table again."""
    path = folder / file
    metadata = {
        k.decode(): json.loads(v) for k, v in pq.ParquetFile(path).metadata.metadata.items() if k.startswith(b"elastocal.")
    }
    schema = SCHEMAS[metadata["elastocal.table"]](joints)
    blocks = [change({name: np.array(values) for name, values in block.items()}) for block in read_blocks(path, schema)]
    for block in blocks:
        for column in schema.columns:
            if column.type == "string":
                block[column.name] = block[column.name][0]
    write_table(path, schema, blocks, metadata["elastocal.provenance"] | origin)
    forge(folder, file)


def scaled(factor, *names):
    """A change that multiplies columns."""
    return lambda block: block | {name: factor * block[name] for name in names}


def copied(folder, file, source):
    """A file in place of another one."""
    shutil.copy(folder / source, folder / file)
    forge(folder, file)


def tabulated(folder, file, frame):
    """A table in place of a CSV file."""
    write_csv(folder / file, frame)
    forge(folder, file)


def cell(folder, file, column, factor, row=0):
    """One cell of a CSV file multiplied."""
    frame = pd.read_csv(folder / file)
    frame.loc[row, column] *= factor
    tabulated(folder, file, frame)


def first_cell(folder, file, column, factor):
    """The first cell of a column that is not zero, multiplied."""
    values = pd.read_csv(folder / file)[column].fillna(0)
    cell(folder, file, column, factor, int(np.flatnonzero(values)[0]))


def said(folder, file, column, value):
    """The first cell of a column that says something else than a value, saying that."""
    frame = pd.read_csv(folder / file)
    other = frame[column].dropna() != value
    assert other.any()
    frame.loc[other.idxmax(), column] = value
    tabulated(folder, file, frame)


def shortened(folder, file, row):
    """A CSV file without one row."""
    tabulated(folder, file, pd.read_csv(folder / file).drop(index=row))


def flipped_byte(folder):
    """One byte in the middle of a file, checksums as they were."""
    data = bytearray((folder / MEASURED).read_bytes())
    data[len(data) // 2] ^= 1
    (folder / MEASURED).write_bytes(data)


def other_unit(folder):
    """A column that says it is in millimetres."""
    file = pq.ParquetFile(folder / ACCURACY)
    # Without the schema that Arrow keeps a second time.
    metadata = {key: value for key, value in file.metadata.metadata.items() if key != b"ARROW:schema"}
    table = file.read()
    place = table.schema.get_field_index("rms")
    field = table.schema.field(place)
    field = field.with_metadata(field.metadata | {b"unit": b"mm"})
    schema = table.schema.set(place, field).with_metadata(metadata)
    pq.write_table(pa.Table.from_arrays(table.columns, schema=schema), folder / ACCURACY, row_group_size=2**30)
    forge(folder, ACCURACY)


def other_seed(folder):
    """Noise of another seed, in a file that says it has the right one."""

    def change(block):
        rng = np.random.default_rng(2)
        return block | {
            name: block[name] + 2e-4 * rng.standard_normal(len(block[name])) for name in ("dx", "dy", "dz", "rx", "ry", "rz")
        }

    shutil.copy(folder / "data/simulated/kuka/0um/measured.parquet", folder / MEASURED)
    rewritten(folder, MEASURED, change, noise="200")


def of_another_run(folder):
    """A file that a run with another seed has left."""
    path = folder / MEASURED
    origin = json.loads(pq.ParquetFile(path).metadata.metadata[b"elastocal.provenance"])
    configuration = origin["configuration"] | {"seed": 7}
    digest = hashlib.sha256(json.dumps(configuration, sort_keys=True).encode()).hexdigest()[:16]
    rewritten(folder, MEASURED, dict, configuration=configuration, configuration_sha256=digest)


def without_first_set(block):
    return {name: values[block["data_set"] > 0] for name, values in block.items()}


def second_set_twice(block):
    return block | {"data_set": np.where(block["data_set"] == 2, 1, block["data_set"])}


def mirrored_point(block):
    return block | {"dz": -block["dz"]} if block["point"][0] == "3DoF" else block


def shuffled(block):
    order = np.random.default_rng(1).permutation(len(block["k_sigma"]))
    return block | {"k_sigma": block["k_sigma"][order]}


def of_parameter(name, step, column, change):
    """A change of one figure of one parameter in one model of a campaign."""

    def changed(block):
        chosen = (np.array(block["parameter"]) == name) & (block["step"] == step)
        return block | {column: np.where(chosen, change(block), block[column])}

    return changed


def rewritten_json(folder, file, change):
    """Change a JSON document in place."""
    document = json.loads((folder / file).read_text("utf-8"))
    change(document)
    (folder / file).write_text(json.dumps(document), encoding="utf-8")
    forge(folder, file)


def better_probability(block):
    """The most probable model a little more so, at the cost of the next."""
    probability = block["probability"].copy()
    probability[0], probability[1] = probability[0] + 0.01, probability[1] - 0.01
    return block | {"probability": probability}


def next_length(block):
    return block | {"rms_per_noise": np.append(block["rms_per_noise"][1:], block["rms_per_noise"][-1] * 0.99)}


def swapped_solvers(block):
    pairs = {
        f"{name}_c{j}": block[f"{other}_c{j}"]
        for j in range(1, 7)
        for name, other in (("equation_11", "gauss_newton"), ("gauss_newton", "equation_11"))
    }
    return block | pairs


def next_best(block):
    """Another link first: the first two of the ladder the other way round in each data set."""
    place = block["link_springs"]
    order = block["added_link"].copy()
    order[place == 1], order[place == 2] = order[place == 2], order[place == 1]
    return block | {"added_link": order}


def one_more_link(block):
    """The model with one link more for the one that cross-validation chose; the smallest for the largest."""
    by_set = block["chosen"].reshape(-1, block["link_springs"].max() + 1)
    return block | {"chosen": np.roll(by_set, 1, axis=1).ravel()}


def of_designs(**kinds):
    """A change that multiplies the errors of designs of some kinds."""
    return lambda block: (
        block
        | {name: block[name] * np.array([kinds.get(kind, 1.0) for kind in block["design"]]) for name in ("rms", "low", "high")}
    )


def typo(folder):
    """A digit of a table for people."""
    path = folder / "reports/tables/table1.md"
    text = path.read_text(encoding="utf-8")
    assert text.count("2.79") == 1
    path.write_text(text.replace("2.79", "2.97"), encoding="utf-8")
    forge(folder, "reports/tables/table1.md")


def planted(file, change, *how):
    """A file, and what plants an error into it in a folder."""
    return file, lambda folder: change(folder, file, *how)


# What is planted, in which file, and how. Ends of bootstrap intervals are not worked out again: tests hold how they are drawn.
PLANTED = {
    "one byte altered": (MEASURED, flipped_byte),
    "a file deleted": ("results/weights/kuka.parquet", lambda folder: (folder / "results/weights/kuka.parquet").unlink()),
    "a unit swapped": (ACCURACY, other_unit),
    "millimetres for metres": planted("results/initial/kuka.parquet", rewritten, scaled(1e3, "mean")),
    "degrees for radians": planted(EXPERIMENTS, rewritten, scaled(180 / np.pi, "q3")),
    "a force turned round": planted(EXPERIMENTS, rewritten, scaled(-1.0, "fy")),
    "noise of another seed": (MEASURED, other_seed),
    "a file of another run": (MEASURED, of_another_run),
    "a noise level in place of another": planted(MEASURED, copied, "data/simulated/kuka/0um/measured.parquet"),
    "a strategy in place of another": planted(METRICS, copied, "results/metrics/kuka/200um/3+6DoF-comb.parquet"),
    "a data set left out": planted(IDEAL, rewritten, without_first_set),
    "a data set twice": planted(IDENTIFIED, rewritten, second_set_twice),
    "an axis mirrored at one point": planted(IDEAL, rewritten, mirrored_point),
    "compliances scaled": planted(IDENTIFIED, rewritten, scaled(1.0001, "c2")),
    "variances for standard deviations": planted(DESIGN, rewritten, scaled(2.0, "cov_4_4")),
    "a score too good": planted(METRICS, rewritten, scaled(0.99, "deviation")),
    "replicates shuffled": planted(REPLICATES, rewritten, shuffled),
    "weights that count all alike": planted(
        "results/weights/kuka.parquet", rewritten, lambda block: block | {"count": np.ones_like(block["count"])}
    ),
    "a bound of the next length": planted("results/bounds/kuka.parquet", rewritten, next_length),
    "solvers swapped": planted("results/solvers/kuka.parquet", rewritten, swapped_solvers),
    "squares of a research question scaled": planted("results/budget/kuka.parquet", rewritten, scaled(1.01, "mean_square")),
    "a standard error too small": planted("reports/tables/table3.csv", cell, "c4_std_error", 0.7),
    "a cell of Table 4 altered": planted("reports/tables/table4.csv", cell, "dev_20_um", 0.98, 1),
    "random designs of another seed": planted(DESIGNS, rewritten, of_designs(random=1.001)),
    "chosen designs better than they are": planted(DESIGNS, rewritten, of_designs(I=0.999)),
    "a bound that no design can keep": planted(DESIGNS, rewritten, of_designs(bound=1.01)),
    "another link first": planted(LADDER, rewritten, next_best),
    "a model too large chosen": planted(LADDER, rewritten, one_more_link),
    "squares of models scaled": planted(LADDER, rewritten, scaled(1.001, "mean_square")),
    "a leak too small": planted(GEOMETRY, rewritten, scaled(0.999, "zero_leak")),
    "an influence on a quantile scaled": planted(USES, rewritten, scaled(1.001, "pooled_p95_influence")),
    "a p value of the comparison altered": planted(COMPARISON, cell, "p_value", 1.01, TABLE3),
    "a corrected p value altered": planted(COMPARISON, cell, "p_holm", 0.99, TABLE3),
    "a spread of studies altered": planted(COMPARISON, cell, "studies_std", 1.01, TABLE3),
    "a figure of the paper altered": planted(COMPARISON, cell, "paper", 1.01, TABLE3),
    "a figure of the paper left out": planted(COMPARISON, shortened, TABLE3),
    "an expectation altered": planted(EXPECTATIONS, cell, "expected", 1.001),
    "a p value of an expectation altered": planted(EXPECTATIONS, cell, "p_value", 1.01, 1),
    "an interval of a pair too narrow": planted(PAIRS, cell, "ratio_high", 0.999),
    "a pair said to be reversed": planted(PAIRS, said, "reversed", True),
    "a rank altered": planted(SCORES, cell, "rank", 2),
    "a compliance of a campaign altered": planted(
        STEPS, rewritten, of_parameter("c4", 1, "value", lambda b: b["value"] + 0.01 * b["std_error"])
    ),
    "an effect's parameter altered": planted(
        STEPS, rewritten, of_parameter("torsion_1_over_GJ", 2, "value", lambda b: b["value"] + 0.01 * b["std_error"])
    ),
    "a standard error of a campaign halved": planted(
        STEPS, rewritten, of_parameter("c2", 2, "std_error", lambda b: 0.5 * b["std_error"])
    ),
    "errors of few configurations scaled": planted("results/few/kuka.parquet", rewritten, scaled(1.01, "mean_square")),
    "errors by poses scaled": planted("results/kinds/kuka.parquet", rewritten, scaled(1.01, "mean_square")),
    "a first order too good": planted("results/stiffness/kuka.parquet", rewritten, scaled(0.9, "first_order")),
    "stiffness errors of other studies scaled": planted(
        "results/studies/R5_positions/kuka.parquet", rewritten, scaled(1.01, "k_sigma")
    ),
    "chosen configurations that are worse than random ones": planted(
        "results/simulated_designs/few/kuka.parquet", rewritten, scaled(-1.0, "rms")
    ),
    "a cell of Table 4 over studies altered": planted("reports/tables/table4_studies.csv", cell, "dev_20_um", 1.001),
    "a rank in the joint test that cannot be": planted("reports/tables/joint_test.csv", cell, "below_p", 0.99),
    "an error of a design in other units": planted("reports/tables/simulated_designs_few.csv", cell, "rms_um", 1e-3),
    "a prior left out": planted(STEPS, rewritten, of_parameter("taper", 2, "prior_std", lambda b: 0.1)),
    "a correlation with the wrong sign": planted(CORRELATIONS, rewritten, scaled(-1.0, "correlation")),
    "a model more probable than its odds": planted(MODELS, rewritten, better_probability),
    "a held-out measurement altered": planted(HELD_OUT, rewritten, scaled(1.00001, "z")),
    "residuals after too small": planted(RESIDUALS, rewritten, scaled(0.99, "after_dx", "after_dy", "after_dz")),
    "residuals of orientations too small": planted(RESIDUALS, rewritten, scaled(0.99, "before_ry")),
    "an error after too small": planted(BEFORE_AFTER, cell, "heldout_rms_m", 0.999, 2),
    "an error over another floor": planted(BEFORE_AFTER, cell, "heldout_rms_over_floor", 0.99, 1),
    "a reduction of a block altered": planted(SPLITS, cell, "reduction", 1.001, 3),
    "a probability of the verdict raised": planted(
        VERDICT, rewritten_json, lambda d: d["effects"][0].update(probability=0.999)
    ),
    "a standard error of the verdict altered": planted(
        VERDICT, rewritten_json, lambda d: d["heldout"].update(reduction_std_error=0.05)
    ),
    "a gain of an effect altered": planted(VERDICT, rewritten_json, lambda d: d["effects"][0].update(heldout_gain=0.74)),
    "a cell of the overview of campaigns altered": planted(CAMPAIGNS, cell, "after_rms_mm", 0.999),
    "a campaign left out of the overview": planted(CAMPAIGNS, shortened, 0),
    "a verdict of the overview altered": planted(CAMPAIGNS, said, "verdict", "adequate"),
    "a digit of a printed table": ("reports/tables/table1.md", typo),
}


def swapped_folds(block):
    """Two poses in each other's folds."""
    fold = block["random"].copy()
    places = [0, int(np.flatnonzero(fold != fold[0])[0])]
    fold[places] = fold[places[::-1]]
    return block | {"random": fold}


def seen_pose(block):
    """A pose that is said to be held out in another fold than it is."""
    fold = block["fold"].copy()
    fold[block["pose"] == 7] = 1 + fold[block["pose"] == 7] % 4
    return block | {"fold": fold}


BLIND = {
    name: f"reports/blind/{name}.csv"
    for name in ("cases", "probabilities", "reliability", "summary", "settings", "confusion", "power", "coverage")
}
MOVED = "results/closed_loop/kuka.parquet"
CASES, TOGETHER, GOALS = (f"reports/closed_loop/{name}.csv" for name in ("cases", "closed_loop", "goals"))
GAINS = "reports/planning/gains.csv"
SLIPS, RATES = "reports/bad_rows/cases.csv", "reports/bad_rows/summary.csv"
FOLDS, ENTRIES = "results/league/one/folds.parquet", "results/league/one/random/half.parquet"
LEAGUE, MECHANISMS = "reports/league/small/league.csv", "reports/league/small/mechanisms.csv"


def of_blind(name, column, factor):
    return planted(BLIND[name], first_cell, column, factor)


# The same for what stands in reports of the blind proof, the closed loop, plans and the league.
PLANTED_IN_PROOFS = {
    "a case said to be detected": planted(BLIND["cases"], said, "named_right", True),
    "an error of a case altered": of_blind("cases", "after_rms_m", 0.99),
    "a p value of the oracle altered": of_blind("cases", "oracle_p_value", 2.0),
    "a stated probability altered": of_blind("probabilities", "stated", 0.99),
    "a size of a set of hypotheses altered": of_blind("probabilities", "set_size", 2),
    "a share of the reliability diagram altered": of_blind("reliability", "rate", 1.01),
    "a rate of the summary altered": of_blind("summary", "rate", 0.99),
    "a limit of the wrong quantile": of_blind("summary", "high", 0.98),
    "a target that was missed said to be reached": planted(BLIND["summary"], said, "holds", True),
    "a target moved": of_blind("summary", "target_high", 1.2),
    "false alarms of a setting altered": of_blind("settings", "hits", 2),
    "a case counted twice in the confusion matrix": of_blind("confusion", "adequate", 2),
    "a power altered": of_blind("power", "detected_low", 0.99),
    "coverage of intervals altered": of_blind("coverage", "rate", 0.9),
    "a pose of the closed loop altered": planted(MOVED, rewritten, lambda b: b | {"pose": b["pose"] * 0}),
    "an error of the closed loop altered": planted(CASES, cell, "found", 0.999),
    "an error without the tracker's noise altered": planted(CASES, cell, "true_reached", 0.999, 3),
    "a ratio to the floor altered": planted(TOGETHER, cell, "over_floor", 0.999, 3),
    "a case more within the goal": planted(GOALS, cell, "within", 2),
    "an interval of the goal by another method": planted(GOALS, cell, "share_low", 0.95),
    "a verdict that bad rows changed said to be the same": planted(SLIPS, said, "damaged_same", True),
    "a rate of bad rows altered": planted(RATES, cell, "low", 1.01, 0),
    "a worth of a plan altered": planted(GAINS, cell, "random_mm", 1.1),
    "poses in each other's folds": planted(FOLDS, rewritten, swapped_folds),
    "a pose predicted that was fitted": planted(ENTRIES, rewritten, seen_pose),
    "an error of the league altered": planted(LEAGUE, cell, "rms_mm", 0.999, 1),
    "a ratio to the best altered": planted(LEAGUE, cell, "ratio_to_best", 1.001, 2),
    "a share of intervals altered": planted(LEAGUE, cell, "covered", 1.01, 2),
    "a share of a mechanism altered": planted(MECHANISMS, cell, "share_low", 1.01, 1),
}
