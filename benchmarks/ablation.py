"""What each part of the search contributes: other criteria on the same linear problems.

`python benchmarks/ablation.py FOLDER BLOCK...` reads blocks of the registered blind
benchmark (`make proof` makes FOLDER/data/blind and FOLDER/data/sealed), after they were
diagnosed and scored. Cases without an effect and with one mechanism of the catalogue
count. Each criterion sees the same problem, linearised about the declared fit:

- *evidence*: the search and the verdict of the engine, without the later
  linearisations, with the settings as they are, and with the prior probability of each
  mechanism halved and doubled;
- *BIC*: forward selection by the Bayesian information criterion [1]_;
- *stepwise F*: forward selection by F tests, at a level of 2 % for all terms together
  (Bonferroni) [2]_;
- *ARD*: forward selection by the marginal likelihood of a ridge with one fitted variance
  for each term [3]_.

References
----------
.. [1] Schwarz, Estimating the dimension of a model, Annals of Statistics 6, 1978.
.. [2] Draper and Smith, Applied Regression Analysis, 15.2, 1998.
.. [3] Tipping and Faul, Fast marginal likelihood maximisation for sparse Bayesian
   models, Artificial Intelligence and Statistics, 2003.
"""

import argparse
import json
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from common import ROOT
from rates import format_rate
from scipy.stats import f as f_distribution

from elastocal.diagnosis.alarm import run_alarm_test
from elastocal.diagnosis.candidate_design import build_candidate_design
from elastocal.diagnosis.fitted_subset import select_initial_subset
from elastocal.diagnosis.hypotheses import ModelTerm
from elastocal.diagnosis.search import SearchProblem, screen_terms, search_models
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.verdict import conclude
from elastocal.fitting.model import Case
from elastocal.loop.whole import read_cases

LEVEL = 0.02
MOST_TERMS = 12
UNDECIDED = "alternatives or unexplained"
VARIANCES = np.geomspace(1e-6, 1e4, 31)
# Relative size of a pivot below which a column is a combination of the selected ones.
DEPENDENT = 1e-9
Gain = Callable[[float, float, int, int, int], float]


def score_bic(before: float, after: float, width: int, rows: int, tried: int) -> float:
    """Decrease of the criterion if a term of so many columns enters."""
    return rows * np.log(before / after) - width * np.log(rows)


def score_f(before: float, after: float, width: int, rows: int, tried: int) -> float:
    """How far the p-value of the F test lies below its level, as a logarithm."""
    statistic = (before - after) / width / (after / (rows - width))
    log_p = f_distribution.logsf(statistic, width, rows - width)
    return float(np.log(LEVEL / tried) - log_p)


def select_by_squares(problem: SearchProblem, gain: Gain) -> set[str]:
    """Select terms one after another by the squares that least squares removes; their
    mechanisms."""
    statistics = problem.statistics
    gram = statistics.gram[0].copy()
    score = statistics.score[0].copy()
    squares = float(statistics.residual_squares[0])
    rows = statistics.degrees_of_freedom
    scale = np.diag(gram).copy()
    terms = list_candidate_terms(problem)
    selected: list[ModelTerm] = []
    while len(selected) < MOST_TERMS:
        options = [term for term in terms if is_free(term, selected)]
        removed = [remove_squares(gram, score, scale, term) for term in options]
        gains = [
            gain(squares, squares - removal, len(term.columns), rows, len(options))
            for term, removal in zip(options, removed, strict=True)
        ]
        if not gains or max(gains) <= 0.0:
            break
        best = int(np.argmax(gains))
        columns = options[best].columns
        inverse = np.linalg.pinv(gram[np.ix_(columns, columns)])
        weights = inverse @ gram[columns]
        score -= weights.T @ score[columns]
        gram -= gram[:, columns] @ weights
        squares -= removed[best]
        rows -= len(columns)
        selected.append(options[best])
    return {term.mechanism for term in selected}


def remove_squares(
    gram: np.ndarray, score: np.ndarray, scale: np.ndarray, term: ModelTerm
) -> float:
    """Squares of the residual that the columns of a term remove."""
    columns = term.columns
    kept = columns[gram[columns, columns] > DEPENDENT * scale[columns]]
    if not len(kept):
        return 0.0
    block = gram[np.ix_(kept, kept)]
    solution: np.ndarray = np.linalg.lstsq(block, score[kept], rcond=DEPENDENT)[0]
    return float(score[kept] @ solution)


