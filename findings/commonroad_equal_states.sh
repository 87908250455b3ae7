#!/usr/bin/env bash
# Two states of commonroad-io are equal wherever they are.
#
# Expected: `==` of two states compares their positions, as their hashes do.
# Version: commonroad-io 2026.1.
# Happens: where both positions are points, the position of the left state is compared with itself. States that differ
#   in nothing but their place are equal, and so are trajectories of such states. Their hashes differ, so that a set
#   keeps both. A test that compares trajectories with == passes for a reader that moves every car.
# Instead: compare `state.position` with numpy.allclose.
# Output:
# > states 100 m apart are equal: True, hashes are equal: False, a set of both holds 2
# > trajectories 100 m apart are equal: True
# > states that differ in speed are equal: False
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check commonroad-io==2026.1 numpy==2.4.6
venv/bin/python - <<'PYTHON' | tee seen
import numpy as np
from commonroad.scenario.state import KSState
from commonroad.scenario.trajectory import Trajectory


def state(x, speed=5.0):
    return KSState(time_step=1, position=np.array([x, 0.0]), orientation=0.0, velocity=speed, steering_angle=0.0)


here, there = state(0.0), state(100.0)
print(
    f"states 100 m apart are equal: {here == there}, hashes are equal: {hash(here) == hash(there)},"
    f" a set of both holds {len({here, there})}"
)
print("trajectories 100 m apart are equal:", Trajectory(1, [here]) == Trajectory(1, [there]))
print("states that differ in speed are equal:", here == state(0.0, speed=6.0))
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
