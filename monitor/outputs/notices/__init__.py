"""Notices by webhook, command and MQTT; what cannot be delivered is kept on disk."""

from monitor.outputs.notices.delivery import Courier
from monitor.outputs.notices.filter import News
from monitor.outputs.notices.transports import NoticeError, make_sender

__all__ = ["Courier", "News", "NoticeError", "make_sender"]
