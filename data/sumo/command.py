"""SUMO on Bendplatz for whoever compares with it: network and demand as files, and the command that simulates them.

The shipped recordings are not made by this command: `drive` has settings of its own.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from data.sumo import demand, net_file
from data.sumo.demand import Driver
from data.sumo.network import Network
from data.sumo.places import BENDPLATZ
from intersection_env.constants import DT
from intersection_env.maps.source import MapSource

DENSER = 1.7  # ours: times the demand of the shipped recordings, for about 12 vehicles at a time
ROUTES = "--route-files"


def command_of(network: Network, drivers: list[Driver], folder: Path) -> list[str]:
    """Writes the network and these drivers for SUMO into the folder; returns the command that simulates them."""
    net, routes = folder / "a.net.xml", folder / "a.rou.xml"
    net_file.write(network, net)
    demand.write(drivers, network.route_edges, routes)
    command = ["sumo", "--net-file", str(net), ROUTES, str(routes), "--step-length", str(DT), "--no-step-log"]
    return [*command, "--no-warnings", "--time-to-teleport", "-1", "--seed", "1"]


def without_drivers(command: list[str]) -> list[str]:
    """The same command, but nobody enters: for going on from a saved state."""
    place = command.index(ROUTES)
    return command[:place] + command[place + 2 :]


def dense_traffic(source: MapSource, duration: float) -> list[Driver]:
    """Cars and trucks as in the shipped recordings, denser: drawn over a longer time, which is then shortened [s]."""
    drawn = demand.draw_drivers(np.random.default_rng(0), BENDPLATZ, demand.streams_of(source), duration * DENSER)
    return [replace(one, depart=one.depart / DENSER) for one in drawn if one.kind != "bicycle"]


def keep_present(state: Path) -> None:
    """Leaves in the state who is on a lane, and their types; SUMO saves the next 200 s' vehicles and all types too."""
    tree = ElementTree.parse(state)
    root = tree.getroot()
    present = {one for on_lane in root.iter("vehicles") for one in on_lane.get("value", "").split()}
    for vehicle in root.findall("vehicle"):
        if vehicle.get("id") not in present:
            root.remove(vehicle)
    types = {vehicle.get("type") for vehicle in root.findall("vehicle")}
    for kind in root.findall("vType"):
        if kind.get("id") not in types:
            root.remove(kind)
    tree.write(state)
