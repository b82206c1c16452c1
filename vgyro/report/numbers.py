"""Numbers for people: as many digits as the uncertainty deserves."""

from __future__ import annotations

import math

MISSING = "—"
THIN_SPACE = "\u2009"
MOST_DECIMALS = 9
MINUS = "\u2212"


def significant(value: float, digits: int = 3) -> str:
    """A number with `digits` significant digits; powers of ten below 1e-4 and from 1e7 on. NaN gives a dash."""
    if not math.isfinite(value):
        return MISSING if math.isnan(value) else ("∞" if value > 0 else f"{MINUS}∞")
    if value == 0:
        return "0"
    magnitude = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if magnitude < -4 or magnitude >= 7:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return _signed(mantissa) + "·10" + _superscript(int(exponent))
    return _grouped(value, max(0, digits - 1 - magnitude))


def plain(value: float, digits: int = 6) -> str:
    """A number as one would write it: at most `digits` significant digits, no zeros at the end."""
    return _signed(f"{value:.{digits}g}") if math.isfinite(value) else MISSING


def rounded(value: float, decimals: int) -> str:
    """A number with a fixed count of decimals, so that a column lines up."""
    return _grouped(value, decimals) if math.isfinite(value) else MISSING


def with_interval(value: float, low: float, high: float) -> tuple[str, str]:
    """(value, interval), both to two significant digits of half the interval's width.

    Without an interval the value has three significant digits and the interval is empty.
    """
    if not math.isfinite(value):
        return MISSING, ""
    if not (math.isfinite(low) and math.isfinite(high)) or high <= low:
        return significant(value), ""
    step = math.floor(math.log10((high - low) / 2))
    decimals = 1 - step
    if decimals > MOST_DECIMALS or abs(value) >= 1e7:
        return significant(value), f"{significant(low)} … {significant(high)}"
    decimals = max(0, decimals)
    return _grouped(value, decimals), f"{_grouped(low, decimals)} … {_grouped(high, decimals)}"


def percent(share: float, digits: int = 3) -> str:
    """A share as a percentage; what is not quite all or nothing never reads as 100 % or 0 %."""
    if not math.isfinite(share):
        return MISSING
    text = f"{100 * share:.{digits}g}"
    if share < 1 and float(text) == 100:
        return f">{THIN_SPACE}99.9{THIN_SPACE}%"
    return f"{text}{THIN_SPACE}%"


def probability(p: float) -> str:
    """A p-value: two significant digits, "< 0.001" below that."""
    if not math.isfinite(p):
        return MISSING
    return "< 0.001" if p < 0.001 else f"{p:.2g}" if p < 0.995 else "1.0"


def duration(seconds: float) -> str:
    """A length of time in the unit that a person would choose."""
    if not math.isfinite(seconds):
        return MISSING
    if 0 < seconds < 0.1:
        return f"{significant(1000 * seconds)} ms"
    if seconds < 120:
        return f"{significant(seconds)} s"
    if seconds < 7200:
        return f"{significant(seconds / 60)} min"
    return f"{significant(seconds / 3600)} h"


def count(value: float) -> str:
    """A whole number, thousands apart."""
    return _grouped(value, 0)


def _grouped(value: float, decimals: int) -> str:
    text = f"{value:,.{decimals}f}".replace(",", THIN_SPACE)
    # A four-digit number reads better in one piece.
    if abs(value) < 9999.5:
        text = text.replace(THIN_SPACE, "")
    return _signed(text if text.strip("-0.") else text.removeprefix("-"))


def _signed(text: str) -> str:
    return text.replace("-", MINUS)


def _superscript(exponent: int) -> str:
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
