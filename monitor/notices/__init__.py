"""Who is told of what: webhooks, commands and MQTT, with what cannot be delivered kept on disk."""

from monitor.notices.courier import Courier
from monitor.notices.news import News
from monitor.notices.senders import NoticeError, make_sender

__all__ = ["Courier", "News", "NoticeError", "make_sender"]
