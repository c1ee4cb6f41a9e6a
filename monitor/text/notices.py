"""Text of a notice, and its customisation by a site."""

from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

NoticeKind = Literal["alarm", "update", "recovery", "acknowledged", "flapping", "trouble", "trend"]

DEFAULT_TEMPLATE = """\
{% for notice in notices %}{{ notice.site }}, {{ notice.utc }}: {{ notice.text }}
{% endfor %}{% if others %}and {{ others }} others, which the history has
{% endif %}"""
_MAX = 200  # notices in one message
_LONGEST = 3000  # characters of its text: chat servers refuse more


@dataclass(frozen=True, kw_only=True)
class Notice:
    """Information for a person."""

    kind: NoticeKind | Literal["heartbeat"]
    site: str
    time: int  #: [ns UTC]
    utc: str  #: the same in words
    state: str  #: state of the alarm
    text: str
    alarm: int | None = None  #: when its alarm was raised [ns UTC]: the same in all notices of one alarm

    def values(self) -> dict[str, Any]:
        """Return JSON values."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class Message:
    """Notices that are sent together."""

    notices: list[Notice]  #: notices in the order of time
    text: str

    @property
    def foremost(self) -> Notice:
        """The notice whose fields are the message's: a reader of one alone must see the alarm."""
        return foremost(self.notices)


def foremost(notices: list[Notice]) -> Notice:
    """Return the last that changes the alarm; without one the last update, then the last trend, then the last."""
    for passed_over in (("trouble", "trend", "update"), ("trouble", "trend"), ("trouble",), ()):
        left = [notice for notice in notices if notice.kind not in passed_over]
        if left:
            return left[-1]
    raise ValueError("notices: expected at least one")


def message(notices: list[Notice], template: str | None = None, others: int = 0) -> Message:
    """Return notices as a text of accepted length; beyond that, problems are only counted, oldest first.

    A template that fails is replaced by the built-in text: untested cases may occur after years.

    Parameters
    ----------
    notices : in the order of time
    template : of the site
    others : notices in addition to these that were not kept
    """
    most = _MAX
    while True:
        numbers = sorted(range(len(notices)), key=lambda i: (notices[i].kind == "trouble", -i))[:most]
        shown = [notices[i] for i in sorted(numbers)]  # the newest, troubles only where there is room for them
        left_out = others + len(notices) - len(shown)
        text = _rendered(shown, template, left_out)
        if len(text) <= _LONGEST or len(shown) == 1:
            return Message(notices=shown, text=text)
        most = len(shown) // 2


def _rendered(notices: list[Notice], template: str | None, others: int) -> str:
    from monitor.text.notice_template import TemplateFailure  # slow to import, as the others inside functions

    try:
        return render(notices, template, others)
    except TemplateFailure as error:
        return f"{render(notices, None, others)}\n(the site's own template has failed: {error})"


def render(notices: list[Notice], template: str | None = None, others: int = 0) -> str:
    """Return the text of notices; templates have `notices`, the foremost as `notice`, and `others`, a number.

    Raises
    ------
    TemplateFailure
        If the template uses undefined names, or more time, memory or output than permitted.
    """
    from monitor.text.notice_template import render_bounded, render_trusted

    context = _context(notices, others)
    if template is None:
        return render_trusted(DEFAULT_TEMPLATE, context).strip()
    return render_bounded(template, [context])[0].strip()


def _context(notices: list[Notice], others: int) -> dict[str, Any]:
    """Return the variables of templates, as JSON values."""
    return {
        "notices": [notice.values() for notice in notices],
        "notice": foremost(notices).values(),
        "others": others,
    }


def check_template(template: str) -> None:
    """Refuse a template that would fail when it is needed, whatever kind of notice it is for.

    Raises
    ------
    ValueError
        Naming the fault.
    """
    from monitor.text.notice_template import TemplateFailure, render_bounded

    kinds: tuple[NoticeKind, ...] = get_args(NoticeKind)
    notices = [Notice(kind=kind, site="site", time=0, utc="then", state="alarm", text="so") for kind in kinds]
    try:
        render_bounded(template, [_context([notice], 0) for notice in notices], checked=True)
    except TemplateFailure as error:
        raise ValueError(f"expected a jinja2 template of `notices` and `notice`: {error}") from error
