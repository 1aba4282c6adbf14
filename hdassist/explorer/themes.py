"""The explorer's two themes, dark and light, and the styles of its pictures in each."""

from __future__ import annotations

from textual.theme import Theme

from hdassist.explorer.pictures import Inks

DARK = Theme(
    "hdassist-dark",
    primary="#56b4e9",
    secondary="#e69f00",
    accent="#56b4e9",
    foreground="#d8dee4",
    background="#0f1419",
    surface="#161c23",
    panel="#1f2730",
    success="#4cc38a",
    warning="#e6b450",
    error="#ff6b6b",
    dark=True,
    variables={"border": "#36424f", "footer-key-foreground": "#56b4e9"},
)
LIGHT = Theme(
    "hdassist-light",
    primary="#0067a8",
    secondary="#a85200",
    accent="#0067a8",
    foreground="#1c2430",
    background="#fbfbf9",
    surface="#f3f3ef",
    panel="#e6e6e0",
    success="#00734a",
    warning="#8a5a00",
    error="#b3261e",
    dark=False,
    variables={"border": "#b9bfc6", "footer-key-foreground": "#0067a8"},
)
THEMES = (DARK, LIGHT)


def inks(dark: bool) -> Inks:
    """Styles on a dark or a light ground."""
    if dark:
        return Inks(
            torques=("#56b4e9", "#e69f00", "#cc79a7", "#4cc38a"),
            text="#d8dee4", muted="#7d8a97", ghost="#5b6671", band="#1d3346", cursor="#2a3541", limit="#ff6b6b",
            trial="#f0e442", now="#d8dee4 bold", best="#4cc38a bold", worst="#ff6b6b bold",
        )  # fmt: skip
    return Inks(
        torques=("#0067a8", "#a85200", "#8a3a72", "#00734a"),
        text="#1c2430", muted="#6a737d", ghost="#9aa3ac", band="#d3e5f3", cursor="#dddfe2", limit="#b3261e",
        trial="#7a3e9d", now="#1c2430 bold", best="#00734a bold", worst="#b3261e bold",
    )  # fmt: skip
