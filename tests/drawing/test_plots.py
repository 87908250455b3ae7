"""Pictures show what the map and the predictions say, and are written whole or not at all."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Rectangle
from PIL import Image

from intersection_env import Intersection, Prediction, Predictor, Traffic, Vehicle, forecast
from intersection_env.files import written_whole
from intersection_env.maps.intersection import XY
from intersection_env.plots import animation
from intersection_env.plots.__main__ import main
from intersection_env.plots.animation import animate
from intersection_env.plots.files import write_figure
from intersection_env.plots.forecast_plot import plot_forecast
from intersection_env.plots.map_plot import plot_map
from intersection_env.plots.prediction_plot import plot_positions, short_ids


@pytest.fixture(scope="module")
def bendplatz() -> Intersection:
    return Intersection.load("bendplatz")


@pytest.fixture(scope="module")
def contested(bendplatz: Intersection) -> Traffic:
    """A left-turner against two oncoming vehicles, and one in nobody's way."""
    vehicles = [
        Vehicle("07/1", "NW-NE", 135.0, 8.0),
        Vehicle("07/2", "SE-NW", 120.0, 12.0),
        Vehicle("07/3", "SE-NW", 100.0, 12.0),
        Vehicle("07/4", "SW-SE", 200.0, 8.0),
    ]
    return Traffic.of(bendplatz, vehicles)


@pytest.fixture(scope="module")
def predictions(contested: Traffic) -> tuple[Prediction, Prediction]:
    """By rule the left-turner waits; told to go first, it does not."""
    idm = Predictor.load("idm")
    return idm.predict(contested), idm.predict(contested, [("07/1", "07/2"), ("07/1", "07/3")])


def texts(axes: Axes) -> dict[str, tuple[float, float]]:
    return {text.get_text(): text.get_position() for text in axes.texts}


def curve(axes: Axes, like: np.ndarray[Any, Any]) -> Any:
    """The one line whose heights are those."""
    found = []
    for line in axes.lines:
        height = np.ma.getdata(np.ma.masked_array(line.get_ydata()))
        if len(height) == len(like) and np.allclose(height, like, atol=1e-3):
            found.append(line)
    assert len(found) == 1
    return found[0]


def test_map_names_every_route_beside_its_own_centreline(intersection: Intersection) -> None:
    axes = plot_map(intersection)
    places = texts(axes)
    for route in intersection.routes:
        distance = np.linalg.norm(route.samples[:, XY] - np.array(places[route.id]), axis=1)
        assert distance.min() < 1.0


def test_names_of_arms_stay_within_the_picture(intersection: Intersection) -> None:
    axes = plot_map(intersection)
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    frame = axes.get_window_extent()
    boxes = [text.get_window_extent() for text in axes.texts if text.get_text().startswith("from ")]
    assert len(boxes) == len({route.entry for route in intersection.routes})
    assert all(frame.x0 <= box.x0 and box.x1 <= frame.x1 for box in boxes)
    assert all(frame.y0 <= box.y0 and box.y1 <= frame.y1 for box in boxes)


def test_map_marks_a_pga_for_every_conflict_where_the_yielder_reaches_it(intersection: Intersection) -> None:
    axes = plot_map(intersection)
    marks = [np.concatenate(line.get_data()).astype(float) for line in axes.lines if line.get_marker() == "D"]
    wanted = [
        intersection.sample(one.yielder, np.array([one.on_yielder[1]], np.float32))[0, XY]
        for one in intersection.conflicts
    ]
    np.testing.assert_allclose(sorted(map(tuple, marks)), sorted(map(tuple, wanted)), atol=1e-4)


def test_map_shows_every_stop_line_and_conflict_at_equal_scales(intersection: Intersection) -> None:
    axes = plot_map(intersection)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    for route in intersection.routes:
        for position in (route.stop_line, min(route.first_conflict, route.length)):
            x, y = intersection.sample(route.index, np.array([position], np.float32))[0, XY]
            assert left < x < right
            assert low < y < high
    assert axes.get_aspect() == 1.0


def test_map_tells_crossing_from_merging(intersection: Intersection) -> None:
    merging = sum(conflict.merging for conflict in intersection.conflicts)
    title = plot_map(intersection).get_title()
    assert f"{len(intersection.conflicts) - merging} crossing and {merging} merging" in title


