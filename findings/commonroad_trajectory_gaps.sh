#!/usr/bin/env bash
# A trajectory of commonroad-io with a gap in time answers with the state of another moment.
#
# Expected: state_at_time_step(5) is the state whose time step is 5, and None where there is none.
# Version: commonroad-io 2026.1.
# Happens: append_state asks for a later time step, not for the next one, so that a trajectory may leave out steps, as
#   where a recorded vehicle was hidden. state_at_time_step counts states from the first one instead of looking at
#   their time steps: after the gap it returns states too early, and None for the last ones that are there.
# Instead: fill gaps before, or look states up by their time_step.
# Output (time steps 0, 1, 5, 6):
# > step 2: state of step 5
# > step 5: no state
# > step 6: no state
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


def state(step):
    position = np.array([5.0 * step, 0.0])
    return KSState(time_step=step, position=position, orientation=0.0, velocity=5.0, steering_angle=0.0)


trajectory = Trajectory(0, [state(0), state(1)])
trajectory.append_state(state(5))
trajectory.append_state(state(6))
for step in (2, 5, 6):
    found = trajectory.state_at_time_step(step)
    print(f"step {step}:", "no state" if found is None else f"state of step {found.time_step}")
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
