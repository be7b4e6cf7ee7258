"""A calibration is read back as it was written, and refused if it is damaged."""

import json
import zipfile
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from tactograph.graph import InputError, Provenance
from tactograph.graph.errors import collect_warnings
from tactograph.graph.rings import bring, brought
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes import Film
from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tactograph.nodes.calibrate.file.write_calibration import write_calibration
from tactograph.nodes.files.calibration_file import FileKind
from tactograph.nodes.stored import Value, stored_values

RNG = np.random.default_rng(0)
PROVENANCE = Provenance({}, None, [], {}, {}, [], [])


def random(*shape: int) -> np.ndarray:
    return RNG.random(shape).astype(np.float32)


ARRAYS = (
    random(4, 6, 8), random(6, 8), 0.07, random(50, 4), random(50, 2),
    RNG.integers(0, 15, 50).astype(np.uint8), random(4, 9), random(4), random(4), 0.004,
)  # fmt: skip


def drawn(value: Value) -> np.ndarray | float:
    """A value that a sensor of four LEDs may have."""
    low, high = value.port.port.low, value.port.port.high
    shape = [4 if dim == "K" else dim for dim in value.port.dims]
    array = RNG.uniform(low, high, shape).astype(np.float32)
    return array if shape else float(array)


FILM = Film(**{name: drawn(value) for name, value in stored_values(Film).items()})
FILM = FILM._replace(lights=random(4, 3))
NOISE, LENS, MISFIT = random(2), random(8) / 100, random(5)
AREA = RNG.integers(0, 2, (6, 8)).astype(np.uint8)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    target = tmp_path / "cal.npz"
    write(target)
    return target


def write(
    target: Path, film: Film = FILM, doubts: list[str] | None = None, lights: str | None = None
) -> None:
    quality = {"entries": 50.0}
    write_calibration(
        *ARRAYS, film, NOISE, 1.5, LENS, quality, doubts or [], AREA, MISFIT,
        file=target, provenance=replace(PROVENANCE, arguments={"lights": lights}),
    )  # fmt: skip


def warnings_of(file: Path, lights: Literal["leds", "bgr", "rgb"] | None = None) -> list[str]:
    """The warnings of a graph that uses a calibration."""
    with collect_warnings([]) as notes:
        read_calibration(file=file, lights=lights)
    return notes


def change(file: Path, **arrays) -> None:
    with np.load(file) as archive:
        stored = dict(archive)
    stored.update(arrays)
    np.savez(file, **{name: array for name, array in stored.items() if array is not None})


def test_a_calibration_is_read_as_it_was_written(file: Path) -> None:
    calibration = read_calibration(file=file)
    for written, read in zip(ARRAYS, calibration, strict=False):
        assert np.allclose(written, read)
    for name, written in FILM._asdict().items():
        assert np.allclose(written, getattr(calibration.film, name)), name
    assert np.allclose(NOISE, calibration.noise)
    assert calibration.correlation == 1.5
    assert np.allclose(LENS, calibration.lens)
    assert np.allclose(MISFIT, calibration.misfit)


ABSURD = {
    "flat": 1e30, "flat ": 1e-30, "dark": 1e30, "pixel_size": 1e30, "pixel_size ": 1e-30,
    "pixel_size  ": -1.0, "lut_light": 1e30, "lut_slope": 1e30, "reflectance": 1e30,
    "residual": 1e30, "null": 1e30, "spread": -1.0, "lights": 1e30, "lights ": 1e-30, "noise": 1e30,
    "noise ": -1.0, "other_lights": 1e30, "diffuse": 1e30, "diffuse ": -1.0, "harmonics": 1e30,
    "flattest": 1e30, "reach": 1e-30, "gain": 1e30, "contact": -1.0, "base": 1e30,
    "roughness": 1e-30, "refraction": 1e-30, "albedo": 1e30, "camera": -1.0, "grain": 1e30,
    "lens": 1e30,
}  # fmt: skip


@pytest.mark.parametrize("name", ABSURD)
def test_a_value_that_no_sensor_has_is_refused(file: Path, name: str) -> None:
    with np.load(file) as archive:
        array = archive[name.strip()]
    change(file, **{name.strip(): (array * ABSURD[name]).astype(np.float32)})
    with pytest.raises(InputError, match=f"'{name.strip()}'"):
        read_calibration(file=file)


def test_every_array_of_a_calibration_has_a_range() -> None:
    for kind in (bring("calibrations", name).KIND for name in brought("calibrations")):
        for name, value in kind.values.items():
            limits = np.isfinite([value.stored.low, value.stored.high]).all()
            assert limits or value.dtype.kind != "f", name


