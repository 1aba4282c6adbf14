"""Answers about drives that tests have made, without a file of what was measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hdassist.acceptance import accept as acceptance
from hdassist.acceptance.answer import AcceptAnswer
from hdassist.acceptance.decision import AcceptedValue
from hdassist.acceptance.limits import Limit
from hdassist.acceptance.predictions import Predictions, predict
from hdassist.acceptance.request import Inputs, Request
from hdassist.measuring.measure import Measurement
from hdassist.model.wheels import MeasuredTeeth
from hdassist.preset.fields import Drive


def accept(
    drive: Drive,
    measured: Mapping[float, Measurement] | None = None,
    *,
    stated: Mapping[Limit, AcceptedValue] | None = None,
    wheels: MeasuredTeeth | None = None,
    predictions: Predictions | None = None,
    **asked: Any,
) -> AcceptAnswer:
    """The answer about a drive; asked: fields of the request."""
    request = Request(drive.name, **asked)
    inputs = Inputs(drive, dict(measured or {}), dict(stated or {}), wheels)
    left = () if request.measured_only else inputs.unmeasured
    if left and predictions is None:
        predictions = predict(drive, left, wheels=wheels, draws=request.draws, sure=request.sure)
    return acceptance.accept(request, inputs, predictions if left else None)
