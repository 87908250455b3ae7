"""The recorded drivers as a Minari data set, for offline and imitation learning: what each saw, did and was paid.

python -m data.minari --scenes bendplatz --split train

Every car and truck that is recorded for 1 s or more drives through `Replay` by its recorded accelerations, as far as
the environment's 6 m/s² go. Needs `pip install "minari[hdf5]" pillow`, as Minari asks for Pillow without saying so.
"""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from intersection_env import Replay, Scenes
from intersection_env.command import run_command
from intersection_env.constants import ACCELERATION
from intersection_env.scenes.scene import SPLITS
from intersection_env.worlds.replay import ReplayWorlds

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Episode:
    """One recorded driver's drive, as `Replay` gives it.

    observations: (step + 1, 12); actions: (step, 1); rewards: (step,); terminations, truncations: (step,) bool.
    """

    scene: str
    vehicle: str
    observations: Floats
    actions: Floats
    rewards: Floats
    terminations: NDArray[np.bool_]
    truncations: NDArray[np.bool_]


def expert_episodes(scenes: str | Path | Scenes, split: str | None = "train") -> Iterator[Episode]:
    """The drives of all recorded cars and trucks of a split, in the order of their tracks.

    Raises:
        ValueError, OSError: as of `ReplayWorlds`.
    """
    worlds = ReplayWorlds(scenes, split=split, autoreset="off")
    worlds.reset(0)  # what it draws, `start` replaces
    tracks = worlds.tracks
    for track in tracks.actors.tolist():
        worlds.start(0, track)
        seen, did, paid = [worlds.observation[0].copy()], [], []
        is_over = False
        while not is_over:
            worlds.action[:] = np.clip(worlds.expert_acceleration / ACCELERATION, -1.0, 1.0)
            did.append(worlds.action.copy())
            worlds.step()
            is_over = bool(worlds.terminated[0] | worlds.truncated[0])
            seen.append((worlds.final_observation if is_over else worlds.observation)[0].copy())
            paid.append(worlds.reward[0])
        ends = np.zeros((2, len(paid)), np.bool_)
        ends[:, -1] = worlds.terminated[0], worlds.truncated[0]
        yield Episode(
            tracks.scene_id[track], tracks.track_id[track], np.stack(seen), np.stack(did), np.array(paid), *ends
        )


def write_data_set(name: str, scenes: str, split: str | None, folder: Path | None = None) -> Any:
    """Writes the drives as the Minari data set of this name, and returns it.

    Args:
        name: as Minari has them, `intersection_env/bendplatz/recorded-v0`.
        scenes: scenes that ship, or a scenes file.
        split: `"train"`, `"development"`, `"validation"`, or None for all.
        folder: of all data sets; None: Minari's own (`MINARI_DATASETS_PATH`, else in the home folder).

    Raises:
        ModuleNotFoundError: Minari is not installed.
        ValueError: there is such a data set already, or as of `ReplayWorlds`.
        OSError: as of `ReplayWorlds`, or the data set cannot be written.
    """
    import minari
    from minari.data_collector import EpisodeBuffer

    if folder is not None:
        os.environ["MINARI_DATASETS_PATH"] = str(folder.resolve())
    environment = gymnasium.make("intersection_env/Replay-v0", scenes=scenes, split=split)
    buffers = [
        EpisodeBuffer(
            id=number,
            options={"scene": one.scene, "vehicle": one.vehicle},
            observations=list(one.observations),
            actions=list(one.actions),
            rewards=one.rewards.tolist(),
            terminations=one.terminations.tolist(),
            truncations=one.truncations.tolist(),
        )
        for number, one in enumerate(expert_episodes(scenes, split))
    ]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".* is set to None")  # who made it, and where it may be evaluated otherwise
        return minari.create_dataset_from_buffers(
            name,
            buffers,
            env=environment,
            algorithm_name="recorded drivers",
            description=str(Replay.__doc__).partition("\n")[0],
            requirements=["intersection_env"],
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the recorded drivers of some scenes as a Minari data set."""
    parser = argparse.ArgumentParser(prog="python -m data.minari", description=main.__doc__)
    parser.add_argument("--scenes", default="bendplatz", help="scenes that ship, or a scenes file")
    parser.add_argument("--split", default="train", choices=(*SPLITS, "all"))
    parser.add_argument("--name", help="of the data set; default: intersection_env/SCENES/SPLIT-v0")
    parser.add_argument("--out", type=Path, help="the folder of all data sets; default: Minari's own")
    options = parser.parse_args(arguments)
    name = options.name or f"intersection_env/{Path(options.scenes).stem}/{options.split}-v0"
    split = None if options.split == "all" else options.split
    try:
        data_set = write_data_set(name, options.scenes, split, options.out)
    except ModuleNotFoundError as error:
        print(f'error: {error}: pip install "minari[hdf5]" pillow', file=sys.stderr)
        return 1
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"{name}: {data_set.total_episodes} episodes, {data_set.total_steps} steps")
    return 0


if __name__ == "__main__":
    run_command(main)