def test_units_version_date_and_settings_are_inside(tmp_path: Path) -> None:
    file = tmp_path / "cal.npz"
    write(file, lights="bgr")
    with np.load(file, allow_pickle=False) as archive:
        about = json.loads(str(archive["about"]))
    assert about["format"] == 1
    assert about["units"]["pixel_size"] == "mm/px"
    assert about["quality"] == {"entries": 50.0}
    assert datetime.fromisoformat(about["date"]).tzinfo is not None
    assert about["provenance"]["arguments"] == {"lights": "bgr"}


def test_a_doubtful_calibration_gives_one_warning_wherever_it_is_used(tmp_path: Path) -> None:
    file = tmp_path / "cal.npz"
    write(file, doubts=["LED 1 is 1.2 m away", "LEDs 2 and 3 are one"])
    (note,) = warnings_of(file)
    assert note == (
        f"calibration {file} is doubtful: LED 1 is 1.2 m away (and 1 more doubt); see "
        f"'tactograph show {file}'"
    )


def test_doubts_out_of_a_file_are_one_short_line_each(tmp_path: Path) -> None:
    file = tmp_path / "cal.npz"
    write(file, doubts=["\x1b[2Jnothing\nwarning: speaks\ud800 against it", "a" * 10**6])
    (note,) = warnings_of(file)
    assert "\\x1b[2Jnothing warning: speaks\\ud800 against it" in note
    assert note.isprintable()
    assert max(map(len, read_calibration(file=file).doubts)) < 3000


def test_a_right_calibration_and_one_without_figures_give_no_warning(file: Path) -> None:
    assert not warnings_of(file)
    with np.load(file) as archive:
        stated = json.loads(str(archive["about"]))
    change(file, about=np.array(json.dumps({n: stated[n] for n in ("format", "kind", "units")})))
    assert not warnings_of(file, "bgr")


def test_lights_of_another_order_are_refused_in_a_line_that_names_both(tmp_path: Path) -> None:
    file = tmp_path / "cal.npz"
    write(file)
    (note,) = warnings_of(file, "rgb")
    assert "does not say whether it was made of colours in the order rgb" in note
    write(file, lights="bgr")
    with pytest.raises(
        InputError, match="made of colours in the order bgr, not rgb; give `lights`=bgr"
    ):
        read_calibration(file=file, lights="rgb")
    assert not warnings_of(file, "bgr")