def select_by_ard(problem: SearchProblem) -> set[str]:
    """Select terms one after another by the log marginal likelihood of their best
    variance; their mechanisms."""
    statistics = problem.statistics
    gram = statistics.gram[0].copy()
    score = statistics.score[0].copy()
    terms = list_candidate_terms(problem)
    selected: list[ModelTerm] = []
    while len(selected) < MOST_TERMS:
        options = [term for term in terms if is_free(term, selected)]
        likelihoods = [maximize_over_variances(gram, score, term) for term in options]
        if not likelihoods or max(likelihoods)[0] <= 0.0:
            break
        best = max(range(len(options)), key=lambda index: likelihoods[index][0])
        columns = options[best].columns
        block = gram[np.ix_(columns, columns)]
        penalized = block + np.eye(len(columns)) / likelihoods[best][1]
        weights = np.linalg.solve(penalized, gram[columns])
        score -= weights.T @ score[columns]
        gram -= gram[:, columns] @ weights
        selected.append(options[best])
    return {term.mechanism for term in selected}


def maximize_over_variances(
    gram: np.ndarray, score: np.ndarray, term: ModelTerm
) -> tuple[float, float]:
    """Largest log marginal likelihood ratio of a term, and its variance."""
    columns = term.columns
    eigenvalues, axes = np.linalg.eigh(gram[np.ix_(columns, columns)])
    eigenvalues = np.maximum(eigenvalues, 0.0)
    along = axes.T @ score[columns]
    shrunk = 1.0 + VARIANCES[:, None] * eigenvalues
    ratios = 0.5 * (VARIANCES[:, None] * along**2 / shrunk - np.log(shrunk)).sum(axis=1)
    best = int(np.argmax(ratios))
    return float(ratios[best]), float(VARIANCES[best])


def list_candidate_terms(problem: SearchProblem) -> list[ModelTerm]:
    return [term for term in problem.terms if term.candidate is not None]


def is_free(term: ModelTerm, selected: Sequence[ModelTerm]) -> bool:
    """Whether a term is no variant of a selected one."""
    return all(term.slot != other.slot for other in selected)


def state_by_evidence(case: Case, settings: Settings) -> tuple[set[str], SearchProblem]:
    """Mechanisms that the verdict states alone, or one word if it states alternatives
    or none; and the linear problem."""
    subset = select_initial_subset(case, settings)
    design = build_candidate_design(
        subset.declared,
        subset.search_sample,
        list(subset.case.candidates.values()),
        settings,
        np.inf,
    )
    problem = design.problem
    empty_model, _ = screen_terms(problem)
    stream = np.random.default_rng(1)
    alarm = run_alarm_test(problem, design.products, empty_model.pose_error_rad, stream)
    conclusion = conclude(problem, search_models(problem), alarm)
    if conclusion.verdict in ("adequate", "not_testable"):
        return set(), problem
    if conclusion.verdict == "named":
        return set(conclusion.best.named), problem
    return {UNDECIDED}, problem


def state_mechanisms(case: Case) -> dict[str, set[str]]:
    """Mechanisms that each criterion states; nothing if it detects nothing."""
    settings = Settings()
    probability = settings.mechanism_probability
    by_evidence, problem = state_by_evidence(case, settings)
    halved = replace(settings, mechanism_probability=0.5 * probability)
    doubled = replace(settings, mechanism_probability=2.0 * probability)
    return {
        "evidence": by_evidence,
        "evidence, priors halved": state_by_evidence(case, halved)[0],
        "evidence, priors doubled": state_by_evidence(case, doubled)[0],
        "BIC": select_by_squares(problem, score_bic),
        "stepwise F": select_by_squares(problem, score_f),
        "ARD": select_by_ard(problem),
    }


def count_block(
    folder: Path, block: str, counts: dict[tuple[str, str], list[bool]]
) -> None:
    """Add the cases of a block: false alarms, detections, right and false mechanisms."""
    for sealed in sorted((folder / "data/sealed" / block).glob("case_*.json")):
        truth = json.loads(sealed.read_text(encoding="utf-8"))
        if truth["case"]["group"] not in ("none", "single"):
            continue
        effects = {defect["effect"] for defect in truth["defects"]}
        size = max((defect["non_centrality"] for defect in truth["defects"]), default=0)
        case, _ = read_cases(
            folder / "data/blind" / block / sealed.stem, ROOT / "config/robots"
        )
        for criterion, stated in state_mechanisms(case).items():
            if not effects:
                counts["false alarms", criterion].append(bool(stated))
                continue
            counts[f"detected at {size:g}", criterion].append(bool(stated))
            counts[f"right alone at {size:g}", criterion].append(stated == effects)
            is_false = bool(stated - effects - {UNDECIDED})
            counts[f"false name alone at {size:g}", criterion].append(is_false)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("blocks", nargs="+")
    arguments = parser.parse_args()
    counts: dict[tuple[str, str], list[bool]] = defaultdict(list)
    for block in arguments.blocks:
        count_block(arguments.folder, block, counts)
        print(f"after {block}")
        for (quantity, criterion), hits in sorted(counts.items()):
            print(f"  {quantity}, {criterion}: {format_rate(hits)}", flush=True)
