"""Captures are read completely and correctly, or refused with the reason."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes.capture.read_capture import CaptureFile, read_capture
from tactograph.nodes.files.image_files import ImageFile

RNG = np.random.default_rng(0)
IMAGES = RNG.integers(1, 250, (4, 12, 16)).astype(np.uint8)


def write(folder: Path, images=IMAGES, suffix: str = ".png") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for k, image in enumerate(images, start=1):
        cv2.imwrite(str(folder / f"led{k}{suffix}"), image)
    return folder


def read_one(folder: Path, **settings):
    (capture,) = read_capture(folder=folder, **settings)
    return capture


@pytest.mark.parametrize(
    ("suffix", "dtype"),
    [
        *((suffix, np.uint8) for suffix in (".png", ".tiff", ".pgm", ".bmp")),
        *((suffix, np.uint16) for suffix in (".png", ".tiff", ".pgm")),
    ],
)
def test_bits_are_fractions_of_full_scale(tmp_path: Path, suffix: str, dtype: type) -> None:
    images = IMAGES.astype(dtype) * dtype(np.iinfo(dtype).max // 255)
    capture = read_one(write(tmp_path, images, suffix))
    assert np.allclose(capture.image, IMAGES / np.float32(255), rtol=0, atol=1e-7)
    assert capture.image.dtype == np.float32


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_images_stay_integers_where_that_is_allowed(tmp_path: Path, dtype: type) -> None:
    images = IMAGES.astype(dtype) * dtype(1 if dtype is np.uint8 else 257)
    whole = read_one(write(tmp_path, images), integers=True).image
    assert whole.dtype == dtype
    assert np.array_equal(whole, images)


@pytest.mark.parametrize("factor", [16, 1], ids=["bright", "dim"])
def test_twelve_bits_in_sixteen_are_fractions_of_their_full_scale(
    tmp_path: Path, factor: int
) -> None:
    write(tmp_path, IMAGES.astype(np.uint16) * factor)
    (tmp_path / "capture.yaml").write_text("bits: 12\n")
    image = read_one(tmp_path, integers=True).image
    assert image.dtype == np.float32, "integers that do not fill their bits are fractions"
    assert image.max() == pytest.approx(int(IMAGES.max()) * factor / 4095)


@pytest.mark.parametrize(
    ("settings", "part"),
    [({"leds": (4, 1, 2)}, np.s_[[3, 0, 1]]), ({"crop": (2, 3, 10, 8)}, np.s_[:, 3:8, 2:10])],
    ids=["a subset of LEDs in another order", "the pixels inside a crop"],
)
def test_a_part_of_a_capture_can_be_read(tmp_path: Path, settings, part) -> None:
    capture = read_one(write(tmp_path), **settings)
    assert np.array_equal(capture.image, IMAGES[part] / np.float32(255))


def test_files_of_another_name_hold_the_same_light(tmp_path: Path) -> None:
    for k, image in enumerate(IMAGES, start=1):
        cv2.imwrite(str(tmp_path / f"image{k:02}.png"), image)
    capture = read_one(tmp_path, files="image{:02}")
    assert np.array_equal(capture.image, IMAGES / np.float32(255))


@pytest.mark.parametrize(("lights", "order"), [("bgr", [0, 1, 2]), ("rgb", [2, 1, 0])])
def test_colour_channels_are_read_as_lights(tmp_path: Path, lights: str, order: list[int]) -> None:
    cv2.imwrite(str(tmp_path / "touch.png"), IMAGES[:3].transpose(1, 2, 0))
    assert np.array_equal(read_one(tmp_path, lights=lights).image, IMAGES[order] / np.float32(255))
    (tmp_path / "capture.yaml").write_text(f"lights: {lights}\n")
    assert np.array_equal(read_one(tmp_path).image, IMAGES[order] / np.float32(255))


@pytest.mark.parametrize("image", [IMAGES[0], np.dstack([IMAGES[0]] * 3)], ids=["grey", "equal"])
def test_an_image_of_equal_channels_holds_no_lights(tmp_path: Path, image) -> None:
    cv2.imwrite(str(tmp_path / "touch.png"), image)
    with pytest.raises(InputError, match="a grey image, but `lights`=bgr needs a colour one"):
        read_one(tmp_path, lights="bgr")
    cv2.imwrite(str(tmp_path / "touch.png"), np.full((12, 16, 3), 128, np.uint8))
    assert len(read_one(tmp_path, lights="bgr").image) == 3, "of evenly lit film it may be right"


def test_sixteen_bit_colour_keeps_its_depth(tmp_path: Path) -> None:
    image = RNG.integers(5000, 65535, (5, 6, 3)).astype(np.uint16)
    cv2.imwrite(str(tmp_path / "touch.png"), image)
    result = read_one(tmp_path, lights="bgr").image
    assert np.allclose(result, image.transpose(2, 0, 1) / 65535, atol=1e-6)


def test_a_folder_of_captures_is_a_stream_in_order_of_name(tmp_path: Path) -> None:
    """Leftovers of a killed writer are no capture."""
    for name in ("b", "a", "c", ".writing-x"):
        write(tmp_path / name)
    assert [c.name for c in read_capture(folder=tmp_path)] == ["a", "b", "c"]


def test_the_truth_next_to_the_images_is_read(tmp_path: Path) -> None:
    truth = RNG.random((12, 16)).astype(np.float32)
    np.save(write(tmp_path) / "truth_height_mm.npy", truth)
    assert np.array_equal(read_one(tmp_path).truth, truth)
    assert read_one(write(tmp_path / "without")).truth is None


def test_saturation_is_a_warning_with_its_share(tmp_path: Path) -> None:
    images = IMAGES.copy()
    images[1, :3] = 255
    with collect_warnings([]) as notes:
        read_one(write(tmp_path, images))
    assert "led2.png: 25.0% of the pixels are saturated" in notes[0]


@pytest.mark.parametrize("white", [100, 2500, 3000, 40000])
def test_a_pgms_own_white_is_full_scale(tmp_path: Path, white: int) -> None:
    """Light that reaches it is saturated, which gives a warning."""
    light = np.linspace(0.2, 1.3, 60 * 80).reshape(60, 80).clip(0, 1)
    for led in range(1, 5):
        counts = np.rint(white * light * (1 if led == 2 else 0.6))
        grey = counts.astype(">u2" if white > 255 else "u1").tobytes()
        (tmp_path / f"led{led}.pgm").write_bytes(b"P5\n80 60\n%d\n" % white + grey)
    with collect_warnings([]) as messages:
        image = read_one(tmp_path).image
    assert image.max() == pytest.approx(1, abs=0.005)
    np.testing.assert_allclose(image[1], light, atol=0.6 / white + 0.005)
    (line,) = [line for line in messages if "saturated" in line]
    assert "led2.pgm" in line


@pytest.mark.parametrize(
    ("file", "bits"), [("a.png", 1), ("a.png", 2), ("a.png", 4), ("a.tiff", 1), ("a.bmp", 1)]
)
def test_less_than_eight_bits_are_refused(tmp_path: Path, file: str, bits: int) -> None:
    ramp = Image.fromarray(np.arange(0, 256, 4, np.uint8).reshape(8, 8))
    (ramp.convert("1") if bits == 1 else ramp.quantize(2**bits)).save(tmp_path / file)
    with pytest.raises(InputError, match=rf"has {bits} bits a pixel; save it with 8 or 16"):
        ImageFile(tmp_path / file).read()


@pytest.mark.parametrize("side", [1, 3])
def test_images_too_small_for_a_height_are_refused(tmp_path: Path, side: int) -> None:
    images = np.full((4, side, 20), 99, np.uint8)
    with pytest.raises(InputError, match=f"20 x {side} pixels; a height needs 4 x 4 or more"):
        read_one(write(tmp_path, images))


def test_images_that_look_like_twelve_bits_give_a_warning(tmp_path: Path) -> None:
    with collect_warnings([]) as notes:
        read_one(write(tmp_path, IMAGES.astype(np.uint16) * 16))
    assert "bits: 12" in notes[0]
    assert "bits: 10" not in notes[0]


def test_what_ten_bits_hold_may_be_a_dim_image_of_twelve(tmp_path: Path) -> None:
    """Told of 12 bits alone, a camera of ten was a quarter as bright as it is."""
    with collect_warnings([]) as notes:
        read_one(write(tmp_path, IMAGES.astype(np.uint16) * 4))
    assert "no value above 1023" in notes[0]
    assert "if it is 10 bit, say 'bits: 10'" in notes[0]
    assert "if it is 12 bit, say 'bits: 12'" in notes[0]


@pytest.mark.parametrize("name", ["capture.yml", "Capture.yaml", "capture.yaml.txt"])
def test_a_file_that_is_called_almost_as_the_captures_own_is_told(
    tmp_path: Path, name: str
) -> None:
    folder = write(tmp_path)
    (folder / name).write_text("leds: [2, 1, 3, 4]\n")
    with collect_warnings([]) as notes:
        read_one(folder)
    assert notes == [f"{folder / name}: not read; a file of this kind is called capture.yaml"]


@pytest.mark.parametrize("text", ["", "\n", "# bits: 12\n"])
def test_a_capture_file_without_entries_states_nothing(tmp_path: Path, text: str) -> None:
    folder = write(tmp_path)
    (folder / "capture.yaml").write_text(text)
    assert read_one(folder).image.shape == IMAGES.shape


def no_folder(folder: Path) -> None:
    for file in folder.iterdir():
        file.unlink()
    folder.rmdir()


def colour(folder: Path) -> None:
    cv2.imwrite(str(folder / "led2.png"), RNG.integers(0, 255, (12, 16, 3)).astype(np.uint8))


SPOIL = {
    "there is no such folder": no_folder,
    "the image of LED 3 is missing": lambda d: (d / "led3.png").unlink(),
    "led2.png: is 8 x 5 pixels, but led1.png is 16 x 12": lambda d: cv2.imwrite(
        str(d / "led2.png"), IMAGES[0, :5, :8]
    ),
    "led2.png: is 16 bit, but led1.png is 8 bit": lambda d: cv2.imwrite(
        str(d / "led2.png"), IMAGES[0].astype(np.uint16)
    ),
    "led1.png: the file is empty": lambda d: (d / "led1.png").write_bytes(b""),
    "led4.png: cannot be decoded": lambda d: (d / "led4.png").write_bytes(
        (d / "led4.png").read_bytes()[:-40]
    ),
    "led5.png: is a folder; one image is needed": lambda d: (d / "led5.png").mkdir(),
    "led5.png: cannot be read: Too many levels": lambda d: (d / "led5.png").symlink_to("led5.png"),
    "led4.png: not an image": lambda d: (d / "led4.png").write_text("hello"),
    "led2.png: a colour image": colour,
    "led3.png: all black": lambda d: cv2.imwrite(str(d / "led3.png"), 0 * IMAGES[0]),
    "needs from 3": lambda d: [(d / f"led{k}.png").unlink() for k in (3, 4)],
    "capture.yaml:1:1: bitz: unknown key; did you mean 'bits'": lambda d: (
        d / "capture.yaml"
    ).write_text("bitz: 12\n"),
    "led1.png: is 8 bit, but 'bits: 12' in capture.yaml says 12": lambda d: (
        d / "capture.yaml"
    ).write_text("bits: 12\n"),
    "led2.png' is a link to 'gone.png'": lambda d: [
        (d / "led2.png").unlink(),
        (d / "led2.png").symlink_to("gone.png"),
    ],
    "capture.yaml:1:1: is no mapping; write 'name: value' lines": lambda d: (
        d / "capture.yaml"
    ).write_text("- leds\n"),
    "capture.yaml:1:18: ball_center_px[0]": lambda d: (d / "capture.yaml").write_text(
        "ball_center_px: [.inf, 5.0]\n"
    ),
    "capture.yaml:1:1: ball_radius_mm": lambda d: (d / "capture.yaml").write_text(
        f"ball_radius_mm: {'9' * 330}\n"
    ),
    "capture.yaml:1:1: ball_contact_px": lambda d: (d / "capture.yaml").write_text(
        "ball_contact_px: 1e300\n"
    ),
    "truth_height_mm.npy: is 3 x 2": lambda d: np.save(
        d / "truth_height_mm.npy", np.zeros((2, 3), np.float32)
    ),
    "truth_height_mm.npy: holds NaN": lambda d: np.save(
        d / "truth_height_mm.npy", np.full((12, 16), np.nan, np.float32)
    ),
    "truth_height_mm.npy: not a NumPy array of numbers": lambda d: np.save(
        d / "truth_height_mm.npy", np.array([{}], dtype=object), allow_pickle=True
    ),
}


@pytest.mark.parametrize("message", SPOIL)
def test_a_spoilt_capture_is_refused(tmp_path: Path, message: str) -> None:
    folder = write(tmp_path / "touch")
    SPOIL[message](folder)
    with pytest.raises(InputError) as caught:
        read_one(folder)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"leds": (1, 1, 2)}, "of LEDs 1,1,2 one is named twice"),
        ({"leds": (1, 2, 7)}, "LED 7 is missing"),
        ({"files": "led"}, "write it as led"),
        ({"crop": (0, 0, 99, 5)}, "has only 16 x 12"),
        ({"lights": "bgr"}, "one colour image is needed"),
    ],
)
def test_settings_that_do_not_fit_the_capture_are_refused(
    tmp_path: Path, settings, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        read_one(write(tmp_path), **settings)


def test_the_error_of_a_folder_without_images_names_the_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"holds no led1.png"):
        list(read_capture(folder=tmp_path))
    (tmp_path / "led1.webp").touch()
    with pytest.raises(InputError, match=r"holds led1.webp, a kind of image that is not read"):
        list(read_capture(folder=tmp_path))


def test_several_captures_are_refused_where_one_is_needed(tmp_path: Path) -> None:
    write(tmp_path / "a")
    write(tmp_path / "b")
    with pytest.raises(InputError, match="holds 2 captures, but one is needed"):
        list(read_capture(folder=tmp_path, single=True))


def test_true_slopes_and_shadows_are_read_and_cropped(tmp_path: Path) -> None:
    write(tmp_path)
    slope = RNG.normal(size=(2, 12, 16)).astype(np.float32)
    np.save(tmp_path / "truth_slope.npy", slope)
    cv2.imwrite(str(tmp_path / "truth_shadow.png"), IMAGES[0])
    capture = read_one(tmp_path, crop=(2, 1, 10, 9))
    assert capture.truth is None
    assert np.array_equal(capture.truth_slope, slope[:, 1:9, 2:10])
    assert np.array_equal(capture.truth_shadow, IMAGES[0, 1:9, 2:10])


@pytest.mark.parametrize("share", [0.3, 0.97])
def test_a_tiff_that_ends_too_early_is_refused_in_one_line(
    tmp_path: Path, recwarn: pytest.WarningsRecorder, share: float
) -> None:
    """Pillow's own warning, of corrupt EXIF data, was printed as well."""
    file = write(tmp_path / "one", suffix=".tif") / "led2.tif"
    whole = file.read_bytes()
    file.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match=r"led2\.tif: .* damaged"):
        read_one(tmp_path / "one")
    assert not recwarn.list


