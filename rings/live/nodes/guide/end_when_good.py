"""End a guided calibration once it is good."""

from typing import Annotated

from annotated_types import Ge, Gt, Interval

from tactograph.sdk import EndOfStream, node


@node
def end_when_good(
    quality: dict[str, float],
    advice: str,
    names: list[str],
    *,
    held_out_deg: Annotated[float, Gt(0)] = 1.0,
    film_percent: Annotated[float, Interval(ge=0, le=100)] = 50.0,
    min_presses: Annotated[int, Ge(1)] = 3,
    presses_at_most: Annotated[int, Ge(1)] = 15,
) -> None:
    """Print the quality of the calibration after each press, and end when it is good enough.

    Parameters
    ----------
    quality
        ``heldout_normal_deg`` and ``heldout_height_um`` from `hold_out_presses`, from two
        presses on; ``film_covered_percent``; ``slopes_covered_percent`` if known.
    advice : what to press next
    names : names of all presses so far
    held_out_deg
        Largest mean error of normals on held-out presses, in degrees, that counts as good.
    film_percent : share of the film's parts that must be covered
    min_presses : fewest presses that must be used, because a few that agree prove nothing
    presses_at_most : number of presses after which the calibration ends, however good it is

    Raises
    ------
    EndOfStream
        If it is good, or after `presses_at_most` presses.
    """
    error = quality.get("heldout_normal_deg", float("inf"))
    parts = [f"film covered {quality['film_covered_percent']:.0f} %"]
    if "slopes_covered_percent" in quality:
        parts += [f"slopes {quality['slopes_covered_percent']:.0f} %"]
    if "heldout_normal_deg" in quality:
        parts += [f"held out {error:.2f} degrees, {quality['heldout_height_um']:.0f} um"]
    print(f"{len(names)}: {', '.join(parts)}", flush=True)
    if (
        error <= held_out_deg
        and quality["film_covered_percent"] >= film_percent
        and quality["presses"] >= min_presses
    ):
        print(f"good: {quality['presses']:.0f} presses are used", flush=True)
        raise EndOfStream
    if len(names) >= presses_at_most:
        print(f"ended after {len(names)} presses, not as good as wanted: {advice}", flush=True)
        raise EndOfStream
    print(f"  next: {advice}", flush=True)
