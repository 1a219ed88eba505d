"""The steps of the study one after the other: from random experiments to compliances."""

from dataclasses import replace

import numpy as np
from made_study_blocks import compliances, deflections_of, experiments_of, identified, joined

from elastocal.study.steps import blocks


def test_numbers_do_not_depend_on_blocks(kuka, strategies, monkeypatch):
    tables = []
    for size in (500, 5, 2, 1):
        monkeypatch.setattr(blocks, "SETS_PER_BLOCK", size)
        experiments = experiments_of(kuka)
        assert len(experiments) == -(-5 // size)
        deflections = deflections_of(kuka, experiments, noise=2e-4)
        table = identified(kuka, strategies["4-6DoF-after-6+3DoF"], experiments, deflections)
        tables.append((joined(experiments), joined(deflections["3DoF"]), table))
    for other in tables[1:]:
        for name, values in tables[0][0].items():
            np.testing.assert_array_equal(other[0][name], values)
        for name in ("dx", "rz"):
            # Whole vectors and their remainders may round otherwise.
            np.testing.assert_allclose(other[1][name], tables[0][1][name], rtol=0, atol=1e-14)
        for name, values in tables[0][2].items():
            np.testing.assert_allclose(other[2][name], values, rtol=1e-6, atol=1e-12, err_msg=name)


def test_links_bend_beyond_what_joints_explain(kuka_extended, strategies):
    experiments = experiments_of(kuka_extended, key="kuka_extended")
    reduced = replace(kuka_extended, links=())
    stiff, elastic = (
        compliances(identified(robot, strategies["6DoF"], experiments, deflections_of(robot, experiments)), 4)
        for robot in (reduced, kuka_extended)
    )
    # What bends in the links is laid on the joints: the shoulder looks softer.
    assert (elastic[:, 1] > 1.2 * stiff[:, 1]).all()
