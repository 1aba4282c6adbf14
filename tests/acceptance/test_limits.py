"""Limits and stated values: how they are written, what they are for, and how checks are explained."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from hdassist.drive.loading import load_text
from hdassist.features.acceptance.limits import CHECKS, CODES, Limit, LimitText, limits_of
from hdassist.features.acceptance.request import stated_values
from hdassist.interface.pages.accept import number
from hdassist.run.errors import PresetError, UsageError
from tests.helpers.acceptances import stated, tiny
from tests.helpers.process import TINY

ROOT = Path(__file__).parents[2]


def bounds(*texts: str) -> tuple[LimitText, ...]:
    return tuple(LimitText.parse(text, "--limit") for text in texts)


def test_small_limits_keep_their_digits():
    asked = limits_of(tiny("order_2=0.004"))[0]
    assert number(0.0041, asked) == "0.00410"
    assert number(28.094, Limit("F_IOR", 30.0)) == "28.09"


def test_limits_name_torques_beyond_those_of_operation():
    drive = tiny("F_ior=9", "F_ior@7=3", "order_2=1")
    assert [(a.code, a.M_g_Nm, a.limit) for a in limits_of(drive)] == [
        ("F_IOR", 1.0, 9.0), ("F_IOR", 4.0, 9.0), ("F_IOR", 7.0, 3.0), ("ORDER", 1.0, 1.0), ("ORDER", 4.0, 1.0),
    ]  # fmt: skip


def test_order_limit_at_one_torque_overrides_the_general_limit():
    drive = tiny("order_2=5", "order_2@4=3", "order_0.1@7=1")
    assert [(a.per_cam_rev, a.M_g_Nm, a.limit) for a in limits_of(drive)] == [(2, 1, 5), (2, 4, 3), (0.1, 7, 1)]
    assert [(a.per_cam_rev, a.M_g_Nm, a.limit) for a in limits_of(tiny("order_2@1=3"))] == [(2, 1, 3)]
    preset = (
        Path(TINY).read_text() + "acceptance: {order_amplitude: {2: 5, 2@4: 3 arcsec, 2.0@4.0: 4, 0@4: 1, x@4: 1}}\n"
    )
    with pytest.raises(PresetError) as caught:
        load_text(preset, "own.yaml")
    assert [(f.path, f.message) for f in caught.value.findings] == [
        ("acceptance.order_amplitude.2.0@4.0", "the key is given twice"),
        ("acceptance.order_amplitude.0@4", "must be an order per input revolution, or ORDER@TORQUE in N*m"),
        ("acceptance.order_amplitude.x@4", "must be an order per input revolution, or ORDER@TORQUE in N*m"),
    ]


def test_words_of_limits():
    texts = ("F_ior@80=30", "F_ior=0.5 arcmin", "order_2=5", "K_1=30 N*m/arcmin", "order_0.01=1", "order_2@80=4")
    assert [str(limit) for limit in bounds(*texts)] == list(texts)
    assert [limit.override for limit in bounds(*texts)] == [
        "acceptance.F_ior.80=30", "acceptance.F_ior=0.5 arcmin", "acceptance.order_amplitude.2=5",
        "acceptance.K_1=30 N*m/arcmin", "acceptance.order_amplitude.0.01=1",
        "acceptance.order_amplitude.2@80=4",
    ]  # fmt: skip
    drive = tiny("order_0.1=1", "K_1=30 N*m/arcmin")
    assert [a.per_cam_rev for a in limits_of(drive)] == [0.1, 0.1, None]
    assert limits_of(drive)[-1].limit == pytest.approx(30 * 10800 / np.pi)
    assert bounds("30", "0.5 arcmin") == bounds("F_ior=30", "F_ior=0.5 arcmin")
    for bad in (
        "",
        "F_ior",
        "@4=30",
        "F_ior=",
        "F_iro=3",
        "K_1@80=3",
        "F_ior@=3",
        "order_x=3",
        "order_2@=3",
        "order_@80=3",
    ):
        with pytest.raises(UsageError):
            bounds(bad)


def test_words_of_stated_values():
    drive = tiny("F_ior=9", "lost_motion=60", "order_2=5")
    first, second, *_, lost = limits_of(drive)
    told = stated_values(["F_ior@4=8.1 ± 0.4", "lost_motion=1+-6 arcsec"], drive)
    assert told == {second: stated(8.1, 0.2), lost: stated(1.0, 3.0)}
    assert stated_values(["F_ior@4=8,1±0,4", "lost_motion=1±6,0"], drive) == told
    assert next(iter(stated_values(["order_2@1=3±1"], drive))).per_cam_rev == 2
    for bad, why in (
        ("F_ior=8±1", "the torque is missing"), ("lost_motion=3", "the uncertainty is missing"),
        ("K_1=3±1", "no limit of this name"),
        ("F_ior@5=8±1", "no limit of this name"), ("lost_motion=x±1", "must be a number"),
        ("lost_motion=1,234±1", "number"), ("lost_motion=1.5±0,5", "number"),
        ("F_ior@4=-8±1", "cannot be below zero"),
    ):  # fmt: skip
        with pytest.raises(UsageError, match=why):
            stated_values([bad], drive)
    with pytest.raises(UsageError, match="twice"):
        stated_values(["F_ior@4=8±1"] * 2, drive)
    assert first not in told


def test_codes_are_explained_and_in_the_docs():
    page = (ROOT / "docs/accept.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `([A-Z_0-9]+)` \|", page, flags=re.MULTILINE)) == set(CODES)
    for item in CODES.values():
        assert item.words == item.words.strip() != ""
        sentences = (item.tests, item.wrong, item.change)
        assert len(set(sentences)) == 3
        assert all(re.fullmatch(r"\S.{20,}\.", text) for text in sentences)
    fields = {c.field for c in CHECKS}
    limits = set(type(tiny().acceptance).model_fields) - {"rule", "travel"}
    assert fields == limits
