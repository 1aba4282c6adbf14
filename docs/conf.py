"""The pages of this folder as one site, and the commands as a manual page; CONTRIBUTING.md says how to make them."""

import re
from typing import Any

from docutils.nodes import SkipNode
from docutils.utils.math.latex2mathml import tex2mathml

import hdassist

project, version = "hdassist", hdassist.__version__
extensions = ["myst_parser"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3  # as code-hosting sites have them
smartquotes = False  # F'_ior and --json are written so

html_math_renderer = "mathml"  # which browsers draw by themselves: no script, nothing fetched
html_title = "hdassist"
html_theme = "furo"
html_theme_options = {"light_css_variables": {"code-font-size": "75%"}}  # 100 columns
html_copy_source = False
html_show_copyright = False

man_pages = [("commands", "hdassist", "kinematic error of harmonic drives", "", 1)]

OUTSIDE = {
    "../CONTRIBUTING.md": "site/contributing.md",
    "../CHANGELOG.md": "site/changelog.md",
    "../.github/ISSUE_TEMPLATE/trace.md": "site/trace.md",
    "../.github/ISSUE_TEMPLATE/experiment.md": "site/experiment-form.md",
}


def setup(app: Any) -> None:
    """Let pages that lie outside of this folder be reached in the site, and draw equations."""
    app.connect("source-read", link_inside)
    app.add_html_math_renderer("mathml", (inline_math, None), (display_math, None))


def link_inside(app: Any, name: str, source: list[str]) -> None:
    """Turn links to pages outside into links to the site's own pages, which include them."""
    for outside, inside in OUTSIDE.items():
        source[0] = source[0].replace(f"]({outside})", f"]({inside})")


def inline_math(writer: Any, node: Any) -> None:
    """Write mathematics within a line."""
    writer.body.append(tex2mathml(node.astext()))
    raise SkipNode


def display_math(writer: Any, node: Any) -> None:
    """Write an equation, with its number beside it where a \\tag gives one."""
    text, number = node.astext(), ""
    if tag := re.search(r"\\tag\{(\w+)\}", text):
        text, number = text.replace(tag[0], ""), f'<span style="float: right">({tag[1]})</span>'
    writer.body.append(f'<div style="margin: 1em 0; overflow-x: auto">{number}{tex2mathml(text, as_block=True)}</div>')
    raise SkipNode
