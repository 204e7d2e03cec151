"""The pages of the documents, and what a reader can run on them.

A fence ```python, ```sh or ```yaml is a snippet. An HTML comment right before it says what its text alone does not:

    <!-- run by: tests/... -->     a test of its own runs it, in the surroundings that it needs
    <!-- not run: reason -->       it can't be run here; commands are still checked against the command line
    <!-- in: FILE PATH -->         YAML that stands at PATH of the campaign FILE; default: the demo, at its top
    <!-- given: code -->           Python that the snippet takes as given

Everything else in a fence without language, or indented, is output, a formula or a drawing.
"""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
MARK = re.compile(r"<!-- (run by|not run|in|given): (.*?) -->", re.DOTALL)
SNIPPETS = ("python", "sh", "yaml")


@dataclass(frozen=True)
class Block:
    """A fence or an indented block of a page; `language` is "" where it has none."""

    page: Path
    line: int
    language: str
    text: str
    marks: dict[str, str]

    @property
    def name(self):
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks(page):
    lines = page.read_text(encoding="utf-8").split("\n")
    found, k = [], 0
    while k < len(lines):
        fence = re.match(r"( *)(```+)(\w*)", lines[k])
        if fence:
            indent, ticks, language = fence.groups()
            end = next(j for j in range(k + 1, len(lines)) if lines[j].strip() == ticks)
            text = "\n".join(line.removeprefix(indent) for line in lines[k + 1 : end])
            found.append(Block(page, k + 1, language, text, _marks(lines[:k])))
            k = end
        elif re.match(r" {4}\S", lines[k]) and k and not lines[k - 1].strip() and not _in_list(lines[:k]):
            end = next(
                (j for j in range(k, len(lines)) if lines[j].strip() and not lines[j].startswith("    ")), len(lines)
            )
            text = "\n".join(line[4:] for line in lines[k:end])
            found.append(Block(page, k + 1, "", text.rstrip(), _marks(lines[:k])))
            k = end - 1
        k += 1
    return found


def snippets(*languages):
    return [block for page in PAGES for block in blocks(page) if block.language in languages]


def _marks(before):
    """The comment that ends right before a block, blank lines aside."""
    text = "\n".join(before).rstrip()
    comments = []
    while text.endswith("-->"):
        start = text.rindex("<!--")
        comments.append(text[start:])
        text = text[:start].rstrip()
    return {kind: words.strip() for comment in comments for kind, words in MARK.findall(comment)}


def _in_list(before):
    """Whether an indented line continues an item of a list."""
    for line in reversed(before):
        if line.strip() and not line.startswith(" "):
            return bool(re.match(r"[-*] |\d+\. |:::", line))
    return False


def anchors(page):
    """What a link can lead to on a page: the slug of each heading, and ids that stand in the text."""
    text = page.read_text(encoding="utf-8")
    ids = set(re.findall(r'id="([^"]+)"', text))
    outside = re.sub(r"^( *)(```+).*?^\1\2\s*$", "", text, flags=re.DOTALL | re.MULTILINE)
    for heading in re.findall(r"^#+ +(.*)$", outside, re.MULTILINE):
        slug = re.sub(r"[^\w\- ]", "", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower())
        ids.add(slug.replace(" ", "-"))
    return ids
