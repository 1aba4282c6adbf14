"""The pages are held together: what a link names is there, and the site's sidebar is the README's last section."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
LINK = r"\]\(([^)\s]+)\)|(?:src|srcset)=\"([^\"]+)\""


def prose(page: Path) -> str:
    """A page without its code."""
    return re.sub(r"^( *)```.*?^\1```$|`[^`\n]*`", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """What a link into a page may name, as code-hosting sites make it of headings."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_have_targets(page: Path):
    for link in ("".join(pair) for pair in re.findall(LINK, prose(page))):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.is_relative_to(ROOT), link
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


def test_the_sidebar_has_the_groups_of_the_readme():
    index = (ROOT / "docs/index.md").read_text(encoding="utf-8")
    sidebar = {
        title: re.findall(r"<([\w/]+)>$", entries, flags=re.MULTILINE)
        for title, entries in re.findall(r"```{toctree}\n:caption: (\w+)\n(.*?)```", index, flags=re.DOTALL)
    }
    more = (ROOT / "README.md").read_text(encoding="utf-8").partition("## More")[2]
    groups = {
        title: [re.sub(r"^docs/|\.md$", "", link) for link in re.findall(r"\]\((.*?)\)", entries)]
        for title, entries in re.findall(r"^- (\w+): (.*(?:\n  .*)*)", more, flags=re.MULTILINE)
    }
    assert len(groups) == 3
    assert sidebar == {
        title: [{"CONTRIBUTING": "site/contributing", "CHANGELOG": "site/changelog"}.get(n, n) for n in names]
        for title, names in groups.items()
    }
