"""Plot what a new film has changed."""

from matplotlib.axes import Axes
from matplotlib.patches import Circle

from tactograph.rings.recheck.nodes._film_pictures import draw_films, draw_light
from tactograph.rings.recheck.nodes.film_change import FilmChange
from tactograph.sdk import F4, Colour, FoundBalls, Light, NewPicture, SheetLight, node


@node
def plot_recalibration(
    then: Light,
    now: Light,
    change: FilmChange,
    image: SheetLight,
    balls: FoundBalls,
    quality: dict[str, float],
    advice: str,
    *,
    picture: NewPicture,
) -> None:
    """Draw both films at rest, the check press, and maps of albedo and dents.

    Parameters
    ----------
    then, now : K x H x W, the old and the new film at rest
    change : as `film_change` returns it
    image, balls
        The presses on a sheet, and their balls; a contact radius of 0 means that there is no ball.
    quality, advice : for the title
    file : the picture goes beside it: ``new.npz`` gives ``new.png``
    """
    films = {"old film at rest": then, "new film at rest": now}
    words = "new against old"
    figure, (upper, lower) = draw_films(films, change, words, width=18)
    _draw_press(upper, image[:, : now.shape[1]], balls.circle[balls.of == 0])
    draw_light(lower, change.strength, words)
    figure.suptitle(advice, x=0.02, ha="left", fontsize=11)
    # Those of single LEDs are drawn.
    figures = {name: quality[name] for name in quality if not name.startswith("light_percent")}
    picture.write(figure, figures, top=0.92)


def _draw_press(axes: Axes, press: F4, circles: F4) -> None:
    axes.imshow(press.mean(axis=0), cmap="gray")
    for x, y, radius in circles[circles[:, 2] > 0]:
        axes.add_patch(Circle((x, y), radius, fill=False, color=Colour.ORANGE))
    is_pressed = (circles[:, 2] > 0).any()
    axes.set_title("check press" if is_pressed else "no check press")
