"""OEM in XML: the same orbit as in keyword = value notation, and refusals with their line."""

from pathlib import Path

import numpy as np
import oem
import pytest
from orbit_files import EPOCH, calendar, circular

from relnav_sim import EphemerisError, load_ephemeris

TIMES = np.arange(0.0, 600.0, 60.0)
STATES = circular(TIMES)
NAMES = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")


def document() -> str:
    """Return an OEM; its metadata begin on line 9, the state at 0 s on line 21, each on a line of its own."""
    times = calendar(TIMES)
    metadata = {
        "OBJECT_NAME": "ONE",
        "OBJECT_ID": "2021-001A",
        "CENTER_NAME": "EARTH",
        "REF_FRAME": "EME2000",
        "TIME_SYSTEM": "UTC",
        "START_TIME": times[0],
        "STOP_TIME": times[-1],
        "INTERPOLATION": "HERMITE",
        "INTERPOLATION_DEGREE": "5",
    }
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<oem id="CCSDS_OEM_VERS" version="2.0">',
        "<header>",
        "<CREATION_DATE>2021-07-10T16:00:00</CREATION_DATE><ORIGINATOR>TEST</ORIGINATOR>",
        "</header>",
        "<body>",
        "<segment>",
        "<metadata>",
        *(f"<{key}>{value}</{key}>" for key, value in metadata.items()),
        "</metadata>",
        "<data>",
        "<COMMENT>between</COMMENT>",
    ]
    for time, state in zip(times, STATES / 1e3, strict=True):
        values = "".join(f"<{name}>{value!r}</{name}>" for name, value in zip(NAMES, state.tolist(), strict=True))
        lines.append(f"<stateVector><EPOCH>{time}</EPOCH>{values}</stateVector>")
    lines += ["<covarianceMatrix><EPOCH>2021-07-10T16:00:00</EPOCH></covarianceMatrix>"]
    return "\n".join([*lines, "</data>", "</segment>", "</body>", "</oem>", ""])


def refusal(folder: Path, text: str) -> str:
    (folder / "a.xml").write_text(text, encoding="utf-8")
    with pytest.raises(EphemerisError) as caught:
        load_ephemeris(folder / "a.xml")
    return str(caught.value).removeprefix(f"{folder}/")


def test_rows_are_those_that_the_oem_package_reads(tmp_path: Path) -> None:
    text = document()
    path = tmp_path / "a.xml"
    path.write_text(text, encoding="utf-8")
    found = load_ephemeris(path)
    np.testing.assert_allclose(found.states, STATES, rtol=1e-15)
    assert (found.epoch, found.spans[0].interpolation.degree) == (EPOCH, 5)
    path.write_text(text.replace("<covarianceMatrix><EPOCH>2021-07-10T16:00:00</EPOCH></covarianceMatrix>\n", ""))
    peer = oem.OrbitEphemerisMessage.open(path)
    np.testing.assert_allclose(
        np.array([[*state.position, *state.velocity] for state in peer.states]) * 1e3, found.states, rtol=1e-15
    )


def test_units_accelerations_and_a_surrounding_ndm_are_read(tmp_path: Path) -> None:
    text = document().replace("<X>", '<X units="km">').replace("<Z_DOT>", '<Z_DOT units="km/s">')
    more = "</Z_DOT><X_DDOT>1</X_DDOT><Y_DDOT>1</Y_DDOT><Z_DDOT>1</Z_DDOT>"
    text = text.replace("</Z_DOT>", more).replace("<oem", "<ndm><oem").replace("</oem>", "</oem></ndm>")
    (tmp_path / "a.xml").write_text(text, encoding="utf-8")
    np.testing.assert_allclose(load_ephemeris(tmp_path / "a.xml").states, STATES, rtol=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("EARTH", "MARS", "a.xml:11: CENTER_NAME is MARS; relnav reads orbits about the EARTH only"),
        ("EME2000", "TEME", "a.xml:12: the frame 'TEME' is not read"),
        ('version="2.0"', 'version="5.0"', "a.xml:2: the version 5.0 is not read"),
        (' version="2.0"', "", "a.xml:2: the version that is not given is not read"),
        ("CCSDS_OEM_VERS", "CCSDS_OPM_VERS", "a.xml:2: <oem> is no orbit ephemeris message"),
        ("<TIME_SYSTEM>UTC</TIME_SYSTEM>\n", "", "a.xml:8: the metadata end here without TIME_SYSTEM"),
        ("OBJECT_ID>", "OBJECT_IDENT>", "a.xml:10: <OBJECT_IDENT> is no keyword of the metadata"),
        ("<Y_DOT>", '<Y_DOT units="m/s">', "a.xml:21: Y_DOT is in 'm/s'; it must be in km/s"),
        ("<Y>", "<Y>1</Y><Y>", "a.xml:21: <stateVector> must hold one <Y>; here is a second"),
        ("Y_DOT>", "Y_DDOT>", "a.xml:21: <stateVector> must hold one <Y_DOT>; here is none"),
        ("2021-07-10T16:02:00<", "2021-07-10T16:01:00<", "a.xml:23: the epoch 2021-07-10T16:01:00 is the same as"),
        ("</segment>", "", "a.xml:34: the file is no XML: mismatched tag"),
        ("stateVector>", "state>", "a.xml:21: <state> stands where <stateVector>"),
        ("<oem", "<!DOCTYPE oem [<!ENTITY a 'b'>]><oem", "a.xml:2: a document type is declared; leave it out"),
    ],
)
def test_what_is_wrong_is_refused_with_its_line(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    text = document()
    assert old in text
    count = 2 if old.endswith(">") and not old.startswith("<") else 1
    assert refusal(tmp_path, text.replace(old, new, count)).startswith(sentence)
