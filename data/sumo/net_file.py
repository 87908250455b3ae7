"""Writes a network as the file that SUMO reads."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from data.sumo.network import CENTRE, Network, length
from intersection_env.maps.curve import Points


def write(network: Network, path: Path) -> None:
    """Write the network as a SUMO net file."""
    nodes = {node for edge in network.edges.values() for node in (edge.begin_node, edge.end_node)}
    lines = ['<net version="1.20" junctionCornerDetail="5" limitTurnSpeed="-1">']
    around = "-200.00,-200.00,200.00,200.00"
    lines.append(_tag("location", netOffset="0.00,0.00", convBoundary=around, origBoundary=around, projParameter="!"))
    for edge_id, link in network.links.items():  # speeds by class hang on an edge's type
        limits = [_tag("restriction", vClass=one, speed=f"{speed:.2f}") for one, speed in link.speeds.items()]
        lines.append(f'<type id="{edge_id[1:]}">{"".join(limits)}</type>')
    for edge_id, link in network.links.items():
        lane = _lane(edge_id, link.shape, link.speed)
        lines.append(f'<edge id="{edge_id}" function="internal" type="{edge_id[1:]}">{lane}</edge>')
    for edge_id, edge in network.edges.items():
        lines.append(
            f'<edge id="{edge_id}" from="{edge.begin_node}" to="{edge.end_node}" priority="1">'
            f"{_lane(edge_id, edge.shape, edge.speed)}</edge>"
        )
    for node in sorted(nodes):
        lines.extend(_junction(network, node))
    for edge_id, link in network.links.items():
        ends = {"from": link.before, "to": link.after, "fromLane": "0", "toLane": "0"}
        more = {"via": f"{edge_id}_0", "visibility": f"{link.visibility:.2f}"}
        lines.append(_tag("connection", **ends, **more, dir=link.direction, state=link.state))
        ends["from"] = edge_id
        lines.append(_tag("connection", **ends, dir=link.direction, state="M"))
    path.write_text("\n".join([*lines, "</net>", ""]), encoding="utf-8")


def _junction(network: Network, node: str) -> Iterable[str]:
    links = [edge_id for edge_id, link in network.links.items() if link.node == node]
    entering = dict.fromkeys(edge for edge, value in network.edges.items() if value.end_node == node)
    ends = [value.shape[-1] for value in network.edges.values() if value.end_node == node]
    ends += [value.shape[0] for value in network.edges.values() if value.begin_node == node]
    x, y = np.mean(ends, axis=0)
    yield (
        f'<junction id="{node}" type="{"priority" if links else "dead_end"}" x="{x:.2f}" y="{y:.2f}"'
        f' incLanes="{" ".join(f"{edge}_0" for edge in entering)}"'
        f' intLanes="{" ".join(f"{edge}_0" for edge in links)}" shape="{_shape(np.array(ends))}">'
    )
    own = links
    if node == CENTRE:
        routes = {pair: key for key, value in network.route_edges.items() for pair in pairwise(value)}
        own = [routes[network.links[edge].before, network.links[edge].after] for edge in links]
    for index, one in enumerate(own):
        waits = [network.has_signs and (one, other) in network.yields for other in own]
        foes = [(one, other) in network.yields or (other, one) in network.yields for other in own]
        yield _tag("request", index=str(index), response=_bits(waits), foes=_bits(foes), cont="0")
    yield "</junction>"


def _bits(flags: list[bool]) -> str:
    return "".join("1" if flag else "0" for flag in reversed(flags))


def _lane(edge: str, shape: Points, speed: float) -> str:
    size = {"speed": f"{speed:.2f}", "length": f"{length(shape):.2f}"}
    return _tag("lane", id=f"{edge}_0", index="0", **size, shape=_shape(shape))


def _shape(points: Points) -> str:
    return " ".join(f"{x:.3f},{y:.3f}" for x, y in points)


def _tag(name: str, **attributes: str) -> str:
    return f"<{name} {' '.join(f'{key}={quoteattr(value)}' for key, value in attributes.items())}/>"
