"""What the explorer's other views show: the error over a cam turn with the forces on the teeth, a trace over it."""

from __future__ import annotations

import io

import numpy as np

from hdassist.comparing.compare import Comparison, RecordConvention, compare, zero_of
from hdassist.comparing.page import comparison_page
from hdassist.error.error_map import searchable
from hdassist.error.trace import Trace, trace
from hdassist.errors import UntrustedError
from hdassist.explorer.answers import Compared, Turned
from hdassist.explorer.questions import TraceQuestion, TurnQuestion
from hdassist.model.contacts import contact_system
from hdassist.model.deviations import state_gaps
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.model.unknown import told as taken_as_zero
from hdassist.mounting.positions import rotated
from hdassist.preset.fields import Drive
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.run.run import UNCHECKED
from hdassist.solve.answers import N_MM
from hdassist.solve.certificate import TOLERANCE, residuals
from hdassist.solve.engine import Engine
from hdassist.solve.formulation import formulate
from hdassist.solve.window import in_wide_enough_window
from hdassist.terminal.console import Style, console

ORDERS = 12  # that are told, the greatest
COLUMNS = 96  # of the page of a comparison


def turned(asked: TurnQuestion) -> Turned:
    """The error over one cam turn, as `hdassist trace` computes it, and the forces on the teeth in its states."""
    drive = rotated(asked.drive, asked.rotation_deg)

    def analysis(there: Drive) -> tuple[Trace, Drive]:
        return trace(there, asked.M_g, start_deg=asked.start_deg, run=UNCHECKED), there

    found, there = in_wide_enough_window(drive, analysis)
    error, proof = found.error, found.error.certificate
    theta, forces = _forces(there, found) if searchable(drive) else ((), ())
    greatest = sorted(found.orders, key=lambda order: -order.amplitude_arcsec)[:ORDERS]
    return Turned(
        M_g=asked.M_g,
        start_deg=asked.start_deg,
        phi_h_deg=tuple(np.degrees(error.states.phi_h).tolist()),
        error_arcsec=tuple(error.error_arcsec.tolist()),
        range_arcsec=error.range_arcsec,
        orders=tuple((o.per_cam_rev, o.amplitude_arcsec, o.cause) for o in greatest),
        theta_deg=theta,
        force_N=forces,
        shares=tuple((float(a), float(b)) for a, b in error.zone_share),
        proof=f"{proof.states} states, greatest residual {proof.max_residual:.0e}",
        warnings=taken_as_zero(asked.drive),
    )


Zones = tuple[tuple[float, ...], ...]


def _forces(drive: Drive, found: Trace) -> tuple[Zones, tuple[Zones, ...]]:
    """Angle [deg] of each tooth from the middle of its zone; force [N] on it by state and zone, driving less other.

    Raises UntrustedError where an answer is not proven.
    """
    system, torque = contact_system(drive), found.error.M_g * N_MM
    gaps = state_gaps(drive, system, found.error.states)
    delta_p = system.delta_p_of(gaps)
    forces, free, _ = Engine(formulate(system), torque).forces(delta_p)
    if not np.all(residuals(system, delta_p, torque, forces, free).worst <= TOLERANCE):
        raise UntrustedError("the forces on the teeth are not proven")
    stations = len(system.face.fall)
    flanks, on = system.flanks, system.on_flanks(forces)
    theta, side, zone = (np.asarray(each)[::stations] for each in (flanks.theta, flanks.side, flanks.zone))
    angles, by_zone = [], []
    for which in (0, 1):
        away = (np.degrees(theta) - 180 * which + 180) % 360 - 180
        places = np.unique(np.round(away[zone == which], 6))
        angles.append(tuple(places.tolist()))
        by_zone.append(_at(places, away, np.sign(torque) * side, np.where(zone == which, on, 0.0)))
    states = range(len(on))
    return tuple(angles), tuple(tuple(tuple(np.round(each[k], 2).tolist()) for each in by_zone) for k in states)


def _at(places: Array, away: Array, side: Array, on: Array) -> Array:
    """Forces by tooth, shape (states, places): those of its driving flank, less those of the other one."""
    column = np.searchsorted(places, np.round(away, 6)) % len(places)
    hit = np.abs(places[column] - away) < 1e-3
    result = np.zeros((len(on), len(places)))
    for k in np.flatnonzero(hit):
        result[:, column[k]] += side[k] * on[:, k]
    return result


def compared(asked: TraceQuestion) -> Compared:
    """A measured trace over the prediction, as `hdassist compare` does it."""
    drive = asked.drive
    record = read_trace(asked.file, TraceForm(), abs(Kinematics.of(drive).u))
    convention = RecordConvention(zero_deg=zero_of(record, drive, None))
    result = in_wide_enough_window(drive, lambda there: compare(record, there, asked.M_g, convention=convention))
    predicted = np.asarray(result.predicted_arcsec)
    return Compared(
        file=record.file,
        turns=tuple(np.asarray(result.sweep.bins.turns).tolist()),
        measured_arcsec=tuple((predicted + result.residual_arcsec).tolist()),
        predicted_arcsec=tuple(predicted.tolist()),
        page=_page(result),
    )


def _page(result: Comparison) -> str:
    """The page of the command, without its plot."""
    style, page = Style(ascii=False, codes=False, width=COLUMNS), io.StringIO()
    console(page, style).print(comparison_page(result, style, plots=False))
    return page.getvalue()
