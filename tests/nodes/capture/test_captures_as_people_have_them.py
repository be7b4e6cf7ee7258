"""Names, colours and depths of images as cameras and people make them."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes.capture.read_balls import read_balls
from tactograph.nodes.capture.read_capture import Capture, read_capture
from tactograph.nodes.capture.read_flat import read_flat

RNG = np.random.default_rng(0)
IMAGES = RNG.integers(1, 250, (4, 12, 16)).astype(np.uint8)
COLOURS = RNG.integers(1, 250, (4, 12, 16, 3)).astype(np.uint8)


def write(folder: Path, names: list[str], images: NDArray[np.integer] = IMAGES) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name, image in zip(names, images, strict=False):
        suffix = Path(name).suffix.lower()
        (folder / name).write_bytes(cv2.imencode(suffix, image)[1].tobytes())
    return folder


def read_one(folder: Path, **settings: object) -> tuple[Capture, list[str]]:
    with collect_warnings([]) as notes:
        (capture,) = read_capture(folder=folder, **settings)
    return capture, notes


NAMES = {
    "led0 to led3 are taken as LEDs 1 to 4": ["led0.png", "led1.png", "led2.png", "led3.png"],
    "led9 to led12 are taken as LEDs 1 to 4": ["led9.png", "led10.png", "led11.png", "led12.png"],
    "image0 to image3 are taken as LEDs 1 to 4": [f"image{k}.png" for k in range(4)],
    "001 to 004 are taken as LEDs 1 to 4": [f"{k:03}.png" for k in range(1, 5)],
    "image07 to image10 are taken as LEDs 1 to 4": [f"image{k:02}.tif" for k in range(7, 11)],
    "img_1_l to img_4_l are taken as LEDs 1 to 4": [f"img_{k}_l.bmp" for k in range(1, 5)],
    "light_0 to light_270 are taken as LEDs 1 to 4": [f"light_{90 * k}.png" for k in range(4)],
}


@pytest.mark.parametrize("note", NAMES)
def test_images_of_one_name_are_the_leds_in_the_order_of_their_numbers(
    tmp_path: Path, note: str
) -> None:
    capture, notes = read_one(write(tmp_path, NAMES[note]))
    assert np.array_equal(capture.image, IMAGES / np.float32(255))
    assert notes == [note]


@pytest.mark.parametrize("name", ["LED{}.PNG", "Led{}.png", "led0{}.TIFF"])
def test_upper_case_and_leading_zeros_are_the_usual_name(tmp_path: Path, name: str) -> None:
    capture, notes = read_one(write(tmp_path, [name.format(k) for k in range(1, 5)]))
    assert np.array_equal(capture.image, IMAGES / np.float32(255))
    assert notes == []


def test_leds_count_from_one_whatever_the_files_numbers(tmp_path: Path) -> None:
    """LED 0 was said to be missing, with the name of a file that was there."""
    folder = write(tmp_path, ["led0.png", "led1.png", "led2.png", "led3.png"])
    assert read_one(folder, leds=(4, 3, 2, 1))[0].image.shape == IMAGES.shape
    with pytest.raises(InputError, match="there is no LED 0: led0 to led3 are LEDs 1 to 4"):
        read_one(folder, leds=(0, 1, 2, 3))


def test_images_of_other_names_are_named_as_left_out(tmp_path: Path) -> None:
    write(tmp_path, [f"led{k}.png" for k in range(1, 5)])
    write(tmp_path, ["IMG_2041.png", "picture.png"])
    capture, notes = read_one(tmp_path)
    assert len(capture.image) == 4
    assert "not read: IMG_2041.png" in notes[0]


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (
            [f"{side}{k}.png" for side in ("left", "right") for k in range(4)],
            r"several names.*left0\.png and right0\.png",
        ),
        (["image0.png", "image1.png", "image3.png", "image4.png"], "an image is missing"),
        ([f"frame{k}.png" for k in range(17)], r"17 LED images.*leds: \[1, 2, \.\.\.\]"),
        (
            ["led1.png", "led01.png", "led2.png", "led3.png"],
            r"led01\.png and led1\.png are both there",
        ),
    ],
    ids=["two names", "a gap between numbers", "a folder of frames", "one number in two files"],
)
def test_names_that_may_mean_several_things_are_refused(
    tmp_path: Path, names: list[str], message: str
) -> None:
    write(tmp_path, names, np.resize(IMAGES, (len(names), 12, 16)))
    with pytest.raises(InputError, match=message):
        read_one(tmp_path)


def test_of_more_leds_than_a_label_holds_eight_around_the_film_are_used(tmp_path: Path) -> None:
    many = RNG.integers(1, 250, (12, 12, 16)).astype(np.uint8)
    write(tmp_path, [f"led{k}.png" for k in range(1, 13)], many)
    capture, notes = read_one(tmp_path)
    assert np.array_equal(capture.image, many[[0, 1, 3, 4, 6, 7, 9, 10]] / np.float32(255))
    assert notes[0].startswith("of 12 LEDs, 1, 2, 4, 5, 7, 8, 10, 11 are taken, as labels hold 8")
    (tmp_path / "capture.yaml").write_text("leds: [3, 6, 9, 12]\n")
    capture, notes = read_one(tmp_path)
    assert np.array_equal(capture.image, many[2::3] / np.float32(255))
    assert notes == []


def test_a_folder_of_captures_of_other_names_is_a_stream(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write(tmp_path / name, [f"image{k}.png" for k in range(4)])
    assert [capture.name for capture in read_capture(folder=tmp_path)] == ["a", "b"]


LEDS = [f"led{k}.png" for k in range(1, 5)]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_colour_camera_s_light_is_the_mean_of_its_channels(tmp_path: Path, dtype: type) -> None:
    colours = COLOURS.astype(dtype) * dtype(1 if dtype is np.uint8 else 257)
    capture, notes = read_one(write(tmp_path, LEDS, colours), integers=True)
    assert np.allclose(capture.image, COLOURS.mean(axis=-1) / 255, atol=1e-6)
    assert len(notes) == 1
    assert "the mean of the three channels; `channel`=red, green or blue" in notes[0]


@pytest.mark.parametrize("at", [0, 1, 2])
def test_a_channel_can_be_chosen(tmp_path: Path, at: int) -> None:
    channel = ("blue", "green", "red")[at]
    folder = write(tmp_path / "touch", LEDS, COLOURS)
    expected = COLOURS[..., at] / np.float32(255)
    capture, notes = read_one(folder, channel=channel)
    assert np.array_equal(capture.image, expected)
    assert notes == []
    balls = read_balls(folder=folder, radius_mm=4.0, channel=channel)
    assert np.array_equal(balls.first, expected)
    image = folder / "led2.png"
    flat = read_flat(capture.image, dark=image, channel=channel)
    assert np.array_equal(flat.dark, expected[1])


def test_a_channel_of_grey_images_gives_a_note(tmp_path: Path) -> None:
    _, notes = read_one(write(tmp_path, LEDS, COLOURS[..., 0]), channel="blue")
    assert notes == ["`channel`=blue: grey images have one channel, which is taken"]


def test_a_colour_that_is_saturated_shows_although_its_mean_is_not(tmp_path: Path) -> None:
    colours = COLOURS.copy()
    colours[1, :3, :, 0] = 255
    _, notes = read_one(write(tmp_path, LEDS, colours))
    assert any("led2.png" in note and "saturated" in note for note in notes)


@pytest.mark.parametrize(
    ("grey", "coloured", "settings", "message"),
    [
        ([], ["touch.png"], {}, r"single image, touch\.png; .*not a page, .*give `lights`=bgr"),
        (LEDS, LEDS[2:3], {}, r"led3\.png: a colour image, but led1\.png is grey"),
        ([], LEDS, {"lights": "bgr"}, "one colour image is needed here"),
    ],
    ids=["one image alone", "beside grey ones", "one of each LED where one is needed"],
)
def test_unexpected_colour_images_are_refused(
    tmp_path: Path, grey, coloured, settings, message
) -> None:
    write(tmp_path, grey)
    write(tmp_path, coloured, COLOURS)
    with pytest.raises(InputError, match=message):
        read_one(tmp_path, **settings)


@pytest.mark.parametrize("bits", [10, 12])
def test_the_white_of_a_pgm_is_full_scale(tmp_path: Path, bits: int) -> None:
    # No two pixels are alike, so that none looks saturated.
    images = 1 + np.arange(4 * 12 * 16).reshape(4, 12, 16)
    for name, image in zip(LEDS, images, strict=True):
        head = f"P5\n# a camera\n16 12\n{2**bits - 1}\n".encode()
        (tmp_path / name).with_suffix(".pgm").write_bytes(head + image.astype(">u2").tobytes())
    capture, notes = read_one(tmp_path, integers=True)
    assert np.allclose(capture.image, images / (2**bits - 1), atol=1e-6)
    assert notes == []
    (tmp_path / "capture.yaml").write_text(f"bits: {bits}\n")
    assert np.array_equal(read_one(tmp_path)[0].image, capture.image)
    (tmp_path / "capture.yaml").write_text("bits: 14\n")
    with pytest.raises(InputError, match=rf"white is {2**bits - 1}, but 'bits: 14'.*says 16383"):
        read_one(tmp_path)


def test_numbers_from_0_in_names_of_another_form_count_from_0(tmp_path: Path) -> None:
    write(tmp_path, [f"cam_{k}_5MP.png" for k in range(4)])
    capture, notes = read_one(tmp_path, files="cam_{}_5MP")
    assert np.allclose(255 * capture.image, IMAGES)
    assert notes == ["cam_0_5MP to cam_3_5MP are taken as LEDs 1 to 4"]
    capture, _ = read_one(tmp_path, files="cam_{}_5MP", leds=(4, 1, 2))
    assert np.allclose(255 * capture.image, IMAGES[[3, 0, 1]])


def test_what_a_folder_of_captures_states_holds_for_each_unless_its_own_file_differs(
    tmp_path: Path,
) -> None:
    for name in ("a", "b"):
        write(tmp_path / name, [f"led{k}.png" for k in (1, 2, 3, 4)], IMAGES.astype(np.uint16))
    (tmp_path / "capture.yaml").write_text("bits: 12\nleds: [4, 1, 2]\n")
    (tmp_path / "b" / "capture.yaml").write_text("bits: 10\n")
    first, second = read_capture(folder=tmp_path)
    assert np.allclose(first.image, IMAGES[[3, 0, 1]] / 4095, atol=1e-6)
    assert np.allclose(second.image, IMAGES[[3, 0, 1]] / 1023, atol=1e-6)


PLATEAUS = {"12 bits at the top of 16": (65520, np.uint16), "video": (235, np.uint8)}


@pytest.mark.parametrize("what", PLATEAUS)
def test_light_that_is_cut_off_below_full_scale_is_saturated(tmp_path: Path, what: str) -> None:
    top, dtype = PLATEAUS[what]
    light = RNG.normal(0.9, 0.2, (4, 40, 50)).clip(0.05, 1)
    _, notes = read_one(write(tmp_path, LEDS, (light * top).astype(dtype)))
    assert len(notes) == 4
    assert f"saturated at {top} of {np.iinfo(dtype).max}; expose shorter" in notes[0]


def test_bright_light_that_is_not_cut_off_is_not_saturated(tmp_path: Path) -> None:
    ramp = np.linspace(0.3, 0.95, 50 * 40).reshape(40, 50)
    even = np.full((4, 40, 50), 0.94)
    for light in (np.stack([ramp] * 4), even):
        assert read_one(write(tmp_path, LEDS, (255 * light).astype(np.uint8)))[1] == []


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_hot_pixels_are_no_saturated_light(tmp_path: Path, dtype: type) -> None:
    """To expose shorter does not help against them."""
    light = RNG.normal(0.5, 0.02, (4, 60, 80))
    light.reshape(4, -1)[:, RNG.choice(60 * 80, 12, replace=False)] = 1
    images = (np.iinfo(dtype).max * light).astype(dtype)
    _, notes = read_one(write(tmp_path, LEDS, images))
    assert len(notes) == 4
    assert all("as hot pixels do" in note and "expose shorter" not in note for note in notes)
    light[:, 20:30, 30:50] = 1
    _, notes = read_one(write(tmp_path, LEDS, (np.iinfo(dtype).max * light).astype(dtype)))
    assert all("saturated; expose shorter" in note for note in notes)


LINES = {
    "row 20": np.s_[:, 20],
    "rows 20 to 22": np.s_[:, 20:23],
    "column 33": np.s_[:, :, 33],
}


@pytest.mark.parametrize("value", [0, 16, 255])
@pytest.mark.parametrize("line", LINES)
def test_a_dead_line_is_reported(tmp_path: Path, line: str, value: int) -> None:
    """One dead row across a touch puts `reconstruct` 9 um off."""
    images = RNG.normal(120, 3, (4, 60, 80)).astype(np.uint8)
    images[:, 15:24, 30:40] = 0  # a shadow
    images[LINES[line]] = value
    _, notes = read_one(write(tmp_path, LEDS, images))
    notes = [note for note in notes if "of the pixels" not in note]
    assert len(notes) == 1, "once, not for each image"
    assert f"led1.png: {line} of one value, unlike its neighbours" in notes[0]


def test_lines_of_even_light_and_black_frames_are_not_dead(tmp_path: Path) -> None:
    ramp = np.tile(np.arange(40, 100, dtype=np.uint8)[:, None], (4, 1, 80))
    ramp[:, :5] = 0
    assert read_one(write(tmp_path / "ramp", LEDS, ramp))[1] == []
    noisy = RNG.normal(120, 3, (4, 60, 80)).astype(np.uint8)
    noisy[:, :5], noisy[:, :, -9:] = 0, 0
    assert read_one(write(tmp_path / "framed", LEDS, noisy))[1] == []


PARITY = np.indices((72, 80))
UNEVEN = {
    "a mosaic of every second pixel": PARITY.sum(0) % 2 == 0,
    "a mosaic of every fourth pixel": (PARITY % 2 == 0).all(0),
    "interlaced lines": PARITY[0] % 2 == 0,
}


@pytest.mark.parametrize("what", UNEVEN)
def test_a_raw_mosaic_and_interlaced_lines_are_reported(tmp_path: Path, what: str) -> None:
    light = RNG.normal(0.6, 0.03, (4, 72, 80)) * (0.6 + 0.4 * PARITY[1] / 80)
    assert read_one(write(tmp_path / "even", LEDS, (255 * light).astype(np.uint8)))[1] == []
    light *= np.where(UNEVEN[what], 0.85, 1)
    _, notes = read_one(write(tmp_path / "odd", LEDS, (255 * light).astype(np.uint8)))
    assert len(notes) == 1, "once, not for each image"
    assert "led1.png: is it a colour camera" in notes[0]
    light *= np.where(UNEVEN[what], 0.6, 1)
    with pytest.raises(InputError, match=r"led1.png: is it a colour camera's raw mosaic"):
        read_one(write(tmp_path / "odd", LEDS, (255 * light).astype(np.uint8)))


LAYOUTS: dict[str, tuple[dict[str, object], list[str], int]] = {
    "gelsightinc/gsmatlab, demo/groove": ({}, [f"image{k:02}.png" for k in range(1, 7)], 6),
    "NewProggie/Realtime-Photometric-Stereo, assets/hand": (
        {}, [*(f"image{k}.png" for k in range(8)), "image_ambient.png"], 8,
    ),
    "NewProggie/Photometric-Stereo, images": (
        {}, ["bunny.png", *(f"bunny_{k}.png" for k in range(1, 4)), "results.jpg"], 3,
    ),
    "bchao1/photometric-stereo, data/women": ({}, [f"input_{k}.tif" for k in range(1, 8)], 7),
    "curesh/photometric-stereo, chrome2": ({}, [f"cs_{k}.jpeg" for k in range(1, 5)], 4),
    "Kaistory/Photometric-stereo-system, img_test": (
        {}, [f"20260420_2239{s:02}.png" for s in (2, 5, 6, 8)], 4,
    ),
    "YertleTurtleGit/photometric-stereo-mappings, test_data": (
        {"files": "{}_BL"}, [f"{k}_{end}.png" for k in range(1, 13) for end in ("BL", "TL")], 8,
    ),
    "guanyingc/SDPS-Net, ToyPSDataset": (
        {"leds": (1, 11, 21, 31, 41)}, [*(f"l_{k:03}.png" for k in range(50)), "mask.png"], 5,
    ),
    "siyuandong16/gelsight_heightmap_reconstruction, Dots1": (
        {"lights": "bgr"}, ["sample_10.jpg", "sample_4.jpg", "ref.jpg"], 3,
    ),
    "ubi-coro/gelsight-calibration, examples/data": (
        {"lights": "bgr"}, ["bead.png", "key.png", "seed.png"], 3,
    ),
    "rpl-cmu/gelslam, 6.310mm": ({"lights": "bgr"}, ["0/gelsight.png", "11/gelsight.png"], 3),
}  # fmt: skip
"""Folders of public repositories: settings, names of files, and lights of a capture."""


@pytest.mark.parametrize("repository", LAYOUTS)
def test_folders_of_public_repositories_are_read_as_is(tmp_path: Path, repository: str) -> None:
    settings, names, count = LAYOUTS[repository]
    colours = RNG.integers(1, 250, (len(names), 12, 16, 3)).astype(np.uint8)
    for name, image in zip(names, colours, strict=True):
        write((tmp_path / name).parent, [Path(name).name], image[None])
    captures = list(read_capture(folder=tmp_path, **settings))
    assert [len(capture.image) for capture in captures] == [count] * len(captures)
    frames = [Path(name).parent.name or Path(name).stem for name in names]
    expected = [""] if "lights" not in settings else sorted(frames, key=lambda n: (len(n), n))
    assert sorted((c.name for c in captures), key=lambda n: (len(n), n)) == expected


def test_one_colour_image_is_a_capture_without_a_folder(tmp_path: Path) -> None:
    file = write(tmp_path, ["press.png"], COLOURS) / "press.png"
    (alone,) = read_capture(folder=file, lights="bgr")
    assert np.array_equal(alone.image, COLOURS[0].transpose(2, 0, 1) / np.float32(255))
    assert np.array_equal(
        read_flat(alone.image, folder=file, lights="bgr", smooth_px=0).flat, alone.image
    )


def test_colour_frames_are_a_stream_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    write(tmp_path, ["sample_10.png", "sample_4.png", "ref.png"], COLOURS)
    captures = list(read_capture(folder=tmp_path, lights="bgr"))
    assert [capture.name for capture in captures] == ["ref", "sample_4", "sample_10"]
    assert np.array_equal(captures[1].image, COLOURS[1].transpose(2, 0, 1) / np.float32(255))
