"""Notices by webhook, command and MQTT; what cannot be delivered is kept on disk."""

from monitor.notices.courier import Courier
from monitor.notices.news import News
from monitor.notices.senders import NoticeError, make_sender

__all__ = ["Courier", "News", "NoticeError", "make_sender"]
