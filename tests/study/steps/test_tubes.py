"""Other tubes under the same loads."""

from dataclasses import replace

import numpy as np
import pytest
from made_studies import few_of
from made_study_blocks import compliances, deflections_of, experiments_of, identified, judge

from elastocal.study.metrics import position_errors
from elastocal.study.steps.tubes import tube_blocks


def test_thicker_tubes_bend_less_and_leave_less_to_what_joints_cannot_explain(kuka_extended):
    found = list(tube_blocks(few_of(kuka_extended), [0.8, 1.0, 1.25], 10))
    for name in ("mean", "maximum", "left"):
        assert np.all(np.diff([block[name].mean() for block in found]) < 0), name
    assert found[0]["diameter"][0] == pytest.approx(0.8 * kuka_extended.links[0].tube.outer_diameter_m)


def test_the_diameter_of_the_file_gives_the_deflections_and_errors_of_the_pipeline(kuka_extended, strategies):
    study = few_of(kuka_extended)
    study = replace(study, size=replace(study.size, noise=0.0))
    (block,) = tube_blocks(study, [1.0], 20)
    experiments = experiments_of(kuka_extended, 6, 20)
    deflections = deflections_of(kuka_extended, experiments)
    (end,) = deflections["6DoF"]
    size = np.sqrt(end["dx"] ** 2 + end["dy"] ** 2 + end["dz"] ** 2).reshape(6, 20)
    np.testing.assert_allclose(block["mean"], size.mean(axis=1), rtol=1e-9)
    models = compliances(identified(kuka_extended, strategies["6DoF"], experiments, deflections), 20)
    np.testing.assert_allclose(block["left"], (position_errors(judge(kuka_extended), models) ** 2).mean(axis=1), rtol=1e-6)
