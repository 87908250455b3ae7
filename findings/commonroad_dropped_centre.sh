#!/usr/bin/env bash
# commonroad-io reads an obstacle whose rectangle lies ahead of its reference point as if it lay around it.
#
# Expected: the format lets a rectangle say where its centre is, seen from the obstacle's position; whoever measures
#   positions at a rear axle writes it. Up to 2024.3 the reader keeps it.
# Version: commonroad-io 2026.1.
# Happens: the centre is read over in silence: origin_x_shift, which the shape has for this, stays 0, and what the
#   obstacle covers is shifted by as much as the file said. Nothing is raised or logged.
# Instead: after reading, set the shape's origin_x_shift from the file; or write positions of centres alone.
# Output (what a car of 4 m covers that stands at 10 m, its centre 3 m ahead of that):
# > origin_x_shift 0.0, covers 8.0 to 12.0 m; the file says 11.0 to 15.0 m
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check commonroad-io==2026.1 numpy==2.4.6
cat > scenario.xml <<'XML'
<?xml version="1.0" encoding="UTF-8"?>
<commonRoad commonRoadVersion="2020a" benchmarkID="ZAM_Centre-1_1_T-1" date="2024-01-01" author="nobody"
            affiliation="none" source="by hand" timeStepSize="0.1">
  <location><geoNameId>-999</geoNameId><gpsLatitude>999</gpsLatitude><gpsLongitude>999</gpsLongitude></location>
  <scenarioTags/>
  <staticObstacle id="1">
    <type>parkedVehicle</type>
    <shape><rectangle><length>4.0</length><width>2.0</width><orientation>0.0</orientation>
      <center><x>3.0</x><y>0.0</y></center></rectangle></shape>
    <initialState>
      <position><point><x>10.0</x><y>0.0</y></point></position>
      <orientation><exact>0.0</exact></orientation><time><exact>0</exact></time>
    </initialState>
  </staticObstacle>
</commonRoad>
XML
venv/bin/python - <<'PYTHON' | tee seen
from commonroad.common.file_reader import CommonRoadFileReader

scenario, _ = CommonRoadFileReader("scenario.xml").open()
(parked,) = scenario.static_obstacles
rear, _, front, _ = parked.occupancy_at_time(0).shapely_object.bounds
shift = parked.obstacle_shape.origin_x_shift
print(f"origin_x_shift {shift}, covers {rear} to {front} m; the file says 11.0 to 15.0 m")
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
