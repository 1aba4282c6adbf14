"""What the screen asks of processes that compute: light to make, so that the screen imports nothing that computes."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.preset.fields import Drive
from hdassist.terminal.options import TrialOptions


@dataclass(frozen=True)
class Effort:
    """How much is computed.

    turns: positions of each wheel that a coarse value rests on; draws, effective samples of what is not known, as check
    and mount have them; draws of trials (None: as many as the command takes); jobs: processes at work (0: one for
    each core).
    """

    turns: int = 8
    draws: int = 64
    trial_draws: int | None = None
    jobs: int = 0


FULL = Effort()


@dataclass(frozen=True)
class MountQuestion:
    """Where the fixed wheel of a drive is best."""

    drive: Drive
    effort: Effort = FULL


@dataclass(frozen=True)
class BeliefQuestion:
    """F'_ior of a drive over all that is not known exactly."""

    drive: Drive
    effort: Effort = FULL


@dataclass(frozen=True)
class TrialsQuestion:
    """Where the fixed wheel is best by trials."""

    drive: Drive
    trials: tuple[str, ...]
    rig: TrialOptions
    effort: Effort = FULL


@dataclass(frozen=True)
class ProofQuestion:
    """F'_ior by every state of the cycle with the fixed wheel turned."""

    drive: Drive
    rotation_deg: float
    effort: Effort = FULL


@dataclass(frozen=True)
class SlopesQuestion:
    """What a step of each field does with the fixed wheel turned."""

    drive: Drive
    rotation_deg: float
    effort: Effort = FULL


@dataclass(frozen=True)
class TurnQuestion:
    """The error over one cam turn with the fixed wheel turned, and the forces on the teeth."""

    drive: Drive
    rotation_deg: float
    M_g: float
    start_deg: float
    effort: Effort = FULL


@dataclass(frozen=True)
class TraceQuestion:
    """A measured trace, in a file, over the prediction."""

    drive: Drive
    file: str
    M_g: float
    effort: Effort = FULL


@dataclass(frozen=True)
class RenderQuestion:
    """A text of an advice: its JSON (json), or a card (.html, .md, .txt)."""

    sealed: bytes
    kind: str
    serial: str = ""


Question = (
    MountQuestion
    | BeliefQuestion
    | TrialsQuestion
    | ProofQuestion
    | SlopesQuestion
    | TurnQuestion
    | TraceQuestion
    | RenderQuestion
)