@pytest.mark.parametrize("shape", [(2, 12, 15), (3, 12, 16), (12, 16)])
def test_true_slopes_of_another_size_are_refused(tmp_path: Path, shape: tuple[int, ...]) -> None:
    np.save(write(tmp_path) / "truth_slope.npy", np.zeros(shape, np.float32))
    with pytest.raises(InputError, match=r"truth_slope\.npy"):
        read_one(tmp_path)


def dark(counts: int, depth: type = np.uint8):
    """Noise below that many counts, as under a lens cap."""
    return RNG.integers(0, counts, (4, 12, 16)).astype(depth)


@pytest.mark.parametrize("images", [dark(3), dark(300, np.uint16)], ids=["8 bit", "16 bit"])
@pytest.mark.parametrize("integers", [False, True])
def test_darkness_with_its_noise_is_no_measurement(tmp_path: Path, images, integers: bool) -> None:
    with pytest.raises(InputError, match=r"led1\.png: too dark to measure"):
        read_one(write(tmp_path, images), integers=integers)


@pytest.mark.parametrize(("counts", "bits"), [(250, 8), (320, 12)])
def test_the_error_of_dark_images_suggests_fewer_bits(
    tmp_path: Path, counts: int, bits: int
) -> None:
    with pytest.raises(InputError, match=rf"too dark to measure.*say 'bits: {bits}'"):
        read_one(write(tmp_path, dark(counts, np.uint16)))


