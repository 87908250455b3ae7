"""What SUMO is told when it is compared with: who drives, who is on a lane, and from which state it goes on."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from data.sumo import demand, generate, net_file
from data.sumo import network as sumo_network
from data.sumo.command import DENSER, command_of, dense_traffic, keep_present, without_drivers
from data.sumo.demand import BLOCK
from data.sumo.places import BENDPLATZ


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


def test_drivers_of_known_vehicles_are_of_their_kind_and_drawn_as_all_are() -> None:
    drawn = demand._driver(np.random.default_rng(4), "7", 0.0, "SW-NE", "vehicle")
    assert demand.driver_like(np.random.default_rng(4), "7", "SW-NE", drawn.kind) == drawn
    for kind in demand.KINDS:
        drivers = [demand.driver_like(np.random.default_rng(seed), "7", "SW-NE", kind) for seed in range(40)]
        assert {one.kind for one in drivers} == {kind}
        assert len({one.traits["tau"] for one in drivers}) > 20
    with pytest.raises(ValueError, match='not for "tram"'):
        demand.driver_like(np.random.default_rng(4), "7", "SW-NE", "tram")


def test_wider_drivers_differ_more_and_keep_what_must_be_above_zero() -> None:
    def drawn(times: float) -> dict[str, np.ndarray]:
        traits = []
        for seed in range(60):
            temper = demand.wider(np.random.default_rng([seed, 1]), times)
            rng = np.random.default_rng(seed)
            traits.append(demand._driver(rng, "7", 0.0, "SW-NE", "vehicle", truck_share=0.0, temper=temper).traits)
        return {name: np.array([one[name] for one in traits]) for name in traits[0]}

    usual, wider = drawn(1.0), drawn(2.0)
    for name in ("speedFactor", "accel", "decel", "tau", "minGap", "jmTimegapMinor"):
        assert 1.4 < wider[name].std() / usual[name].std() < 3.0, name
    assert (wider["accel"].min(), wider["tau"].min()) >= (0.55, 0.35)
    assert wider["speedFactor"].mean() < usual["speedFactor"].mean() - 0.05, "a pace of their own, mostly slower"


def test_usual_temper_changes_nothing() -> None:
    assert demand.wider(np.random.default_rng(0), 1.0) == demand.USUAL
    place, streams = BENDPLATZ, demand.streams_of(sumo_network.read()[0])
    drivers = [
        demand.draw_drivers(np.random.default_rng(3), place, streams, BLOCK, *temper)
        for temper in ((), (demand.wider(np.random.default_rng(5), 1.0),))
    ]
    assert drivers[0] == drivers[1]


@pytest.mark.parametrize("option", ["--wider", "--larger"])
@pytest.mark.parametrize(("times", "message"), [("0.5", "from 1 to 4"), ("2", "--output"), ("nan", "from 1 to 4")])
def test_other_recordings_are_never_written_over_those_that_ship(
    capsys: pytest.CaptureFixture[str], option: str, times: str, message: str
) -> None:
    with pytest.raises(SystemExit):
        generate.main(["--recording", "0", option, times])
    assert message in capsys.readouterr().err


def test_types_without_trips_let_nobody_enter(tmp_path: Path) -> None:
    source, network = sumo_network.read()
    drivers = dense_traffic(source, BLOCK)
    demand.write(drivers, network.route_edges, tmp_path / "a.xml", depart=False)
    root = ElementTree.parse(tmp_path / "a.xml").getroot()
    assert [one.get("id") for one in root.iter("vType")] == [f"t{one.id}" for one in drivers]
    assert not list(root.iter("vehicle"))


def test_network_without_signs_differs_in_who_waits_alone(tmp_path: Path) -> None:
    _, network = sumo_network.read()
    roots = []
    for name, written in (("signs", network), ("none", sumo_network.without_signs(network))):
        net_file.write(written, tmp_path / name)
        roots.append(ElementTree.parse(tmp_path / name).getroot())
    signs, none = roots
    assert {one.get("state") for one in none.iter("connection")} == {"M"}
    assert {one.get("state") for one in signs.iter("connection")} == {"M", "m", "s"}
    for one, other in zip(signs.iter("request"), none.iter("request"), strict=True):
        assert one.get("foes") == other.get("foes")
        assert set(str(other.get("response"))) <= {"0"}
    assert any("1" in str(one.get("response")) for one in signs.iter("request"))
    for root in roots:
        for one in (*root.iter("connection"), *root.iter("request")):
            for changed in ("state", "response"):
                one.attrib.pop(changed, None)
    assert ElementTree.tostring(signs) == ElementTree.tostring(none)
