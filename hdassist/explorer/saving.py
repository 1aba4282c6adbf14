"""The preset that the explorer writes; never over a file without asking."""

from __future__ import annotations

from pathlib import Path

from hdassist.errors import HdassistError, UsageError
from hdassist.explorer.asking import Asking
from hdassist.explorer.screens import Confirm
from hdassist.loading.write import with_changes
from hdassist.terminal.files import put_text, require_writable
from hdassist.visible import visible


class Saving(Asking):
    """The action that writes a file."""

    def action_save(self) -> None:
        """Write the preset with the changes, its comments and order as they are."""
        source = self.session.source
        if not self.session.drive.origin.overrides:
            self.notify("nothing is changed: there is nothing to save")
            return
        file = source.file if Path(source.file).suffix else f"{source.name}-changed.yaml"
        self.fill_in("save the preset", file, "comments and order of the original are kept", self.write)

    def write(self, path: str) -> None:
        """Write the preset to a file, an existing one only after asking."""
        source, overrides = self.session.source, self.session.drive.origin.overrides
        try:
            if path == "-":
                raise UsageError("the screen has standard output", "name a file")
            require_writable(path, force=True)
            text = with_changes(source.text, source.file, overrides)
        except HdassistError as error:
            self.complain(error)
            return

        def put(sure: bool | None) -> None:
            if not sure:
                return
            try:
                put_text(path, text)
            except HdassistError as error:
                self.complain(error)
                return
            self.notify(visible(f"wrote {path}"), markup=False)

        if Path(path).exists():
            self.push_screen(Confirm(f"{path} exists. Replace it?"), put)
        else:
            put(True)
