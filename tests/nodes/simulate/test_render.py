"""Light and shadow on simple surfaces, as geometry demands."""

import json

import cv2
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tactograph.graph import InputError
from tactograph.graph.backends.device_call import DeviceCall
from tactograph.nodes.light.film_bounce import film_bounce
from tactograph.nodes.simulate.blur import blur
from tactograph.nodes.simulate.interreflect import interreflect
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.simulate.render import render
from tactograph.nodes.simulate.shape_ball import shape_ball
from tactograph.nodes.simulate.view import view
from tactograph.nodes.slope.height_slopes import height_slopes
from tests.fixtures import Raytraced

PIXEL = 0.1
FAR_MM = 1e6
"""Distance from which light is parallel."""


def towards(slant_deg, azimuth_deg, distance=1.0):
    """One LED, 1 x 3."""
    slant, azimuth = np.deg2rad([slant_deg, azimuth_deg])
    unit = [np.sin(slant) * np.cos(azimuth), np.sin(slant) * np.sin(azimuth), np.cos(slant)]
    return np.float32([unit]) * np.float32(distance)


def plane(p, q, size=(21, 33)):
    y, x = np.indices(size)
    return np.float32(PIXEL * (p * (x - size[1] / 2) + q * (y - size[0] / 2)))


def wall(rise, size=(5, 200), edge=100):
    """High ground left of `edge`, the film at rest right of it."""
    height = np.zeros(size, np.float32)
    height[:, :edge] = rise
    return height


