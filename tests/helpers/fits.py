"""Recordings of the tests, each fitted once."""

from __future__ import annotations

from hdassist.recording import chain, posterior
from hdassist.recording.positions import Recording
from hdassist.recording.posterior import AmplitudePosterior

_fitted = dict[tuple[object, ...], AmplitudePosterior]()
_fitted_both = dict[tuple[object, ...], tuple[AmplitudePosterior, AmplitudePosterior]]()


def fit_once(recording: Recording, *, seed: int) -> AmplitudePosterior:
    """Return the samples of a recording, those of before if it was fitted before.

    Measurements and commands of the tests fit the same recordings again and again, which takes up to 4 s each. Tests of
    the model itself, in tests/recording, call posterior_of_recording, so each of their fits is computed.

    recording: readings of one drive at one torque in one direction.
    seed: seed of the random numbers.
    """
    key = (*_key(recording), seed, chain.ENOUGH_SAMPLES)
    if key not in _fitted:
        _fitted[key] = posterior.posterior_of_recording(recording, seed=seed)
    return _fitted[key]


def fit_both_once(
    forward: Recording, backward: Recording, *, seed: int
) -> tuple[AmplitudePosterior, AmplitudePosterior]:
    """Return the samples of both directions of a recording, as `fit_once` does for one."""
    key = (*_key(forward), *_key(backward), seed, chain.ENOUGH_SAMPLES)
    if key not in _fitted_both:
        _fitted_both[key] = posterior.posteriors_of_directions(forward, backward, seed=seed)
    return _fitted_both[key]


def _key(recording: Recording) -> tuple[object, ...]:
    """Return a key that is equal for equal recordings."""
    columns = (recording.input_rev, recording.output_rev, recording.error_arcsec, recording.sweep, recording.time)
    return (*(column.tobytes() for column in columns), recording.ratio)


def keep_fits() -> None:
    """Let measurements and corrections of this process fit each recording once."""
    from hdassist.features.correction import directions
    from hdassist.features.measuring import full_cycle

    full_cycle.posterior_of_recording = fit_once
    full_cycle.posteriors_of_directions = fit_both_once
    directions.posterior_of_recording = fit_once
    directions.posteriors_of_directions = fit_both_once
