#!/usr/bin/env bash
# commonroad-io's curvature of a line is wrong at its ends, and everywhere where its points are unevenly spaced.
#
# Expected: on an arc of 20 m radius compute_polyline_curvatures returns about 1/20 at every point.
# Version: commonroad-io 2026.1.
# Happens: derivatives are taken over the index of the points, not over the way between them, and twice in a row with
#   one-sided differences at the ends. The first and last curvature are half of the true one, the second and last but
#   one three quarters; where the spacing changes, as it does on most maps, it is 2.48 to 0.45 times the true one.
#   A speed that is limited by the lateral acceleration errs accordingly.
# Instead: resample to even spacing and leave two points off at either end, or use the circle through three points.
# Output (curvature times radius, 1.00 is right):
# > evenly spaced: 0.50 0.75 1.00 1.00 1.00 1.00 1.00 0.75 0.50
# > unevenly spaced: 0.50 0.75 2.48 1.00 0.45 1.00 2.48 0.75 0.50
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check commonroad-io==2026.1 numpy==2.4.6
venv/bin/python - <<'PYTHON' | tee seen
import numpy as np
from commonroad.geometry.polyline_util import compute_polyline_curvatures

RADIUS = 20.0
EVEN = np.arange(9) * 0.1
UNEVEN = np.cumsum([0.0, 0.1, 0.1, 0.1, 0.3, 0.3, 0.1, 0.1, 0.1])
for name, angle in (("evenly", EVEN), ("unevenly", UNEVEN)):
    arc = RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
    print(f"{name} spaced:", *(f"{one:.2f}" for one in RADIUS * compute_polyline_curvatures(arc)))
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
