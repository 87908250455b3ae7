#!/usr/bin/env bash
# highway-env's test of two rotated rectangles turns them the wrong way round.
#
# Expected: utils.rotated_rectangles_intersect agrees with the corners that utils.rect_corners gives.
# Version: highway-env 1.12.1, against shapely 2.2.0.
# Happens: point_in_rotated_rectangle turns the point by +angle into the rectangle's frame, where it must turn by
#   -angle. A point 2 m ahead of the middle of a car of 5 m is outside unless the car heads along an axis. Of pairs of
#   cars at random headings a tenth of those that overlap is missed, and one in seven of those that do not overlap
#   "overlaps". RegulatedRoad, by which cars give way at the environment's intersections, asks it whether a
#   conflict is possible; crashes are found by are_polygons_intersecting, which is right.
# Instead: utils.are_polygons_intersecting, or shapely.
# Output:
# > point 2 m ahead, heading 0 degrees: inside True
# > point 2 m ahead, heading 30 degrees: inside False
# > rotated_rectangles_intersect: of 797 pairs that overlap 80 are missed, of 1203 that do not 175 are said to
# > are_polygons_intersecting: of 797 pairs that overlap 0 are missed, of 1203 that do not 0 are said to
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check highway-env==1.12.1 numpy==2.4.6 shapely==2.2.0
venv/bin/python - <<'PYTHON' | tee seen
import numpy as np
from highway_env import utils
from shapely import Polygon

for degrees in (0, 30):
    angle = np.radians(degrees)
    ahead = 2 * np.array([np.cos(angle), np.sin(angle)])
    inside = utils.point_in_rotated_rectangle(ahead, np.zeros(2), 5.0, 2.0, angle)
    print(f"point 2 m ahead, heading {degrees} degrees: inside {bool(inside)}")



def closed(rectangle):
    corners = utils.rect_corners(*rectangle)
    return np.vstack([corners, corners[:1]])


random, still = np.random.default_rng(0), np.zeros(2)
truth, told = [], {"rotated_rectangles_intersect": [], "are_polygons_intersecting": []}
for _ in range(2000):
    middle, angles = random.uniform(-5, 5, 2), random.uniform(-np.pi, np.pi, 2)
    one, other = (np.zeros(2), 4.5, 1.8, angles[0]), (middle, 4.5, 1.8, angles[1])
    first, second = closed(one), closed(other)
    truth.append(Polygon(first).intersects(Polygon(second)))
    told["rotated_rectangles_intersect"].append(utils.rotated_rectangles_intersect(one, other))
    told["are_polygons_intersecting"].append(utils.are_polygons_intersecting(first, second, still, still)[0])
truth = np.array(truth)
for name, answers in told.items():
    print(
        f"{name}: of {truth.sum()} pairs that overlap {(truth & ~np.array(answers)).sum()} are missed,"
        f" of {(~truth).sum()} that do not {(np.array(answers) & ~truth).sum()} are said to"
    )
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
