"""Plot what has changed since a calibration."""

from typing import Annotated

from tactograph.rings.recheck.nodes._film_pictures import draw_films, draw_light
from tactograph.sdk import F4, Height, Light, NewPicture, Port, node, write_picture


@node
def plot_check(
    then: Light,
    now: Light,
    strength: Annotated[F4, Port("K", "1")],
    albedo: Annotated[F4, Port("H W", "1")],
    dent: Height,
    leds: str,
    film: str,
    lens: str,
    ambient: str,
    camera: str,
    *,
    file: NewPicture,
) -> None:
    """Draw the film then and now, maps of albedo and dents, and the verdicts.

    Parameters
    ----------
    then, now : K x H x W, the untouched film
    strength, albedo, dent : K, H x W, and H x W in mm: as `film_change` returns them
    leds, film, lens, ambient, camera : as `judge_film` returns them
    file : the picture
    """
    films = {"untouched film at the calibration": then, "untouched film now": now}
    words = "now against then"
    figure, (upper, lower) = draw_films(films, albedo, dent, words, width=13)
    draw_light(upper, 100 * strength, words)
    lower.axis("off")
    verdicts = {"LEDs": leds, "film": film, "lens": lens, "ambient light": ambient}
    lines = [f"{name}: {verdict}" for name, verdict in (verdicts | {"camera": camera}).items()]
    text = lower.text(0, 1, "\n\n".join(lines), va="top", wrap=True, fontsize=9)
    text.set_parse_math(False)
    write_picture(figure, file)
