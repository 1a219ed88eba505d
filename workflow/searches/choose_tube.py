"""Which tube diameter gives kuka_extended the mean deflection that the paper's Table 2 prints.

Run once by hand, from the top of the repository: python workflow/searches/choose_tube.py
Its answer, rounded to 0.1 mm, stands in config/robots/kuka_extended.yaml; nothing else of the paper went into the choice.
"""

from elastocal.io.documents import read_document
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.study.assumptions import diameter_for_mean_deflection
from elastocal.study.simulation import Loading, random_experiments

TABLE_2_MEAN_M = 1.749e-3

if __name__ == "__main__":
    config = read_document("config.yaml")
    robot = robot_from_document(read_document("config/robots/kuka_extended.yaml"))
    measurements = {key: config["interpretations"][key] for key in ("offset_frame", "joint_range")}
    experiments = random_experiments(
        robot.chain,
        robot.joint_limits,
        config["seed"],
        "kuka_extended",
        Loading(**config["loading"], **measurements),
        "identification",
        range(config["data_sets"]),
        config["configurations"],
    )
    diameter = diameter_for_mean_deflection(robot, experiments, TABLE_2_MEAN_M)
    print(f"outer_diameter_m: {diameter:.4f} at wall_m: {robot.links[0].tube.wall_m}")
