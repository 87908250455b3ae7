"""An animation of predictions: vehicles to scale on the map, coloured by speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from intersection_env.constants import DT
from intersection_env.files import written_whole
from intersection_env.maps.intersection import XY
from intersection_env.maps.outline import directions, junction_extent, stop_lines
from intersection_env.plots.colours import INK, KERB
from intersection_env.plots.lanes import draw_lanes, zoom_to_junction
from intersection_env.plots.prediction_plot import short_ids
from intersection_env.prediction.predictor import Prediction

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from PIL.Image import Image

FRAMES_PER_STEP = 2  # ours: 10 pictures a second move smoothly; positions between steps are interpolated
TOP_SPEED = 15.0  # [m/s], end of the colour scale: a little above 50 km/h
HOLD = 1.5  # [s], for which the last picture stands
COLOURS = 256
DOTS_PER_INCH = 100
NAME_SIZE = 7.0  # [point]
PANEL = 4.8  # [inch], width of one prediction
MARGIN = 12.0  # [m] shown around what a map's plot shows: room for those who queue
LONGEST_LINE = 2.0  # [m], of stop lines
NAME_GAP = 1.5  # [m] from a vehicle to the middle of its name

BODY = np.array([(-0.5, -0.5), (0.36, -0.5), (0.5, -0.3), (0.5, 0.3), (0.36, 0.5), (-0.5, 0.5)])
"""(corner, 2): a vehicle of one metre by one, its front narrowed."""


def animate(predictions: Mapping[str, Prediction], path: Path) -> None:
    """Writes an animation (GIF) of predictions side by side, in real time.

    Args:
        predictions: by title; of each, scenario 0 is shown. All on one map.
        path: the file to write, `.gif`.

    Raises:
        ValueError: another kind of file, or no predictions.
        OSError: the file cannot be written.
    """
    if path.suffix != ".gif":
        raise ValueError(f'an animation must end in .gif, not "{path}"')
    if not predictions:
        raise ValueError("no predictions to animate")
    frames = _frames(predictions)
    milliseconds = round(1000.0 * DT / FRAMES_PER_STEP)
    durations = [milliseconds] * (len(frames) - 1) + [round(1000.0 * HOLD)]
    with written_whole(path) as temporary:
        frames[0].save(
            temporary, format="GIF", save_all=True, append_images=frames[1:], duration=durations, loop=0, optimize=False
        )


def _frames(predictions: Mapping[str, Prediction]) -> list[Image]:
    """The pictures of an animation; what stands still is drawn once."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    first = next(iter(predictions.values()))
    width, height = np.ptp(junction_extent(first.traffic.intersection), axis=0) + 2.0 * MARGIN
    size = (PANEL * len(predictions), PANEL * height / width + 1.15)
    figure = Figure(figsize=size, dpi=DOTS_PER_INCH, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)  # matplotlib leaves its methods untyped
    panels = figure.subplots(1, len(predictions), squeeze=False)[0].tolist()
    clock = figure.suptitle("0.0 s", fontsize=11, animated=True)
    stages = [_Stage(axes, *item) for axes, item in zip(panels, predictions.items(), strict=True)]
    _draw_scale(figure, panels)
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    pictures: list[Image.Image] = []
    for step in np.linspace(0.0, len(first.time) - 1.0, (len(first.time) - 1) * FRAMES_PER_STEP + 1).tolist():
        canvas.restore_region(still)
        clock.set_text(f"{step * DT:.1f} s")
        figure.draw_artist(clock)
        for stage in stages:
            stage.show(step)
        pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    sheet = Image.new("RGB", (pictures[0].width, 3 * pictures[0].height))
    for row, picture in enumerate((pictures[0], pictures[len(pictures) // 2], pictures[-1])):
        sheet.paste(picture, (0, row * picture.height))
    palette = sheet.quantize(COLOURS)
    return [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]


class _Stage:
    """The map with the vehicles of one prediction."""

    def __init__(self, axes: Axes, title: str, prediction: Prediction) -> None:
        from matplotlib.colors import Normalize

        self._axes, self._prediction = axes, prediction
        self._normalize, self._colours = Normalize(0.0, TOP_SPEED), _speed_colours()
        intersection = prediction.traffic.intersection
        draw_lanes(axes, intersection)
        zoom_to_junction(axes, intersection, MARGIN)
        axes.set(xticks=[], yticks=[])
        axes.spines[:].set_color(KERB)
        axes.set_title(title, fontsize=9.5)
        for line in stop_lines(intersection, LONGEST_LINE):
            axes.plot(*line.ends.T, color="white", linewidth=1.2)
        body: dict[str, Any] = {"edgecolor": INK, "linewidth": 0.6, "animated": True}
        self._bodies = [axes.fill([], [], **body)[0] for _ in prediction.traffic.ids]
        self._names = [_Name(axes, name) for name in short_ids(prediction.traffic)]

    def show(self, step: float) -> None:
        """Draws the vehicles at a step, or between two."""
        prediction, traffic = self._prediction, self._prediction.traffic
        before, share = int(step), step - int(step)
        after = min(before + 1, len(prediction.time) - 1)
        position = (1.0 - share) * prediction.position[0, before] + share * prediction.position[0, after]
        speed = (1.0 - share) * prediction.speed[0, before] + share * prediction.speed[0, after]
        shown = np.flatnonzero(prediction.present[0, before])
        samples = traffic.intersection.sample_each(traffic.route[shown], position[shown])
        centre, (ahead, left) = samples[:, XY], directions(samples)
        colours = self._colours(self._normalize(speed[shown]))
        for row, i in enumerate(shown.tolist()):
            body = BODY * (traffic.length[i], traffic.width[i])
            self._bodies[i].set_xy(centre[row] + body @ np.stack([ahead[row], left[row]]))
            self._bodies[i].set_facecolor(colours[row])
            self._axes.draw_artist(self._bodies[i])
        beside = centre - (0.5 * traffic.width[shown, None] + NAME_GAP) * left
        for i, place in zip(shown.tolist(), beside, strict=True):  # above all bodies
            self._names[i].show(place)


class _Name:
    """A vehicle's id as a path, laid out once: drawing text anew takes most of the time of a picture."""

    def __init__(self, axes: Axes, name: str) -> None:
        from matplotlib.patches import PathPatch
        from matplotlib.path import Path as Outline
        from matplotlib.textpath import TextPath

        self._axes = axes
        path = TextPath((0.0, 0.0), name, size=NAME_SIZE * DOTS_PER_INCH / 72.0)
        box = path.get_extents()
        centred = Outline(path.vertices - [(box.x0 + box.x1) / 2.0, (box.y0 + box.y1) / 2.0], path.codes)
        self._patch = axes.add_patch(PathPatch(centred, facecolor=INK, linewidth=0.0, animated=True))

    def show(self, place: NDArray[np.float64]) -> None:
        """Draws the id centred at a place, (2,) [m]."""
        from matplotlib.transforms import Affine2D

        self._patch.set_transform(Affine2D().translate(*self._axes.transData.transform(place)))
        self._axes.draw_artist(self._patch)


def _draw_scale(figure: Figure, panels: Sequence[Axes]) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    mappable = ScalarMappable(Normalize(0.0, TOP_SPEED), _speed_colours())
    bar = figure.colorbar(mappable, ax=panels, location="bottom", shrink=0.35, aspect=40, pad=0.02)
    bar.set_label("speed [m/s]", fontsize=8)
    bar.ax.tick_params(labelsize=7.5)


def _speed_colours() -> Any:
    """Dark red where a vehicle stands, over yellow, to blue at speed; told apart without seeing red or green."""
    from matplotlib import colormaps

    return colormaps["RdYlBu"]
