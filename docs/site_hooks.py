"""What the site changes in pages: those of rings lie beside the others there."""

import re

TO_A_PAGE = re.compile(r"\]\((?:\.\./)+(?:rings/)?(?:\w+/)?docs/")


def on_page_markdown(markdown: str, **_: object) -> str:
    """Lead links from and to the pages of rings to where `generate.py` puts them."""
    return TO_A_PAGE.sub("](", markdown)
