"""What is chosen among candidates: configurations of a design, link springs of a model; each candidate is tried in full.

A design's worth comes from inverses of whole information matrices, a model's from least squares on whole data sets by QR, where
the pipeline updates matrices and works with normal equations.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.audit.findings import Finding, compared, held
from elastocal.audit.questions import drawn
from elastocal.audit.streams import numbers

if TYPE_CHECKING:
    from collections.abc import Callable

    import pandas as pd

    from elastocal.audit.arm import Arm
    from elastocal.audit.audited import Audited

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


def designs(run: Audited, file: str, robot: str) -> list[Finding]:
    """Random designs of every size, chosen ones and the bound of some sizes."""
    frame, questions = run.table(file), run.configuration["questions"]
    sizes = questions["design_sizes"]
    found = [held(file, "sizes", "counting", set(frame["configurations"]) == set(sizes), f"{set(frame['configurations'])}")]
    for joint_range, mine in frame.groupby("joint_range"):
        by_kind = mine.set_index(["design", "configurations"])
        products, weight = _candidates(run, robot, str(joint_range))
        draws = numbers(run.seed, robot, "random designs", 0)
        for size in sizes:
            errors = [
                _error(products[draws.choice(len(products), size, replace=False)], weight) for _ in range(_RANDOM_DESIGNS)
            ]
            expected = [np.sqrt(np.mean(np.square(errors))), *np.quantile(errors, [0.05, 0.95])]
            stored = by_kind.loc[("random", size), ["rms", "low", "high"]].to_numpy(float)
            checked = f"{size} random configurations, {joint_range}"
            found.append(compared(file, checked, "pinocchio", stored, expected, _CLOSE))
        for size in np.array(sizes)[run.picked(f"{file} {joint_range}", len(sizes), _few(run))]:
            for kind in "DAI":
                best = _chosen(products, int(size), _value(kind, weight))
                checked = f"{size} {kind}-optimal configurations, {joint_range}"
                stored = by_kind.loc[(kind, size), ["rms", "low", "high"]].to_numpy(float)
                expected = 3 * [_error(products[best], weight)]
                found.append(compared(file, checked, "every candidate by pinocchio", stored, expected, _CLOSE))
            bound, reached = float(by_kind.loc[("bound", size), "rms"]), _best_weights(products, int(size), weight)
            below = (1 - _SLACK) * reached <= bound <= reached * (1 + _CLOSE)
            note = f"{bound:.6g}, the best weights reach {reached:.6g}"
            checked = f"bound of {size} configurations, {joint_range}"
            found.append(held(file, checked, "weights on every candidate", below, note))
    return found


def _few(run: Audited) -> int:
    return max(1, run.sample // _FEWER)


def _candidates(run: Audited, robot: str, joint_range: str) -> tuple[np.ndarray, np.ndarray]:
    """Information (candidates, n, n) of each candidate in true compliances, and the mean square of what is to be accurate."""
    arm, settings = run.arm(robot), run.configuration
    noise, end = 1e-6 * settings["tables"]["noise_um"], arm.end_effector
    pairs = zip(
        *drawn(run, robot, 0, settings["questions"]["candidates"], 1.0, "candidates of designs", joint_range), strict=True
    )
    rows = np.array([arm.regressor(q, w, end, run.wrench_at)[: run.rows] for q, w in pairs]) * arm.compliance / noise
    pairs = zip(*drawn(run, robot, 0, settings["test_configurations"], 1.0, "test", joint_range), strict=True)
    slope = np.array([arm.regressor(q, w, end, run.wrench_at)[:3] for q, w in pairs]) * arm.compliance
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


def _chosen(products: np.ndarray, size: int, value: Callable[[np.ndarray], np.ndarray]) -> list[int]:
    """Candidates one by one, each the best beside those before it; then each in turn against the best for its place."""
    prior, found = np.eye(products.shape[1]), list[int]()

    def worths(kept: list[int], among: np.ndarray) -> np.ndarray:
        matrix = prior + products[kept].sum(axis=0)
        gained = value(matrix + products[among]) - value(matrix)
        return np.where(np.isin(among, kept), -np.inf, gained)

    every = np.arange(len(products))
    for _ in range(size):
        found.append(int(np.argmax(worths(found, every))))
    matrix = prior + products[found].sum(axis=0)
    short = np.union1d(np.argsort(-value(matrix + products))[:_SHORT_LIST], found)
    for _ in range(_ROUNDS):
        before = list(found)
        for place, old in enumerate(before):
            gained = worths(found[:place] + found[place + 1 :], short)
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
        slopes = np.einsum("cij,ji->c", products, inverse @ weight @ inverse)
        weights *= np.sqrt(slopes)
        weights /= weights.sum()
    return float(np.sqrt(np.trace(weight @ inverse)))


def ladder(run: Audited, file: str, robot: str) -> list[Finding]:
    """Models with more and more link springs in sampled data sets: what comes next, where to stop, what is left."""
    frame, questions = run.table(file), run.configuration["questions"]
    cells = frame.groupby(["noise", "length", "data_set"])
    count = len(questions["ladder_noise_um"]) * len(questions["ladder_lengths"]) * run.configuration["data_sets"]
    found = [compared(file, "noises, lengths and data sets", "counting", [cells.ngroups], [count], 0.0)]
    one = bool((cells["chosen"].sum() == 1).all())
    found.append(held(file, "one model is chosen of each data set", "pandas", one, "none or several", cells.ngroups))
    links = cells["added_link"].agg(lambda some: sorted(some) == list(range(len(some))))
    found.append(held(file, "every link comes once", "pandas", bool(links.all()), "a link twice", cells.ngroups))
    positive = bool((frame["mean_square"] > 0).all())
    found.append(held(file, "squares are positive", "pandas", positive, "one that is not", len(frame)))
    tests = _springs(run, robot, 0, run.configuration["test_configurations"], "test")
    keys = list(cells.indices)
    for place in run.picked(file, len(keys), _few(run)):
        noise, length, data_set = (float(keys[place][0]), *map(int, keys[place][1:]))
        found += _rungs(run, file, robot, cells.get_group(keys[place]), (noise, length, data_set), tests)
    return found


def _rungs(
    run: Audited, file: str, robot: str, cell: pd.DataFrame, key: tuple[float, int, int], tests: tuple[np.ndarray, np.ndarray]
) -> list[Finding]:
    """The models of one data set, along the order that the file has."""
    arm, (noise, length, data_set) = run.arm(robot), key
    columns, clean = _springs(run, robot, data_set, length)
    longest = max(run.configuration["questions"]["ladder_lengths"])
    normal = numbers(run.seed, robot, f"noise/{arm.end_effector}", data_set).standard_normal((longest, 6))[:length]
    right, at = clean + noise * normal, f"{1e6 * noise:g} µm, length {length}, data set {data_set}"
    cell = cell.sort_values("link_springs")
    added, chosen = cell["added_link"].to_numpy()[1:] - 1, int(cell["chosen"].to_numpy().argmax())

    def left_out(some: list[int]) -> float:
        total, place = 0.0, np.arange(length) % _FOLDS
        for fold in range(_FOLDS):
            model = _least_squares(columns[place != fold], right[place != fold], _taken(arm, some))
            total += float(((right[place == fold] - columns[place == fold] @ model) ** 2).sum())
        return total

    scores, squares, worst = [], [], 1.0
    for step in range(len(added) + 1):
        so_far = list(added[:step])
        model = _least_squares(columns, right, _taken(arm, so_far))
        squares.append(((tests[1][:, :3] - tests[0][:, :3] @ model) ** 2).sum(axis=1).mean())
        scores.append(left_out(so_far))
        if step:
            others = [left_out([*so_far[:-1], link]) for link in added[step:]]
            worst = max(worst, scores[-1] / min([scores[-1], *others]))
    best = scores[chosen] <= min(scores) * (1 + _NEARLY)
    by = "least squares on pinocchio"
    note = f"another link leaves {worst:.6g} times less"
    return [
        compared(file, f"squares left, {at}", by, cell["mean_square"], squares, _NEARLY, scale=squares),
        held(file, f"each link is the best one, {at}", by, worst <= 1 + _NEARLY, note, len(added)),
        held(file, f"the model chosen is the best one, {at}", by, best, f"{chosen} links", len(scores)),
    ]


def _springs(
    run: Audited, robot: str, data_set: int, count: int, purpose: str = "identification"
) -> tuple[np.ndarray, np.ndarray]:
    """Deflection per unit of each spring (configurations, 6, n + 8 links), and the exact one (configurations, 6)."""
    arm = run.arm(robot)
    columns, moved = [], []
    for angles, wrench in zip(*drawn(run, robot, data_set, count, purpose=purpose), strict=True):
        torques = arm.torques(angles, wrench, arm.end_effector, run.wrench_at)
        jacobian = arm.jacobian(arm.unloaded(angles), f"{arm.end_effector} target")
        parts: list[Any] = [jacobian[:, : arm.joints] * torques[: arm.joints]]
        for number, vector in enumerate(arm.links):
            block = slice(arm.joints + 6 * number, arm.joints + 6 * number + 6)
            turn = np.kron(np.eye(2), _triad(vector))
            along, forced = jacobian[:, block] @ turn, turn.T @ torques[block]
            parts.append(along * forced)
            # Bending: a force deflects and turns, a moment turns and deflects.
            parts += [(along[:, i] * forced[j] + along[:, j] * forced[i])[:, None] for i, j in ((1, 5), (2, 4))]
        columns.append(np.concatenate(parts, axis=1))
        moved.append(arm.deflection(angles, wrench, arm.end_effector, run.wrench_at))
    return np.array(columns), np.array(moved)


def _triad(vector: np.ndarray) -> np.ndarray:
    """Axes of a link in columns: along it, across it and the axis of the chain that is least along it, and across both."""
    along = vector / np.linalg.norm(vector)
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    across /= np.linalg.norm(across)
    return np.stack([along, across, np.cross(along, across)], axis=1)


def _taken(arm: Arm, links: list[int]) -> np.ndarray:
    """Columns of the joints and of some links."""
    return np.concatenate([np.arange(arm.joints), *(arm.joints + 8 * int(link) + np.arange(8) for link in links)])


def _least_squares(columns: np.ndarray, right: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """Coefficients of all columns, zero where not taken; a ridge in rows of its own."""
    matrix = columns.reshape(-1, columns.shape[-1])[:, taken]
    scale = np.linalg.norm(matrix, axis=0)
    longer = np.concatenate([matrix / scale, np.sqrt(_RIDGE) * np.eye(len(taken))])
    basis, triangle = np.linalg.qr(longer)
    found = np.zeros(columns.shape[-1])
    found[taken] = np.linalg.solve(triangle, basis[: len(matrix)].T @ right.ravel()) / scale
    return found


CHECKS = (
    (re.compile(r"results/designs/([^/]+)\.parquet"), designs),
    (re.compile(r"results/ladder/([^/]+)\.parquet"), ladder),
)
