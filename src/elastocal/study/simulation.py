"""Simulated data sets as in the paper, and their tables on disk: random configurations
and forces, exact deflections, noise.

Arrays have the axes (data set, configuration, ...); arrays read from tables have the
component as first axis in memory.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.io.origin import describe_provenance
from elastocal.io.storage import read_blocks, write_table
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.components import (
    COMPONENT_NAMES,
    WRENCH_NAMES,
    list_joint_columns,
)
from elastocal.mechanics.elastostatics import (
    build_extended_chain,
    build_spring_compliance,
    compute_exact_deflections,
    compute_generalized_forces,
    compute_offset_wrench,
    select_loaded_point,
)
from elastocal.mechanics.kinematics import compute_jacobians, compute_poses
from elastocal.mechanics.robot_file import parse_joint_limits
from elastocal.random_streams import draw_data_sets
from elastocal.study.jobs import Job, collect_provenance, load_robot
from elastocal.study.schemas import DEFLECTIONS, EXPERIMENTS, INITIAL, WEIGHTS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    import pandas as pd

    from elastocal.io.storage import Columns
    from elastocal.mechanics.chain import Chain, MeasuringPoint
    from elastocal.mechanics.robot import Robot

# Block size: a step holds this many data sets in memory at a time.
SETS_PER_BLOCK = 500

# The columns that `unpack_deflections` needs.
DEFLECTION_COLUMNS = ("configuration", *COMPONENT_NAMES)

DATA_SETS = "data sets"
TESTS = "test configurations"


@dataclass(frozen=True)
class Experiments:
    """Loaded configurations of a robot.

    Attributes
    ----------
    joint_angles : (sets, configurations, n) array, rad
    wrench : (sets, configurations, 6) array, N and N m
        At the end-effector, base axes.
    """

    joint_angles: np.ndarray
    wrench: np.ndarray


@dataclass(frozen=True)
class Loading:
    """How the robot is moved and loaded.

    Attributes
    ----------
    force_N : float
        Magnitude of the force.
    offset_m : (3,)
        From the end-effector to the point where the force acts.
    offset_frame : str
        Axes of the offset (interpretation R4).
    joint_range : str
        Joint angles are uniform in +-pi, or within the robot's limits (interpretation
        R3).
    direction : (3,) or None
        Direction of the force, base axes; uniform on the sphere if None.
    """

    force_N: float
    offset_m: tuple[float, ...]
    offset_frame: str
    joint_range: str
    direction: tuple[float, ...] | None = None


@dataclass(frozen=True)
class RandomDesign:
    """Distribution of random configurations and wrenches.

    Attributes
    ----------
    chain : Chain
    limits : (n, 2) array, rad
        Joint limits.
    loading : Loading
    key : str
        Name of the robot's file; part of the names of the random streams.
    """

    chain: Chain
    limits: np.ndarray
    loading: Loading
    key: str

    @property
    def ranges(self) -> np.ndarray:
        """Lower and upper ends (2, n) of the joint angles, rad."""
        if self.loading.joint_range == "limits":
            return self.limits.T
        full_turn = np.full(self.chain.coordinates, np.pi)
        return np.stack([-full_turn, full_turn])


def draw_random_experiments(
    design: RandomDesign,
    seed: int,
    purpose: str,
    data_sets: Sequence[int] | np.ndarray,
    configurations: int,
) -> Experiments:
    """Draw random configurations and wrenches.

    Directions of normal vectors are uniform on the sphere [1].

    Parameters
    ----------
    design
    seed : int
    purpose : str
        Part of the names of the random streams: data that identify and data that
        validate never share one.
    data_sets
        Numbers of the data sets.
    configurations : int
        Configurations in each data set; the first k do not depend on their number.

    References
    ----------
    .. [1] Muller, M. E., A note on a method for generating points uniformly on
       n-dimensional spheres, Communications of the ACM 2, 1959.
    """
    chain = design.chain
    loading = design.loading
    shares = draw_data_sets(
        seed,
        design.key,
        f"{purpose}/joint angles",
        data_sets,
        lambda stream: stream.random((configurations, chain.coordinates)),
    )
    low, high = design.ranges
    joint_angles = low + (high - low) * shares
    if loading.direction is None:
        normal = draw_data_sets(
            seed,
            design.key,
            f"{purpose}/force",
            data_sets,
            lambda stream: stream.standard_normal((configurations, 3)),
        )
    else:
        direction = np.array(loading.direction, float)
        normal = np.broadcast_to(direction, (*joint_angles.shape[:-1], 3))
    force = loading.force_N * normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    rotation = None
    if loading.offset_frame == "tool":
        _, rotation = compute_poses(chain, joint_angles, chain.end_effector)
    wrench = compute_offset_wrench(force, loading.offset_m, rotation)
    return Experiments(joint_angles, wrench)


def compute_true_deflections(
    robot: Robot, experiments: Experiments, point: MeasuringPoint, wrench_at: str
) -> np.ndarray:
    """Compute the deflection of a measuring point by the virtual joint method: theta
    from equation 7, then the exact kinematics of all springs.

    See `mechanics.elastostatics`.

    Parameters
    ----------
    robot : Robot
        The reduced model or, if the robot has links, the extended one.
    experiments
    point
        A point of the robot's chain.
    wrench_at : str
        Where the wrench that deflects a partial point acts (interpretation R6).

    Returns
    -------
    (sets, configurations, 6) array, m and rad
    """
    chain = build_extended_chain(robot)
    unloaded = chain.at(experiments.joint_angles)
    measured = replace(chain.point(point.name), offset_m=point.offset_m)
    jacobian = compute_jacobians(
        chain, unloaded, select_loaded_point(chain, measured, wrench_at)
    )
    torques = compute_generalized_forces(jacobian, experiments.wrench)
    springs = torques @ build_spring_compliance(robot)
    return compute_exact_deflections(chain, unloaded, springs, measured)


def draw_measurement_noise(
    seed: int,
    key: str,
    point_name: str,
    data_sets: Sequence[int] | np.ndarray,
    configurations: int,
) -> np.ndarray:
    """Draw standard normal noise (sets, configurations, 6) at one measuring point.

    The error is this noise times the noise level. All levels use the same numbers, so
    that they differ only in scale: common random numbers [1].

    References
    ----------
    .. [1] Glasserman, P. and Yao, D. D., Some guidelines and guarantees for common random
       numbers, Management Science 38, 1992.
    """
    return draw_data_sets(
        seed,
        key,
        f"noise/{point_name}",
        data_sets,
        lambda stream: stream.standard_normal((configurations, 6)),
    )


def split_data_sets(count: int) -> Iterator[range]:
    """Yield the numbers of `count` data sets, block by block."""
    for first in range(0, count, SETS_PER_BLOCK):
        yield range(first, min(first + SETS_PER_BLOCK, count))


def make_prefix_index(
    sets: Sequence[int] | np.ndarray, lengths: int
) -> dict[str, np.ndarray]:
    """Columns that number the rows of a block with one row for each data set and prefix
    length."""
    return {
        "data_set": np.repeat(np.asarray(sets), lengths),
        "length": np.tile(np.arange(1, lengths + 1), len(sets)),
    }


def list_data_sets(columns: Columns) -> np.ndarray:
    """List the numbers (sets,) of the data sets of a block; rows of a data set are
    adjacent."""
    numbers = columns["data_set"]
    return numbers[np.flatnonzero(np.diff(numbers, prepend=-1))]


def pack_experiments(
    sets: Sequence[int] | np.ndarray, experiments: Experiments
) -> dict[str, np.ndarray]:
    """Pack experiments into a block of the experiments table."""
    columns = _index_columns(sets, experiments.joint_angles.shape[1])
    columns |= {
        f"q{j + 1}": angle.ravel()
        for j, angle in enumerate(np.moveaxis(experiments.joint_angles, -1, 0))
    }
    return columns | _component_columns(WRENCH_NAMES, experiments.wrench)


def unpack_experiments(columns: Columns) -> Experiments:
    """Unpack the experiments of a block."""
    joints = sum(name[0] == "q" for name in columns)
    angles = list_joint_columns(joints)
    return Experiments(
        _stack_components(columns, angles), _stack_components(columns, WRENCH_NAMES)
    )


def unpack_deflections(columns: Columns) -> np.ndarray:
    """Unpack the deflections (sets, configurations, 6) of a block."""
    return _stack_components(columns, COMPONENT_NAMES)


def _index_columns(
    sets: Sequence[int] | np.ndarray, configurations: int
) -> dict[str, np.ndarray]:
    return {
        "data_set": np.repeat(np.asarray(sets), configurations),
        "configuration": np.tile(np.arange(configurations), len(sets)),
    }


def _component_columns(
    names: Sequence[str], values: np.ndarray
) -> dict[str, np.ndarray]:
    return {name: values[..., k].ravel() for k, name in enumerate(names)}


def _count_configurations(columns: Columns) -> int:
    """Number of configurations in each data set of a block."""
    return int(columns["configuration"].max()) + 1


def _stack_components(columns: Columns, names: Sequence[str]) -> np.ndarray:
    """Stack columns of a block to an array (sets, configurations, components)."""
    configurations = _count_configurations(columns)
    components = [columns[name].reshape(-1, configurations) for name in names]
    return np.moveaxis(np.stack(components), 0, -1)


def simulate_blocks(
    experiments: Iterable[Columns], robot: Robot, wrench_at: str
) -> Iterator[dict[str, np.ndarray | str]]:
    """Simulate deflections without noise; yields one block for each block of experiments
    and each measuring point."""
    for block in experiments:
        loaded = unpack_experiments(block)
        sets = list_data_sets(block)
        for point in robot.chain.points:
            deflections = compute_true_deflections(robot, loaded, point, wrench_at)
            numbers = _index_columns(sets, deflections.shape[1])
            yield {
                "point": point.name,
                **numbers,
                **_component_columns(COMPONENT_NAMES, deflections),
            }


def add_noise_to_blocks(
    ideal_blocks: Iterable[dict[str, np.ndarray]], key: str, seed: int, noise: float
) -> Iterator[dict[str, np.ndarray | str]]:
    """Add independent normal noise to every component of ideal deflections.

    Parameters
    ----------
    ideal_blocks
        Blocks of the deflections table.
    key : str
        Name of the robot's file.
    seed : int
    noise : float
        Standard deviation, the same number in m and rad.
    """
    for block in ideal_blocks:
        point = block["point"][0]
        normal = draw_measurement_noise(
            seed, key, point, list_data_sets(block), _count_configurations(block)
        )
        measured = {
            name: block[name] + noise * normal[..., k].ravel()
            for k, name in enumerate(COMPONENT_NAMES)
        }
        yield block | measured | {"point": point}


def summarize_displacements(displacement: np.ndarray) -> dict[str, np.ndarray]:
    """Mean, mean square and maximum size of the displacements of each data set.

    `displacement` is (sets, configurations, 3 or more); only the first three components
    count.
    """
    size = np.linalg.norm(displacement[..., :3], axis=-1)
    return {
        "mean": size.mean(axis=1),
        "mean_square": (size**2).mean(axis=1),
        "maximum": size.max(axis=1),
    }


def compute_statistics(frame: pd.DataFrame) -> dict[str, pd.Series]:
    """Mean, standard deviation and maximum of the deflections of each data set, m, from
    the initial table or the table of tubes."""
    return {
        "mean": frame["mean"],
        "std": (frame.mean_square - frame["mean"] ** 2) ** 0.5,
        "max": frame.maximum,
    }


def draw_bootstrap_weights(
    seed: int, key: str, data_sets: Sequence[int] | np.ndarray, replicates: int
) -> np.ndarray:
    """Draw how often each data set counts in each replicate: once in replicate 0,
    Poisson(1) times in the others.

    The independent weights of the Poisson bootstrap [1] have mean one and do not depend
    on the number of data sets. They are the same for every noise level and strategy, so
    that replicates of two of them can be compared one by one.

    Parameters
    ----------
    seed, key
        As in `random_streams.open_stream`.
    data_sets
        Numbers of the data sets.
    replicates : int

    Returns
    -------
    (1 + replicates, sets) array

    References
    ----------
    .. [1] Hanley, J. A. and MacGibbon, B., Creating non-parametric bootstrap samples using
       Poisson frequencies, Computer Methods and Programs in Biomedicine 83, 2006.
    """
    counts = draw_data_sets(
        seed,
        key,
        "bootstrap",
        data_sets,
        lambda stream: stream.poisson(1.0, replicates),
    )
    return np.vstack([np.ones(len(counts)), counts.T])


def draw_weight_blocks(
    key: str, seed: int, data_sets: int, tests: int, replicates: int
) -> Iterator[dict[str, np.ndarray | str]]:
    """Draw how often each data set and each test configuration counts in each bootstrap
    replicate.

    Yields columns of the weights table: data sets in the blocks of the experiments, then
    all test configurations.
    """
    for sets in split_data_sets(data_sets):
        weights = draw_bootstrap_weights(seed, key, sets, replicates)
        yield _weight_columns(DATA_SETS, sets, weights[1:].T)
    test_counts = draw_data_sets(
        seed,
        key,
        "bootstrap of tests",
        [0],
        lambda stream: stream.poisson(1.0, (replicates, tests)),
    )[0]
    yield _weight_columns(TESTS, range(tests), test_counts.T)


def _weight_columns(
    members: str, numbers: Sequence[int], counts: np.ndarray
) -> dict[str, np.ndarray | str]:
    return {
        "members": members,
        "number": np.repeat(numbers, counts.shape[1]),
        "replicate": np.tile(np.arange(1, counts.shape[1] + 1), len(counts)),
        "count": counts.ravel(),
    }


def draw_experiments(job: Job) -> None:
    """Draw random configurations and loads of one robot."""
    params = job.params
    robot = job.wildcards.robot
    chain = parse_chain(params.chain, params.lengths_m, robot)
    document = {"joint_limits_deg": params.joint_limits_deg}
    limits = parse_joint_limits(document, chain, robot)
    design = RandomDesign(chain, limits, Loading(**params.loading), robot)
    blocks = (
        pack_experiments(
            sets,
            draw_random_experiments(
                design, params.seed, params.purpose, sets, params.configurations
            ),
        )
        for sets in split_data_sets(params.data_sets)
    )
    schema = EXPERIMENTS.for_joints(chain.coordinates)
    write_table(job.output.experiments, schema, blocks, describe_provenance(params))


def draw_weights(job: Job) -> None:
    """Draw the bootstrap weights of one robot, once for all strategies and noise
    levels."""
    params = job.params
    blocks = draw_weight_blocks(
        job.wildcards.robot,
        params.seed,
        params.data_sets,
        params.tests,
        params.replicates,
    )
    write_table(job.output.weights, WEIGHTS, blocks, collect_provenance(job))


def simulate(job: Job) -> None:
    """Simulate the deflections of one robot without noise."""
    robot = load_robot(job)
    schema = EXPERIMENTS.for_joints(robot.joints)
    experiments = read_blocks(job.input.experiments, schema)
    blocks = simulate_blocks(experiments, robot, job.params.wrench_at)
    write_table(job.output.ideal, DEFLECTIONS, blocks, describe_provenance(job.params))


def measure(job: Job) -> None:
    """Simulate the measured deflections of one robot at one noise level."""
    ideal = read_blocks(job.input.ideal, DEFLECTIONS)
    noise_um = job.wildcards.noise
    blocks = add_noise_to_blocks(
        ideal, job.wildcards.robot, job.params.seed, 1e-6 * float(noise_um)
    )
    origin = describe_provenance(job.params, noise_um=noise_um)
    write_table(job.output.measured, DEFLECTIONS, blocks, origin)


def summarize_initial(job: Job) -> None:
    """Summarize the deflections of a robot before any calibration (Table 2), data set by
    data set."""
    ideal = read_blocks(job.input.ideal, DEFLECTIONS, point=job.params.end_effector)
    blocks = map(_summarize_block, ideal)
    write_table(job.output.initial, INITIAL, blocks, describe_provenance(job.params))


def _summarize_block(block: Columns) -> dict[str, np.ndarray]:
    """Columns of the initial table from a block of deflections."""
    sets = list_data_sets(block)
    return {
        "data_set": sets,
        "configurations": np.full(len(sets), _count_configurations(block)),
        **summarize_displacements(unpack_deflections(block)),
    }
