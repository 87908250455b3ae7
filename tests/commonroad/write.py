"""Run where commonroad-io is, and nothing of this package: writes an XML scenario as that version's protobuf.

python write.py SCENARIO.xml FOLDER
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Any

from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.file_writer import CommonRoadFileWriter, FileFormat, OverwriteExistingFile
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.obstacle import DynamicObstacle

TRUCK = 9.0
"""[m] long."""


def main(source: Path, folder: Path) -> None:
    """Writes `scenario.pb`, or, where it is three files, `map.pb`, `dynamic.pb`, `problems.pb`, and `truck.pb`."""
    warnings.simplefilter("ignore")  # its own, of its own code
    scenario, problems = CommonRoadFileReader(str(source)).open()
    writer = CommonRoadFileWriter(scenario, problems, file_format=FileFormat.PROTOBUF)
    if not hasattr(writer, "write_dynamic_to_file"):
        writer.write_to_file(str(folder / "scenario.pb"), OverwriteExistingFile.ALWAYS)
        return
    writer.write_map_to_file(str(folder / "map.pb"), OverwriteExistingFile.ALWAYS)
    writer.write_dynamic_to_file(str(folder / "dynamic.pb"), OverwriteExistingFile.ALWAYS)
    writer.write_scenario_to_file(str(folder / "problems.pb"), OverwriteExistingFile.ALWAYS)
    middle = as_truck(scenario)
    writer = CommonRoadFileWriter(scenario, problems, file_format=FileFormat.PROTOBUF)
    writer.write_dynamic_to_file(str(folder / "truck.pb"), OverwriteExistingFile.ALWAYS)
    print(f"{middle.x} {middle.y}")


def as_truck(scenario: Any) -> Any:
    """Leaves one obstacle, as a truck whose origin lies at its rear axle, and returns its middle at first."""
    from commonroad.geometry.obstacle_shapes.truck_shape import TruckShape  # 2026.1

    car = scenario.dynamic_obstacles[0]
    shape = TruckShape.with_length(TRUCK)
    driven = TrajectoryPrediction(car.prediction.trajectory, shape)
    truck = DynamicObstacle(car.obstacle_id, car.obstacle_type, shape, car.initial_state, driven)
    scenario.remove_obstacle(scenario.obstacles)
    scenario.add_objects(truck)
    return truck.occupancy_at_time(car.initial_state.time_step).center


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