def test_a_dim_led_among_bright_ones_does_not_look_like_fewer_bits(tmp_path: Path) -> None:
    images = IMAGES.astype(np.uint16) * 256
    images[1] //= 16
    with collect_warnings([]) as notes:
        read_one(write(tmp_path, images))
    assert notes == []


def test_fewer_bits_than_eight_give_a_warning(tmp_path: Path) -> None:
    with collect_warnings([]) as notes:
        read_one(write(tmp_path, IMAGES // 32 * 17))
    assert len(notes) == 1
    assert "only one gray level in 17 occurs, as in images of 4 bits" in notes[0]


@pytest.mark.parametrize("quality", [8, 50])
def test_jpeg_compression_gives_a_warning_whatever_the_file_is_called(
    tmp_path: Path, quality: int
) -> None:
    """Otherwise a touch of such images is doubted as having the slopes of no surface."""
    y, x = np.mgrid[:120, :160]
    ball = 0.6 + 0.4 * np.exp(-((x - 80) ** 2 + (y - 60) ** 2) / 800) + x / 900
    noise = np.random.default_rng(0).normal(0, 1, (4, 120, 160))
    taken = [np.clip(120 * ball + noise[k] + 9 * k, 0, 255).astype(np.uint8) for k in range(4)]
    with collect_warnings([]) as notes:
        read_one(write(tmp_path / "raw", taken))
    assert notes == []
    packed = [
        cv2.imencode(".jpg", plane, [cv2.IMWRITE_JPEG_QUALITY, quality])[1] for plane in taken
    ]
    with collect_warnings([]) as notes:
        read_one(write(tmp_path / "jpeg", [cv2.imdecode(each, 0) for each in packed]))
    (note,) = notes
    assert "led1.png: the light jumps at every eighth pixel, as JPEG leaves it" in note


def test_smooth_light_without_noise_is_not_taken_for_jpeg(tmp_path: Path) -> None:
    """As the mean of many images is: its slopes change most at the same side of every block."""
    y, x = np.mgrid[-0.5:0.5:240j, -0.5:0.5:320j]
    corners = [(1.2, 1.2), (-1.2, 1.2), (-1.2, -1.2), (1.2, -1.2)]
    lit = [0.8 / (1 + (x - at) ** 2 + (y - down) ** 2) for at, down in corners]
    with collect_warnings([]) as notes:
        read_one(write(tmp_path, [np.round(65535 * each).astype(np.uint16) for each in lit]))
    assert notes == []


def test_jpeg_is_read_with_a_warning(tmp_path: Path) -> None:
    smooth = [np.full((16, 16), 40 * k, np.uint8) for k in range(1, 5)]
    write(tmp_path, smooth[:3])
    cv2.imwrite(str(tmp_path / "led4.jpg"), smooth[3])
    with collect_warnings([]) as notes:
        capture = read_one(tmp_path)
    assert np.allclose(255 * capture.image[3], 160, atol=2)
    assert "JPEG compression costs accuracy; record PNG or TIFF" in notes, "once for all captures"


TURNED, PICTURES = Image.Exif(), [Image.fromarray(image) for image in IMAGES]
TURNED[0x0112] = 3
CMYK = Image.fromarray(IMAGES[:3].transpose(1, 2, 0)).convert("CMYK")
DEEP = Image.fromarray(IMAGES[1].astype(np.uint16))
LARGE = Image.new("1", (8192, 8192))


@pytest.mark.parametrize(
    ("suffix", "picture", "how", "message"),
    [
        *((end, PICTURES[1], {"exif": TURNED}, "orientation") for end in ("png", "tiff", "jpg")),
        *(
            (end, PICTURES[0], {"save_all": True, "append_images": PICTURES[1:]}, "holds 4 pages")
            for end in ("png", "tiff")
        ),
        ("tiff", PICTURES[1], {"tiffinfo": {262: 0}}, r"led2\.tiff: .* 0 is white"),
        ("tiff", DEEP, {"tiffinfo": {262: 0}}, r"led2\.tiff: .* 0 is white"),
        ("tiff", CMYK, {}, r"led2\.tiff"),
        ("png", LARGE, {}, "too large for a camera image"),
    ],
)
def test_an_image_that_is_more_than_its_pixels_or_not_a_cameras_is_refused(
    tmp_path: Path, suffix: str, picture: Image.Image, how: dict[str, object], message: str
) -> None:
    (write(tmp_path) / "led2.png").unlink()
    picture.copy().save(tmp_path / f"led2.{suffix}", **how)
    with pytest.raises(InputError, match=message):
        read_one(tmp_path)


def test_transparency_is_refused_and_an_opaque_alpha_channel_read(tmp_path: Path) -> None:
    write(tmp_path)
    image = Image.fromarray(IMAGES[1]).convert("LA")
    image.save(tmp_path / "led2.png")
    assert np.array_equal(read_one(tmp_path).image, IMAGES / np.float32(255))
    image.putalpha(100)
    image.save(tmp_path / "led2.png")
    with pytest.raises(InputError, match=r"led2\.png: is transparent"):
        read_one(tmp_path)


def test_one_led_in_two_files_is_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(write(tmp_path) / "led1.tiff"), IMAGES[1])
    with pytest.raises(InputError, match=r"led1\.png and led1\.tiff are both there"):
        read_one(tmp_path)


def test_a_file_in_place_of_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"led1\.png: is a file; give the folder"):
        read_one(write(tmp_path) / "led1.png")


@pytest.mark.parametrize("place", ["press.MP4", "."])
def test_a_video_is_refused_with_the_command_that_takes_it(tmp_path: Path, place: str) -> None:
    (tmp_path / "press.MP4").write_bytes(b"a film")
    message = r"a video: 'tactograph run live camera=.*press\.MP4 port=none' takes it"
    with pytest.raises(InputError, match=message):
        read_one(tmp_path / place)


def test_a_pipe_in_the_place_of_the_capture_file_is_refused(tmp_path: Path) -> None:
    """A pipe that nobody writes to would block its reader."""
    os.mkfifo(tmp_path / "capture.yaml")
    with pytest.raises(InputError, match=r"capture\.yaml: is no plain file"):
        CaptureFile.read(tmp_path)
