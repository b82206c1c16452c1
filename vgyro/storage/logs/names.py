"""What the names and units of a log's columns say: words, axes, units, and the kind of quantity."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from typing import Literal

from vgyro.log import RateUnit

Kind = Literal[
    "time", "gyro", "temperature", "id", "counter", "acceleration", "magnetic field", "pressure", "angle", "text",
    "other",
]  # fmt: skip

RATE_UNITS: dict[str, RateUnit] = {
    **dict.fromkeys(("deg/s", "°/s", "dps", "degree/s", "degrees/s", "degps", "degs", "grad/s", "deg_s"), "deg/s"),
    **dict.fromkeys(("rad/s", "rads", "radps", "rps", "rad_s", "radian/s", "radians/s"), "rad/s"),
    **dict.fromkeys(("mdps", "mdeg/s", "m°/s"), "mdps"),
    **dict.fromkeys(("deg/h", "°/h", "deg/hr", "dph", "deg_h"), "deg/h"),
}
"""Units as `plain_unit` writes them."""
UNITS: dict[str, Kind] = {
    **dict.fromkeys(("g", "mg", "m/s2", "mps2", "m/s/s", "gs"), "acceleration"),
    **dict.fromkeys(("ut", "µt", "nt", "mt", "t", "gauss", "mgauss", "mga"), "magnetic field"),
    **dict.fromkeys(("pa", "hpa", "kpa", "mbar", "bar"), "pressure"),
    **dict.fromkeys(("c", "°c", "degc", "celsius"), "temperature"),
    **dict.fromkeys(("deg", "°", "rad"), "angle"),
    **dict.fromkeys(("rad/s2", "deg/s2", "°/s2", "m/s", "m", "hz", "v", "mv", "k", "km/h"), "other"),
}
NEVER = re.compile(
    r"covariance|variance|std ?dev|sigma|bias|clip|error|status|device|calibration|integral|derivative|setpoint"
    r"|absolute|magnitude|\bnorm\b|\b(sampl\w*|frame|baud|data|heart|update|output) rate|\bdt\b|\bodr\b"
)
"""In a name that is no reading of a sensor."""
TIMES = re.compile(
    r"time\w*|timestamps?|stamp|zeit(stempel)?|uhrzeit|temps|tiempo|tempo|datetime|epoch|seconds|elapsed"
)
TEMPERATURES = re.compile(r"te?mp\d*|temperatur[aeo]?\d*|therm(o|ometer|istor)?\d*|degc")
TURNING = r"(ang(le|ular)?|rot(ation(al)?)?|roll|pitch|yaw|turn|body|winkel|dreh)"
SENSORS: dict[Kind, tuple[str, ...]] = {
    "gyro": (
        r"[xyz]?(gyros?|gyr|gyroscopes?|gyroskop|giroscopio|gyroscopio|gyrometer)[a-z]?\d*", r"gy[xyz]?\d*",
        r"om[xyz]\d*", r"omega[a-z]?\d*", rf"{TURNING} ?(rates?|vel|velocity|speed|geschwindigkeit)\d*", "w rs",
        r"drehrate\w?", r"winkelgeschw\w*", "(vitesse|velocidad|velocita) (angulaire|angular|angolare)",
    ),
    "acceleration": (
        r"[xyz]?(acc|acce|accel|accelero|acceleration|accelerometer|accelerometre)[a-z]?\d*", r"ac[xyz]?\d*",
        r"beschl\w*", r"acc?eler\w*", "linear", "gravity", "gforce", "force", "g ?f[xyz]?", r"(l|f)?a[xyz]\d*", "dv",
        "a rs", "^a [xyz]", "(?<=imu )a [xyz]", "lin acc",
    ),
    "magnetic field": (
        r"[xyz]?(mag|magn|magneto|magnetic|magnetometer|compass)[a-z]?\d*", r"magnet\w*", r"m[xyz]\d*", "^m [xyz]",
    ),
    "pressure": ("press?", r"pressure\d*", "baro(meter)?", "alt(itude)?", "druck", "pression", "presion", "humidity"),
    "angle": (
        r"quat\w*", "q[0-3wxyz]", "orientation", "ori", "euler", "attitude", "roll", "pitch", "yaw", "heading",
        "azimuth", "angle[xyz]?", "winkel", "mat", "matrix", "dcm", "rotvec", "rotation vector", "tilt",
    ),
}  # fmt: skip
"""Of several the one that ends last tells; of those that end together, the first: angular velocity is no angle."""
FORMS = {kind: re.compile(rf"\b(?:{'|'.join(forms)})\b") for kind, forms in SENSORS.items()}
OTHERS = re.compile(
    r"vel(ocity)?|speed|pos(ition)?|lat(itude)?|lon(gitude)?|hdop|volts?|voltage|current|amps?|battery|vbat|power"
    r"|rssi|lux|light|steps|distance|range|rpm|motor|servo|throttle|pwm"
)
"""Words of quantities that are none of a gyro, where no word of a sensor stands beside them."""
SHORT: tuple[tuple[Kind, str], ...] = (
    ("acceleration", r"a\d*"),
    ("magnetic field", r"m\d*"),
    ("pressure", r"p\d*"),
    ("temperature", r"t\d+"),
    ("angle", r"q"),
    ("id", r"id|sensor|sensorid|ch|chan|channel|dev|addr|address|node|unit|imu|index|instance"),
    (
        "counter",
        r"n|no|nr|num|number|count|counter|cnt|seq|sequence|index|idx|i|k|samples?|frame|packet|row|line",
    ),
    ("time", r"t|ts|s|sec|secs|ms|msec|millis|us|usec|micros|ns|nsec|utc|tow|clock|uptime|ticks?|date"),
    ("gyro", r"g([xyz]\d*|\d+)|w([xyz]\d*|\d+)|r[xyz]\d*|rates?\w?\d*|rot(ation)?\w?\d*"),
)
"""Words that say little; each holds where the values allow it."""
WHOLE: dict[str, Kind] = {"g": "gyro", "w": "gyro"}
"""Names that say so as a whole: in "x_g" the g is a unit."""
ANGLES = {"roll": "x", "pitch": "y", "yaw": "z", "p": "x", "q": "y", "r": "z"}
AXIS = re.compile(r"(?:g|w|om|r|ar|gy|gyro|gyr|rate|omega|rot|vel|velocity)?([xyz])\d*")
ALIKE = str.maketrans("ºμ⁻¹²", "°µ-12")
LEADING_AXIS = re.compile(r"([xyz])(?:gyro|gyr|gyroscope)")


def words_of(name: str) -> list[str]:
    """Words of a name in lower case, without accents and what stands in brackets.

    "GyroA (deg/s)" → gyro, a;  "imu1_gx" → imu1, gx;  "rotationRateX" → rotation, rate, x.
    """
    bare = re.sub(r"[(\[{][^)\]}]*[)\]}]", " ", name).replace("°", " ")
    bare = "".join(sign for sign in unicodedata.normalize("NFKD", bare) if not unicodedata.combining(sign))
    bare = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z]{2})", " ", bare)
    return [word for word in re.split(r"[\W_]+", bare.lower()) if word]


def bare_name(name: str) -> str:
    """A column's name without a unit in brackets."""
    return re.sub(r"\s*(\([^)]*\)|\[[^\]]*[^\]\d][^\]]*\])\s*$", "", name) or name


