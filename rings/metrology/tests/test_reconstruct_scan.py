"""A scan, by its sensor's light model alone."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.one_run import run
from benchmarks.scans import DEVICES, UNKNOWN_UM, groove, settled
from rings.metrology.tests.scan.scans import PIXEL, cap, groove_shape, seen, write_model, write_scan
from tactograph.graph import InputError
from tactograph.nodes import BAND_DEVIATIONS
from tests.fixtures import real_data


@pytest.mark.slow
def test_a_cap_has_its_height(tmp_path: Path) -> None:
    model = write_model(tmp_path / "model.yaml")
    z = cap(radius=0.9, depth=0.06)
    write_scan(tmp_path / "scan", seen(z, model), calib="model.yaml")
    arguments = {"capture": tmp_path / "scan", "model": tmp_path / "scan"}
    found = run("reconstruct_scan", **arguments)
    assert found["height"].shape == z.shape
    assert found["pixel"] == PIXEL
    assert found["height"].max() == pytest.approx(z.max(), rel=0.02)
    assert np.sqrt(np.mean((found["height"] - z) ** 2)) < 2e-3
    scaled = run("reconstruct_scan", **arguments, scale=(1.1, 0.05), cell_px=1)
    np.testing.assert_allclose(scaled["height"], 1.1 * z, atol=2e-3)
    np.testing.assert_allclose(scaled["error"], 0.05 * np.abs(z), atol=1e-4)


def test_edges_within_pixels_are_stated_and_level_film_is_at_zero(tmp_path: Path) -> None:
    """A groove whose sharp edges lie within pixels, which see the light of both sides."""
    fine, (rows, columns) = 4, cap().shape
    file = tmp_path / "model.yaml"
    model = write_model(file, flat=False)
    u, v = (np.interp(np.arange(fine * len(w)) / fine, np.arange(len(w)), w)
            for w in (model.u, model.v))  # fmt: skip
    finer = model._replace(u=np.float32(u), v=np.float32(v))
    z = groove_shape(0.12, 40, 0.6, (fine * rows, fine * columns), PIXEL / fine)
    light = seen(np.roll(z, 3, axis=1), finer, PIXEL / fine)
    mean = light.reshape(len(light), rows, fine, columns, fine).mean(axis=(2, 4))
    noise = np.random.default_rng(2).normal(1, 0.01, mean.shape)
    write_scan(tmp_path / "scan", (mean * noise).astype(np.float32))
    arguments = {"capture": tmp_path / "scan", "model": file, "cell_px": 4}
    found = run("reconstruct_scan", **arguments)
    true = np.roll(z, 3, axis=1)[fine // 2 :: fine, fine // 2 :: fine]
    off, level, deep = found["height"] - true, true == 0, true < -0.119
    assert abs(off[level].mean()) < 2e-4
    assert np.mean(np.abs(off[deep]) < BAND_DEVIATIONS * found["error"][deep]) > 0.8


def test_a_model_for_other_pixels_gives_a_warning(tmp_path: Path) -> None:
    file = tmp_path / "model.yaml"
    write_scan(tmp_path / "scan", seen(cap(), write_model(file)))
    file.write_text(file.read_text().replace(f"mmperpixel: {PIXEL}", "mmperpixel: 0.05"))
    arguments = {"capture": tmp_path / "scan", "model": file}
    found = run("reconstruct_scan", **arguments)
    assert found["pixel"] == PIXEL
    message = f"the scan says {PIXEL} mm per px, its light model 0.05: the scan's is taken"
    assert any(message in warning for warning in found.warnings)
    stated = run("reconstruct_scan", **arguments, pixel_size_mm=0.03)
    assert stated["pixel"] == pytest.approx(0.03)
    assert not any("the scan says" in warning for warning in stated.warnings)


def test_a_step_of_known_depth_settles_the_scale(tmp_path: Path) -> None:
    """The film shows all slopes a tenth too steep."""
    file, part = tmp_path / "model.yaml", tmp_path / "part"
    model = write_model(file)
    for folder, depth in ((tmp_path / "known", 0.12), (part, 0.06)):
        z = 1.1 * groove_shape(depth, 30, 0.6)
        noise = np.random.default_rng(int(1e3 * depth)).normal(1, 0.01, (6, *z.shape))
        write_scan(folder, (seen(z, model) * noise).astype(np.float32))
    arguments = {"capture": part, "model": file, "cell_px": 2, "out": tmp_path / "result"}
    known = {"step": tmp_path / "known", "certified_um": (120, 0.2)}
    for wrong, message in (
        ({"certified_um": None}, "a known step needs both: step=SCAN certified_um=DEPTH"),
        ({"step": None}, "a known step needs both: step=SCAN certified_um=DEPTH"),
        ({"scale": (1.1, 0.01)}, "known: a known step tells the scale: give step or scale"),
        (
            {"certified_um": (60, 0.2)},
            "/known: its step is 13. um deep, not 60: check certified_um",
        ),
        ({"step_crop": (0, 0, 40, 20)}, "/known: .* show a groove or ridge|/known: its step is"),
        ({"step_crop": (0, 0, 99, 20)}, "/known has only 96 x 64 pixels"),
    ):
        with pytest.raises(InputError, match=message):
            run("reconstruct_scan", **arguments, **(known | wrong))
    settled_by_it = run("reconstruct_scan", **arguments, **known)
    assert settled_by_it["height"].min() == pytest.approx(-0.06, abs=2e-3)
    assert any("known: its step is 13" in line for line in settled_by_it.warnings)
    found = run("measure_step", height=tmp_path / "result/height.npy")["step"]
    assert found["step_depth_um"] == pytest.approx(60, abs=0.5)
    assert 0.1 < found["step_uncertainty_um"] < 0.6
    parts = tmp_path / "result/error_parts.npy"
    cropped = run("measure_step", height=parts.with_name("height.npy"), crop=(3, 5, 95, 40))["step"]
    assert cropped["step_uncertainty_um"] == pytest.approx(found["step_uncertainty_um"], rel=0.5)
    np.save(parts, np.load(parts)[0])
    with pytest.raises(InputError, match=r"error_parts\.npy: is damaged"):
        run("measure_step", height=parts.with_name("height.npy"))
    run("reconstruct_scan", **arguments)
    assert not parts.exists()


@pytest.mark.slow
def test_a_known_groove_settles_real_sensors_models(tmp_path: Path) -> None:
    real_data("gelsight_scans")
    alone, after = settled(DEVICES[1], 30, 0, tmp_path)
    assert alone["step_depth_um"] > UNKNOWN_UM + 3
    assert after["step_depth_um"] == pytest.approx(UNKNOWN_UM, abs=1)
    assert after["step_uncertainty_um"] < alone["step_uncertainty_um"] / 3
    for wall, seed in ((20, 21), (40, 0)):
        _, other = settled(DEVICES[0], wall, seed, tmp_path)
        off = abs(other["step_depth_um"] - UNKNOWN_UM)
        assert 0.5 < off < BAND_DEVIATIONS * other["step_uncertainty_um"]


def test_a_model_of_another_frame_is_refused(tmp_path: Path) -> None:
    """Without a flat field it has no pixels of its own that would differ from the images'."""
    model = write_model(tmp_path / "model.yaml", flat=False)
    write_scan(tmp_path / "scan", seen(cap(), model)[:, :-2, :-4])
    sensor = {"capture": tmp_path / "scan", "model": tmp_path / "model.yaml"}
    with pytest.raises(
        InputError,
        match=r"62 rows of pixels in capture=.* but 64 in .* do both come from one sensor",
    ):
        run("reconstruct_scan", **sensor)
    run("reconstruct_scan", **sensor, crop=(0, 0, 92, 62))


@pytest.mark.slow
def test_grooves_through_real_sensors_models_have_their_depth() -> None:
    """500 um with walls of 30 degrees, 1 % of noise.  The rows of one share their error."""
    held = []
    for device in DEVICES:
        for seed in range(2):
            file = real_data("gelsight_scans") / "devices" / f"{device}.yaml"
            _, figures, rows = groove(file, seed, 0.5, 30)
            assert figures["step_depth_um"] == pytest.approx(500, abs=1)
            assert 0.03 < figures["step_uncertainty_um"] < 0.5
            held.append(rows.mean())
    assert np.mean(held) > 0.8
