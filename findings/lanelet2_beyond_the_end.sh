#!/usr/bin/env bash
# Beyond the end of a line, lanelet2's arc coordinates give the way to its end point as the lateral offset.
#
# Expected: geometry.toArcCoordinates tells how far along a line and how far to its side a point lies; back through
#   fromArcCoordinates comes the same point.
# Version: lanelet2 1.2.3.
# Happens: past either end the length stays that of the end, and the distance is that to the end point, with a sign. A
#   car straight ahead of the end, on the lane's axis, is "3 m to the right"; one 13 m on and 4 m to the left is 5 m to
#   the left at 10 m. The way back ends somewhere else. A car that leaves the mapped area in the middle of its
#   lane seems to drift sideways.
# Instead: test whether the length is 0 or that of the line, and extend the line or drop the point.
# Output (line from 0, 0 to 10, 0):
# > 5, 1: length 5.0, distance 1.0, and back: 5.0, 1.0
# > 13, 0: length 10.0, distance -3.0, and back: 10.0, -3.0
# > 13, 4: length 10.0, distance 5.0, and back: 10.0, 5.0
# > -3, 4: length 0.0, distance 5.0, and back: 0.0, 5.0
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check lanelet2==1.2.3
venv/bin/python - <<'PYTHON' | tee seen
from lanelet2.core import BasicPoint2d, LineString3d, Point3d, getId
from lanelet2.geometry import fromArcCoordinates, to2D, toArcCoordinates

line = to2D(LineString3d(getId(), [Point3d(getId(), x, 0.0, 0.0) for x in (0.0, 10.0)]))
for x, y in ((5, 1), (13, 0), (13, 4), (-3, 4)):
    arc = toArcCoordinates(line, BasicPoint2d(x, y))
    back = fromArcCoordinates(line, arc)
    print(f"{x}, {y}: length {arc.length:.1f}, distance {arc.distance:.1f}, and back: {back.x:.1f}, {back.y:.1f}")
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
