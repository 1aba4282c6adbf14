"""Options of an archive of measured drives: adding to it, and showing how a drive has changed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from hdassist.errors import UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.measuring.measure import Measurement
    from hdassist.report import Report


@dataclass(frozen=True, kw_only=True)
class ArchiveOptions(o.OptionGroup):
    """Where results are kept, of which drive and measured how; or the drive whose history is shown."""

    archive: str | None = None
    serial: str = ""
    conditions: list[str]
    history: str | None = None

    def archiving(self, files: Sequence[str]) -> "Callable[[Measurement], None]":
        """The use of each result of files. Raises UsageError for options that do not go together."""
        from hdassist.measuring.archive import add_to_archive, read_conditions
        from hdassist.terminal.output import note

        asked = (bool(files), bool(self.archive), bool(self.serial), self.history is not None)
        if asked not in ((1, 0, 0, 0), (1, 1, 1, 0), (0, 1, 0, 1)) or (self.conditions and not self.serial):
            words = "expected FILE, FILE --archive DIR --serial S, or --history S --archive DIR"
            raise UsageError(words, "hdassist measure -h")
        conditions = read_conditions(self.serial, self.conditions)

        def take(found: "Measurement") -> None:
            if self.archive:
                is_new = add_to_archive(self.archive, conditions, found)
                day = f" of {conditions['date']}" if "date" in conditions else ""
                words = f"added as {self.serial}{day}" if is_new else f"known of {self.serial}, not added again"
                note(f"{self.archive}: {found.trace.file} {words}")

        return take

    def history_report(self, serial: str) -> "Report":
        """How a drive of the archive has changed."""
        from hdassist.measuring.archive import is_cut_off, read_archive
        from hdassist.pages.measure import history_report

        archive = str(self.archive)
        report = history_report(serial, archive, read_archive(archive, serial))
        words = f"{archive}: its last line was cut off, a result is lost: add the records of that time again"
        return replace(report, warnings=(words,)) if is_cut_off(archive) else report
