"""Two robots that nothing was tuned on go the whole way, from a URDF to a verified
robot, by the lines that the commands print; and what is stated is compared with the
truth of an independent simulation."""

import numpy as np
import pytest
from replayed import Replay
from study_folder import Study
from unseen_cells import HEAVY, LIGHT

# Corners of a path in joint space: around these angles, by as much, degrees.
LIGHT_MIDDLE = [20, 50, 70, -30, 70, 30]
HEAVY_MIDDLE = [20, 20, 20, 30, 50, 40]
AROUND = [35, 18, 18, 40, 30, 60]
CORNERS = 8


# Force of a process on the flange, N, base axes: sideways, as no weight pulls.
PROCESS_N = (0.0, 50.0, 0.0)
# A caliper's error of a reflector, which no measurement of that reflector shows. A robot
# that is corrected by such measurements errs by no more.
CALIPER_M = 0.3e-3


def draw_way(middle):
    draws = np.random.default_rng(11).uniform(-1, 1, (CORNERS, len(middle)))
    return np.array(middle) + np.array(AROUND) * draws


def rms(values):
    return float(np.sqrt((np.asarray(values) ** 2).mean()))


def correct(replay, path_options, *, base_known):
    """Correct the path, run it, certify and verify it; return the true RMS errors
    before and after the correction, m, and the documents."""
    campaign = replay.next.split("campaigns/")[1].split()[0]
    replay.follow(*path_options)
    program = next(replay.folder.glob("targets.[!c]*")).name
    before, after = (
        rms(replay.find_true_errors(base_known=base_known, suffix=suffix))
        for suffix in ("_uncorrected", "")
    )
    replay.follow(may_fail=True)
    replay.measure_targets(program)
    replay.follow(may_fail=True)
    certificate = replay.read(campaign, "certificate.json")
    return before, after, certificate, replay.read(campaign, "verification.json")


def assert_not_contradicted(after, certificate, verification):
    """What is predicted and what is measured agree with the true error."""
    decision = certificate["conformity"]["decision"]
    tolerance_m = certificate["conformity"]["tolerance_m"]
    assert decision != ("fail" if after <= tolerance_m else "pass")
    assert after < certificate["accuracy"]["rms_bound_m"]
    assert verification["prediction"]["held"]
    assert verification["prediction"]["above_bound"] <= 0.1 * verification["targets"]


@pytest.fixture
def start(tmp_path):
    """Plans the measurement of a robot, measures it and diagnoses it."""

    def plan_and_measure(unseen, offsets, *plan, files=None, comma):
        Study.of_links(tmp_path)
        replay = Replay(unseen, tmp_path, offsets, comma=comma)
        replay.follow("--output", "robot.yaml")
        for name, offset in offsets.items():
            coordinates = ",".join(map(str, offset))
            plan += ("--target", f"{name}:flange={coordinates}")
        replay.follow(*plan)
        replay.measure_sheet("campaigns/cell")
        replay.follow(files=files)
        assert replay.follow().startswith("✓")
        assert replay.follow().count("✓ cell") == 1
        return replay

    return plan_and_measure


def assert_corrected(before, after):
    """Both are true RMS errors of the flange, m."""
    assert after < 0.5 * before
    assert after < CALIPER_M


@pytest.mark.slow
def test_a_light_robot_is_corrected_and_a_second_round_does_no_harm(start):
    """25 poses without load, and the base frame known."""
    offsets = {"SMR1": (0.04, 0.02, 0.06)}
    files = ["morning.csv", "afternoon.csv"]
    replay = start(
        LIGHT, offsets, "--poses", "25", "--base-known", files=files, comma=False
    )
    replay.write_path(draw_way(LIGHT_MIDDLE), 60, "xyz", "WPR")
    units = ("--lengths", "mm", "--angles", "deg", "--rotation", "euler:xyz")
    options = (*units, "--format", "urscript")
    before, first, certificate, verification = correct(replay, options, base_known=True)
    assert_corrected(before, first)
    assert_not_contradicted(first, certificate, verification)
    # What remains repeats, so that the next line goes round the loop again.
    assert verification["remaining"]["remains"]
    assert " --with " in replay.next
    replay.follow()
    _, second, certificate, verification = correct(replay, options, base_known=True)
    assert second < 1.1 * first
    assert_not_contradicted(second, certificate, verification)


@pytest.mark.slow
def test_a_second_round_removes_what_the_first_could_not_see(start):
    """No pose of the first campaign has a load, and no weight turns joint 1. Along the
    path a force of a process does."""
    offsets = {"SMR1": (0.04, 0.02, 0.06)}
    replay = start(LIGHT, offsets, "--poses", "25", "--base-known", comma=False)
    replay.write_path(draw_way(LIGHT_MIDDLE), 60, "xyz", "WPR", force_N=PROCESS_N)
    units = ("--lengths", "mm", "--angles", "deg", "--rotation", "euler:xyz")
    options = (*units, "--format", "urscript")
    before, first, _, verification = correct(replay, options, base_known=True)
    remaining_m = verification["remaining"]["rms_m"]
    assert first < before
    assert verification["remaining"]["remains"]
    assert "compliance: identify" in replay.follow()
    _, second, certificate, verification = correct(replay, options, base_known=True)
    assert second < 0.5 * first
    assert verification["remaining"]["rms_m"] < 0.3 * remaining_m
    assert second < certificate["accuracy"]["rms_bound_m"]
    assert verification["prediction"]["held"]


@pytest.mark.slow
def test_a_heavy_robot_with_a_balancer_and_a_moved_tracker_is_corrected(start):
    """No file states its springs, its balancer or where the tracker stood."""
    offsets = {
        "SMR1": (0.05, 0.03, 0.08),
        "SMR2": (-0.06, 0.05, 0.08),
        "SMR3": (0, -0.07, 0.11),
    }
    files = ["morning.csv", "afternoon.csv"]
    plan = ("--poses", "30", "--force", "1000")
    replay = start(HEAVY, offsets, *plan, files=files, comma=True)
    replay.write_path(draw_way(HEAVY_MIDDLE), 60, "ZYX", "ABC")
    units = ("--lengths", "mm", "--angles", "deg", "--rotation", "euler:ZYX")
    options = (*units, "--format", "krl")
    before, after, certificate, verification = correct(
        replay, options, base_known=False
    )
    assert_corrected(before, after)
    assert_not_contradicted(after, certificate, verification)
