"""What SUMO is told when it is compared with: who drives, who is on a lane, and from which state it goes on."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from data.sumo import network as sumo_network
from data.sumo.command import DENSER, command_of, dense_traffic, keep_present, without_drivers
from data.sumo.demand import BLOCK


def test_command_without_drivers_is_the_same_but_for_their_file(tmp_path: Path) -> None:
    source, network = sumo_network.read()
    command = command_of(network, dense_traffic(source, BLOCK), tmp_path)
    named = {path.name for path in map(Path, command) if path.parent == tmp_path}
    assert named == {path.name for path in tmp_path.iterdir()} == {"a.net.xml", "a.rou.xml"}
    left = without_drivers(command)
    assert [one for one in command if one not in left] == ["--route-files", str(tmp_path / "a.rou.xml")]


def test_dense_traffic_is_motor_vehicles_of_a_longer_time_in_the_time_asked_for() -> None:
    drivers = dense_traffic(sumo_network.read()[0], 4 * BLOCK)
    departures = [one.depart for one in drivers]
    assert departures == sorted(departures)
    assert 3 * BLOCK < departures[-1] < (4 * BLOCK * DENSER + BLOCK) / DENSER
    assert {one.kind for one in drivers} == {"car", "truck_bus"}


def test_state_of_libsumo_keeps_only_who_is_on_a_lane_and_their_types(tmp_path: Path) -> None:
    state = tmp_path / "a.xml"
    lane = '<lane id="L"><vehicles value="0 2"/></lane>'
    cars = "".join(f'<vType id="t{k}"/>' for k in range(4)) + "".join(f'<vehicle id="{k}" type="t{k}"/>' for k in "012")
    state.write_text(f"<snapshot>{cars}{lane}</snapshot>")
    keep_present(state)
    kept = [one.get("id") for one in ElementTree.parse(state).getroot()]
    assert kept == ["t0", "t2", "0", "2", "L"]
