"""A film of any shape at rest: its images by a calibration, and heights above it from them."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tactograph.graph import InputError, Provenance, load
from tactograph.graph.files.read_graph import read_graph
from tactograph.nodes import BAND_DEVIATIONS, F4
from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tactograph.nodes.calibrate.ranks.rank_checks import rank_checks
from tactograph.nodes.files.height_files import write_ply
from tactograph.nodes.light.untouched_film import untouched_film
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.stream.touch import Touch
from tactograph.nodes.write.write_result import write_result
from tests.fixtures import RIG_PIXEL_MM, Calibration, MadeOnce, Raytraced
from tests.pipelines.conftest import run

RIG = "near33"
Curved = Callable[..., Path]


def shape_of(form: str, size: tuple[int, int]) -> F4:
    """A dome, or a cylinder whose axis is turned: both slope by 0.3 to 0.4 at the border."""
    y, x = np.mgrid[: size[0], : size[1]].astype(np.float64) * RIG_PIXEL_MM[RIG]
    x, y = x - x.mean(), y - y.mean()
    square = x * x + y * y if form == "dome" else (0.94 * y - 0.34 * x) ** 2
    radius = (2.4 if form == "dome" else 1.8) * np.sqrt((x * x + y * y).max())
    return (radius - np.sqrt(radius**2 - square)).astype(np.float32)


@pytest.fixture
def curved(calibration: Calibration, made_once: MadeOnce) -> Curved:
    """The calibration of a rig whose film is no plane."""

    def make(form: str, camera: float = 0) -> Path:
        def write(file: Path) -> None:
            with np.load(calibration(RIG)) as known:
                arrays = dict(known)
            arrays["camera"] = np.float32(camera)
            arrays["rest"] = shape_of(form, arrays["flat"].shape[1:])
            np.savez(file, **arrays)
            cal = read_calibration(file=file)
            share = untouched_film(cal.flat, cal.film, cal.rest, cal.pixel_size).share
            assert share is not None
            arrays["flat"] = cal.flat * share
            np.savez(file, **arrays)

        return made_once(f"{form}_{camera:.3f}.npz", write)

    return make


@pytest.fixture
def truth(raytraced: Raytraced) -> F4:
    return np.asarray(np.load(raytraced / RIG / "cat_film" / "truth_height_mm.npy"))


@pytest.mark.parametrize("form", ["dome", "cylinder"])
def test_heights_above_the_film_are_restored(form: str, curved: Curved, truth: F4) -> None:
    see = load("see_touch", calibration=curved(form))
    touched, untouched = (see(height=height)["image"] for height in (truth, 0 * truth))
    quick = load("reconstruct", calibration=curved(form))
    for images, height in ((touched, truth), (untouched, 0 * truth)):
        error = quick(frames=images)["height"] - height
        assert np.sqrt(np.mean(error**2)) < 0.3 * RIG_PIXEL_MM[RIG]
    careful = load("precise", calibration=curved(form))
    assert np.abs(careful(frames=untouched)["height"]).max() < 2e-3
    result = careful(frames=touched)
    off = np.abs(result["height"] - truth)
    assert np.sqrt(np.mean(off**2)) < 0.15 * RIG_PIXEL_MM[RIG]
    assert np.mean((off <= BAND_DEVIATIONS * result["error"])[truth > 0.02]) > 0.8


def test_the_truth_is_compared_above_the_film_at_rest(
    curved: Curved, truth: F4, tmp_path: Path
) -> None:
    """A capture's truth is the film's own height, which a dome raises by a millimetre."""
    capture = tmp_path / "capture"
    np.save(tmp_path / "height.npy", truth)
    run("see_touch", capture, height=tmp_path / "height.npy", calibration=curved("dome"))
    film = np.load(capture / "truth_height_mm.npy")
    np.testing.assert_allclose(film - truth, shape_of("dome", truth.shape), atol=1e-6)
    result = run("precise", capture=capture, calibration=curved("dome"))
    off = np.sqrt(np.mean((result["height"] - truth) ** 2))
    assert result["metrics"]["rmse_um"] == pytest.approx(1e3 * off, rel=1e-3)
    assert result["metrics"]["in_90_percent_band"] > 80


def test_film_at_rest_that_a_near_pupil_sees_departs_from_no_model(
    curved: Curved, truth: F4
) -> None:
    """Its light is that of its own slopes, which are not those that the camera sees."""
    near = curved("dome", camera=1 / 60)
    images = load("see_touch", calibration=near)(height=truth)["image"]
    graph = replace(read_graph("precise"), outputs={"misfit": "misfit"})
    _, _, departs, *_ = load(graph, calibration=near)(frames=images)["misfit"]
    assert departs < 1e-3


def test_both_back_ends_find_the_same_height_above_a_dome(curved: Curved, truth: F4) -> None:
    images = load("see_touch", calibration=curved("dome"))(height=truth)["image"]
    heights = [
        load("reconstruct", calibration=curved("dome"), backend=backend)(frames=images)["height"]
        for backend in ("numpy", "opencl")
    ]
    np.testing.assert_allclose(*heights, atol=2e-4)


def test_valid_touches_of_a_dome_are_trusted_and_wrong_ones_are_not(
    curved: Curved, truth: F4, tmp_path: Path
) -> None:
    """The ranks are those of valid touches that are drawn above the film at rest."""
    file = tmp_path / "cal.npz"
    shutil.copy(curved("dome"), file)
    rank_checks(file=file, count=32)
    images = load("see_touch", calibration=file)(height=truth)["image"]
    graph = load("reconstruct", calibration=file, accept_contradictions=True)
    assert graph(frames=images)["metrics"]["trust"] > 0.01
    with pytest.warns(UserWarning, match="may be wrong"):
        assert graph(frames=images[[1, 0, 2, 3]])["metrics"]["trust"] < 0.01


def test_a_stream_on_a_dome_finds_the_heights_of_single_touches(curved: Curved, truth: F4) -> None:
    images = load("see_touch", calibration=curved("dome"))(height=truth)["image"]
    with load("precise_stream", calibration=curved("dome")) as stream:
        heights = [stream(frames=images)["height"] for _ in range(2)]
    alone = load("precise", calibration=curved("dome"))(frames=images)["height"]
    np.testing.assert_allclose(heights, [alone, alone], atol=1e-4)


def test_the_tables_of_the_paper_hold_on_a_dome(curved: Curved, truth: F4) -> None:
    """As well as on a plane, from whose light they were made."""
    images = load("see_touch", calibration=curved("dome"))(height=truth)["image"]
    height = load("paper", calibration=curved("dome"))(frames=images)["height"]
    assert np.sqrt(np.mean((height - truth) ** 2)) < 1.5 * RIG_PIXEL_MM[RIG]


def test_a_mesh_is_the_films_own_shape(truth: F4, tmp_path: Path) -> None:
    """Under a near camera, points that rise towards the pupil appear beside their place."""
    view, provenance = View(camera=1 / 60), Provenance({}, None, [], {}, {}, [], [])
    touch = Touch(
        truth, truth[None], RIG_PIXEL_MM[RIG], view=view, rest=shape_of("dome", truth.shape)
    )
    with pytest.raises(InputError, match="its places are not those of a plane"):
        write_result(touch, folder=tmp_path, grid="metric", provenance=provenance)
    write_ply(tmp_path / "height.ply", touch.film, touch.pixel, touch.view)
    vertices = trimesh.load_mesh(tmp_path / "height.ply", process=False).vertices
    film = shape_of("dome", truth.shape).astype(np.float64) + truth
    y, x = np.mgrid[: truth.shape[0], : truth.shape[1]] * RIG_PIXEL_MM[RIG]
    x, y = (x - x.mean()) * (1 - film / 60), (y.mean() - y) * (1 - film / 60)
    lies = np.stack([x, y, film], axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(vertices, lies, atol=1e-5)
    # A stream's points are those of the mesh, from the first pixel.
    right, down = touch.places_mm()
    points = np.stack([right, -down, touch.film], axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(points - points.mean(axis=0), lies - lies.mean(axis=0), atol=1e-4)


@pytest.mark.parametrize("graph", ["reconstruct_no_flat", "paper_no_flat"])
def test_a_graph_that_takes_the_film_for_a_plane_refuses_a_dome(
    graph: str, curved: Curved, raytraced: Raytraced
) -> None:
    with pytest.raises(InputError, match="no plane at rest"):
        run(graph, calibration=curved("dome"), capture=raytraced / RIG / "cat_film")
