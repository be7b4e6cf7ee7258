"""Describe a touch in one sentence."""

from tactograph.graph import node
from tactograph.nodes import Metrics


@node
def touch_in_words(figures: Metrics) -> str:
    """Return the first facts about a touch: its contacts, their depth, and its trust.

    Parameters
    ----------
    figures : of `measure_contact` and `judge_touch`, as far as the graph has them
    """
    checked = "" if "check_light" in figures else " (without a check of the light)"
    judged = "its light was not judged"
    if "trust" in figures:
        judged = f"trust {figures['trust']:.2g}{checked}"
    if "contacts" not in figures:
        return judged
    count = int(figures["contacts"])
    depth = max(
        (v for name, v in figures.items() if name.startswith("contact_depth_mm/")), default=0
    )
    contacts = {0: "no contact", 1: f"1 contact, {depth:.2g} mm deep"}.get(
        count, f"{count} contacts, the deepest of {depth:.2g} mm"
    )
    return f"{contacts}; {judged}"
