#!/usr/bin/env bash
# A point mass that drives west fulfils a goal of commonroad-io that asks for heading east.
#
# Expected: a goal region with an interval of orientations holds for states whose orientation lies in it.
# Version: commonroad-io 2026.1.
# Happens: for a point mass (velocities along x and y) GoalRegion.is_reached first replaces the velocity along x by the
#   speed, which is positive, and then takes the heading from it and the velocity along y. Every state seems to head
#   east: due west becomes due east, and 3 m/s east with 4 m/s north becomes 39 instead of 53 degrees.
# Instead: turn the state into one with a heading (state.orientation and the speed) before asking.
# Output:
# > heads 180 degrees: goal around 180 is reached: False, goal around 0: True; with a heading: True, False
# > heads 53 degrees: goal around 53 is reached: False, goal around 39: True; with a heading: True, False
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check commonroad-io==2026.1 numpy==2.4.6
venv/bin/python - <<'PYTHON' | tee seen
from math import degrees, hypot, radians

import numpy as np
from commonroad.common.util import AngleInterval, Interval
from commonroad.planning.goal import GoalRegion
from commonroad.scenario.state import CustomState, PMState


def reached(state, around):
    """Whether the goal of heading that way, within 5 degrees, is reached."""
    wanted = AngleInterval(radians(around - 5), radians(around + 5))
    return bool(GoalRegion([CustomState(time_step=Interval(0, 10), orientation=wanted)]).is_reached(state))


for speeds, other in (((-10.0, 0.0), 0), ((3.0, 4.0), 39)):
    state = PMState(time_step=3, position=np.zeros(2), velocity=speeds[0], velocity_y=speeds[1])
    heading = round(degrees(state.orientation))
    instead = CustomState(time_step=3, orientation=state.orientation, velocity=hypot(*speeds))
    print(
        f"heads {heading} degrees: goal around {heading} is reached: {reached(state, heading)},"
        f" goal around {other}: {reached(state, other)};"
        f" with a heading: {reached(instead, heading)}, {reached(instead, other)}"
    )
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
