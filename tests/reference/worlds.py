"""What the twin says of a world, under one name: `from tests.reference import worlds as reference_worlds`.

For tests, where the package has the same names; the rules are in the files that are imported here.
"""

from tests.reference.closed_loop import State, Step, decided, step
from tests.reference.decide import Rules
from tests.reference.recorded import Recording, Scene, Track
from tests.reference.replay import Ride, RideStep, actor_decides, begin, ride_on
from tests.reference.starts import newcomer_distance, speed_range, violations

__all__ = [
    "Recording",
    "Ride",
    "RideStep",
    "Rules",
    "Scene",
    "State",
    "Step",
    "Track",
    "actor_decides",
    "begin",
    "decided",
    "newcomer_distance",
    "ride_on",
    "speed_range",
    "step",
    "violations",
]
