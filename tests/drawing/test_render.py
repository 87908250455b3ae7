"""Pictures of a snapshot: to scale, the same for the same snapshot, and without a display."""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np
import pygame
import pytest
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from intersection_env import Intersection
from intersection_env.maps.intersection import XY, Sample
from intersection_env.render.ink import HELD, INK, SECOND, SPEEDS, WAITING, Colour
from intersection_env.render.renderer import Renderer
from intersection_env.render.road_layer import ASPHALT
from intersection_env.render.snapshot import Ghosts, Snapshot

WEST_EAST, EAST_WEST, SOUTH_WEST = "W-E", "E-W", "S-W"
Picture = NDArray[np.uint8]


@pytest.fixture(scope="module")
def t_junction() -> Intersection:
    return Intersection.load("t_junction")


@pytest.fixture(scope="module")
def renderer(t_junction: Intersection) -> Renderer:
    """Shows 15 pixels a metre."""
    return Renderer(t_junction, view=20.0)


def snapshot_of(intersection: Intersection, *vehicles: tuple[str, float], length: float = 4.5) -> Snapshot:
    """Vehicles on these routes at these positions, at 5 m/s where 10 m/s are allowed, and none of them held."""
    count = len(vehicles)
    return Snapshot(
        route=np.array([intersection.route_index(route) for route, _ in vehicles], np.int32),
        position=np.array([position for _, position in vehicles], np.float32),
        speed=np.full(count, 5.0, np.float32),
        length=np.full(count, length, np.float32),
        width=np.full(count, 1.8, np.float32),
        v_max=np.full(count, 10.0, np.float32),
        enters=np.ones(count, np.bool_),
    )


def pairs(*rows: tuple[int, int]) -> NDArray[np.int32]:
    return np.array(rows, np.int32).reshape(-1, 2)


def is_near(picture: Picture, colour: Colour) -> NDArray[np.bool_]:
    """Which pixels have about this colour: (height, width)."""
    return np.asarray(np.abs(picture.astype(int) - colour).max(axis=2) <= 12)


def differs(one: Picture, other: Picture) -> NDArray[np.bool_]:
    return np.asarray((one != other).any(axis=2))


