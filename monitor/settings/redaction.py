"""Masking of secrets in addresses, headers, arguments and texts.

Host names are no secrets: name servers and TLS handshakes carry them in the clear.
"""

import hashlib
import re
from collections.abc import Iterable, Iterator
from urllib.parse import parse_qsl, unquote, urlsplit

from pydantic import SecretStr

MASK = "***"
_SHORTEST = 4  # characters of a secret that is masked inside a text: shorter ones are parts of common words
_PLAIN_TOPIC = re.compile(r"redacted-[0-9a-f]{8}")


def revealed(secret: SecretStr | None) -> str:
    """Return the value of a secret, to be used and never shown; empty if there is none."""
    return "" if secret is None else secret.get_secret_value()


def shown_address(url: str) -> str:
    """Return scheme, host and port of an address."""
    try:
        place = urlsplit(url)
        host, port = place.hostname or "", place.port
    except ValueError:
        return MASK
    host = f"[{host}]" if ":" in host else host
    return f"{place.scheme}://{host}" + (f":{port}" if port else "")


def redacted_topic(url: str) -> str:
    """Return an MQTT address without user and password, its topic replaced by a digest.

    Two topics of one broker stay different, so that another thermometer is noticed. The function leaves its own result
    as it is.
    """
    try:
        topic = urlsplit(url).path.strip("/")
    except ValueError:
        return MASK
    if not _PLAIN_TOPIC.fullmatch(topic):
        topic = f"redacted-{hashlib.sha256(topic.encode()).hexdigest()[:8]}"
    return f"{shown_address(url)}/{topic}"


def secrets_of_address(url: str) -> Iterator[str]:
    """Yield possible secrets in an address: itself, user, password, path, and values of its query."""
    yield url
    try:
        place = urlsplit(url)
        yield from (place.netloc.rpartition("@")[0], place.username or "", place.password or "")
    except ValueError:
        return
    yield from (place.path, *place.path.split("/"), place.query, place.fragment)
    yield from (value for _, value in parse_qsl(place.query))


def masked(text: str, secrets: Iterable[str]) -> str:
    """Return a text in which every secret, also in its decoded or escaped form, is replaced by `***`."""
    forms = {form for secret in secrets for form in (secret, unquote(secret), repr(secret)[1:-1])}
    for form in sorted(forms, key=len, reverse=True):
        if len(form.strip("/")) >= _SHORTEST:
            text = text.replace(form, MASK)
    return text
