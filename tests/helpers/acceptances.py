"""Acceptance results of drives that tests construct, without files of measurements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hdassist.drive.model.deviations import MeasuredTeeth
from hdassist.drive.preset.fields import Drive
from hdassist.features.acceptance import accept as acceptance
from hdassist.features.acceptance.answer import AcceptAnswer
from hdassist.features.acceptance.decision import AcceptedValue, Predictions, predict
from hdassist.features.acceptance.limits import Limit
from hdassist.features.acceptance.request import Inputs, Request
from hdassist.features.measuring.measure import Measurement
from tests.helpers.process import SMALL, TINY


def accept(
    drive: Drive,
    measured: Mapping[float, Measurement] | None = None,
    *,
    stated: Mapping[Limit, AcceptedValue] | None = None,
    wheels: MeasuredTeeth | None = None,
    predictions: Predictions | None = None,
    **asked: Any,
) -> AcceptAnswer:
    """Return the acceptance result of a drive.

    drive: drive to accept.
    measured: measurements by torque [N*m].
    stated: values measured by other means, by limit.
    wheels: measured teeth.
    predictions: predictions of the model; None if they are computed when needed.
    asked: fields of the request.
    """
    request = Request(drive.name, **asked)
    inputs = Inputs(drive, dict(measured or {}), dict(stated or {}), wheels)
    left = () if request.measured_only else inputs.unmeasured
    if left and predictions is None:
        predictions = predict(drive, left, wheels=wheels, draws=request.draws, sure=request.sure)
    return acceptance.accept(request, inputs, predictions if left else None)


def tiny(*limits: str, **asked: Any) -> Drive:
    """Return the tiny drive with limits; asked: fields of its request."""
    return Request(TINY, limits=limits, **asked).load()


def small(*limits: str, **asked: Any) -> Drive:
    """Return the small drive with limits; asked: fields of its request."""
    return Request(SMALL, limits=limits, **asked).load()


def stated(number: float, uncertainty: float) -> AcceptedValue:
    """Return a value measured by other means, with its standard uncertainty, in the unit of its check."""
    return AcceptedValue(number, 2 * uncertainty, "stated", "whole")
