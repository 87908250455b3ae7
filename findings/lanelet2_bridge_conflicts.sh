#!/usr/bin/env bash
# In Python lanelet2 lists a lanelet on a bridge as in conflict with the one below.
#
# Expected: RoutingGraph.conflicting leaves out lanelets that pass overhead: points have heights, and in C++ the graph
#   can be told how tall its vehicles are.
# Version: lanelet2 1.2.3.
# Happens: the Python constructor takes map, rules and costs but no height of participants, and without one overlaps are
#   looked for from above only. A road 20 m up is in conflict with the road on the ground.
# Instead: keep of the conflicting ones those for which geometry.overlaps3d (by default within 3 m of height) holds.
# Output:
# > 0 m above: conflicting 1, overlaps3d True
# > 20 m above: conflicting 1, overlaps3d False
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check lanelet2==1.2.3
venv/bin/python - <<'PYTHON' | tee seen
from lanelet2.core import Lanelet, LaneletMap, LineString3d, Point3d, getId
from lanelet2.geometry import overlaps3d
from lanelet2.routing import RoutingGraph
from lanelet2.traffic_rules import Locations, Participants, create


def road(left, right):
    """A lanelet between two lines of points."""
    lines = [LineString3d(getId(), [Point3d(getId(), *map(float, point)) for point in one]) for one in (left, right)]
    lanelet = Lanelet(getId(), *lines)
    for key, value in (("subtype", "road"), ("location", "urban"), ("one_way", "yes")):
        lanelet.attributes[key] = value
    return lanelet


for height in (0, 20):
    ground = road([(-50, 2, 0), (50, 2, 0)], [(-50, -2, 0), (50, -2, 0)])
    across = road([(-2, -50, height), (-2, 50, height)], [(2, -50, height), (2, 50, height)])
    place = LaneletMap()
    place.add(ground)
    place.add(across)
    graph = RoutingGraph(place, create(Locations.Germany, Participants.Vehicle))
    print(f"{height} m above: conflicting {len(graph.conflicting(ground))}, overlaps3d {overlaps3d(ground, across)}")
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
