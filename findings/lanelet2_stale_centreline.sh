#!/usr/bin/env bash
# After a border point has been moved, a lanelet of lanelet2 keeps its old centreline.
#
# Expected: primitives share their points, and the README promises that all owners of a point see when it is changed.
# Version: lanelet2 1.2.3.
# Happens: the centreline is computed when first asked for and kept. Border and polygon follow the moved point; the
#   centreline, the lanelet's length and the distance to the centreline do not.
# Instead: lanelet.resetCache() after each change.
# Output (the left border of a lanelet 4 m wide moves 4 m outwards at x = 10 m):
# > before: border at 2, centreline ends at 0.0, 2.0 m from 10, 2, length 10.0, polygon to 2
# > moved: border at 6, centreline ends at 0.0, 2.0 m from 10, 2, length 10.0, polygon to 6
# > reset: border at 6, centreline ends at 2.0, 0.0 m from 10, 2, length 10.4, polygon to 6
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check lanelet2==1.2.3
venv/bin/python - <<'PYTHON' | tee seen
from lanelet2.core import BasicPoint2d, Lanelet, LineString3d, Point3d, getId
from lanelet2.geometry import distanceToCenterline2d, length2d


def line(y):
    return LineString3d(getId(), [Point3d(getId(), x, y, 0.0) for x in (0.0, 10.0)])


def tell(when):
    distance = distanceToCenterline2d(lanelet, BasicPoint2d(10.0, 2.0))
    print(
        f"{when}: border at {lanelet.leftBound[1].y:.0f}, centreline ends at {lanelet.centerline[-1].y:.1f},"
        f" {distance:.1f} m from 10, 2, length {length2d(lanelet):.1f}, polygon to {lanelet.polygon2d()[1].y:.0f}"
    )


lanelet = Lanelet(getId(), line(2.0), line(-2.0))
tell("before")
lanelet.leftBound[1].y = 6.0
tell("moved")
lanelet.resetCache()
tell("reset")
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
