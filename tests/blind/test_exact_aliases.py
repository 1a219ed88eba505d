"""The aliases that the scores set aside are exact on the design of the blind cases, and
no others are."""

import numpy as np
import pytest
from analysed_robots import ROBOTS

from elastocal.campaigns.campaign import tabulate_measurements
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.linearization import compute_effect_sensitivities, linearize
from elastocal.fitting.model import build_case
from elastocal.fitting.noise import estimate_noise
from elastocal.loop.loading import load_campaign
from elastocal_proof.blind.cases import BlindCase, write_sealed_case
from elastocal_proof.blind.scores import EXACT_ALIASES

pytestmark = pytest.mark.slow

_SINE = 1e-6
_ROUNDING = 1e-7


def directions(declared, observations, candidates):
    """Orthonormal bases of what each candidate contributes beyond the declared model,
    whitened; without a column, nothing."""
    line = linearize(
        declared.model, declared.estimate, observations, declared.conditions
    )
    left = declared.whiten(line.sensitivities).reshape(line.residual.size, -1)
    basis = np.linalg.qr(left / np.linalg.norm(left, axis=0))[0]
    found = []
    for candidate in candidates:
        made = compute_effect_sensitivities(
            [(candidate.displacement, ())],
            line.conditions,
            line.coordinate_jacobian,
            observations.state,
        )
        columns = declared.whiten(made).reshape(line.residual.size, -1)
        columns = columns / np.linalg.norm(columns, axis=0)
        for _ in range(2):
            columns = columns - basis @ (basis.T @ columns)
        turned, sizes, _ = np.linalg.svd(columns, full_matrices=False)
        found.append((candidate, turned[:, sizes > _ROUNDING]))
    return found


@pytest.fixture(scope="module", params=["fanuc", "abb"])
def seen(request, tmp_path_factory):
    """What every candidate makes of the measurements of a robot without an effect, off
    the declared model."""
    folder = tmp_path_factory.mktemp(request.param)
    # Of an arm whose file tells no weights: where it does, weights absorb some of what
    # is compared here.
    made = BlindCase(
        "aliases",
        "none",
        request.param,
        (),
        (),
        "weight_compensated",
        314159,
        changes={"weighs": False},
    )
    write_sealed_case(made, folder / "blind", folder / "sealed", ROBOTS)
    descriptions, training, _ = load_campaign(
        read_campaign_folder(folder / "blind" / made.name, ROBOTS)
    )
    case = build_case(descriptions, tabulate_measurements(training))
    declared = fit_model(case.model, case.observations, estimate_noise(case)[0])
    candidates = [c for c in case.candidates.values() if not c.shapes]
    return directions(declared, case.observations, candidates)


def test_effects_with_the_same_span_are_those_set_aside_and_compliances_take_up_a_wrong_force_scale(
    seen,
):
    same = set()
    for one, columns in seen:
        for other, others in seen:
            within = (
                columns.shape[1]
                and np.linalg.norm(columns - others @ (others.T @ columns), 2) < _SINE
            )
            if one.effect != other.effect and within and columns.shape == others.shape:
                same.add(((one.effect, one.joints), other.effect))
    told = {
        (place, other)
        for place, other in EXACT_ALIASES.items()
        if place[0] not in ("force_scale", "link_weight")
    }
    assert same == told
    columns = [part for candidate, part in seen if candidate.effect == "force_scale"]
    assert columns and not sum(part.shape[1] for part in columns)
