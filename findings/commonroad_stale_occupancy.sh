#!/usr/bin/env bash
# Where an obstacle of commonroad-io is after a move depends on whether one has asked before.
#
# Expected: translate_rotate of an obstacle moves its trajectory and what it covers; its docstring says that the set of
#   occupancies is computed anew.
# Version: commonroad-io 2026.1.
# Happens: occupancies are cached when first asked for, and the cache outlives translate_rotate. States are moved,
#   occupancies of later steps are not, while that of the initial step is: checks of collisions then run against places
#   that the vehicle has left. Without the earlier question everything is right.
# Instead: after the move assign the trajectory anew (prediction.trajectory = prediction.trajectory), which empties the
#   cache.
# Output (x after a move by 100 m):
# > not asked before: state 105, covers 105
# > asked before: state 105, covers 5
# > asked before, trajectory assigned anew: state 105, covers 105
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check commonroad-io==2026.1 numpy==2.4.6
venv/bin/python - <<'PYTHON' | tee seen
import numpy as np
from commonroad.geometry.obstacle_shapes.rect_obstacle_shape import RectObstacleShape
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.state import InitialState, KSState
from commonroad.scenario.trajectory import Trajectory


def car():
    """At 0 m, and at 5 m one step later."""
    rest = {"acceleration": 0.0, "yaw_rate": 0.0, "slip_angle": 0.0}
    first = InitialState(time_step=0, position=np.zeros(2), orientation=0.0, velocity=5.0, **rest)
    later = KSState(
        time_step=1, position=np.array([5.0, 0.0]), orientation=0.0, velocity=5.0, steering_angle=0.0
    )
    shape = RectObstacleShape(width=2.0, length=4.0)
    return DynamicObstacle(1, ObstacleType.CAR, shape, first, TrajectoryPrediction(Trajectory(1, [later]), shape))


for words, asks, assigns in (
    ("not asked before", False, False),
    ("asked before", True, False),
    ("asked before, trajectory assigned anew", True, True),
):
    one = car()
    if asks:
        one.occupancy_at_time(1)
    one.translate_rotate(np.array([100.0, 0.0]), 0.0)
    if assigns:
        one.prediction.trajectory = one.prediction.trajectory
    covers = one.occupancy_at_time(1).shapely_object.centroid.x
    print(f"{words}: state {one.state_at_time(1).position[0]:.0f}, covers {covers:.0f}")
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