def test_map_is_drawn_into_axes_that_are_given(bendplatz: Intersection) -> None:
    from matplotlib.figure import Figure

    axes = Figure().subplots(1, 2)[1]
    assert plot_map(bendplatz, axes) is axes
    assert axes.lines


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_command_draws_a_map_into_one_file(tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str) -> None:
    path = tmp_path / "new" / f"map{suffix}"
    assert main(["t_junction", "--out", str(path)]) == 0
    assert [one.name for one in path.parent.iterdir()] == [path.name]
    assert path.stat().st_size > 10_000
    assert str(path) in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere", "--out", "map.png"], 'no map "nowhere" ships'),
        (["missing.json", "--out", "map.png"], "missing.json"),
        (["t_junction", "--out", "map.bmp"], "a picture must end in .png, .svg, .pdf"),
    ],
)
def test_command_that_cannot_draw_says_why_and_leaves_nothing(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 1
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_file_that_was_there_survives_a_write_that_fails(tmp_path: Path) -> None:
    path = tmp_path / "picture.png"
    path.write_bytes(b"before")
    with pytest.raises(OSError, match="disk full"):
        _write_half(path)
    assert path.read_bytes() == b"before"
    assert len(list(tmp_path.iterdir())) == 1


def _write_half(path: Path) -> None:
    with written_whole(path) as temporary:
        temporary.write_bytes(b"half")
        raise OSError("disk full")


def test_positions_are_those_predicted_from_the_first_conflict(
    contested: Traffic, predictions: tuple[Prediction, Prediction]
) -> None:
    panels = plot_positions(*predictions).axes
    for axes, prediction in zip(panels, predictions, strict=True):
        for i in (0, 1, 2):
            first_conflict = contested.intersection.routes[contested.route[i]].first_conflict
            curve(axes, prediction.position[0, :, i] + contested.length[i] / 2 - first_conflict)


def test_vehicles_are_numbered_in_the_order_in_which_they_enter(predictions: tuple[Prediction, Prediction]) -> None:
    default, best = plot_positions(*predictions).axes
    turner = curve(default, heights(predictions[0], 0)).get_color()
    assert numbers(best)[:2] == [("1", turner), ("2", numbers(default)[0][1])]
    assert numbers(default)[0][1] != turner
    assert [number for number, _ in numbers(default)] == ["1", "2", "3"]
    assert numbers(default)[2][1] == turner


def numbers(axes: Axes) -> list[tuple[str, str]]:
    """The numbers at which vehicles cross, with their colours."""
    circles = [one for one in axes.texts if one.get_text().isdecimal() and one.get_position()[0] > 0.0]
    return [(one.get_text(), str(one.get_color())) for one in circles]


def heights(prediction: Prediction, vehicle: int) -> np.ndarray[Any, Any]:
    traffic = prediction.traffic
    first_conflict = traffic.intersection.routes[traffic.route[vehicle]].first_conflict
    return np.asarray(prediction.position[0, :, vehicle] + traffic.length[vehicle] / 2 - first_conflict)


def test_vehicles_in_another_order_are_bold_and_those_without_conflict_are_grey(
    predictions: tuple[Prediction, Prediction],
) -> None:
    axes = plot_positions(*predictions).axes[0]
    turner, bystander = curve(axes, heights(predictions[0], 0)), curve(axes, heights(predictions[0], 3))
    assert turner.get_linewidth() > 2.0 > bystander.get_linewidth()
    assert bystander.get_color() == "#c9c9c6"


def test_recorded_future_is_dashed_where_it_is_known(
    contested: Traffic, predictions: tuple[Prediction, Prediction]
) -> None:
    position = predictions[0].position[0] - np.float32(1.0)
    known = np.arange(51)[:, None] < np.array([51, 20, 0, 51])
    left, right = plot_positions(*predictions, np.ma.masked_array(position, ~known)).axes
    dashed = [line for line in left.lines if line.is_dashed()]
    assert [int(np.ma.count(line.get_ydata())) for line in dashed] == [51, 20, 0]
    assert not any(line.is_dashed() for line in right.lines)


def test_ids_of_vehicles_that_start_abreast_do_not_overlap(bendplatz: Intersection) -> None:
    vehicles = [Vehicle(name, "SE-NW", 140.0 - 8.0 * k, 8.0) for k, name in enumerate("abc")]
    vehicles += [Vehicle(name, "NW-NE", 139.0 - 8.0 * k, 8.0) for k, name in enumerate("def")]
    prediction = Predictor.load("idm").predict(Traffic.of(bendplatz, vehicles))
    figure = plot_positions(prediction, prediction)
    figure.draw_without_rendering()
    boxes = [one.get_window_extent() for one in figure.axes[0].texts if one.get_text() in set("abcdef")]
    assert len(boxes) == 6
    spans = sorted((box.y0, box.y1) for box in boxes)
    assert all(below[1] <= above[0] for below, above in pairwise(spans))


def test_an_id_beside_the_first_conflict_is_not_struck_through(bendplatz: Intersection) -> None:
    route = bendplatz.routes[bendplatz.route_index("SE-NW")]
    vehicles = [Vehicle("a", "SE-NW", route.first_conflict - 2.25, 0.0), Vehicle("b", "NW-NE", 120.0, 8.0)]
    prediction = Predictor.load("idm").predict(Traffic.of(bendplatz, vehicles))
    figure = plot_positions(prediction, prediction)
    figure.draw_without_rendering()
    axes = figure.axes[0]
    (own,) = [one.get_window_extent() for one in axes.texts if one.get_text() == "a"]
    (line,) = [one for one in axes.collections if isinstance(one, LineCollection)]
    begin = axes.transData.transform(line.get_segments()[0])[0]
    assert own.y0 < begin[1] < own.y1
    assert own.x1 < begin[0]


def test_ids_lose_the_recording_only_if_all_have_the_same(bendplatz: Intersection) -> None:
    rows = [Vehicle("07/15", "SE-NW", 90.0, 8.0), Vehicle("07/9", "SE-NW", 60.0, 8.0)]
    assert short_ids(Traffic.of(bendplatz, rows)) == ("15", "9")
    rows[1] = rows[1]._replace(id="08/15")
    assert short_ids(Traffic.of(bendplatz, rows)) == ("07/15", "08/15")


def test_animation_moves_in_real_time_and_is_the_only_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, predictions: tuple[Prediction, Prediction]
) -> None:
    monkeypatch.setattr(animation, "DOTS_PER_INCH", 30)  # small, hence fast
    path = tmp_path / "two.gif"
    animate({"default": predictions[0], "best": predictions[1]}, path)
    assert [one.name for one in tmp_path.iterdir()] == ["two.gif"]
    with Image.open(path) as film:
        assert getattr(film, "n_frames", 0) == 101
        pictures, seconds = [], 0.0
        for frame in (0, 100):
            film.seek(frame)
            pictures.append(np.asarray(film.convert("RGB"), dtype=np.int64))
            seconds += film.info["duration"] / 1e3
    assert seconds == pytest.approx(0.1 + animation.HOLD)
    width = pictures[0].shape[1] // 2
    assert (pictures[0][:, :width] != pictures[1][:, :width]).any()
    assert (pictures[1][40:, :width] != pictures[1][40:, width : 2 * width]).any()


