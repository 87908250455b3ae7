"""Traffic at unsignalized intersections: maps, recorded scenes, prediction, maneuvers, environments for learning.

Importing it registers the environments, as `intersection_env/Replay-v0` with Gymnasium and
`intersection_env/ClosedLoop-v0` with PettingZoo; `intersection_env.VARIANTS` lists them all.
"""

from importlib.metadata import version

from intersection_env import installed as installed  # first: it says what is wrong where the core is missing
from intersection_env.envs.closed_loop import ClosedLoop, env, parallel_env
from intersection_env.envs.replay import Replay
from intersection_env.envs.replay_vector import ReplayVector
from intersection_env.envs.variants import VARIANTS, Variant, register
from intersection_env.maps.intersection import Intersection
from intersection_env.prediction.forecast import Forecast, forecast
from intersection_env.prediction.maneuvers import crossing_orders, rank_maneuvers
from intersection_env.prediction.noise import Noise
from intersection_env.prediction.predictor import Observation, Prediction, Predictor, Summary
from intersection_env.scenes.scene import Scene
from intersection_env.scenes.scenes import Scenes
from intersection_env.traffic import Traffic, Vehicle
from intersection_env.worlds.closed_loop import ClosedLoopWorlds
from intersection_env.worlds.replay import ReplayWorlds

__all__ = [
    "VARIANTS",
    "ClosedLoop",
    "ClosedLoopWorlds",
    "Forecast",
    "Intersection",
    "Noise",
    "Observation",
    "Prediction",
    "Predictor",
    "Replay",
    "ReplayVector",
    "ReplayWorlds",
    "Scene",
    "Scenes",
    "Summary",
    "Traffic",
    "Variant",
    "Vehicle",
    "__version__",
    "crossing_orders",
    "env",
    "forecast",
    "parallel_env",
    "rank_maneuvers",
]

__version__ = version("intersection_env")

register()
