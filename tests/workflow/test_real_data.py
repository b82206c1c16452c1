"""Real recordings, from a manifest of config/examples to the page. Expected: what the boards' own data say.

Two axes and one definition of r_t, to be quick; the whole data sets run in the same way.
"""

import html
import json
import re

import pyarrow.parquet as pq
import pytest
import yaml

pytestmark = [pytest.mark.workflow, pytest.mark.timeout(1800)]

BOARD_Y = ["imu1_gy", "imu3_gy", "imu5_gy", "imu7_gy", "imu2_gx", "imu4_gx", "imu6_gx", "imu8_gx"]
BOARD_X = ["imu1_gx", "imu3_gx", "imu5_gx", "imu7_gx", "imu2_gy", "imu4_gy", "imu6_gy", "imu8_gy"]
QUICK = {"definitions": ["level"], "modes": ["causal"], "models": ["dcc"]}


def from_example(lab, root, name: str, folder: str, recordings: list[str], **changes) -> None:
    """Copy an example's manifest into raw/, point it at the files, keep some recordings."""
    manifest = yaml.safe_load((root / "config/examples" / name / "dataset.yaml").read_text(encoding="utf-8"))
    manifest["recordings"] = [entry for entry in manifest["recordings"] if entry["name"] in recordings]
    manifest["analysis"].setdefault("volatility", {}).update(QUICK)
    target = lab.folder / "raw" / name
    target.mkdir()
    text = yaml.safe_dump({**manifest, **changes, "folder": folder}, sort_keys=False)
    (target / "dataset.yaml").write_text(text, encoding="utf-8")


def sentences(lab, name: str) -> str:
    """The conclusions of a page, as text."""
    page = (lab.folder / f"reports/{name}.html").read_text(encoding="utf-8")
    section = re.search(r'<section[^>]*id="conclusions".*?</section>', page, flags=re.DOTALL)
    assert section is not None
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", " ", section.group(0))))


@pytest.fixture(scope="module")
def output(lab, root, shared_data) -> str:
    from_example(
        lab, root, "mimu4444", str(shared_data / "mimu4444-array"), ["exp_1", "exp_2"], gyros=[*BOARD_X, *BOARD_Y]
    )
    from_example(lab, root, "adis16405", str(shared_data / "adis16405-static"), ["rec2", "rec4"], gyros=["gyro_x"])
    config = lab.folder / "config/config.yaml"
    config.write_text("datasets: [mimu4444, adis16405]\n", encoding="utf-8")
    done = lab.run("--cores", "2")
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.mark.parametrize(("recording", "packets"), [("exp_1", 37439), ("exp_2", 39301)])
def test_every_packet_of_the_captures(lab, output: str, shared_data, recording: str, packets: int) -> None:
    record = json.loads((lab.folder / f"results/mimu4444/{recording}/integrity.json").read_text(encoding="utf-8"))
    assert (record["frames"]["good"], record["frames"]["lost"]) == (packets, 0), output
    # Every checksum holds: what is not a packet is the acknowledgement before the first and a cut one after the last.
    assert {entry["cause"] for entry in record["damage"]} <= {"leading bytes", "truncated at the end"}
    assert record["gaps"] == []
    frames = pq.read_table(lab.folder / f"results/mimu4444/{recording}/frames.parquet")
    beside = pq.read_table(shared_data / "mimu4444-array" / f"{recording}.parquet")
    for name in (column for column in beside.column_names if column.startswith("imu")):
        assert frames.column(name).to_numpy().tolist() == beside.column(name).to_numpy().tolist()


def test_the_bad_gyros_of_the_mimu_board_are_named(lab, output: str) -> None:
    text = sentences(lab, "mimu4444")
    bad = "".join(re.findall(r"Axis [xy]: \d of 8 gyros are bad[^→]*→", text))
    assert output
    for gyro in ("imu4_gy", "imu5_gy", "imu1_gx", "imu7_gx", "imu7_gy", "imu8_gx"):
        assert gyro in bad, text


def test_the_arch_effect_of_the_adis_is_drift_but_for_the_knock(lab, output: str) -> None:
    text = sentences(lab, "adis16405")
    assert output
    assert re.search(r"axis x, rec2\): drift: gyro_x\.", text), text
    assert re.search(r"axis x, rec4\): drift \+ disturbance: gyro_x\.", text), text