def test_animation_of_nothing_or_of_another_kind_is_refused(
    tmp_path: Path, predictions: tuple[Prediction, Prediction]
) -> None:
    with pytest.raises(ValueError, match="no predictions"):
        animate({}, tmp_path / "none.gif")
    with pytest.raises(ValueError, match=r"must end in \.gif"):
        animate({"default": predictions[0]}, tmp_path / "film.mp4")
    with pytest.raises(ValueError, match=r"must end in \.png"):
        write_figure(plot_positions(*predictions), tmp_path / "figure.jpg")
    assert not list(tmp_path.iterdir())


def test_forecast_shows_a_fan_a_vehicle_and_a_bar_an_order() -> None:
    vehicles = [Vehicle("a", "SE-NW", 90.0, 12.0), Vehicle("b", "SW-NE", 75.0, 6.0), Vehicle("c", "NW-SE", 130.0, 9.0)]
    found = forecast(Predictor.load(), Traffic.of(Intersection.load("bendplatz"), vehicles))
    fans, bars = plot_forecast(found).axes
    assert len(fans.collections) == len(np.unique(found.traffic.conflicts)), "who has no conflict has no fan"
    widths = [bar.get_width() for bar in bars.patches if isinstance(bar, Rectangle)]
    assert widths == pytest.approx((100.0 * found.probability[:8]).tolist())
    assert bars.texts[0].get_text().endswith(found.words()[0])
    assert {text.get_text() for text in fans.texts} <= set(found.traffic.ids)
