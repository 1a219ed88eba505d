"""What is chosen among candidates: configurations of a design, link springs of a model; each candidate is tried in full.

A design's worth comes from inverses of whole information matrices, a model's from least squares on whole data sets by QR, where
the pipeline updates matrices and works with normal equations.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal_proof.audit.findings import Finding, compare, require
from elastocal_proof.audit.streams import draw, numbers

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import pandas as pd

    from elastocal_proof.audit.arm import Arm
    from elastocal_proof.audit.audited import Audited

_RANDOM_DESIGNS = 400
# One in so many of the rows of other files: sizes of designs, and data sets of a ladder, that are worked out again.
_FEWER = 4
# How an exchange is searched: among so many candidates, in so many rounds, for so much more.
_SHORT_LIST, _ROUNDS, _MORE = 400, 4, 1e-6
# Steps towards the best weights on candidates, and how far below its value a bound may lie.
_STEPS, _SLACK = 300, 0.01
# Of designs; of models, whose springs nearly do the same.
_CLOSE, _NEARLY = 1e-6, 1e-4
_FOLDS = 5
# Share of a column's squares that is added to them.
_RIDGE = 1e-10


def designs(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Random designs of every size, chosen ones and the bound of some sizes."""
    frame, sizes = run.table(file), run.configuration["questions"]["design_sizes"]
    yield require("sizes", "counting", {*frame["configurations"]} == {*sizes}, f"{set(frame['configurations'])}", len(sizes))
    for joint_range, mine in frame.groupby("joint_range"):
        rows = mine.set_index(["design", "configurations"])[["rms", "low", "high"]]
        products, weight = _candidates(run, robot, str(joint_range))
        draws = numbers(run.seed, robot, "random designs")
        for size in sizes:
            chosen = (draws.choice(len(products), size, replace=False) for _ in range(_RANDOM_DESIGNS))
            errors = np.array([_error(products[some], weight) for some in chosen])
            expected = [np.sqrt((errors**2).mean()), *np.quantile(errors, [0.05, 0.95])]
            checked = f"{size} random configurations, {joint_range}"
            yield compare(checked, "pinocchio", rows.loc[("random", size)], expected, _CLOSE)
        for size in np.array(sizes)[run.pick(f"{file} {joint_range}", len(sizes), _fewer(run))]:
            for kind in "DAI":
                reached = _error(products[_exchange(products, int(size), _value(kind, weight))], weight)
                checked = f"{size} {kind}-optimal configurations, {joint_range}"
                yield compare(checked, "every candidate by pinocchio", rows.loc[(kind, size)], 3 * [reached], _CLOSE)
            bound, reached = rows.loc[("bound", size), "rms"], _best_weights(products, int(size), weight)
            below = (1 - _SLACK) * reached <= bound <= reached * (1 + _CLOSE)
            note = f"{bound:.6g}, the best weights reach {reached:.6g}"
            yield require(f"bound of {size} configurations, {joint_range}", "weights on every candidate", below, note)


