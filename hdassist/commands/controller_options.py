"""Options of the file that a controller takes a correction from, and how its axis counts."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING

from hdassist.errors import UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.correction.correct import Correction
    from hdassist.correction.forms import CorrectionForm
    from hdassist.correction.writers import ControllerFormat


@dataclass(frozen=True, kw_only=True)
class ControllerOptions(o.OptionGroup):
    """The file of a controller, and how its axis counts."""

    write: str | None = None
    axis: str = "1"
    clockwise: bool = False
    zero: float = 0.0
    rows_from: float = 0.0
    steps_per_degree: float = 0.0

    def controller_target(self, form: CorrectionForm, *, force: bool) -> tuple[ControllerFormat, str] | None:
        """Controller and file that are asked for, of a form.

        Raises UsageError: no such controller, or a form that it does not keep; as `take_output` for the file.
        """
        from hdassist.correction.writers import CONTROLLER_FORMATS
        from hdassist.terminal.files import take_output

        if self.write is None:
            return None
        name, _, path = self.write.partition("=")
        if name not in CONTROLLER_FORMATS or path in ("", "-"):
            known = ", ".join(CONTROLLER_FORMATS)
            raise UsageError(f"invalid --write {self.write!r}: expected CONTROLLER=FILE", f"controllers: {known}")
        if not (self.axis.isascii() and self.axis.isalnum()):
            raise UsageError(f"invalid --axis {self.axis!r}: expected letters and digits")
        for number in (self.zero, self.rows_from, self.steps_per_degree):
            if not isfinite(number):
                raise UsageError(f"invalid number {number:g} of an axis: expected a finite one")
        controller = CONTROLLER_FORMATS[name]
        controller.require(form.turn, form.points)
        take_output(path, force)
        return controller, path

    def controller_texts(self, result: Correction, controller: ControllerFormat) -> tuple[str, str]:
        """The controller's file of a correction, and its companions."""
        from hdassist.correction.writers import ControllerAxis, correction_file

        axis = ControllerAxis(self.axis, -1 if self.clockwise else 1, self.zero, self.rows_from, self.steps_per_degree)
        return correction_file(result, controller, axis)