def plain_unit(unit: str) -> str:
    """A unit in one way of writing: "rad s^-1", "rad/sec", "rad·s⁻¹" → rad/s; "m/s²", "m s-2" → m/s2."""
    text = unit.strip().lower().translate(ALIKE)
    text = re.sub(r"\^|\*\*", "", text)
    text = re.sub(r"(?<=[a-z°])[\s·.*]*(?:per|/)[\s]*s(?:ec(?:onds?)?)?\b", "/s", text)
    text = re.sub(r"(?<=[a-z°])[\s·.*]*/\s*sec(?:ond)?2\b", "/s2", text)
    text = re.sub(r"(?<=[a-z°])[\s·.*]+s(?:ec)?-([12])\b", lambda found: "/s" + found[1].replace("1", ""), text)
    text = re.sub(r"\bms-2\b", "m/s2", text)
    return text.replace("deg c", "degc").replace(" ", "")


def unit_in(name: str, unit: str) -> str:
    """The unit of a column in one way of writing: as the log has it, else the last word of its name if that is one."""
    if unit.strip():
        return plain_unit(unit)
    parts = name.split()
    last = plain_unit(parts[-1]) if len(parts) > 1 else ""
    return last if "/" in last or last in RATE_UNITS else ""


def sensor_of(words: Sequence[str]) -> Kind | None:
    """The kind of sensor that words name beyond doubt; None where they do not."""
    text = " ".join(words)
    if NEVER.search(text):
        return "other"
    if any(TEMPERATURES.fullmatch(word) for word in words):
        return "temperature"
    best: tuple[int, Kind] | None = None
    for kind, form in FORMS.items():
        end = max((found.end() for found in form.finditer(text)), default=0)
        if end and (best is None or end > best[0]):
            best = end, kind
    if best is not None:
        return best[1]
    return "other" if any(OTHERS.fullmatch(word) for word in words) else None


def short_kinds(words: Sequence[str]) -> list[Kind]:
    """Kinds that short words may mean, the likeliest first: later words say more, imu1_gx is a gyro of imu1."""
    if len(words) == 1 and words[0] in WHOLE:
        return [WHOLE[words[0]]]
    found: list[Kind] = ["gyro"] if re.search(r"\b[gw] [xyz]\b", " ".join(words)) else []
    return found + [kind for word in reversed(words) for kind, form in SHORT if re.fullmatch(form, word)]


def says_time(words: Sequence[str]) -> bool:
    """Does a name say that the column is a time?"""
    return any(TIMES.fullmatch(word) for word in words)


def is_called_time(name: str) -> bool:
    """Is a column called a time, by a word that may be short?"""
    words = words_of(name)
    return says_time(words) or "time" in short_kinds(words)


def axis_of(name: str) -> str:
    """x, y or z where the name says so or has an index 0, 1, 2; else z: gyros without an axis are one array."""
    index = re.search(r"\[([012])\]$", name)
    if index:
        return "xyz"[int(index.group(1))]
    words = words_of(name)
    for word in reversed(words):
        if match := AXIS.fullmatch(word) or LEADING_AXIS.fullmatch(word):
            return match.group(1)
    return next((ANGLES[word] for word in words if word in ANGLES), "z")
