"""What the twin says of a traffic, under one name: `from tests.reference import predictor as reference`.

For tests, where the package has the same names; the rules are in the files that are imported here.
"""

from tests.reference.decide import Rules, accepts_gap
from tests.reference.drive import NETWORK_ACCELERATION, Idm, drive
from tests.reference.intersection import Map, load_map
from tests.reference.memory import Memory, initial_memory
from tests.reference.networks import Network, evaluate
from tests.reference.observe import observe
from tests.reference.order_probabilities import logits, order_features, probabilities, yielder_first
from tests.reference.orders import complete, lane_chains, orders
from tests.reference.pairs import conflict_of, conflicts
from tests.reference.patience import patience
from tests.reference.position_quantiles import position_quantiles
from tests.reference.predict import predict
from tests.reference.traffic import TIME_STEP, Traffic

__all__ = [
    "NETWORK_ACCELERATION",
    "TIME_STEP",
    "Idm",
    "Map",
    "Memory",
    "Network",
    "Rules",
    "Traffic",
    "accepts_gap",
    "complete",
    "conflict_of",
    "conflicts",
    "drive",
    "evaluate",
    "initial_memory",
    "lane_chains",
    "load_map",
    "logits",
    "observe",
    "order_features",
    "orders",
    "patience",
    "position_quantiles",
    "predict",
    "probabilities",
    "yielder_first",
]
