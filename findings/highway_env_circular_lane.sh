#!/usr/bin/env bash
# On an arc of highway-env that is longer than half a circle, the way along it jumps back to negative.
#
# Expected: CircularLane.local_coordinates undoes CircularLane.position on the whole lane.
# Version: highway-env 1.12.1.
# Happens: the angle since the lane's start is wrapped to -180 to 180 degrees. From half the circle on the longitudinal
#   coordinate is a whole circumference too small: who drives ahead counts as behind, and as off the lane.
# Instead: build rings of arcs of at most half a circle each.
# Output (three quarters of a circle of 20 m, 94.2 m long):
# > placed at 60 m: found at 60.0 m, on the lane: True
# > placed at 65 m: found at -60.7 m, on the lane: False
# > placed at 90 m: found at -35.7 m, on the lane: False
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check highway-env==1.12.1 numpy==2.4.6
venv/bin/python - <<'PYTHON' | tee seen
import numpy as np
from highway_env.road.lane import CircularLane

lane = CircularLane([0.0, 0.0], radius=20.0, start_phase=0.0, end_phase=1.5 * np.pi)
for way in (60.0, 65.0, 90.0):
    position = lane.position(way, 0.0)
    print(
        f"placed at {way:.0f} m: found at {lane.local_coordinates(position)[0]:.1f} m,"
        f" on the lane: {bool(lane.on_lane(position))}"
    )
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
