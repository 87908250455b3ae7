#!/usr/bin/env bash
# commonroad-io finds no crossing of two lines that lie a few hundred metres from the origin.
#
# Expected: compute_polyline_intersections finds where two polylines cross, wherever that is.
# Version: commonroad-io 2026.1, against shapely 2.2.0.
# Happens: a crossing counts only if a cross product of coordinates is below 1e-12, which rounding alone exceeds once
#   coordinates are in the hundreds. Of crossings at random angles all are found near the origin, none 500 m from it;
#   UTM coordinates are thousands of kilometres from theirs. The answer is an empty array, not an error.
# Instead: shapely's LineString.intersection.
# Output:
# > 0 m from the origin: 200 of 200 crossings found, by shapely 200
# > 500 m from the origin: 0 of 200 crossings found, by shapely 200
# > 500000 m from the origin: 0 of 200 crossings found, by shapely 200
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check commonroad-io==2026.1 numpy==2.4.6 shapely==2.2.0
venv/bin/python - <<'PYTHON' | tee seen
import numpy as np
from commonroad.geometry.polyline_util import compute_polyline_intersections
from shapely import LineString

random = np.random.default_rng(1)
directions = [20 * np.array([np.cos(angle), np.sin(angle)]) for angle in random.uniform(0.0, 2 * np.pi, 200)]
for away in (0, 500, 500_000):
    middle = np.array([away, away])
    crosses = [(middle + [-d, d], middle + [-d[::-1] * [-1, 1], d[::-1] * [-1, 1]]) for d in directions]
    found = sum(len(compute_polyline_intersections(one, other)) == 1 for one, other in crosses)
    by_shapely = sum(LineString(one).intersects(LineString(other)) for one, other in crosses)
    print(f"{away} m from the origin: {found} of 200 crossings found, by shapely {by_shapely}")
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
