"""Cards of Nastran's bulk data: free fields, or fields of 8 or 16 columns."""

from collections.abc import Iterator, Sequence


def bulk_cards(lines: Sequence[str]) -> Iterator[list[str]]:
    """Yield the fields of each card of the bulk data, continuations joined."""
    card: list[str] = []
    for line in (line.partition("$")[0].rstrip() for line in lines):
        if not line:
            continue
        fields = _fields(line)
        continued = not fields[0] or fields[0][0] in "+*"
        if continued and card:
            card += fields[1:]
            continue
        if card:
            yield card
        card = [fields[0].rstrip("*").upper(), *fields[1:]]
    if card:
        yield card


def _fields(line: str) -> list[str]:
    """Return the name of a card and its fields, without that of the continuation."""
    if "," in line:
        words = [word.strip() for word in line.split(",")]
        count = 5 if "*" in words[0] else 9
        return [*words, *[""] * count][:count]
    line = line.expandtabs()
    wide = "*" in line[:8]
    size, count = (16, 4) if wide else (8, 8)
    own = [line[8 + size * k : 8 + size * (k + 1)].strip() for k in range(count)]
    return [line[:8].strip(), *own]


def nastran_number(word: str) -> str:
    """Return a number such as 1.5-3 with the exponent's letter."""
    text = word.upper().replace("D", "E") or "0"
    for sign in "+-":
        head, found, tail = text[1:].rpartition(sign)
        if found and head and head[-1] != "E" and tail.isdecimal():
            return f"{text[0]}{head}E{sign}{tail}"
    return text
