"""Notices by webhook, command and MQTT, kept on disk until delivered."""

from monitor.outputs.notices.delivery import NoticeSender
from monitor.outputs.notices.filter import NoticeFilter
from monitor.outputs.notices.transports import NoticeError, make_sender

__all__ = ["NoticeError", "NoticeFilter", "NoticeSender", "make_sender"]