def _fewer(run: Audited) -> int:
    return max(1, run.sample // _FEWER)


def _candidates(run: Audited, robot: str, joint_range: str) -> tuple[np.ndarray, np.ndarray]:
    """Information (candidates, n, n) of each candidate in true compliances, and the mean square of what is to be accurate."""
    arm, found = run.arm(robot), []
    settings = run.configuration
    counts = settings["questions"]["candidates"], settings["test_configurations"]
    for purpose, count in zip(("candidates of designs", "test"), counts, strict=True):
        pairs = zip(*draw(run, robot, 0, count, purpose, joint_range), strict=True)
        found.append(np.array([arm.regressor(*pair, arm.end_effector, run.wrench_at) for pair in pairs]) * arm.compliance)
    rows, slope = found[0][:, : run.rows] / run.noise_m, found[1][:, :3]
    return np.einsum("cki,ckj->cij", rows, rows), np.einsum("tki,tkj->ij", slope, slope) / len(slope)


def _error(products: np.ndarray, weight: np.ndarray) -> float:
    """RMS error (m) that configurations leave, of compliances that are known to their own size."""
    return float(np.sqrt(np.trace(weight @ np.linalg.inv(np.eye(len(weight)) + products.sum(axis=0)))))


def _value(kind: str, weight: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Worth of information matrices (..., n, n): the larger the better."""
    if kind == "D":
        return lambda matrices: np.linalg.slogdet(matrices)[1]
    counted = weight if kind == "I" else np.eye(len(weight)) / len(weight)
    return lambda matrices: -np.einsum("ij,...ji->...", counted, np.linalg.inv(matrices))


def _exchange(products: np.ndarray, size: int, value: Callable[[np.ndarray], np.ndarray]) -> list[int]:
    """Candidates one by one, each the best beside those before it; then each in turn against the best for its place."""
    prior, found = np.eye(products.shape[1]), list[int]()

    def gains(kept: list[int], among: np.ndarray) -> np.ndarray:
        matrix = prior + products[kept].sum(axis=0)
        return np.where(np.isin(among, kept), -np.inf, value(matrix + products[among]) - value(matrix))

    for _ in range(size):
        found.append(int(np.argmax(gains(found, np.arange(len(products))))))
    matrix = prior + products[found].sum(axis=0)
    short = np.union1d(np.argsort(-value(matrix + products))[:_SHORT_LIST], found)
    for _ in range(_ROUNDS):
        before = list(found)
        for place, old in enumerate(before):
            gained = gains(found[:place] + found[place + 1 :], short)
            if gained.max() > (1 + _MORE) * gained[short == old][0]:
                found[place] = int(short[np.argmax(gained)])
        if found == before:
            break
    return found


def _best_weights(products: np.ndarray, size: int, weight: np.ndarray) -> float:
    """RMS error by the best weights on all candidates, each as often as it likes: weights grow with the root of their slope."""
    weights = np.full(len(products), 1 / len(products))
    for _ in range(_STEPS):
        inverse = np.linalg.inv(np.eye(len(weight)) + size * np.tensordot(weights, products, axes=1))
        weights *= np.sqrt(np.einsum("cij,ji->c", products, inverse @ weight @ inverse))
        weights /= weights.sum()
    return float(np.sqrt(np.trace(weight @ inverse)))


def ladder(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Models with more and more link springs in sampled data sets: what comes next, where to stop, what is left."""
    frame, questions = run.table(file), run.configuration["questions"]
    cells = frame.groupby(["noise", "length", "data_set"])
    count = len(questions["ladder_noise_um"]) * len(questions["ladder_lengths"]) * run.configuration["data_sets"]
    yield compare("noises, lengths and data sets", "counting", [cells.ngroups], [count], 0.0)
    one, links = cells["chosen"].sum() == 1, cells["added_link"].agg(lambda some: sorted(some) == list(range(len(some))))
    yield require("one model is chosen of each data set", "pandas", one.all(), "none or several", cells.ngroups)
    yield require("every link comes once", "pandas", links.all(), "a link twice", cells.ngroups)
    yield require("squares are positive", "pandas", (frame["mean_square"] > 0).all(), "one that is not", len(frame))
    tests, keys = _springs(run, robot, 0, run.configuration["test_configurations"], "test"), list(cells.indices)
    for place in run.pick(file, len(keys), _fewer(run)):
        yield from _climb(run, robot, cells.get_group(keys[place]).sort_values("link_springs"), tests)


def _climb(run: Audited, robot: str, cell: pd.DataFrame, tests: tuple[np.ndarray, np.ndarray]) -> Iterator[Finding]:
    """The models of one data set, along the order that the file has."""
    arm, longest = run.arm(robot), max(run.configuration["questions"]["ladder_lengths"])
    noise, length, data_set = (cell[name].iloc[0] for name in ("noise", "length", "data_set"))
    columns, clean = _springs(run, robot, int(data_set), length)
    normal = numbers(run.seed, robot, f"noise/{arm.end_effector}", int(data_set)).standard_normal((longest, 6))[:length]
    right, at = clean + noise * normal, f"{1e6 * noise:g} µm, length {length}, data set {data_set}"
    added, chosen = (cell["added_link"].to_numpy()[1:] - 1).tolist(), int(cell["chosen"].to_numpy().argmax())

    def validate(links: list[int]) -> float:
        """Squares that are left in each fold by the model of the others."""
        fold, taken = np.arange(length) % _FOLDS, _taken(arm, links)
        models = [_least_squares(columns[fold != k], right[fold != k], taken) for k in range(_FOLDS)]
        return sum(float(((right[fold == k] - columns[fold == k] @ model) ** 2).sum()) for k, model in enumerate(models))

    steps = [added[:step] for step in range(len(added) + 1)]
    models = [_least_squares(columns, right, _taken(arm, links)) for links in steps]
    squares = [((tests[1][:, :3] - tests[0][:, :3] @ model) ** 2).sum(axis=1).mean() for model in models]
    scores = [validate(links) for links in steps]
    better = [scores[k] / validate([*links[:-1], other]) for k, links in enumerate(steps) if k for other in added[k:]]
    by, worst = "least squares on pinocchio", max(better, default=1.0)
    yield compare(f"squares left, {at}", by, cell["mean_square"], squares, _NEARLY, scale=squares)
    note = f"another link leaves {worst:.6g} times less"
    yield require(f"each link is the best one, {at}", by, worst <= 1 + _NEARLY, note, len(added))
    best = scores[chosen] <= min(scores) * (1 + _NEARLY)
    yield require(f"the model chosen is the best one, {at}", by, best, f"{chosen} links", len(scores))


def _springs(
    run: Audited, robot: str, data_set: int, count: int, purpose: str = "identification"
) -> tuple[np.ndarray, np.ndarray]:
    """Deflection per unit of each spring (configurations, 6, n + 8 links), and the exact one (configurations, 6)."""
    arm = run.arm(robot)
    columns, moved = [], []
    for pair in zip(*draw(run, robot, data_set, count, purpose), strict=True):
        torques = arm.torques(*pair, arm.end_effector, run.wrench_at)
        jacobian = arm.jacobian(arm.extend(pair[0]), f"{arm.end_effector} target")
        parts = [jacobian[:, : arm.joints] * torques[: arm.joints]]
        for number, vector in enumerate(arm.links):
            block, turn = arm.link_block(number), np.kron(np.eye(2), _triad(vector))
            along, forced = jacobian[:, block] @ turn, turn.T @ torques[block]
            parts.append(along * forced)
            # Bending: a force deflects and turns, a moment turns and deflects.
            parts += [(along[:, i] * forced[j] + along[:, j] * forced[i])[:, None] for i, j in ((1, 5), (2, 4))]
        columns.append(np.concatenate(parts, axis=1))
        moved.append(arm.deflection(*pair, arm.end_effector, run.wrench_at))
    return np.array(columns), np.array(moved)


def _triad(vector: np.ndarray) -> np.ndarray:
    """Axes of a link in columns: along it, across it and the axis of the chain that is least along it, and across both."""
    along = vector / np.linalg.norm(vector)
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    across /= np.linalg.norm(across)
    return np.stack([along, across, np.cross(along, across)], axis=1)


def _taken(arm: Arm, links: list[int]) -> np.ndarray:
    """Columns of the joints and of some links."""
    return np.concatenate([np.arange(arm.joints), *(arm.joints + 8 * link + np.arange(8) for link in links)])


def _least_squares(columns: np.ndarray, right: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """Coefficients of all columns, zero where not taken; a ridge in rows of its own."""
    matrix = columns.reshape(-1, columns.shape[-1])[:, taken]
    scale = np.linalg.norm(matrix, axis=0)
    basis, triangle = np.linalg.qr(np.concatenate([matrix / scale, np.sqrt(_RIDGE) * np.eye(len(taken))]))
    found = np.zeros(columns.shape[-1])
    found[taken] = np.linalg.solve(triangle, basis[: len(matrix)].T @ right.ravel()) / scale
    return found


CHECKS = {"results/designs/{robot}.parquet": designs, "results/ladder/{robot}.parquet": ladder}
