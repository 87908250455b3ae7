"""The vehicles at one moment, and their distances."""

from dataclasses import dataclass, fields

from tests.reference.intersection import Floats, Integers, Map, Sample, sample

TIME_STEP = 0.2  # s
BRAKING = 4.0  # m/s², of s_brake


@dataclass(frozen=True)
class Traffic:
    """The vehicles at one moment; each array (vehicle,): route index, [m], [m/s], [m], [m], [m/s]."""

    route: Integers
    position: Floats
    speed: Floats
    length: Floats
    width: Floats
    max_speed: Floats


FIELDS = tuple(field.name for field in fields(Traffic))


def front(traffic: Traffic, i: int) -> float:
    return float(traffic.position[i] + traffic.length[i] / 2)


def rear(traffic: Traffic, i: int) -> float:
    return float(traffic.position[i] - traffic.length[i] / 2)


def distance_to_stop_line(intersection: Map, traffic: Traffic, i: int) -> float:
    return float(intersection.routes[traffic.route[i]].stop_line - front(traffic, i))


def braking_distance(traffic: Traffic, i: int) -> float:
    return float(max(traffic.speed[i], 0.0) ** 2 / (2 * BRAKING))


def speed_limit(intersection: Map, traffic: Traffic, i: int) -> float:
    """v_max: the map's at the vehicle's centre, or the vehicle's own."""
    here = sample(intersection, int(traffic.route[i]), float(traffic.position[i]))
    return float(min(here[Sample.V_MAX], traffic.max_speed[i]))
