"""A touch in one sentence."""

import pytest

from tactograph.nodes.contact.touch_in_words import touch_in_words


@pytest.mark.parametrize(
    ("figures", "sentence"),
    [
        ({"contacts": 0.0, "trust": 0.981, "check_light": 0.2}, "no contact; trust 0.98"),
        (
            {"contacts": 1.0, "contact_depth_mm/c1": 0.6149, "trust": 4.2e-6},
            "1 contact, 0.61 mm deep; trust 4.2e-06 (without a check of the light)",
        ),
        (
            {"contacts": 2.0, "contact_depth_mm/c1": 0.2, "contact_depth_mm/c2": 1.25},
            "2 contacts, the deepest of 1.2 mm; its light was not judged",
        ),
        ({"trust": 0.5, "check_light": 0.5}, "trust 0.5"),
    ],
)
def test_a_touch_in_words_has_contacts_depth_and_trust(
    figures: dict[str, float], sentence: str
) -> None:
    assert touch_in_words(figures) == sentence
