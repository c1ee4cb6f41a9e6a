"""Notices by webhook, command and MQTT, kept on disk until delivered."""

from monitor.outputs.notices.delivery import NoticeSender as NoticeSender
from monitor.outputs.notices.filter import NoticeFilter as NoticeFilter
from monitor.outputs.notices.transports import NoticeError as NoticeError
from monitor.outputs.notices.transports import make_sender as make_sender
