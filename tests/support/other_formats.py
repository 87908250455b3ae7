"""Recordings written again in INTERACTION's and CommonRoad's formats."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from data.recording import Recording


def write_interaction(folder: Path, id: str, recording: Recording) -> None:
    """The vehicles, and beside them those on foot or bicycle, of whom the format has no heading and size."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = {"vehicle": [], "pedestrian": []}  # type: dict[str, list[pd.DataFrame]]
    for index, user in enumerate(recording.road_user):
        own = slice(recording.offsets[index], recording.offsets[index + 1])
        frame = recording.frame[own]
        soft = user in ("pedestrian", "bicycle")
        table = pd.DataFrame(
            {
                "track_id": f"P{recording.track_id[index]}" if soft else recording.track_id[index],
                "frame_id": frame + 1,
                "timestamp_ms": np.rint(1000.0 * (frame + 1) / recording.frame_rate).astype(int),
                "agent_type": "pedestrian/bicycle" if soft else user.partition("_")[0],
                "x": recording.x[own],
                "y": recording.y[own],
                "vx": recording.velocity[own, 0],
                "vy": recording.velocity[own, 1],
            }
        )
        if not soft:
            body = {"psi_rad": recording.heading[own], "length": recording.length[index]}
            table = table.assign(**body, width=recording.width[index])
        rows["pedestrian" if soft else "vehicle"].append(table)
    for kind, tables in rows.items():
        if tables:
            pd.concat(tables, ignore_index=True).to_csv(folder / f"{kind}_tracks_{id}.csv", index=False)


def write_commonroad(path: Path, recording: Recording, begin: int = 0, end: int | None = None) -> None:
    """The obstacles of the frames from `begin` to before `end` as one scenario."""
    path.parent.mkdir(parents=True, exist_ok=True)
    obstacles = []
    for index, user in enumerate(recording.road_user):
        rows = np.arange(recording.offsets[index], recording.offsets[index + 1])
        rows = rows[(recording.frame[rows] >= begin) & (recording.frame[rows] < (end or 1 << 30))]
        if not len(rows):
            continue
        states = [_state(recording, row, begin) for row in rows]
        size = max(recording.length[index], 0.5), max(recording.width[index], 0.5)
        shape = f"<rectangle><length>{size[0]}</length><width>{size[1]}</width></rectangle>"
        obstacles.append(
            f'<dynamicObstacle id="{1000 + recording.track_id[index]}"><type>{user.partition("_")[0]}</type>'
            f"<shape>{shape}</shape><initialState>{states[0]}</initialState>"
            f"<trajectory>{''.join(f'<state>{one}</state>' for one in states[1:])}</trajectory></dynamicObstacle>"
        )
    head = f'<commonRoad commonRoadVersion="2020a" benchmarkID="XX" timeStepSize="{1.0 / recording.frame_rate:g}">'
    path.write_text(f"<?xml version='1.0' encoding='UTF-8'?>\n{head}{''.join(obstacles)}</commonRoad>\n")


def _state(recording: Recording, row: int, begin: int) -> str:
    values = {
        "orientation": np.arctan2(*recording.velocity[row, ::-1]),
        "time": recording.frame[row] - begin,
        "velocity": np.hypot(*recording.velocity[row]),
        "acceleration": 0.0,
    }
    place = f"<position><point><x>{recording.x[row]}</x><y>{recording.y[row]}</y></point></position>"
    return place + "".join(f"<{name}><exact>{value}</exact></{name}>" for name, value in values.items())
