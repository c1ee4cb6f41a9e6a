"""What a notice says, and how a site may say it otherwise."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

from jinja2 import StrictUndefined, TemplateError
from jinja2.sandbox import SandboxedEnvironment

NoticeKind = Literal["alarm", "update", "recovery", "acknowledged", "flapping", "trouble"]

DEFAULT_TEMPLATE = """\
{% for notice in notices %}{{ notice.site }}, {{ notice.utc }}: {{ notice.text }}
{% endfor %}"""
_ENVIRONMENT = SandboxedEnvironment(undefined=StrictUndefined, autoescape=False, keep_trailing_newline=True)


@dataclass(frozen=True, kw_only=True)
class Notice:
    """Something a person may want to be told."""

    kind: NoticeKind | Literal["heartbeat"]
    site: str
    time: int  #: [ns UTC]
    utc: str  #: the same in words
    state: str  #: of the alarm
    text: str
    alarm: int | None = None  #: when its alarm was raised [ns UTC]: the same in all notices of one alarm

    def values(self) -> dict[str, Any]:
        """Return JSON values."""
        return asdict(self)


def render(notices: list[Notice], template: str | None = None) -> str:
    """Return the text that tells notices, in the order of time; templates see `notices` and the last one as `notice`.

    Raises
    ------
    TemplateError
        If the template asks for what there is not.
    """
    made = _ENVIRONMENT.from_string(template or DEFAULT_TEMPLATE)
    return made.render(notices=notices, notice=notices[-1]).strip()


def check_template(template: str) -> None:
    """Refuse a template that would fail when it is needed.

    Raises
    ------
    ValueError
        Naming what is wrong with it.
    """
    notice = Notice(kind="alarm", site="site", time=0, utc="then", state="alarm", text="so")
    try:
        render([notice], template)
    except (TemplateError, TypeError, ValueError, ArithmeticError) as error:
        raise ValueError(f"expected a jinja2 template of `notices` and `notice`: {error}") from error
