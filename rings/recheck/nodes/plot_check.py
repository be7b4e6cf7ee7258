"""Plot what has changed since a calibration."""

from tactograph.rings.recheck.nodes._film_pictures import draw_films, draw_light
from tactograph.rings.recheck.nodes.film_change import FilmChange
from tactograph.rings.recheck.nodes.judge_film import Verdicts
from tactograph.sdk import Light, NewPicture, node


@node
def plot_check(
    then: Light,
    now: Light,
    change: FilmChange,
    verdicts: Verdicts,
    *,
    picture: NewPicture,
) -> None:
    """Draw the film then and now, maps of albedo and dents, and the verdicts.

    Parameters
    ----------
    then, now : K x H x W, the untouched film
    change : as `film_change` returns it
    verdicts : as `judge_film` returns them
    file : the picture
    """
    films = {"untouched film at the calibration": then, "untouched film now": now}
    words = "now against then"
    figure, (upper, lower) = draw_films(films, change, words, width=13)
    draw_light(upper, change.strength, words)
    lower.axis("off")
    causes = "LEDs", "film", "lens", "ambient light", "camera"
    lines = [f"{cause}: {verdict}" for cause, verdict in zip(causes, verdicts[:5], strict=True)]
    text = lower.text(0, 1, "\n\n".join(lines), va="top", wrap=True, fontsize=9)
    text.set_parse_math(False)
    picture.write(figure)