def shadow_length(labels, edge=100):
    """Dark pixels in the middle row, right of the wall, in mm."""
    return np.count_nonzero(labels[labels.shape[0] // 2, edge:]) * PIXEL


slants = st.floats(5, 70)
azimuths = st.floats(0, 360)


@settings(max_examples=30)
@given(p=st.floats(-2, 2), q=st.floats(-2, 2), slant=slants, azimuth=azimuths)
def test_plane_under_distant_light_obeys_lamberts_cosine(p, q, slant, azimuth):
    led = towards(slant, azimuth)
    rendered = render(plane(p, q), PIXEL, towards(slant, azimuth, FAR_MM), level=0.5)
    cosine = float(led[0] @ [-p, -q, 1]) / np.sqrt(1 + p * p + q * q)
    expected = 0.5 * max(cosine, 0) / np.cos(np.deg2rad(slant))
    np.testing.assert_allclose(rendered.light, expected, rtol=1e-4, atol=1e-4)


@settings(max_examples=20)
@given(slant=slants, azimuth=azimuths, distance=st.floats(5, 500))
def test_flat_film_falls_off_with_the_inverse_square_and_the_cosine(slant, azimuth, distance):
    (led,) = lights = towards(slant, azimuth, distance)
    light = render(plane(0, 0), PIXEL, lights).light[0]
    rows, columns = light.shape
    y, x = np.indices(light.shape)
    x, y = (x - (columns - 1) / 2) * PIXEL, (y - (rows - 1) / 2) * PIXEL
    irradiance = led[2] / ((led[0] - x) ** 2 + (led[1] - y) ** 2 + led[2] ** 2) ** 1.5
    np.testing.assert_allclose(light / light[0, 0], irradiance / irradiance[0, 0], rtol=1e-4)


def test_film_closer_to_the_light_is_brighter_by_the_inverse_square():
    led = np.float32([[0, 0, 20]])
    low, high = (render(np.full((3, 3), z, np.float32), PIXEL, led).light for z in (0.0, 5.0))
    assert high[0, 1, 1] / low[0, 1, 1] == pytest.approx((20 / 15) ** 2, rel=1e-5)


@pytest.mark.parametrize("lights", [light_ring(), light_ring(slant_deg=45.0, distance_mm=7.07)])
def test_level_is_the_brightest_light_of_the_film_at_rest(lights):
    # One LED much closer than the others, and all of them: the brightest counts.
    lights = np.concatenate([lights, lights[:1] * np.float32(0.9)])
    light = render(plane(0, 0, (81, 101)), PIXEL, lights, level=0.6).light
    assert light.max() == pytest.approx(0.6, rel=1e-3)


@settings(max_examples=20)
@given(rise=st.floats(0.5, 3), slant=st.floats(10, 65))
def test_distant_light_casts_a_step_s_shadow_of_height_over_tan_elevation(rise, slant):
    rendered = render(wall(rise), PIXEL, towards(slant, 180, FAR_MM))
    expected = rise / np.tan(np.deg2rad(90 - slant))
    assert shadow_length(rendered.labels) == pytest.approx(expected, abs=1.5 * PIXEL)


def test_near_light_casts_a_step_s_shadow_of_similar_triangles():
    height, rise, foot = 20.0, 2.0, 6.0
    rendered = render(wall(rise), PIXEL, np.float32([[-foot, 0, height]]))
    assert shadow_length(rendered.labels) == pytest.approx(
        rise * foot / (height - rise), abs=1.5 * PIXEL
    )


def test_hemisphere_s_shadow_is_as_long_as_equation_1_says():
    # D = h = 5 mm and r = 1 mm, the paper's example: x is about 0.4 mm.
    pixel, radius = 0.02, 1.0
    ball = shape_ball(radius_mm=radius, width_px=200, height_px=201, pixel_size_mm=pixel)
    rendered = render(*ball, towards(45, 180, FAR_MM))
    row = rendered.labels[100]
    rim = round(99.5 + radius / pixel)
    assert np.count_nonzero(row[rim:]) * pixel == pytest.approx(np.sqrt(2) - 1, abs=2 * pixel)


def test_shadow_of_a_steep_light_ends_where_the_wall_ends():
    assert shadow_length(render(wall(2.0), PIXEL, towards(0, 0, FAR_MM)).labels) == 0


def test_slope_that_faces_away_is_an_attached_shadow():
    rendered = render(plane(1.5, 0), PIXEL, towards(60, 0, FAR_MM))
    assert (rendered.labels == 1).all()
    assert (rendered.light == 0).all()
    assert (render(plane(1.5, 0), PIXEL, towards(60, 180, FAR_MM)).labels == 0).all()


def test_bit_of_each_led_marks_exactly_where_a_point_light_leaves_black():
    rendered = render(
        *shape_ball(radius_mm=4.0, rise_mm=3.5, width_px=160, height_px=120, pixel_size_mm=1 / 7),
        light_ring(),
    )
    for k in range(4):
        np.testing.assert_array_equal((rendered.labels >> k & 1) == 1, rendered.light[k] == 0)
    assert set(np.unique(rendered.labels)) > {0, 1, 2, 4, 8}


def test_turning_the_scene_by_a_quarter_passes_the_image_to_the_next_light():
    # A ring of four on a ball: each image is the last one, turned.
    ball = shape_ball(radius_mm=2.0, width_px=61, height_px=61, pixel_size_mm=PIXEL)
    light = render(*ball, light_ring(first_azimuth_deg=20.0, distance_mm=30.0)).light
    for k in range(4):
        turned = np.rot90(light[k], -1)
        close = np.isclose(turned, light[(k + 1) % 4], atol=1e-4)
        assert close.mean() > 0.995  # except for grazing rays


def test_energy_does_not_depend_on_the_pixel_size():
    lights = light_ring(distance_mm=40.0)
    ball = {"radius_mm": 5.0, "rise_mm": 2.0}
    coarse = shape_ball(**ball, width_px=120, height_px=120, pixel_size_mm=0.1)
    fine = shape_ball(**ball, width_px=240, height_px=240, pixel_size_mm=0.05)
    a, b = (render(*s, lights).light.mean((1, 2)) for s in (coarse, fine))
    np.testing.assert_allclose(a, b, rtol=3e-3)


def test_step_of_the_ray_hardly_matters():
    ball = shape_ball(width_px=160, height_px=120, pixel_size_mm=1 / 7)
    coarse, fine = (render(*ball, light_ring(), step_px=s).labels for s in (0.5, 0.1))
    assert np.mean(coarse != fine) < 5e-3


def test_led_with_a_size_casts_a_penumbra_of_similar_triangles():
    rise, height, size = 2.0, 20.0, 4.0
    led = np.float32([[-8, 0, height]])
    hard = render(wall(rise), PIXEL, led)
    soft = render(wall(rise), PIXEL, led, led_size_mm=size, rays=64)
    lit = render(wall(0.0), PIXEL, led).light
    share = (soft.light / lit)[0, 2, 100:]
    penumbra = np.count_nonzero((share > 0.02) & (share < 0.98)) * PIXEL
    assert penumbra == pytest.approx(size * rise / (height - rise), abs=2 * PIXEL)
    # Half the rays reach the pixels at the hard shadow's edge.
    assert shadow_length(soft.labels) == pytest.approx(shadow_length(hard.labels), abs=PIXEL)


def test_several_samples_per_pixel_measure_a_shadow_to_a_fraction_of_a_pixel():
    rise, slant = 1.23, 40
    exact = rise * np.tan(np.deg2rad(slant))
    # The wall slopes over the pixel between its two levels; the rays clear its upper edge.
    after_edge = exact - PIXEL
    rendered = render(wall(rise), PIXEL, towards(slant, 180, FAR_MM), samples=4, step_px=0.1)
    row = rendered.light[0, 2, 100:] / rendered.light[0, 2, -1]
    assert (1 - row).sum() * PIXEL == pytest.approx(after_edge + 0.5 * PIXEL, abs=0.2 * PIXEL)
    assert np.count_nonzero((row > 0.02) & (row < 0.98)) <= 2


def test_samples_leave_a_plane_unchanged():
    lights = towards(30, 20, 40)
    once, often = (render(plane(0.5, -0.3), PIXEL, lights, samples=n) for n in (1, 3))
    inner = np.s_[:, 1:-1, 1:-1]
    np.testing.assert_allclose(often.light[inner], once.light[inner], rtol=1e-4)


def test_gloss_adds_a_highlight_where_the_normal_is_half_way_to_the_camera():
    ball = shape_ball(radius_mm=5.0, width_px=121, height_px=121, pixel_size_mm=PIXEL)
    slant = 40
    dull, glossy = (
        render(*ball, towards(slant, 0, FAR_MM), gloss=g, shininess=200.0).light[0]
        for g in (0.0, 0.5)
    )
    y, x = np.unravel_index(np.argmax(glossy - dull), dull.shape)
    assert y == 60
    assert (x - 60) * PIXEL == pytest.approx(5 * np.sin(np.deg2rad(slant / 2)), abs=PIXEL)
    assert (glossy >= dull).all()


def test_leds_that_shine_by_the_cosine_light_the_film_off_their_axis_less() -> None:
    # The film at rest then falls off with cos(axis) more than under a point that shines evenly.
    (led,) = lights = towards(40, 0, 20)
    rest = plane(0, 0, (41, 61))
    evenly, by_cosine = (render(rest, PIXEL, lights, cosine_leds=c).light[0] for c in (False, True))
    y, x = np.indices(rest.shape)
    to_led = np.stack([led[0] - (x - 30) * PIXEL, led[1] - (y - 20) * PIXEL, led[2] + 0 * x])
    axis = np.tensordot(led / 20, to_led, axes=1) / np.sqrt((to_led**2).sum(axis=0))
    np.testing.assert_allclose(by_cosine / evenly, axis, rtol=1e-4)


def test_a_disk_that_faces_the_film_casts_a_penumbra_as_tall_as_it_stands() -> None:
    rise, foot, z = 2.0, 12.0, 6.0
    led = np.float32([[-foot, 0, z]])
    lit, soft = (
        render(wall(r), PIXEL, led, led_size_mm=1.0, rays=128, cosine_leds=True).light
        for r in (0.0, rise)
    )
    share = (soft / lit)[0, 2, 100:]
    penumbra = np.count_nonzero((share > 0.02) & (share < 0.98)) * PIXEL
    up, across = 0.5 * foot / np.hypot(foot, z), 0.5 * z / np.hypot(foot, z)
    longest = rise * (foot + across) / (z - up - rise)
    shortest = rise * (foot - across) / (z + up - rise)
    assert penumbra == pytest.approx(longest - shortest, abs=3 * PIXEL)


def coated(slope: float, slant: float, **coat: float) -> float:
    """Light of a plane tilted along x under a distant LED, over that of a matt one."""
    led = towards(slant, 0, FAR_MM)
    settings = {"coat_alpha": 0.2, "refractive_index": 1.5, "albedo": 0.7, **coat}
    film = plane(slope, 0, (5, 5))
    light = render(film, PIXEL, led, **settings).light[0, 2, 2]
    return float(light / render(film, PIXEL, led).light[0, 2, 2])


def test_a_coat_mirrors_most_where_the_normal_is_half_way_to_the_camera() -> None:
    slant = 40.0
    tilts = np.deg2rad(np.arange(0, 41, 4))
    relative = [coated(-np.tan(t), slant) * np.cos(np.deg2rad(slant) - t) for t in tilts]
    assert tilts[int(np.argmax(relative))] == pytest.approx(np.deg2rad(slant / 2), abs=0.08)


def test_light_loses_fresnels_share_into_a_coat_and_out_of_it() -> None:
    # Straight down and up through index 1.5: 4 % each; its mirror is far from the camera's way.
    through = 1 - 0.04
    mirror = 0.04 / (4 * 0.7 * 0.2**2)
    assert coated(0.0, 0.0) == pytest.approx(through**2 + mirror, rel=1e-3)
    assert coated(0.0, 60.0, coat_alpha=0.05) == pytest.approx(through * (1 - 0.0892), rel=2e-3)


def test_a_camera_nearby_sees_the_coat_s_mirror_elsewhere() -> None:
    # Flat film mirrors the LED where the way to the LED and to the pupil lean alike.
    led, pupil = np.float32([[6, 0, 20]]), 20.0
    film = plane(0, 0, (5, 121))
    matt, coat = (
        render(film, PIXEL, led, coat_alpha=a, camera_mm=pupil).light[0, 2] for a in (0.0, 0.03)
    )
    assert (np.argmax(coat / matt) - 60) * PIXEL == pytest.approx(3.0, abs=PIXEL)


def test_light_below_the_surface_is_refused():
    with pytest.raises(InputError, match=r"LED 1 stands 5 mm .* rises to 6 mm"):
        render(np.full((3, 3), 6, np.float32), PIXEL, np.float32([[0, 0, 5]]))


def capture(rig, scene):
    """The ray tracer's images 0 to 1, height, lights and pixel size."""
    folder = Raytraced() / rig / scene
    images = [cv2.imread(str(folder / f"led{k}.png"), cv2.IMREAD_UNCHANGED) for k in range(1, 5)]
    facts = json.loads((folder / "scene.json").read_text())
    stack = np.stack(images).astype(np.float32) / np.iinfo(images[0].dtype).max
    height = np.load(folder / "truth_height_mm.npy")
    return stack, height, facts["pixel_size_mm"], np.float32(facts["lights_mm"])


def away_from_shadow_edges(labels, steep):
    """K x H x W: no shadow begins or ends, and no wall stands, within two pixels."""
    window = np.ones((5, 5), np.uint8)
    shadows = [labels >> k & 1 for k in range(4)]
    calm = cv2.dilate(steep.astype(np.uint8), window) == 0
    return np.stack([(cv2.dilate(s, window) == cv2.erode(s, window)) & calm for s in shadows])


@pytest.mark.one_case
@pytest.mark.parametrize(
    ("rig", "scene"),
    [
        ("far28", "calibration"),
        ("far28", "cat"),
        ("far28", "sphere_film"),
        ("near33", "sphere"),
        ("near33", "cat"),
        ("near33", "cat_film"),
        ("far28_vga16", "cat_film"),
    ],
)
def test_agrees_with_an_independent_ray_tracer(device, rig, scene):
    make = DeviceCall(render, device) if rig == "far28_vga16" else render
    flat, rest, pixel, lights = capture(rig, "flat")
    plain = make(rest, pixel, lights, level=1.0).light
    gain = float((flat * plain).sum() / (plain * plain).sum())
    images, height, pixel, lights = capture(rig, scene)
    rendered = make(height, pixel, lights, level=gain)

    steep = np.hypot(*np.gradient(height, pixel)) > 3
    calm = away_from_shadow_edges(rendered.labels, steep)
    error = 255 * np.abs(rendered.light - images)[calm]
    noise = 255 * np.abs(gain * plain - flat)
    # The ray tracer's images carry shot noise: agreement to within it is the most there is.
    assert np.median(error) < np.median(noise) + 0.05
    assert error.mean() < noise.mean() + 0.05
    dark_traced, dark_rendered = images < 0.01, rendered.light < 0.01
    either = (dark_traced | dark_rendered) & calm
    if np.count_nonzero(either) > 200:
        assert (
            np.count_nonzero(dark_traced & dark_rendered & calm) / np.count_nonzero(either) > 0.97
        )
    if np.count_nonzero(dark_rendered) > 2000:
        # Pixels on an edge are mixed by the ray tracer and not by `render`.
        iou = np.count_nonzero(dark_traced & dark_rendered) / np.count_nonzero(
            dark_traced | dark_rendered
        )
        assert iou > 0.9


def in_the_hand(device, facts, height, pixel, lights, level):
    """The images of a rig in the hand, and the labels and the height that its pixels see."""
    coat, size = facts.get("coating") or {}, 2 * (facts.get("led_disc_radius_mm") or 0)
    camera, albedo = facts.get("camera_mm") or 0.0, facts["albedo"]
    rig = {
        "level": level, "led_size_mm": size, "cosine_leds": size > 0, "rays": 8,
        "coat_alpha": coat.get("roughness", 0.0),
        "refractive_index": coat.get("refractive_index", 1.5), "albedo": albedo,
        "camera_mm": camera,
    }  # fmt: skip
    draw = DeviceCall(render, device)
    rendered = draw(height, pixel, lights, **rig)
    light, labels = rendered.light, rendered.labels
    if facts.get("bounces"):
        rest = draw(np.zeros_like(height), pixel, lights, **rig).light
        # The coat takes its share of what the film throws on itself, too.
        share = 0.9 * albedo if coat else albedo
        light = interreflect(
            light, rest, height, lights, pixel,
            albedo=share, bounces=5, bounce=DeviceCall(film_bounce, device),
        )  # fmt: skip
    slope = height_slopes(height, pixel).slope
    lens = {"camera_mm": camera, "lens_at_corner": facts.get("lens_at_corner") or 0.0}
    viewed = view(light, height, slope, labels, **lens)
    return (
        blur(viewed.light, deviation_px=facts.get("blur_px") or 0.0),
        viewed.labels,
        viewed.height,
    )


@pytest.mark.one_case
@pytest.mark.parametrize(
    ("rig", "scene", "more"),
    [
        ("hand_ideal", "cat_film", 0.03),
        ("hand_perspective", "cat_film", 0.03),
        ("hand_lens", "calibration_off", 0.06),
        ("hand_discs", "cat_film", 0.03),
        ("hand_gloss", "sphere_film", 0.2),
        ("hand_bounce", "cat_film", 0.25),
        ("hand", "sphere_film", 0.25),
    ],
)
def test_agrees_with_an_independent_ray_tracer_in_the_hand(device, rig, scene, more):
    flat, _, pixel, lights = capture(rig, "flat")
    facts = json.loads((Raytraced() / rig / scene / "scene.json").read_text())
    at_rest = {**facts, "bounces": 0}  # a flat film has no interreflection
    none = np.zeros(flat.shape[1:], np.float32)
    plain, _, _ = in_the_hand(device, at_rest, none, pixel, lights, 1.0)
    gain = float((flat * plain).sum() / (plain * plain).sum())
    noise = 255 * np.abs(gain * plain - flat)

    images, expected, _, _ = capture(rig, scene)
    _, height, _, _ = capture("hand_ideal", scene)  # seen from straight above
    light, labels, apparent = in_the_hand(device, facts, height, pixel, lights, gain)
    np.testing.assert_allclose(np.median(np.abs(apparent - expected)), 0, atol=1e-4)
    steep = np.hypot(*np.gradient(apparent, pixel)) > 3
    calm = away_from_shadow_edges(labels, steep) & (apparent > 0.02) & (images < 0.99)
    error = 255 * np.abs(light - images)[calm]
    assert np.median(error) < np.median(noise) + more
    assert error.mean() < noise.mean() + 1.5 * more
