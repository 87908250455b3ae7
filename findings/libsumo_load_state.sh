#!/usr/bin/env bash
# libsumo's loadState brings vehicles back, but not the random numbers that were saved with them.
#
# Expected: with --save-state.rng the state of the random numbers is saved; loading it twice in one simulation and
#   driving on gives the same traffic twice, as what-if comparisons from one moment need.
# Version: libsumo 1.28.0.
# Happens: simulation.loadState of a running simulation restores positions and speeds, while random numbers go on where
#   they were: each continuation differs, from the first one too. A simulation that begins with --load-state of the same
#   file does continue exactly, so that the file is complete.
# Instead: begin a simulation with --load-state for each continuation.
# Output (metres along the road, 30 s after the state was saved):
# > driven on: 727.326 609.378 585.924 550.097
# > loaded, driven on: 727.658 610.739 588.322 549.715
# > loaded again, driven on: 728.354 610.186 587.046 555.055
# > begun with --load-state: 727.326 609.378 585.924 550.097
set -euo pipefail
script=$(realpath "$0")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check eclipse-sumo==1.28.0 libsumo==1.28.0
venv/bin/python - <<'PYTHON' | tee seen
import subprocess
from pathlib import Path

import libsumo

Path("road.nod.xml").write_text('<nodes><node id="a" x="0" y="0"/><node id="b" x="2000" y="0"/></nodes>')
Path("road.edg.xml").write_text('<edges><edge id="e" from="a" to="b" numLanes="1" speed="13.9"/></edges>')
command = ["venv/bin/netconvert", "-n", "road.nod.xml", "-e", "road.edg.xml", "-o", "road.net.xml"]
subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
cars = "".join(f'<vehicle id="{index}" type="car" route="r" depart="{3 * index}"/>' for index in range(4))
Path("cars.rou.xml").write_text(
    f'<routes><vType id="car" sigma="0.5"/><route id="r" edges="e"/>{cars}</routes>'
)
START = ["sumo", "-n", "road.net.xml", "-r", "cars.rou.xml", "--seed", "7", "--no-step-log", "--no-warnings"]


def drive_on(words):
    for _ in range(30):
        libsumo.simulationStep()
    print(f"{words}:", *(f"{libsumo.vehicle.getLanePosition(str(index)):.3f}" for index in range(4)))


libsumo.start([*START, "--save-state.rng", "--save-state.precision", "17"])
for _ in range(20):
    libsumo.simulationStep()
libsumo.simulation.saveState("state.xml")
drive_on("driven on")
libsumo.simulation.loadState("state.xml")
drive_on("loaded, driven on")
libsumo.simulation.loadState("state.xml")
drive_on("loaded again, driven on")
libsumo.close()

libsumo.start([*START, "--load-state", "state.xml"])
drive_on("begun with --load-state")
libsumo.close()
PYTHON
diff <(sed -n 's/^# > //p' "$script") seen
