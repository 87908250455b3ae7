#!/usr/bin/env bash
# commonroad-io's XML writer cuts digits off where it should round.
#
# Expected: decimal_precision=4 writes the nearest number with four decimals: errors up to 0.00005, as often up as down.
# Version: commonroad-io 2026.1.
# Happens: the digits after the fourth are dropped. Every coordinate moves towards zero, by up to 0.0001; the mean error
#   does not vanish, so what is written and read again has drifted, and 1.99999 becomes 1.9999.
# Instead: round positions, angles and speeds to four decimals before writing.
# Output:
# > 1.99999 comes back as 1.9999
# > of 2000 coordinates: 2000 nearer to zero, 0 farther, largest error 0.00010, mean error 0.00005
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check commonroad-io==2026.1 numpy==2.4.6
venv/bin/python - <<'PYTHON' | tee seen
import numpy as np
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.file_writer import CommonRoadFileWriter
from commonroad.common.util import FileFormat
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork, LaneletType
from commonroad.scenario.scenario import Scenario, Tag


def read_again(points, file):
    """The left border of a lanelet, after it has been written and read."""
    right = points - [0.0, 3.0]
    scenario = Scenario(0.1)
    lanelet = Lanelet(points, (points + right) / 2, right, 1, lanelet_type={LaneletType.URBAN})
    scenario.add_objects(LaneletNetwork.create_from_lanelet_list([lanelet]))
    about = {"author": "a", "affiliation": "b", "source": "c", "tags": {Tag.URBAN}}
    writer = CommonRoadFileWriter(
        scenario, PlanningProblemSet(), **about, decimal_precision=4, file_format=FileFormat.XML
    )
    writer.write_to_file(file)
    return CommonRoadFileReader(file).open()[0].lanelet_network.find_lanelet_by_id(1).left_vertices


print("1.99999 comes back as", read_again(np.array([[1.99999, 5.0], [20.0, 5.0]]), "one.xml")[0, 0])
random = np.random.default_rng(1)
points = np.column_stack([np.sort(random.uniform(10.0, 900.0, 1000)), random.uniform(10.0, 20.0, 1000)])
error = np.abs(points) - np.abs(read_again(points, "many.xml"))
print(
    f"of {error.size} coordinates: {(error > 0).sum()} nearer to zero, {(error < 0).sum()} farther,"
    f" largest error {error.max():.5f}, mean error {error.mean():.5f}"
)
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
