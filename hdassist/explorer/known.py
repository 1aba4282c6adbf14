"""What is known so far of each variant that was looked at, so that undo and redo need no process."""

from __future__ import annotations

from dataclasses import dataclass, field

from hdassist.explorer.answers import Advised, Answer, Believed, Curve, Facts, Failed, Slopes, Underway
from hdassist.explorer.state import Step

MOST = 64  # steps that are remembered


@dataclass
class Known:
    """Answers about one drive, or about one drive with trials."""

    facts: Facts | None = None
    curve: Curve | None = None  # none where any hole may be the best: against holes it would mean nothing
    belief: Believed | None = None
    old: Believed | None = None  # of the variant before, until there is one of this
    advised: Advised | None = None
    failed: Failed | None = None
    share: float = 0.0  # of what is under way
    slopes: dict[float, Slopes] = field(default_factory=dict)

    def take(self, answer: Answer) -> None:
        """Learn an answer."""
        match answer:
            case Facts():
                self.facts = answer
            case Curve():
                self.curve = merged(self.curve, answer)
            case Believed():
                self.belief = answer
            case Slopes():
                self.slopes[answer.rotation_deg] = answer
            case Advised():
                self.advised = answer
                if not (self.facts and self.facts.any_hole):
                    self.curve = merged(self.curve, answer.curve)
            case Underway():
                self.share = answer.share
            case Failed():
                self.failed = answer


def merged(old: Curve | None, new: Curve) -> Curve:
    """A curve with what another one knows as surely or more so."""
    if old is None or old.torques != new.torques:
        return new
    for place in new.places:
        old = old.with_place(place)
    return old


class Memory:
    """What is known, by what was changed of the preset and by trials."""

    def __init__(self) -> None:
        self._known: dict[Step, Known] = {}

    def of(self, step: Step) -> Known:
        """What is known at a step; of the drive alone at one without trials."""
        known = self._known.pop(step, None) or Known()
        self._known[step] = known  # the last one asked for is forgotten last
        while len(self._known) > MOST:
            self._known.pop(next(iter(self._known)))
        return known
