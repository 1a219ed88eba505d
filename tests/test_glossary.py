"""Code, messages, reports and pages use the words of the field, and none of the private
words of earlier versions."""

import re
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
SEARCHED = (
    *(
        "README.md",
        "Snakefile",
        "config.yaml",
        "data/README.md",
        "results/README.md",
        "reports/README.md",
    ),
    *("config", "docs", "workflow", "src", "benchmarks"),
)
KINDS = {".py", ".smk", ".typ", ".txt", ".yaml", ".md", ""}
# Patterns of banned words, each with the words to use instead.
GLOSSARY = {
    r"rivals?|weigh(s|ed|ing)? (the )?alternatives": (
        "alternative, compare alternatives"
    ),
    r"doubts?|akin": "model departure, a related mechanism",
    r"cannot tell|told from|tell it from": "non-identifiable, distinguishable from, ambiguous",
    r"off the model": "residual subspace, contribution",
    r"tame|wild": "inlier, outlier",
    r"first look|looks?_taken|initial look": "initial screening",
    r"circumstances?": "conditions",
    r"explainable|foreseen": "predictable share, promised",
    r"state_verdict": "verdict, report",
    r"readings?_(of|from)|Readings|readings": (
        "interpretation of the paper; measurement of a tracker"
    ),
    r"appearing_whole|whole files": "atomic write",
    r"intake|taken_in": "load, import",
    r"test poses": "validation poses, held-out poses",
    r"opened_\w+|\w*_opened|loop\.opened|blind\.truths": (
        "load_..., the name of what the file holds"
    ),
    r"(tells?|telling|told) .{0,40}apart": "distinguish",
    r"(data|could not|cannot|nobody|experiments of .{0,25}) (can )?tells?": (
        "identify, identifiable"
    ),
    r"be told|unless told|(is|are|was|nobody) (not )?told": (
        "identified, by default, declared, given"
    ),
    r"what (is|was|were) said|said (for|of) what|name (is )?said|said (alone|then)"
    r"|worth what they say": ("verdict, reported, stated, calibrated"),
    # Names of rows and columns that the pipeline writes are allowed: hypotheses that
    # hold the truth, class with the truth.
    r"(?<!hypotheses that )holds? the truth"
    r"|(of|by|given|give|above|below|and|where) (the|its|their) truths?": "ground truth",
    r"(a|every|sealed) truth|truth document": "ground truth; the true value, where it is a number",
}
# Banned names of variables and functions.
IDENTIFIERS = (
    r"\w*_(said|told)\w*|(said|told|unsaid|saying) \|?= .*"
    r"|(said|told|unsaid|saying)([\[(]|\.\w|: \w+\[).*"
)


@pytest.fixture(scope="module")
def texts():
    """Texts of all files by their paths."""
    paths = [
        path
        for name in SEARCHED
        for path in (sorted((REPOSITORY / name).rglob("*")) or [REPOSITORY / name])
    ]
    return {
        path: path.read_text(encoding="utf-8")
        for path in paths
        if path.is_file() and path.suffix in KINDS
    }


def find_lines(pattern, texts):
    """Return the lines that match a pattern. Names of random streams are allowed, because
    a new name would change the random numbers."""
    pattern = re.compile(rf"(?<![A-Za-z])(?:{pattern})(?![A-Za-z])")
    lines = [
        (path, line)
        for path, text in texts.items()
        if pattern.search(text)
        for line in text.splitlines()
    ]
    return [
        f"{path}: {line.strip()[:100]}"
        for path, line in lines
        if pattern.search(line) and "stream(" not in line
    ]


@pytest.mark.parametrize("banned", GLOSSARY)
def test_no_banned_word_is_used(banned, texts):
    assert find_lines(banned, texts) == [], f"say {GLOSSARY[banned]!r}"


def test_no_variable_is_called_said_or_told(texts):
    assert find_lines(IDENTIFIERS, texts) == [], (
        "say what it is, such as 'verdict', 'stated', 'outcome', 'declared'"
    )