def add_duplicate(file: Path, member: str) -> None:
    with zipfile.ZipFile(file, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr(member, archive.read(member))


def set_about(file: Path, **about) -> None:
    """Change the file's description of itself."""
    with np.load(file) as archive:
        stated = json.loads(str(archive["about"]))
    change(file, about=np.array(json.dumps(stated | about)))


SPOIL = {
    "there is no such calibration": lambda f: f.unlink(),
    "is a folder, and no calibration": lambda f: (f.unlink(), f.mkdir()),
    "damaged": lambda f: f.write_bytes(f.read_bytes()[:500]),
    "this calibration cannot be used": lambda f: f.write_bytes(b""),
    "it holds a pickle": lambda f: np.savez(f, about=np.array([{}], dtype=object)),
    "not a calibration": lambda f: np.savez(f, height=np.zeros(3)),
    "calibration format 99": lambda f: change(
        f, about=np.array(json.dumps({"kind": "tactograph calibration", "format": 99}))
    ),
    "'null' is missing": lambda f: change(f, null=None),
    "'flat' holds NaN": lambda f: change(f, flat=np.full((4, 6, 8), np.nan, np.float32)),
    "'reflectance' has shape": lambda f: change(f, reflectance=random(3, 9)),
    "'lut_slope' is float64": lambda f: change(f, lut_slope=np.zeros((50, 2))),
    "'lens' is missing": lambda f: change(f, lens=None),
    "'lights' is missing": lambda f: change(f, lights=None),
    "not above the film": lambda f: change(f, lights=-random(4, 3)),
    "'other_lights' has shape": lambda f: change(f, other_lights=random(7, 4, 3)),
    "'harmonics' has shape": lambda f: change(f, harmonics=random(4, 8, 5)),
    "'lens' has shape": lambda f: change(f, lens=random(7)),
    "'noise' has shape": lambda f: change(f, noise=random(3)),
    "holds 0, which no sensor has": lambda f: change(f, pixel_size=np.float32(0)),
    "holds 1e-06, which no sensor has": lambda f: change(f, pixel_size=np.float32(1e-6)),
    "'camera' holds 1, which no": lambda f: change(f, camera=np.float32(1)),
    "'lens' moves what lies at the border by 100%": lambda f: change(
        f, lens=np.float32([1, *[0] * 7])
    ),
    "'flat' holds -0.5": lambda f: change(f, flat=np.full((4, 6, 8), -0.5, np.float32)),
    "'area' shows film at 0 of 48": lambda f: change(f, area=np.zeros((6, 8), np.uint8)),
    "'lut_light' is the same for all": lambda f: change(f, lut_light=np.ones((50, 4), np.float32)),
    "'lut_slope' is the same for all": lambda f: change(f, lut_slope=np.ones((50, 2), np.float32)),
    "it holds 'flat' twice": lambda f: add_duplicate(f, "flat.npy"),
    "'flat' is empty": lambda f: change(f, flat=random(4, 0, 8)),
    "'lut_light' is empty": lambda f: change(
        f, lut_light=random(0, 4), lut_slope=random(0, 2), lut_lit=np.zeros(0, np.uint8)
    ),
    "all LEDs in one place": lambda f: change(f, lights=np.float32([[1, 2, 30]] * 4)),
    "or one line": lambda f: change(f, lights=np.float32([[k, 2, 30] for k in range(4)])),
    "'format' is not a whole number": lambda f: set_about(f, format="1"),
    "not a calibration;": lambda f: change(f, about=np.array("[" * 100_000)),
    "not a calibration; ": lambda f: set_about(f, kind=None),
    "'quality' is not a list of figures": lambda f: set_about(f, quality=None),
    "'quality' is not a list of figures;": lambda f: set_about(f, quality=[1.0]),
    "'quality' is not a list of figures; ": lambda f: set_about(f, quality="good"),
    "'quality' is not a list of figures; c": lambda f: set_about(f, quality={"entries": "many"}),
    "'quality' is not a list of figures; ca": lambda f: set_about(f, quality={"entries": None}),
    "'quality' is not a list of figures; cal": lambda f: set_about(f, quality={"entries": 10**400}),
}


@pytest.mark.parametrize("message", SPOIL)
def test_a_spoilt_file_is_refused_with_the_reason(file: Path, message: str) -> None:
    SPOIL[message](file)
    with pytest.raises(InputError) as caught:
        read_calibration(file=file)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("cal.np", r"there is no such .*did you mean 'cal\.npz'\?"),
        (".", "is a folder, and no calibration file"),
        ("text.npz", r"cannot be used: damaged, or no \.npz"),
    ],
)
def test_what_is_no_file_of_any_sensor_is_refused_alike(file: Path, name: str, why: str) -> None:
    (file.parent / "text.npz").write_text("no archive")
    with pytest.raises(InputError, match=why):
        FileKind.read_sensor(file.parent / name)


@pytest.mark.parametrize(
    ("film", "why"),
    [
        (FILM._replace(lights=np.full((4, 3), 1e39)), "'lights' holds NaN or infinite values"),
        (FILM._replace(lights=-random(4, 3)), "'lights' has an LED that is not above the film"),
        (FILM._replace(gain=30.0), "'gain' holds 30, which no sensor has"),
    ],
)
def test_a_calibration_that_could_not_be_read_is_not_written(
    tmp_path: Path, film: Film, why: str
) -> None:
    with pytest.raises(InputError) as caught:
        write(tmp_path / "cal.npz", film)
    assert f"not written: {why}" in str(caught.value)
    assert str(caught.value).endswith(
        "check the images, the pixel size, and the ball's place and radius"
    )
    with pytest.raises(InputError, match=r"; a ball of 3\.8 mm explains the light better$"):
        write(tmp_path / "cal.npz", film, ["a ball of 3.8 mm explains the light better", "dim"])
    assert not list(tmp_path.iterdir())


BALL = {"ball_radius_mm": 7.0, "pixel_size_mm": 0.07}


@pytest.mark.parametrize(
    ("graph", "params"),
    [
        ("calibrate", {"capture": "missing", **BALL}),
    ],
)
def test_another_suffix_is_refused_before_reading(graph: str, params: dict[str, object]) -> None:
    with pytest.raises(InputError, match=r"something\.npz"):
        open_pipeline(graph, {**params, "out": "cal.yaml"})


@pytest.mark.parametrize("cut", range(100, 3000, 290))
def test_a_file_cut_anywhere_is_refused(file: Path, cut: int) -> None:
    content = file.read_bytes()
    file.write_bytes(content[: min(cut, len(content) - 1)])
    with pytest.raises(InputError):
        read_calibration(file=file)
