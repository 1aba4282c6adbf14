"""Numbers in texts: ASCII digits with a decimal point, in every option that takes them inside a text."""

from collections.abc import Callable
from math import inf, isnan

import pytest

from hdassist.features.acceptance.limits import LimitText
from hdassist.features.measuring.orders import parse_orders, parse_stated
from hdassist.features.mounting.posterior import read_trial
from hdassist.interface.terminal.options import degrees_or_fit
from hdassist.run.errors import UsageError
from hdassist.run.files import number_of

READERS: dict[str, tuple[Callable[[str], object], str]] = {
    "hole of a trial": (lambda text: read_trial(f"h{text}=20", 12), "4"),
    "value of a trial": (lambda text: read_trial(f"h4={text}", 12), "20"),
    "budget": (lambda text: parse_stated([f"encoder={text}"]), "1"),
    "orders": (parse_orders, "4"),
    "limit": (lambda text: LimitText.parse(f"order_{text}=30", "--limit"), "2"),
    "angle": (lambda text: degrees_or_fit("--cam-zero", text), "30"),
}


@pytest.mark.parametrize(("read", "good"), READERS.values(), ids=READERS)
def test_underscores_and_digits_of_other_scripts_are_refused(read: Callable[[str], object], good: str) -> None:
    read(good)
    for text in (f"{good}_0", "٤", "４", f"{good[0]}٠"):
        with pytest.raises(UsageError):
            read(text)


def test_plainly_written_number_is_read_as_python_reads_it() -> None:
    for text in ("4", "-2.5", "+.5", "1e3", " 7 ", "1.E-2"):
        assert number_of(text) == float(text)
    assert number_of("1e999") == inf
    for text in ("", "1_0", "٤", "nan", "inf", "0x1", "1,5", "1e", "--1"):
        assert isnan(number_of(text))
