"""The kind `surface`: its derivatives, the field that it assumes, and parameters that
come back from wavy tables."""

import numpy as np
import pytest
from checked_kinds import check_derivatives
from contact_campaigns import (
    build_contact_case,
    count_std_errors,
    open_workshop,
    spread_places,
    write_contacts,
)
from support import refused

from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.noise import estimate_noise
from elastocal.measuring.protocol import Feature
from elastocal.measuring.surface import SURFACE
from elastocal_proof.plant.contacts import draw_form, touch_surface

TABLE = Feature("table", "surface", {"normal": [0.0, 0.0, 1.0], "form_std_m": 2e-4})
GRID_M = np.linspace(-0.2, 0.2, 9)
PLACES_M = np.stack(np.meshgrid(GRID_M, GRID_M, [0.3]), axis=-1).reshape(-1, 3)
NORMALS = np.array([[0.0, 0.0, 1.0], [0.8, 0.6, 0.0], [0.0, 0.8, 0.6]])
FORM_M = 3e-4


@pytest.fixture(scope="module")
def flat():
    """Values of a flat table that is touched at all places."""
    return SURFACE.start(TABLE, PLACES_M, np.zeros((len(PLACES_M), 1)))


def test_derivatives_are_those_of_the_residual(flat):
    steps = np.random.default_rng(0).normal(0.0, 2e-4, len(SURFACE.unknowns(TABLE)))
    check_derivatives(SURFACE, SURFACE.move(flat, steps), np.zeros((4, 1)))


def test_the_field_has_the_stated_deviation_and_a_matern_covariance(flat):
    deviations = np.array(
        [unknown.prior_std or 0.0 for unknown in SURFACE.unknowns(TABLE)]
    )
    columns = SURFACE.evaluate(PLACES_M, None, np.zeros((81, 1)), flat).by_unknowns[
        :, 0
    ]
    covariance = (columns * deviations**2) @ columns.T
    middle = 40
    assert covariance[middle, middle] == pytest.approx(4e-8, rel=0.1)
    # The form changes over 0.15 of the width of the touched area, 0.06 m.
    distance = np.linalg.norm(PLACES_M - PLACES_M[middle], axis=1)
    scaled = np.sqrt(3.0) * distance / 0.06
    expected = (1.0 + scaled) * np.exp(-scaled)
    correlation = covariance[middle] / covariance[middle, middle]
    np.testing.assert_allclose(correlation, expected, atol=0.06)


def test_only_amplitudes_with_priors_deviate_from_what_is_declared(flat):
    steps = np.arange(len(SURFACE.unknowns(TABLE))) * 1e-6
    moved = SURFACE.move(flat, steps)
    np.testing.assert_allclose(SURFACE.deviate(TABLE, moved)[3:], steps[3:])
    np.testing.assert_allclose(SURFACE.state(moved)[3:], steps[3:])


@pytest.mark.parametrize("form", [0.0, 0.5, "unknown"])
def test_a_form_of_no_table_is_refused(form):
    with refused("campaign.yaml", "form_std_m", "0.01 m at most"):
        SURFACE.unknowns(Feature("table", "surface", {"form_std_m": form}))


def measure_wavy_tables(seed):
    """Rows of a tip on three wavy tables, at 25 places of each three times."""
    workshop = open_workshop(seed)
    (middle,) = spread_places(workshop, 1)
    rows = []
    for number, normal in enumerate(NORMALS):
        form = draw_form(workshop.draws, FORM_M, 0.1)
        sides = np.linalg.svd(normal[None])[2][1:]
        for place in range(25):
            offset = GRID_M[[2 * (place % 5), 2 * (place // 5)]] @ sides
            for _ in range(3):
                angles = touch_surface(workshop, middle + offset, normal, form, 3e-5)
                rows.append({"angles": angles, "feature": f"table{number}"})
    return rows


def fit_tables(folder, kind, rows):
    """Fit tables as a kind, with noise from the residual."""
    features = {f"table{number}": {} for number in range(3)}
    document = {"measured": kind, "features": features}
    case = build_contact_case(write_contacts(folder, document, rows))
    noise, _ = estimate_noise(case)
    return fit_model(case.model, case.observations, noise)


def test_waves_of_tables_are_no_errors_of_the_robot(tmp_path):
    rows = measure_wavy_tables(2)
    wavy = fit_tables(tmp_path / "wavy", "surface", rows)
    # Four offsets: 4 standard errors are exceeded in 1 of 4,000 fits.
    assert np.abs(count_std_errors(wavy)).max() < 4.0
    assert wavy.noise.position_m == pytest.approx(3e-5, rel=0.4)
    flat = fit_tables(tmp_path / "flat", "plane", rows)
    indices = np.concatenate(
        [wavy.parameter_indices(f"joint_offset@{joint}") for joint in range(2, 6)]
    )
    std = np.sqrt(np.diag(wavy.covariance))[indices]
    indices = np.concatenate(
        [flat.parameter_indices(f"joint_offset@{joint}") for joint in range(2, 6)]
    )
    assert (std < 0.5 * np.sqrt(np.diag(flat.covariance))[indices]).all()
