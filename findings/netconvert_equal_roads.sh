#!/usr/bin/env bash
# At a crossing of four equal roads netconvert picks the major road by how the network is turned.
#
# Expected: four roads of one priority, one lane and one speed meet as equals; turning the network by 90 degrees turns
#   the right of way along with it.
# Version: eclipse-sumo 1.28.0.
# Happens: at 50 km/h the node becomes a "priority" junction, and one of the two straight roads is made the major one,
#   with no warning. Which one is a matter of the compass: turned by 90 degrees the other road has priority, turned by
#   10 degrees too. Cars that would meet as equals drive through on one road and wait on the other.
# Instead: state the node's type (right_before_left, allway_stop, priority_stop) or unequal priorities of the edges.
# Output (roads a and c are opposite each other, b and d too; a heads east before turning):
# > turned by 0 degrees: priority, major b d
# > turned by 10 degrees: priority, major a c
# > turned by 90 degrees: priority, major a c
# > turned by 180 degrees: priority, major b d
# > type stated, turned by 0 degrees: right_before_left, major
# > type stated, turned by 90 degrees: right_before_left, major
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check eclipse-sumo==1.28.0
venv/bin/python - <<'PYTHON' | tee seen
import subprocess
import xml.etree.ElementTree as ET
from math import cos, radians, sin
from pathlib import Path


def junction(degrees, kind=""):
    """The middle's type, and the roads from which it may be crossed straight on without giving way."""
    nodes, edges = [f'<node id="middle" x="0" y="0" {kind}/>'], []
    for index, road in enumerate("abcd"):
        angle = radians(degrees + 90 * index)
        nodes.append(f'<node id="{road}" x="{200 * cos(angle):.2f}" y="{200 * sin(angle):.2f}"/>')
        same = 'numLanes="1" speed="13.89" priority="1"'
        edges.append(f'<edge id="from_{road}" from="{road}" to="middle" {same}/>')
        edges.append(f'<edge id="to_{road}" from="middle" to="{road}" {same}/>')
    Path("place.nod.xml").write_text(f"<nodes>{''.join(nodes)}</nodes>")
    Path("place.edg.xml").write_text(f"<edges>{''.join(edges)}</edges>")
    command = ["venv/bin/netconvert", "-n", "place.nod.xml", "-e", "place.edg.xml", "-o", "place.net.xml"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    network = ET.parse("place.net.xml").getroot()
    major = [
        one.get("from").removeprefix("from_")
        for one in network.iter("connection")
        if one.get("from").startswith("from_") and one.get("dir") == "s" and one.get("state") == "M"
    ]
    return network.find("junction[@id='middle']").get("type"), sorted(major)


for words, degrees, kind in (
    ("", 0, ""),
    ("", 10, ""),
    ("", 90, ""),
    ("", 180, ""),
    ("type stated, ", 0, 'type="right_before_left"'),
    ("type stated, ", 90, 'type="right_before_left"'),
):
    found, major = junction(degrees, kind)
    print(f"{words}turned by {degrees} degrees: {' '.join([found + ', major', *major])}")
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
