"""Orbit Ephemeris Messages in XML: CCSDS 505.0-B."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

from relnav_sim.recorded.oem import METADATA, VERSION_KEY, Entry, Rows, check_version, read_metadata
from relnav_sim.recorded.segment import Place, Segment

_POSITION, _VELOCITY = ("X", "Y", "Z"), ("X_DOT", "Y_DOT", "Z_DOT")
_ACCELERATION = ("X_DDOT", "Y_DDOT", "Z_DDOT")
_UNITS = {
    **dict.fromkeys(_POSITION, "km"),
    **dict.fromkeys(_VELOCITY, "km/s"),
    **dict.fromkeys(_ACCELERATION, "km/s**2"),
}
_DEEPEST = 20


@dataclass
class _Element:
    tag: str
    place: Place
    attributes: dict[str, str]
    children: list[_Element] = field(default_factory=list)
    text: str = ""

    def named(self, tag: str) -> Iterator[_Element]:
        return (child for child in self.children if child.tag == tag)

    def only(self, tag: str) -> _Element:
        """Return the child of a name.

        Raises:
            EphemerisError: There is none, or more than one.
        """
        found = list(self.named(tag))
        if len(found) != 1:
            place = found[1].place if found else self.place
            raise place.error(f"<{self.tag}> must hold one <{tag}>; here {'is a second' if found else 'is none'}")
        return found[0]


def read_oem_xml(text: str, path: str) -> list[Segment]:
    """Return the segments of an OEM in XML; covariance is left out.

    Args:
        text: The file's text.
        path: Its path, for errors.

    Raises:
        EphemerisError: The file is no OEM, or about what relnav does not read.
    """
    root = _tree(text, path)
    oem = root.only("oem") if root.tag == "ndm" else root
    if oem.tag != "oem" or oem.attributes.get("id", VERSION_KEY) != VERSION_KEY:
        raise oem.place.error(f"<{oem.tag}> is no orbit ephemeris message, which begins with <oem id={VERSION_KEY!r}>")
    check_version(oem.attributes.get("version", "that is not given"), oem.place)
    segments = [_segment(each) for each in oem.only("body").named("segment")]
    if not segments:
        raise oem.place.error("the message holds no segment")
    return segments


def _segment(element: _Element) -> Segment:
    entries: dict[str, Entry] = {}
    metadata = element.only("metadata")
    for child in metadata.children:
        if child.tag == "COMMENT":
            continue
        if child.tag not in METADATA:
            raise child.place.error(f"<{child.tag}> is no keyword of the metadata")
        if child.tag in entries:
            raise child.place.error(f"<{child.tag}> stands here a second time")
        if not child.text.strip():
            raise child.place.error(f"<{child.tag}> has no value")
        entries[child.tag] = child.text.strip(), child.place
    rows = Rows(read_metadata(entries, metadata.place))
    for child in element.only("data").children:
        if child.tag == "stateVector":
            accelerated = any(child.named(_ACCELERATION[0]))
            rows.add(
                child.place,
                child.only("EPOCH").text.strip(),
                [_value(child, name) for name in _POSITION + _VELOCITY],
                [_value(child, name) for name in _ACCELERATION] if accelerated else [],
            )
        elif child.tag not in ("COMMENT", "covarianceMatrix"):
            raise child.place.error(f"<{child.tag}> stands where <stateVector> or <covarianceMatrix> should")
    return rows.segment(element.place)


def _value(state: _Element, name: str) -> str:
    element = state.only(name)
    units = element.attributes.get("units", _UNITS[name])
    if units != _UNITS[name]:
        raise element.place.error(f"{name} is in {units!r}; it must be in {_UNITS[name]}")
    return element.text.strip()


def _tree(text: str, path: str) -> _Element:
    """Return the root of a document, with the line of each element.

    Raises:
        EphemerisError: The text is no XML, or declares a document type, which no message needs and which can make a
            small file huge.
    """
    parser = expat.ParserCreate()
    top = _Element("", Place(path, 1), {})
    open_elements = [top]

    def begin(tag: str, attributes: dict[str, str]) -> None:
        place = Place(path, parser.CurrentLineNumber)
        if len(open_elements) > _DEEPEST:
            raise place.error("the elements are nested deeper than those of any message")
        element = _Element(tag.rpartition(":")[2], place, attributes)
        open_elements[-1].children.append(element)
        open_elements.append(element)

    def end(_: str) -> None:
        open_elements.pop()

    def data(text: str) -> None:
        open_elements[-1].text += text

    def doctype(*_: object) -> None:
        raise Place(path, parser.CurrentLineNumber).error("a document type is declared; leave it out")

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = data, doctype
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise Place(path, error.lineno).error(f"the file is no XML: {expat.ErrorString(error.code)}") from None
    return top.children[0]