def centre_of(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Column and row, on average, of what is marked."""
    rows, columns = np.nonzero(mask)
    assert len(rows), "nothing is marked"
    return np.array([columns.mean() + 0.5, rows.mean() + 0.5])


def place_of(renderer: Renderer, intersection: Intersection, route: str, position: float) -> NDArray[np.float64]:
    """Where a place on a route is to be seen: column and row, the map's north up."""
    sample = intersection.sample(intersection.route_index(route), np.array([position], np.float32))[0]
    camera = renderer.camera
    return np.array(
        [
            camera.width / 2 + camera.scale * (sample[Sample.X] - camera.x),
            camera.height / 2 - camera.scale * (sample[Sample.Y] - camera.y),
        ]
    )


def pixel_at(picture: Picture, place: NDArray[np.float64]) -> Picture:
    column, row = place.astype(int)
    return np.asarray(picture[row, column])


def test_picture_has_the_size_and_is_the_callers_own(intersection: Intersection) -> None:
    renderer = Renderer(intersection, (320, 240))
    snapshot = snapshot_of(intersection)
    picture = renderer.rgb_array(snapshot)
    assert picture.shape == (240, 320, 3)
    assert picture.dtype == np.uint8
    before = picture.copy()
    picture[:] = 0
    np.testing.assert_array_equal(renderer.rgb_array(snapshot), before)


def test_same_moment_gives_the_same_bytes(intersection: Intersection) -> None:
    routes = [(route.id, route.stop_line - 5.0) for route in intersection.routes]
    snapshot = snapshot_of(intersection, *routes)
    snapshot = replace(snapshot, waits_for=pairs((0, 1)), assigned=pairs((2, 3)), labels=["a"] * len(routes), time=1.0)
    one, other = Renderer(intersection), Renderer(intersection)
    first = one.rgb_array(snapshot)
    other.rgb_array(snapshot_of(intersection, routes[0]))
    np.testing.assert_array_equal(other.rgb_array(snapshot), first)
    np.testing.assert_array_equal(one.rgb_array(snapshot), first)


@pytest.mark.parametrize("route", [WEST_EAST, EAST_WEST, SOUTH_WEST])
def test_vehicle_is_seen_where_it_is(t_junction: Intersection, renderer: Renderer, route: str) -> None:
    empty = renderer.rgb_array(snapshot_of(t_junction))
    for past in (-3.0, 1.0):
        position = t_junction.routes[t_junction.route_index(route)].stop_line + past
        seen = differs(renderer.rgb_array(snapshot_of(t_junction, (route, position))), empty)
        assert np.abs(centre_of(seen) - place_of(renderer, t_junction, route, position)).max() < 3.0


@pytest.mark.parametrize("length", [1.8, 4.5, 11.9])
def test_vehicle_is_drawn_to_scale(t_junction: Intersection, renderer: Renderer, length: float) -> None:
    snapshot = snapshot_of(t_junction, (WEST_EAST, 160.0), length=length)
    seen = differs(renderer.rgb_array(snapshot), renderer.rgb_array(snapshot_of(t_junction)))
    scale = renderer.camera.scale
    assert scale == 15.0
    assert abs(seen.any(axis=0).sum() - length * scale) <= 2.0
    assert abs(seen.any(axis=1).sum() - 1.8 * scale) <= 2.0
    assert seen.sum() == pytest.approx(length * 1.8 * scale**2, rel=0.06)


def test_colour_goes_from_standing_to_v_max(t_junction: Intersection, renderer: Renderer) -> None:
    place = place_of(renderer, t_junction, WEST_EAST, 150.0)
    snapshot = snapshot_of(t_junction, (WEST_EAST, 150.0))
    for speed, shade in ((-1.0, 0), (0.0, 0), (5.0, 128), (10.0, 255), (12.0, 255)):
        picture = renderer.rgb_array(replace(snapshot, speed=np.array([speed], np.float32)))
        assert np.abs(pixel_at(picture, place).astype(int) - SPEEDS[shade]).max() <= 4


def test_windscreen_is_nearer_to_the_front(t_junction: Intersection, renderer: Renderer) -> None:
    picture = renderer.rgb_array(snapshot_of(t_junction, (WEST_EAST, 150.0)))
    for ahead, is_glass in ((0.7, True), (-0.7, False)):
        place = place_of(renderer, t_junction, WEST_EAST, 150.0 + ahead)
        assert (np.abs(pixel_at(picture, place).astype(int) - INK).max() <= 12) == is_glass


def test_red_bar_stands_before_a_vehicle_that_is_held(t_junction: Intersection, renderer: Renderer) -> None:
    free = snapshot_of(t_junction, (WEST_EAST, 150.0), (EAST_WEST, 150.0))
    held = replace(free, enters=np.array([False, True]))
    assert not is_near(renderer.rgb_array(free), HELD).any()
    bar = centre_of(is_near(renderer.rgb_array(held), HELD))
    assert np.abs(bar - place_of(renderer, t_junction, WEST_EAST, 150.0 + 2.25 + 0.6)).max() < 4.0


def test_arrow_leads_from_one_that_waits_to_whom_it_waits_for(t_junction: Intersection, renderer: Renderer) -> None:
    snapshot = snapshot_of(t_junction, (SOUTH_WEST, 90.0), (WEST_EAST, 140.0))
    assert not is_near(renderer.rgb_array(snapshot), WAITING.colour).any()
    for pair, other_end in (((0, 1), (SOUTH_WEST, 93.0)), ((1, 0), (WEST_EAST, 143.0))):
        picture = renderer.rgb_array(replace(snapshot, waits_for=pairs(pair)))
        seen = is_near(picture, WAITING.colour)
        assert not is_near(picture, SECOND.colour).any()
        columns, rows = np.nonzero(seen)[::-1]
        tail = np.linalg.norm(np.stack([columns, rows], axis=1) - place_of(renderer, t_junction, *other_end), axis=1)
        assert tail.min() < 12.0
        assert (tail > tail.max() - 8.0).sum() > (tail < tail.min() + 8.0).sum(), "the head is not at the other end"


def test_priority_assignment_looks_different_from_waiting(t_junction: Intersection, renderer: Renderer) -> None:
    snapshot = snapshot_of(t_junction, (SOUTH_WEST, 90.0), (WEST_EAST, 140.0))
    picture = renderer.rgb_array(replace(snapshot, assigned=pairs((0, 1))))
    assert is_near(picture, SECOND.colour).sum() > 30
    assert not is_near(picture, WAITING.colour).any()


def test_arrow_between_vehicles_that_touch_is_left_out(t_junction: Intersection, renderer: Renderer) -> None:
    snapshot = snapshot_of(t_junction, (WEST_EAST, 140.0), (WEST_EAST, 145.0))
    without = renderer.rgb_array(snapshot)
    picture = renderer.rgb_array(replace(snapshot, waits_for=pairs((0, 1))))
    np.testing.assert_array_equal(picture, without)


def test_ghost_is_seen_where_it_was_recorded_and_shines_through(t_junction: Intersection, renderer: Renderer) -> None:
    snapshot = snapshot_of(t_junction, (EAST_WEST, 150.0))
    recorded = snapshot_of(t_junction, (WEST_EAST, 150.0))
    ghosts = Ghosts(recorded.route, recorded.position, recorded.length, recorded.width)
    picture = renderer.rgb_array(replace(snapshot, ghosts=ghosts))
    seen = differs(picture, renderer.rgb_array(snapshot))
    place = place_of(renderer, t_junction, WEST_EAST, 150.0)
    assert np.abs(centre_of(seen) - place).max() < 3.0
    assert seen.sum() == pytest.approx(4.5 * 1.8 * renderer.camera.scale**2, rel=0.06)
    inside = pixel_at(picture, place).astype(int)
    assert (inside < ASPHALT).all()
    assert (inside > 0.8 * np.array(ASPHALT)).all()


def test_acting_vehicle_has_a_ring(t_junction: Intersection, renderer: Renderer) -> None:
    snapshot = snapshot_of(t_junction, (EAST_WEST, 150.0), (WEST_EAST, 150.0))
    without, picture = renderer.rgb_array(snapshot), renderer.rgb_array(replace(snapshot, highlight=1))
    seen = differs(picture, without)
    place = place_of(renderer, t_junction, WEST_EAST, 150.0)
    assert np.abs(centre_of(seen) - place).max() < 3.0
    np.testing.assert_array_equal(pixel_at(picture, place), pixel_at(without, place))


def test_time_caption_and_labels_are_written(t_junction: Intersection, renderer: Renderer) -> None:
    snapshot = snapshot_of(t_junction, (WEST_EAST, 150.0))
    without = renderer.rgb_array(snapshot)
    places = []
    for shown in (
        replace(snapshot, time=12.4),
        replace(snapshot, time=12.4, caption="03/2"),
        replace(snapshot, labels=["17"]),
    ):
        places.append(centre_of(differs(renderer.rgb_array(shown), without)))
    vehicle = place_of(renderer, t_junction, WEST_EAST, 150.0)
    assert (places[0] < 60.0).all()
    assert places[1][1] > places[0][1]
    assert 0.9 < np.linalg.norm(places[2] - vehicle) / renderer.camera.scale < 5.0


def test_small_pictures_carry_no_letters(t_junction: Intersection) -> None:
    renderer = Renderer(t_junction, (96, 96))
    snapshot = snapshot_of(t_junction, (WEST_EAST, 150.0))
    written = replace(snapshot, time=12.4, caption="03/2", labels=["17"])
    np.testing.assert_array_equal(renderer.rgb_array(written), renderer.rgb_array(snapshot))


@pytest.mark.parametrize("size", [(600, 600), (500, 300)])
def test_whole_map_is_shown_on_request(intersection: Intersection, size: tuple[int, int]) -> None:
    renderer = Renderer(intersection, size, view=None)
    empty = renderer.rgb_array(snapshot_of(intersection))
    for route in intersection.routes:
        for position in (0.0, route.length):
            place = place_of(renderer, intersection, route.id, position)
            assert (place > 0.0).all()
            assert (place < size).all()
            assert differs(renderer.rgb_array(snapshot_of(intersection, (route.id, position))), empty).any()


def test_vehicles_out_of_sight_change_nothing(intersection: Intersection) -> None:
    renderer = Renderer(intersection, (200, 200), view=2.0)
    far = snapshot_of(intersection, *((route.id, 0.0) for route in intersection.routes))
    far = replace(far, labels=["far"] * len(far.route))
    np.testing.assert_array_equal(renderer.rgb_array(far), renderer.rgb_array(snapshot_of(intersection)))


def test_vehicle_wider_than_the_picture_fills_it(t_junction: Intersection) -> None:
    renderer = Renderer(t_junction, (200, 200), view=0.5)
    route = next(one for one in t_junction.routes if one.id == WEST_EAST)
    nearest = int(np.argmin(np.hypot(*(route.samples[:, XY] - (renderer.camera.x, renderer.camera.y)).T)))
    snapshot = replace(
        snapshot_of(t_junction, (WEST_EAST, float(nearest)), length=18.0), width=np.array([18.0], np.float32)
    )
    assert is_near(renderer.rgb_array(snapshot), SPEEDS[128]).all()


def test_window_shows_the_picture_and_closes_twice(t_junction: Intersection, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    renderer = Renderer(t_junction, (320, 240))
    snapshot = snapshot_of(t_junction, (WEST_EAST, 150.0))
    begin = time.perf_counter()
    for _ in range(4):
        renderer.show(snapshot, fps=50.0)
    assert time.perf_counter() - begin > 0.055
    window = pygame.display.get_surface()
    assert window is not None
    shown = np.frombuffer(pygame.image.tobytes(window, "RGB"), np.uint8).reshape(240, 320, 3)
    np.testing.assert_array_equal(shown, renderer.rgb_array(snapshot))
    renderer.close()
    renderer.close()
    assert not pygame.display.get_init()
    renderer.show(snapshot, fps=50.0)
    renderer.close()
    assert renderer.rgb_array(snapshot).shape == (240, 320, 3)


def test_renderer_without_window_leaves_the_display_of_others_alone(
    t_junction: Intersection, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame.display.init()
    renderer = Renderer(t_junction)
    renderer.close()
    renderer.close()
    assert pygame.display.get_init()
    pygame.display.quit()


def test_pictures_go_on_after_another_environment_quits_pygame(
    t_junction: Intersection, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    renderer = Renderer(t_junction)
    snapshot = replace(snapshot_of(t_junction, (WEST_EAST, 150.0)), time=3.0)
    before = renderer.rgb_array(snapshot)
    renderer.show(snapshot, fps=1000.0)
    for start_again in (False, True):
        pygame.quit()
        if start_again:
            pygame.init()
        renderer.show(snapshot, fps=1000.0)
        np.testing.assert_array_equal(renderer.rgb_array(snapshot), before)
    renderer.close()


def test_missing_pygame_says_what_to_install(t_junction: Intersection, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(DependencyNotInstalled, match=r'pip install "intersection_env\[render\]"'):
        Renderer(t_junction)


@pytest.mark.parametrize(
    ("size", "view", "message"),
    [
        ((0, 600), 60.0, r"size is \(0, 600\)"),
        ((600, 600), 0.0, "view is 0.0 m"),
        ((600, 600), float("nan"), "view is nan m"),
    ],
)
def test_impossible_pictures_are_refused(
    t_junction: Intersection, size: tuple[int, int], view: float, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Renderer(t_junction, size, view)
