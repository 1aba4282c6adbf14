"""The pages of this folder as one site, and the commands as a manual page; CONTRIBUTING.md says how to make them."""

from typing import Any

import hdassist

project, version = "hdassist", hdassist.__version__
extensions = ["myst_parser"]
myst_heading_anchors = 2  # as code-hosting sites have them
smartquotes = False  # F'_ior and --json are written so

html_title = "hdassist"
html_theme = "furo"
html_theme_options = {"light_css_variables": {"code-font-size": "75%"}}  # 100 columns
html_copy_source = False
html_show_copyright = False

man_pages = [("commands", "hdassist", "kinematic error of harmonic drives", "", 1)]

OUTSIDE = {"../CONTRIBUTING.md": "site/contributing.md", "../CHANGELOG.md": "site/changelog.md"}


def setup(app: Any) -> None:
    """Let pages that lie outside of this folder be reached in the site."""
    app.connect("source-read", link_inside)


def link_inside(app: Any, name: str, source: list[str]) -> None:
    """Turn links to pages outside into links to the site's own pages, which include them."""
    for outside, inside in OUTSIDE.items():
        source[0] = source[0].replace(f"]({outside})", f"]({inside})")
