"""The aliases that the scores set aside are exact on the design of the blind cases, and
there are no others."""

import numpy as np
import pytest
from analysed_robots import ROBOTS

from elastocal.campaigns.campaign import tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.fitting.cases import build_case
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.linearization import compute_effect_sensitivities, linearize
from elastocal.fitting.noise import estimate_noise
from elastocal.loop.loading import load_campaign
from elastocal_proof.blind.cases import BlindCase, write_sealed_case
from elastocal_proof.blind.scores import EXACT_ALIASES

pytestmark = pytest.mark.slow

# Largest sine of an angle between two spans that are the same.
_SINE = 1e-6
# Singular values below this are rounding errors.
_ROUNDING = 1e-7


def compute_bases(declared, observations, candidates):
    """Compute an orthonormal basis of the whitened columns of each candidate, after
    their projection off the declared model; it is empty if nothing remains."""
    linear = linearize(
        declared.model, declared.estimate, observations, declared.conditions
    )
    rows = linear.residual.size
    declared_columns = declared.whiten(linear.sensitivities).reshape(rows, -1)
    declared_columns = declared_columns / np.linalg.norm(declared_columns, axis=0)
    declared_basis = np.linalg.qr(declared_columns)[0]
    bases = []
    for candidate in candidates:
        sensitivities = compute_effect_sensitivities(
            [(candidate.displacement, ())],
            linear.conditions,
            linear.coordinate_jacobian,
            observations.state,
        )
        columns = declared.whiten(sensitivities).reshape(rows, -1)
        columns = columns / np.linalg.norm(columns, axis=0)
        # The second projection removes the rounding errors of the first.
        for _ in range(2):
            columns = columns - declared_basis @ (declared_basis.T @ columns)
        left, singular_values, _ = np.linalg.svd(columns, full_matrices=False)
        bases.append(left[:, singular_values > _ROUNDING])
    return bases


@pytest.fixture(scope="module", params=["fanuc", "abb"])
def candidates_and_bases(request, tmp_path_factory):
    """Candidates without shapes, and their bases on a robot without an effect."""
    folder = tmp_path_factory.mktemp(request.param)
    # The robot file declares no weights, because weights would absorb a part of the
    # columns that are compared.
    blind_case = BlindCase(
        "aliases",
        "none",
        request.param,
        (),
        (),
        "weight_compensated",
        314159,
        changes={"weighs": False},
    )
    write_sealed_case(blind_case, folder / "blind", folder / "sealed", ROBOTS)
    descriptions, training, _ = load_campaign(
        read_campaign_folder(folder / "blind" / blind_case.name, ROBOTS)
    )
    case = build_case(descriptions, tabulate_measurements(training))
    declared = fit_model(case.model, case.observations, estimate_noise(case)[0])
    candidates = [
        candidate for candidate in case.candidates.values() if not candidate.shapes
    ]
    return candidates, compute_bases(declared, case.observations, candidates)


def is_same_span(basis, other_basis):
    """Check whether two orthonormal bases span the same space, which is not empty."""
    if not basis.size or basis.shape != other_basis.shape:
        return False
    residual = basis - other_basis @ (other_basis.T @ basis)
    return np.linalg.norm(residual, 2) < _SINE


def test_effects_with_the_same_span_are_the_aliases_of_the_scores(candidates_and_bases):
    same_spans = set()
    for candidate, basis in zip(*candidates_and_bases, strict=True):
        for alias, alias_basis in zip(*candidates_and_bases, strict=True):
            if candidate.effect != alias.effect and is_same_span(basis, alias_basis):
                same_spans.add(((candidate.effect, candidate.joints), alias.effect))
    expected = {
        (located_effect, alias)
        for located_effect, alias in EXACT_ALIASES.items()
        if located_effect[0] not in ("force_scale", "link_weight")
    }
    assert same_spans == expected


def test_compliances_absorb_a_wrong_force_scale(candidates_and_bases):
    force_scale_bases = [
        basis
        for candidate, basis in zip(*candidates_and_bases, strict=True)
        if candidate.effect == "force_scale"
    ]
    assert force_scale_bases
    assert not any(basis.size for basis in force_scale_bases)
