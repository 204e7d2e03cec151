"""Files of two-line element sets, with or without a line with the name above each."""

from __future__ import annotations

from relnav_sim.near_names import nearest
from relnav_sim.wording import first_of


def set_in(text: str, wanted: str | None, path: str) -> tuple[str, str]:
    """Return the two lines of one set of a file.

    Args:
        text: The file's text.
        wanted: The name above the lines, or the catalogue number; None: the only set.
        path: The file's path, for errors.

    Raises:
        ValueError: There is no such set, or more than one; says the line where one is to blame.
    """
    lines = [(number, line.rstrip()) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    sets: list[tuple[str, tuple[str, str]]] = []
    name = ""
    while lines:
        number, line = lines.pop(0)
        if not line.startswith("1 "):
            name = line.removeprefix("0 ").strip()
            if not lines or not lines[0][1].startswith("1 "):
                raise ValueError(f"{path}:{number}: line 1 of a two-line element set should follow this line")
            continue
        if not lines or not lines[0][1].startswith("2 "):
            raise ValueError(f"{path}:{number}: line 2 of the two-line element set should follow this line")
        sets.append((name, (line, lines.pop(0)[1])))
        name = ""
    if not sets:
        raise ValueError(f"{path}:1: holds no two-line element set")
    fitting = [both for name, both in sets if wanted is None or _is(wanted, name, both[0])]
    if len(fitting) == 1:
        return fitting[0]
    names = [name or both[0][2:7].strip() for name, both in sets]
    if fitting:
        which = " of this name; give the catalogue number as name" if wanted else f"; give name: {first_of(names)}"
        raise ValueError(f"{path} holds {len(fitting)} two-line element sets{which}")
    near = nearest(wanted or "", names)
    raise ValueError(
        f"{path} holds no two-line element set named {wanted!r}"
        + (f"; did you mean {near!r}?" if near else f"; there are {first_of(names)}")
    )


def _is(wanted: str, name: str, first: str) -> bool:
    return wanted in (name, first[2:7].strip())
