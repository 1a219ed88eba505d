"""A regression is one file."""

import sys

import pytest

import elastocal.remainder
from elastocal.remainder.catalogue import regressions

CONSTANT = """
import numpy as np

from elastocal.remainder.protocol import Prediction

NAME, WORDS, SETTINGS = "constant", "constant", ({},)


def fitted(inputs, residual, settings, seed):
    mean = residual.mean(axis=0)
    for _ in settings:
        yield lambda there: Prediction(np.tile(mean, (len(there), 1)))
"""


@pytest.fixture
def one_more(tmp_path, monkeypatch):
    (tmp_path / "constant.py").write_text(CONSTANT, encoding="utf-8")
    monkeypatch.setattr(elastocal.remainder, "__path__", [*elastocal.remainder.__path__, str(tmp_path)])
    regressions.cache_clear()
    yield
    regressions.cache_clear()
    sys.modules.pop("elastocal.remainder.constant", None)


def test_the_catalogue_has_every_module_with_a_name():
    assert set(regressions()) == {"extra_trees", "gaussian_process", "ridge_harmonics"}


def test_a_file_more_is_a_regression_more(one_more):
    assert "constant" in regressions()
